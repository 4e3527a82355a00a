"""The safety shield."""
