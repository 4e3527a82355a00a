"""Policies: scripted opponents, submissions and learned ones, by name."""
