"""Ten thousand decisions of real games: the plain shield sends what the compiled one does, and how long it takes."""

import importlib
import os
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.entries.wrap import game_spec, shielded_files
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.platforms import layout as L

SEEDS = int(os.environ.get("STEERCLEAR_STUDY_GAMES", "9"))
GAMES = [(opponent, seed) for opponent in ("easy", "medium") for seed in range(SEEDS)]
UNTOLD = [L.THRUST, L.RUDDER, L.SPEED_ERROR, L.HEADING_ERROR]


class Noting(Shield):
    """Decides without autopilot memory, as in a zip, and notes what it was asked and what it sent."""

    def __init__(self, config):
        super().__init__(config)
        self.noted = []

    def decide(self, fleet, wanted, surroundings=None):
        state = fleet.state.copy()
        state[:, L.THRUST :] = 0.0
        state[:, UNTOLD] = np.nan
        fleet = replace(fleet, state=state)
        decisions = super().decide(fleet, wanted, surroundings)
        self.noted.append((fleet, wanted.values.copy(), surroundings, decisions.filtered.values.copy()))
        return decisions


def noted_in(opponent, seed, settings):
    env = MctfEnv(GameConfig.preset("mctf2026", default_start=False))
    observations, infos = env.reset(seed=seed)
    shield, ids = Noting(settings), list(env.possible_agents)
    teams = [(shield.wrap(policies.make("medium")), ids[:3]), (policies.make(opponent), ids[3:])]
    for policy, own in teams:
        policy.reset(env, own, seed)
    noting = teams[0][0].shield
    while env.agents:
        actions = [policy.act(observations, infos) for policy, _ in teams]
        observations, _, _, _, infos = env.step({**actions[0], **actions[1]})
    env.close()
    return noting.noted


@pytest.mark.study
def test_ten_thousand_decisions_are_the_same(tmp_path, monkeypatch, capsys):
    facts = game_spec("mctf2026", {"separation_m": 4.0})
    package, files = shielded_files(facts, "mctf2026", {})
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    monkeypatch.syspath_prepend(str(tmp_path))
    parts = ("shield", "config", "fleet", "commands", "surroundings")
    plain = {name: importlib.import_module(f"{package}.shield.{name}") for name in parts}
    settings, worst, spent, changed = ShieldConfig.of(**facts["shield"]), 0.0, [], 0
    for opponent, seed in GAMES:
        shield = plain["shield"].Shield(plain["config"].ShieldConfig.of(**facts["shield"]))
        for fleet, wanted, around, sent in noted_in(opponent, seed, settings):
            names = tuple(kind if isinstance(kind, str) else kind.name for kind in fleet.platforms)
            seen = plain["fleet"].Fleet(**{**vars(fleet), "platforms": names})
            edge = plain["surroundings"].Surroundings(around.field)
            begun = time.process_time()
            with np.errstate(all="ignore"):
                found = shield.decide(seen, plain["commands"].Commands.game_deg(wanted), edge).filtered.values
            spent.append(time.process_time() - begun)
            worst, changed = max(worst, np.abs(found - sent).max()), changed + bool((sent != wanted).any())
    with capsys.disabled():
        times = np.percentile(spent, [50, 95, 99, 100]) * 1e3
        sys.stderr.write(
            f"\n{len(spent)} decisions, {changed} changed, worst {worst:g}; ms p50 p95 p99 max: {times.round(1)}\n"
        )
    assert len(spent) >= 600 * len(GAMES)
    assert worst == 0.0, "the same statements give the same bits"
