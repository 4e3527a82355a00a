"""A boat that a current sets over the hard line: it is told its link's own stop, and the log proves it bit for bit."""

import numpy as np
import pytest
from lake import TEXT, Lake
from steerclear.experiments.deploy.replay import replay_log
from steerclear.experiments.sim_boats import Water
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import layout as L

BEYOND_M = 3.0
LINE = TEXT.replace("xmax_m: 100, ymax_m: 60}", f"xmax_m: 100, ymax_m: 60, beyond_m: {BEYOND_M}, then: stop}}")
STARTS = {"blue_1": (99.0, 20.0, 90.0), "blue_2": (10.0, 20.0, 90.0)}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The log, and where the first boat was at each turn, m beyond the geofence."""
    beyond_m = []
    folder = tmp_path_factory.mktemp("stopped")
    water = Water(current_mps=1.6, current_to_deg=90.0)  # it is over the line before it has turned round
    with Lake(folder, text=LINE, starts=STARTS, wants=((0.0, 1.57), (0.0, 1.57)), boxed=True, water=water) as lake:
        for _ in range(80):
            lake.turn()
            beyond_m.append(float(lake.water.states()["blue_1"][L.X]) - 100.0)
    return lake.box.path, np.array(beyond_m)


def test_it_is_stopped_by_its_link_and_handed_over(run):
    path, beyond_m = run
    assert beyond_m[-1] > BEYOND_M
    with LogReader(path) as log:
        ticks = [tick for tick in log.ticks() if tick.decisions is not None]
    stopped = [
        tick for tick in ticks if tick.decisions[tick.decisions.fleet.names.index("blue_1")].reason is Reason.STOPPED
    ]
    assert stopped
    crossed = int(np.flatnonzero(beyond_m > BEYOND_M)[0])
    told = [tick.number for tick in ticks if any(a.subject == "blue_1" and "hard line" in a.text for a in tick.actions)]
    assert abs(stopped[0].number - crossed) <= 5, "for when the command takes effect, as its sensors say it"
    assert abs(told[0] - crossed) <= 10
    assert told == list(range(told[0], ticks[-1].number + 1)), "until its pilot brings it in"
    assert np.nan_to_num(stopped[0].sent["blue_1"].speed_mps) == 0.0


def test_every_decision_is_made_again_bit_for_bit(run):
    with LogReader(run[0]) as log:
        found = replay_log(log, keep_tracks=False)
    assert found.reasons["STOPPED"] > 0
    assert found.proof.same == found.proof.decisions > 50
    assert found.proof.strayed == 0
    assert found.proved
