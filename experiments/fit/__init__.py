"""Fitting a platform to logs of a boat: runs, models, least squares, held-out errors, and the words to act on."""
