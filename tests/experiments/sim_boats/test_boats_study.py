import logging
import subprocess
import sys
import time
from pathlib import Path

import pytest
from boat_links import READY
from steerclear.experiments.sim_boats import SimBoat, SimFleet

logger = logging.getLogger(__name__)
COMMANDER = Path(__file__).with_name("boat_commander.py")
SECONDS = 20.0


@pytest.mark.study
@pytest.mark.parametrize(("boats", "speed"), [(16, 1.0), (16, 5.0), (6, 10.0)])
def test_boats_fit_one_core(boats, speed):
    """Processor time of boats that stream 60 messages a second each and obey at 10 Hz (real s)."""
    specs = [SimBoat(f"b{i}", team=2, start=(10.0 * i, 5.0, 0.0)) for i in range(boats)]
    with SimFleet(specs, autopilot=READY, noise=1.0, speed=speed) as fleet:
        places = [f"{address}={fleet.system_ids[name]}" for name, address in fleet.addresses.items()]
        arguments = [sys.executable, str(COMMANDER), str(SECONDS), *places]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as commander:
            time.sleep(3.0)
            cpu_s, time_s, wall_s = fleet.cpu_s, fleet.time_s, time.monotonic()
            time.sleep(SECONDS - 8.0)
            cpu_s, time_s = fleet.cpu_s - cpu_s, fleet.time_s - time_s
            wall_s = time.monotonic() - wall_s
            heard = int(commander.communicate(timeout=60.0)[0])
        assert all(boat.autopilot.vehicle.armed for boat in fleet.boats.values())
        share, each_ms = cpu_s / wall_s, 1e3 * cpu_s / time_s / boats
        logger.warning(
            "%d boats at %gx: %.1f %% of a core, %.2f ms a boat and simulated s, %.2f s let go, %d packets heard",
            boats, speed, 100.0 * share, each_ms, fleet.let_go_s, heard,
        )  # fmt: skip
        assert share < 0.8
        assert fleet.let_go_s == 0.0
        assert heard > 0.5 * boats * 60.0 * SECONDS * min(speed, 1.0)
