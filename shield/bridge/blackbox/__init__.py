"""The black box: every input, decision and output of a run, on disk within a second, and what reads it back."""
