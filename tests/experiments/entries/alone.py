"""Run by a test in a process of its own: a shielded zip's shield or entry, where only numpy can be imported.

``alone.py FOLDER shield STATES OUT``: the shield decides about recorded states; ``alone.py FOLDER entry STATES OUT``:
the entry is asked for its team's actions in them. OUT is an array of commands. ``as solution`` and ``as packages``: the
two entries in team_one and team_two are imported in that way, and each is asked for one action.
"""

import importlib
import json
import sys
from pathlib import Path

BLOCKED = {"numba", "llvmlite", "scipy", "qpsolvers", "daqp", "osqp", "steerclear", "yaml"}


class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"{name} is not there")


def main(folder, what, states, out):
    sys.meta_path.insert(0, Blocked())
    sys.path.insert(0, folder)
    import numpy as np

    recorded = dict(np.load(states))
    if what.startswith("as "):
        return np.save(out, np.array(both(folder, what)))
    package = next(path for path in Path(folder).glob("steerclear_*") if path.is_dir()).name
    answer = {"shield": shield_commands, "entry": entry_actions}[what](package, folder, recorded)
    assert not BLOCKED & {name.partition(".")[0] for name in sys.modules}
    return np.save(out, np.array(answer))


def both(folder, how):
    """Both entries built before either is asked."""
    entries = []
    for name in ("team_one", "team_two"):
        if how == "as packages":
            entries.append(importlib.import_module(f"{name}.solution").solution())
            continue
        sys.path.insert(0, str(Path(folder, name)))
        entries.append(importlib.import_module("solution").solution())
        del sys.path[0], sys.modules["solution"]
    import numpy as np

    state = state_of(np.array([(30.0 + 20 * i, 40.0, 0.0, 0.0) for i in range(6)]))
    return [entry.compute_action("agent_0", {}, {}, state) for entry in entries]


def state_of(boats):
    """A global state of boats (x, y, heading, speed)."""
    state = {}
    for i, boat in enumerate(boats):
        name = f"agent_{i}"
        state[name, "pos"], state[name, "heading"], state[name, "speed"] = boat[:2], boat[2], boat[3]
        for flag in ("is_tagged", "oob", "is_disabled"):
            state[name, flag] = False
    return state


def rows_of(state):
    import numpy as np

    rows = np.zeros((*state.shape[:2], 11))
    rows[:, :, :4] = state
    rows[:, :, [4, 5, 6, 8]] = np.nan
    return rows


def shield_commands(package, folder, recorded):
    def named(name):
        return importlib.import_module(f"{package}.shield.{name}")

    facts = json.loads(Path(folder, package, "facts.json").read_text())
    shield = named("shield").Shield(named("config").ShieldConfig.of(**facts["shield"]))
    return decide(
        shield, named("fleet").Fleet, named("commands").Commands, named("surroundings").Surroundings, recorded
    )


def decide(shield, fleet, commands, surroundings, recorded):
    """Commands sent for recorded states; the test does the same with the compiled shield."""
    around = surroundings((0.0, 0.0, 160.0, 80.0))
    names, team = tuple(f"agent_{i}" for i in range(6)), __import__("numpy").array([0, 0, 0, 1, 1, 1])
    sent = []
    rows = rows_of(recorded["state"])
    for row, ours, driven, wanted in zip(
        rows, recorded["controlled"], recorded["driven"], recorded["wanted"], strict=True
    ):
        seen = fleet(row, team, ("surveyor",) * 6, ours, names, driven=driven)
        sent.append(shield.decide(seen, commands.game_deg(wanted), around).filtered.values)
    return sent


def entry_actions(package, folder, recorded):
    import solution

    entry, actions = solution.solution(), []
    for row in recorded["state"][:10]:
        state = state_of(row)
        seen = dict.fromkeys([f"agent_{i}" for i in range(3)], row)
        actions.append([entry.compute_action(f"agent_{i}", seen, seen, state) for i in range(3)])
    return actions


if __name__ == "__main__":
    main(*sys.argv[1:])
