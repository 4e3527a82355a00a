"""`Recorder`: every tick to every sink, whatever one of them does."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from ..exceptions import BridgeError
from .tick import Tick, TickSink

LOG = logging.getLogger(__name__)


class Recorder:
    """Gives ticks to sinks.

    Attributes:
        fault: why ticks can no longer be kept; empty: they are.

    Args:
        sinks: the black box among them.
    """

    def __init__(self, sinks: Sequence[TickSink]) -> None:
        self.fault = ""
        self._sinks = sinks
        self._broken: set[int] = set()

    def take(self, tick: Tick) -> None:
        """Give a tick to all; a sink that can keep no more is named, and the others still get it."""
        faults = []
        for k, sink in enumerate(self._sinks):
            try:
                sink.take(tick)
                self._broken.discard(k)
            except BridgeError as error:
                faults.append(str(error))
                if k not in self._broken:
                    LOG.error("%s", error)
                self._broken.add(k)
            except Exception:
                if k not in self._broken:
                    LOG.exception("a sink broke; it gets no boat into danger")
                self._broken.add(k)
        self.fault = "; ".join(faults)
