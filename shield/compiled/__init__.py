"""Where machine code is kept, and who compiles it."""
