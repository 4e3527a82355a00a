"""Entries whose ``compute_action`` does what a test says, and a game for them."""

import textwrap

import pytest
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.entries.team import EntryTeam

OWN = ["agent_0", "agent_1", "agent_2"]


@pytest.fixture(scope="session")
def game():
    """A 3 v 3 game that has just begun: env, observations, infos."""
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1)
    yield env, observations, infos
    env.close()


@pytest.fixture
def write_entry(tmp_path):
    """Writes a submission whose ``compute_action`` has the given body; answers its path."""

    def write(body, start="pass", head=""):
        folder = tmp_path / f"team_{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        lines = [
            textwrap.dedent(head),
            "import os, sys, time, threading",
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
def team_of(write_entry):
    """Builds an isolated team of an entry's code; all are closed when the test is over."""
    built = []

    def build(body, answer_s=20.0, start="pass", **settings):
        team = EntryTeam(write_entry(body, start=start), answer_s, **settings)
        built.append(team)
        return team

    yield build
    for team in built:
        team.close()


@pytest.fixture
def play(game):
    """Plays some steps of a team in the game as it stands; answers the actions."""

    def steps(team, number=2, seed=0):
        env, observations, infos = game
        team.reset(env, OWN, seed)
        return [team.act(observations, infos) for _ in range(number)]

    return steps
