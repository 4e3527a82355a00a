"""Wrappers that put the shield around policies and environments."""
