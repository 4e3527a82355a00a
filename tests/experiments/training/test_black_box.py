"""What users see of trainings: commands, exit codes, files, and that stopping costs nothing, whenever and however."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml
from commands import run as call
from steerclear import policies
from steerclear.env import mctf_v0
from steerclear.env.config import GameConfig
from steerclear.policies.entrants.learned import read_weights

STEERCLEAR = [sys.executable, "-m", "steerclear.experiments.cli"]
LEAGUE = {
    "decisions": 180,
    "rules": {"max_time_s": 8.0},
    "stages": [{"opponents": ["hold"], "games": 2, "net": -5}, {"opponents": ["medium", "self"]}],
    "league": {"every": 1, "keep": 1},
}
"""Snapshots of which one is kept, so that they leave the pool while games against them go on."""


def curve_of(folder):
    """The curve without times."""
    rows = json.loads((folder / "curve.json").read_text())["rows"]
    return [{name: value for name, value in row.items() if name != "wall"} for row in rows]


def kept_in(run):
    """The number of the newest checkpoint."""
    return max((int(path.stem) for path in run.glob("checkpoints/[0-9]*.zip")), default=0)


def same_networks(one, two):
    pairs = zip((*one.weights, *one.biases), (*two.weights, *two.biases), strict=True)
    return all(np.array_equal(mine, other) for mine, other in pairs)


def stopped(words, number, run):
    """Run a training until it has kept two more checkpoints, then send it a signal; its exit status."""
    process = subprocess.Popen(
        [*STEERCLEAR, *map(str, words)], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
    )
    until, before = time.monotonic() + 300.0, kept_in(run)
    while kept_in(run) <= before + 1 and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(process.pid, number)
    return process.wait(timeout=120)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory, tiny_content):
    """A training of a league that nobody stopped."""
    folder = tmp_path_factory.mktemp("unbroken")
    (folder / "league.yaml").write_text(yaml.safe_dump({**tiny_content, **LEAGUE}))
    done = call("train", folder / "league.yaml", "--out", folder / "run")
    assert done.exit_code == 0, done.output
    return folder


def test_a_training_leaves_its_files(unbroken):
    run = unbroken / "run"
    rows = curve_of(run)
    assert [row["decisions"] for row in rows] == [36, 72, 108, 144, 180]
    assert (rows[0]["stage"], rows[-1]["stage"]) == (0, 1)
    assert {"net", "net_low", "net_high", "games"} <= rows[-1]["evaluation"]["medium"].keys()
    for name in ("best.npz", "final.npz", "model.zip", "config.yaml"):
        assert (run / name).stat().st_size > 0


def test_stopped_in_whatever_way_a_training_goes_on_to_the_same_curve(unbroken, tmp_path):
    """First by SIGTERM, and what goes on from there by SIGKILL."""
    run = tmp_path / "run"
    words = ("train", unbroken / "league.yaml", "--out", run)
    for number, status in ((signal.SIGTERM, 130), (signal.SIGKILL, -9)):
        more = () if number == signal.SIGTERM else ("--resume",)
        left = stopped([*words, *more], number, run)
        assert left == status or (run / "model.zip").exists()
    again = call(*words, "--resume")
    assert again.exit_code == 0, again.output
    assert curve_of(run) == curve_of(unbroken / "run")
    assert same_networks(read_weights(run / "final.npz"), read_weights(unbroken / "run" / "final.npz"))


def test_a_model_plays_what_was_trained_as_its_weights_do(unbroken):
    """Its decisions are held for the interval, in single games as in batches."""
    ends = []
    for name in ("weights:final.npz", "sb3:model.zip"):
        kind, _, file = name.partition(":")
        game = mctf_v0.parallel_env(GameConfig.preset("aamas2024", default_start=False, max_time_s=8.0))
        observations, infos = game.reset(seed=3)
        own = list(game.agents)[:3]
        team = policies.make(f"{kind}:{unbroken / 'run' / file}")
        team.reset(game, own, 3)
        while game.agents:
            observations, _, _, _, infos = game.step(team.act(observations, infos))
        ends.append(game.unwrapped.core.state[0, :3, :2].copy())
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seed: 010", "programs disagree about what 010 means"),
        ("games: 1:0", "programs disagree about what 1:0 means"),
        ("decisions: 2_400", "programs disagree about what 2_400 means"),
        ("games: 4\ngames: 96", "key 'games' is given twice; keep one"),
        ("net: {features: yes}", "write true or false"),
        ("net: !!python/object:os.system {}", "leave it out"),
        ("gamess: 3", "unknown key 'gamess'"),
        ("a: [", "line "),
    ],
)
def test_a_config_that_cannot_be_is_refused_in_one_line(tmp_path, text, words):
    config = tmp_path / "config.yaml"
    config.write_text(f"{text}\n")
    found = call("train", config, "--out", tmp_path / "run")
    assert found.exit_code == 2, found.output
    assert words in found.stderr
    assert len(found.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_number_with_an_exponent_is_a_number(tmp_path, tiny_content):
    config = tmp_path / "config.yaml"
    config.write_text(yaml.safe_dump({**tiny_content, "decisions": 36}) + "device: cpu\n")
    text = config.read_text().replace("epochs: 2", "epochs: 2\n  learning_rate: 1e-3")
    config.write_text(text)
    assert "1e-3" in text
    assert call("train", config, "--out", tmp_path / "run").exit_code == 0
    assert json.loads((tmp_path / "run" / "curve.json").read_text())["settings"]["ppo"]["learning_rate"] == 1e-3
