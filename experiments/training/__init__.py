"""Learning teams: ``steerclear train`` and ``steerclear export``."""
