"""One decision: what is screened, the program and its rows, backups, and what is sent."""
