"""Simulated boats behind real MAVLink sockets: our dynamics, an autopilot that behaves as the real one measured."""
