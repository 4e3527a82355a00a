"""Barriers h, one a file: margins, m, that are >= 0 while a boat on its backup manoeuvre keeps clear."""
