"""Writes a log at a steady rate until killed: for the drill. Says on stdout what it took and when.

Arguments: log to take ticks from, log to write, rate Hz.
"""

import sys
import time
from pathlib import Path

from steerclear.shield.bridge.blackbox import LogReader, McapWriter
from steerclear.shield.bridge.messages import Tick


def main(source: str, target: str, rate: str) -> None:
    with LogReader(Path(source)) as log:
        header, ticks = log.header, list(log.ticks())
    writer, period_s, number = McapWriter(Path(target), header), 1.0 / float(rate), 0
    began = time.monotonic()
    while True:
        shown = vars(ticks[number % len(ticks)])
        writer.take(Tick(**(shown | {"number": number, "began_s": header.clock_s + number * period_s})))
        sys.stdout.write(f"{number} {time.monotonic():.6f}\n")
        sys.stdout.flush()
        number += 1
        time.sleep(max(0.0, began + number * period_s - time.monotonic()))


main(*sys.argv[1:])
