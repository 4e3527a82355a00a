"""`Referee`: watches boats, keeps the game by the env's rules, and tells everybody how it stands."""

from __future__ import annotations
