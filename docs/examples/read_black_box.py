"""Read a black box: what the shield decided on the water, record by record.

Give the log's path: python read_black_box.py RUN.mcap
"""

import sys
from pathlib import Path

from steerclear.shield.bridge.blackbox import LogReader

with LogReader(Path(sys.argv[1])) as log:
    ticks = list(log.ticks())
changed = sum(tick.decisions.count_intervened for tick in ticks if tick.decisions is not None)
print(f"{len(ticks)} decisions of {', '.join(ticks[0].fleet.names)}; {changed} commands changed")
