"""Boats that run MOOS-IvP: the shield as one more client of each boat's MOOSDB."""
