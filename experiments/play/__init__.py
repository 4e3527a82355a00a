"""One game: its settings, its seats, its shields, the water it is played on, and what is recorded."""
