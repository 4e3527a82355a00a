"""ArduPilot boats over MAVLink 2."""
