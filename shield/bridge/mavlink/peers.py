"""Where each boat is heard from, on a wire many may send on."""

from __future__ import annotations

from .sockets import Peer

MOVES_AFTER_S = 3.0
"""A boat may come from another address once its old one has been silent that long."""


class Peers:
    """The address of each system id; a second address that speaks while the first does is not believed."""

    def __init__(self) -> None:
        self._places: dict[int, tuple[Peer, float]] = {}

    def accept(self, system: int, peer: Peer, now_s: float) -> bool:
        """Whether a believed message of that boat from there is taken; remembers the place."""
        known = self._places.get(system)
        if known is not None and known[0] != peer and now_s - known[1] < MOVES_AFTER_S:
            return False
        self._places[system] = (peer, now_s)
        return True

    def place(self, system: int) -> Peer | None:
        """Where to send for that boat; None while it was not heard."""
        known = self._places.get(system)
        return None if known is None else known[0]

    def forget(self, system: int) -> None:
        """The boat is nobody's any more."""
        self._places.pop(system, None)
