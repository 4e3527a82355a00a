"""Our own black box (``.mcap``): what boats were told and where they told they were."""

from __future__ import annotations

import math
from pathlib import Path

from steerclear.shield.bridge.blackbox import LogReader

from .errors import FitError
from .runs import Run
from .streams import Streams

NAMES = dict.fromkeys(("x", "y", "heading", "speed"), "readings") | dict.fromkeys(
    ("told_speed", "told_heading"), "commands sent"
)


def read_box(path: Path, boat: str | None) -> list[Run]:
    """Runs of one boat of a log that `steerclear deploy` or `sea-trial` wrote; readings count from when they were true.

    Raises:
        FitError: it tells too little, or of several boats and none was named.
        LogError: it is no black-box log.
    """
    boats: dict[str, Streams] = {}
    with LogReader(path) as log:
        for tick in log.ticks():
            for name, reading in tick.readings.items():
                if not math.isfinite(reading.age_s):
                    continue
                streams = boats.setdefault(name, Streams())
                at_s = reading.read_s - reading.position_age_s
                streams.add("x", at_s, reading.position_m[0])
                streams.add("y", at_s, reading.position_m[1])
                streams.add("heading", reading.read_s - reading.heading_age_s, math.degrees(reading.heading_rad))
                streams.add("speed", reading.read_s - reading.velocity_age_s, reading.speed_mps)
            for name, sent in tick.sent.items():
                if sent.delivered and math.isfinite(sent.heading_rad) and math.isfinite(sent.speed_mps):
                    streams = boats.setdefault(name, Streams())
                    streams.add("told_heading", sent.sent_s, math.degrees(sent.heading_rad))
                    streams.add("told_speed", sent.sent_s, sent.speed_mps)
    if boat is None and len(boats) > 1:
        raise FitError(f"{path.name} tells of boats {', '.join(sorted(boats))}; name one with --boat")
    name = boat or next(iter(boats), "")
    if name not in boats:
        raise FitError(f"{path.name} tells nothing of boat {name!r}; it has {', '.join(sorted(boats)) or 'none'}")
    return boats[name].runs(path.stem, NAMES)
