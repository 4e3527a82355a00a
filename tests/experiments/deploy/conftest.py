"""Fleet files, policies in files, and snapshots of simulated games."""

import contextlib
import os
import pty
import textwrap

import numpy as np
import pytest
from steerclear.experiments.deploy.referee import state_of
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.platforms import layout as L

SEEN = [L.X, L.Y, L.HEADING, L.SPEED]


@pytest.fixture(scope="session")
def fleet_of():
    """Builds a fleet file of two teams of that size; a boat outside the game stands in the middle of the list."""

    def build(size=3, team="blue", more="", platform="heron"):
        lines = [
            "version: 1",
            "field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40], y_axis_deg: 20.0}",
            "geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}",
            f"team: {team}",
            'feed: {listen: "127.0.0.1:14700", referee: "127.0.0.1:14701"}',
            more,
            "boats:",
        ]
        for i in range(2 * size):
            side = "blue" if i < size else "red"
            link = f'link: {{kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: {i + 1}}}'
            how = link if side == team else "contact: feed"
            lines.append(f"  - {{name: {side}_{i % size + 1}, agent: agent_{i}, platform: {platform}, {how}}}")
            if i == size - 1:
                lines.append("  - {name: rescue, platform: heron, contact: feed}")
        return parse_fleet("\n".join(lines))

    return build


@pytest.fixture
def snapshot_of():
    """Builds what the loop would see of an env's game: positions of all boats of the file, and the referee's word."""

    def build(env, fleet, number=0, taken_s=0.0):
        players = [boat.name for boat in fleet.boats if boat.agent is not None]
        seen = np.full((len(fleet.boats), 4), np.nan)
        seen[[i for i, boat in enumerate(fleet.boats) if boat.agent is not None]] = env.core.state[0][:, SEEN]
        return Snapshot(number, taken_s, seen, state_of(env.core, players).as_dict(), 0.0)

    return build


@pytest.fixture
def write_entry(tmp_path):
    """Writes a submission whose ``compute_action`` has the given body; answers its path."""

    def write(body, start="pass", head=""):
        folder = tmp_path / f"entry_{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        lines = [
            textwrap.dedent(head),
            "class solution:",
            "    def __init__(self):",
            textwrap.indent(textwrap.dedent(start).strip(), " " * 8),
            "    def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):",
            textwrap.indent(textwrap.dedent(body).strip(), " " * 8),
        ]
        (folder / "solution.py").write_text("\n".join(lines) + "\n")
        return str(folder)

    return write


@pytest.fixture
def terminal():
    """A pseudo terminal: (the end a person types at, the end the program reads)."""
    outer, inner = pty.openpty()
    yield outer, inner
    for descriptor in (outer, inner):
        with contextlib.suppress(OSError):
            os.close(descriptor)
