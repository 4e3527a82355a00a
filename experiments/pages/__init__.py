"""Pages of docs that are made of results, and what the keys of results mean."""
