"""Makes this folder's helpers importable from the folders inside it."""
