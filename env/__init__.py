"""The game: rules, boats, observations, presets and pictures."""
