"""Sets from which no shield, or not this one, saves a boat: promised, played, shown."""
