"""The black box: every input, decision and output on disk, at most a second behind, and reading it back.

How to use it::

    header = header_of_fleet(fleet, text, policy="medium", commanded=links, clock_s=clock.now_s())
    box = McapWriter(log_path(folder, ".mcap"), header)      # a TickSink
    box.take(tick)                                           # every turn; BridgeError: ticks can no longer be kept
    box.note("override of blue_1 by the operator")           # a line of text
    box.close()
    tlog = TlogWriter(log_path(folder, ".tlog"))             # tlog.on_bytes("in" | "out", raw, unix_us)
    check_disk(folder, boats=6)                              # before the start: a CheckResult
    with LogReader(path) as log:                             # also of a log cut off by a crash
        for tick in log.ticks(): ...
"""

from .disk import Disk, TlogWriter, check_disk
from .hash_chain import ChainCheck
from .header import LoggedBoat, LogHeader, header_of_fleet, platforms_of
from .reader import LogLine, LogReader
from .recorder import McapWriter, log_path

__all__ = [
    "ChainCheck",
    "Disk",
    "LogHeader",
    "LogLine",
    "LogReader",
    "LoggedBoat",
    "McapWriter",
    "TlogWriter",
    "check_disk",
    "header_of_fleet",
    "log_path",
    "platforms_of",
]
