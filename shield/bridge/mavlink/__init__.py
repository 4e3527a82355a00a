"""Links to ArduPilot boats over MAVLink 2."""
