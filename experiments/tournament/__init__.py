"""The competition: teams that meet each other on both sides, with and without the shield."""
