"""Backup manoeuvres: which there are, where they lead, what each is worth, and which one every boat holds."""
