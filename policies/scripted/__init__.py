"""Scripted policies: one compiled kernel decides for all boats of a team, in one game or in thousands."""
