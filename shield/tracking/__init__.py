"""What is known of boats from one decision to the next: tracks, autopilots, commands on their way."""
