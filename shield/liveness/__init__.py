"""What keeps safe boats from standing still for ever."""
