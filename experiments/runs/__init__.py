"""Many games: where they run, what is kept of them on disk, and how a run is gone on with."""
