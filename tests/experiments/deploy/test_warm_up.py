"""`steerclear warm-up` compiles all that simulated boats, their runner, referee and policy, and fits of boats need."""

import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[2]
AFTER_IT = """
import sys
from pathlib import Path
import numpy as np
from fit_logs import as_csv, drive
from steerclear.experiments.deploy.player import Orders, cast_of, load_player
from steerclear.experiments.deploy.quiet import warm_up
from steerclear.experiments.deploy.referee import Umpire, game_config, player_names
from steerclear.experiments.fit.fitting import residuals
from steerclear.experiments.fit.models import MODELS
from steerclear.experiments.fit.reading import read_logs
from steerclear.experiments.sim_boats import SimFleet
from steerclear.experiments.sim_boats.demo import demo_fleet, off_platform
from steerclear.experiments.warming import PARTS
from steerclear.shield import jit
from steerclear.shield.bridge.messages import Contact, Snapshot

PARTS["boats"]()
PARTS["fits of boats"]()
made, load = [], jit._Kept.load_overload
jit._Kept.load_overload = lambda kept, *args: made.append(kept._name) or load(kept, *args)

fleet = demo_fleet()
warm_up(fleet)
config, names = game_config(fleet), player_names(fleet)
umpire, player = Umpire(config, names), load_player(Orders(cast_of(fleet), "easy"))
places = [(10.0 + 5.0 * k, 20.0) for k in range(len(names))]
for k in range(5):
    contacts = [Contact(name, place, 1.0, 1.0, 0.1 * k, 0.1, "feed") for name, place in zip(names, places)]
    state = umpire.watch(contacts, 0.1 * k)
    player.play(Snapshot(k, 0.1 * k, np.array([(*place, 57.0, 1.0) for place in places]), state.as_dict()))
boats = SimFleet.from_file(fleet, hulls=lambda name, boat: off_platform(boat, 0.1, name, 1))
boats.play()
boats.advance(3.0)
boats.close()
as_csv(Path(sys.argv[1]), drive(120.0))
runs = read_logs([Path(sys.argv[1])])
for model in MODELS.values():
    residuals(model, model.starts()[0], runs, 2.0)
print("late:", made)
"""


def test_after_it_nothing_is_compiled_for_boats_and_fits(tmp_path):
    paths = [TESTS, TESTS / "experiments" / "fit", TESTS / "shield" / "bridge" / "blackbox"]
    program = f"import sys; sys.path[:0] = {list(map(str, paths))!r}\n{AFTER_IT}"
    command = [sys.executable, "-c", program, str(tmp_path / "log.csv")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "late: []"
