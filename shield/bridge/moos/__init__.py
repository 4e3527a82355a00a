"""Boats that run MOOS-IvP: the shield as one more client of each boat's MOOSDB."""

POLICY = "moos"
"""Name of the policy whose commands come from the boats' own communities."""
