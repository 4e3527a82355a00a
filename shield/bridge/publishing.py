"""Telling others where our boats are: team-mates' runners, the other team's, the referee."""

from __future__ import annotations

import logging
import math

from ..exceptions import FeedError
from .feed_packets import Fix
from .feed_sender import FeedSender
from .frame import FieldFrame
from .link import BoatReading
from .tick import Tick

LOG = logging.getLogger(__name__)

EVERY = 2
"""Every second tick is sent."""


class PositionPublisher:
    """A sink that sends own boats' fixes to the listeners of the feed.

    Args:
        sender: sends them.
        frame: the field's.
        error_m: bound of their position errors, m.
    """

    def __init__(self, sender: FeedSender, frame: FieldFrame, error_m: float) -> None:
        self._sender = sender
        self._frame = frame
        self._error_m = error_m
        self._told = False

    def take(self, tick: Tick) -> None:
        """Send the fixes of a tick."""
        if tick.number % EVERY:
            return
        fixes = [self._fix(reading) for reading in tick.readings.values() if math.isfinite(reading.age_s)]
        try:
            if fixes:
                self._sender.send_positions(fixes)
        except FeedError as error:  # an impossible reading must not stop the others for good
            if not self._told:
                LOG.warning("positions not published: %s", error)
            self._told = True

    def close(self) -> None:
        """Give the socket back."""
        self._sender.close()

    def _fix(self, reading: BoatReading) -> Fix:
        latitude, longitude = self._frame.to_geodetic_deg(*reading.position_m)
        return Fix(
            boat=reading.boat,
            latitude_deg=latitude,
            longitude_deg=longitude,
            heading_deg=math.degrees(self._frame.heading_to_true_rad(reading.heading_rad)),
            speed_mps=reading.speed_mps,
            age_s=reading.age_s,
            error_m=self._error_m,
        )
