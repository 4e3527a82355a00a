"""Entries: policies of others, run in processes of their own with limits, so that what they do stays with them."""
