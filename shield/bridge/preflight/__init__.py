"""Checks before boats move: each a function that answers with a `CheckResult`."""
