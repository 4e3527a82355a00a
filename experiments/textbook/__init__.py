"""Filters from the literature, to compare the shield with on the same encounters."""
