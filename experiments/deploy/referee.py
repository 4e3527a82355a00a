"""`Referee`: watches boats, keeps the game by the env's rules, and tells everybody how it stands."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from types import TracebackType

from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.feed import FeedSender, GameState
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.compat import Self
