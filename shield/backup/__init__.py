"""Backup manoeuvres: the families, their rollouts, their scores, and which one every boat holds."""
