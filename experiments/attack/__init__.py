"""The search for opponents that cause breaches."""
