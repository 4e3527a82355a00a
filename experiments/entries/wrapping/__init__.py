"""Making a shielded zip of an entry: its own files, the shield's modules as plain Python, and what they need."""
