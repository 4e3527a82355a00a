"""Reachability value tables: how near two boats can come under optimal play, solved once and looked up."""
