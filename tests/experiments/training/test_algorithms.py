"""Cloning, QMIX, and QMIX with PPO behind it."""

import json

import numpy as np
import pytest
import torch
from steerclear.experiments.cli import app
from steerclear.experiments.training.cloning import fitted
from steerclear.experiments.training.config import CloningOptions, read_config
from steerclear.experiments.training.qmix import MonotoneMixer
from steerclear.experiments.training.training import training_of
from steerclear.policies import make_batch
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.cloned import OPTION_NAMES, Chooser, read_chooser
from steerclear.policies.entrants.learned.network import Features, Network, joined, write_weights
from steerclear.shield.exceptions import ConfigError, PolicyError
from typer.testing import CliRunner

NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)


def test_a_clone_agrees_with_a_rule_it_was_shown():
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(600):
        x, y = rng.uniform(0, 80), rng.uniform(0, 40)
        rows.append({"time_s": 0.0, "option": "attack" if x + y > 60 else "guard", "own_x": x, "own_y": y})
    _, curve = fitted(rows, CloningOptions(epochs=60, rate=1e-2, hidden=16, batch=64), 0, {})
    assert curve[-1]["agrees"] > 0.93


def test_gradients_are_those_of_finite_differences():
    rng = np.random.default_rng(1)
    chooser = Chooser.fresh(["a", "b"], 4, rng, {})
    seen, chosen = rng.normal(size=(7, 2)), rng.integers(0, len(OPTION_NAMES), 7)

    def loss():
        values = chooser.values(seen)
        top = values.max(1, keepdims=True)
        logs = values - top - np.log(np.exp(values - top).sum(1, keepdims=True))
        return -logs[np.arange(7), chosen].mean()

    for array, gradient in zip(chooser.parameters(), chooser.gradients(seen, chosen), strict=True):
        at = tuple(0 for _ in array.shape)
        array[at] += 1e-6
        above = loss()
        array[at] -= 2e-6
        below = loss()
        array[at] += 1e-6
        assert gradient[at] == pytest.approx((above - below) / 2e-6, abs=1e-7)


def test_cloning_ends_in_a_chooser_that_can_be_read(tiny, tmp_path):
    config = tiny(
        algorithm="cloning", stages=[{"opponents": ["hold"]}], options={"epochs": 20}, rules={"max_time_s": 12.0}
    )
    training_of(read_config(config), tmp_path / "run", False).run()
    chooser = read_chooser(tmp_path / "run" / "best.npz")
    assert chooser.card["demonstrations"] == "scripted demonstrator"
    assert "own_x" in chooser.names
    (tmp_path / "cut.npz").write_bytes((tmp_path / "run" / "best.npz").read_bytes()[:200])
    with pytest.raises(PolicyError, match="holds no chooser"):
        read_chooser(tmp_path / "cut.npz")


def test_qmix_learns_from_a_replay_and_its_network_plays(tiny, tmp_path):
    changes = {"options": {"batch": 8, "updates": 1}, "stages": [{"opponents": ["hold"]}], "decisions": 240}
    training = training_of(read_config(tiny(algorithm="qmix", **changes)), tmp_path / "run", False)
    training.run()
    assert training.learner.updates > 10
    network = read_weights(tmp_path / "run" / "final.npz")
    assert network.kind == "discrete"
    assert json.loads((tmp_path / "run" / "curve.json").read_text())["rows"][-1]["evaluation"]["medium"]["games"] == 2


def test_qmix_keeps_its_weights_where_the_evaluation_fails(tiny, tmp_path, monkeypatch):
    def failing(*arguments):
        raise RuntimeError("an opponent's file is gone")

    monkeypatch.setattr("steerclear.experiments.training.training.play_games", failing)
    training = training_of(read_config(tiny(algorithm="qmix", decisions=24)), tmp_path / "run", False)
    with pytest.raises(RuntimeError, match="is gone"):
        training.run()
    assert read_weights(tmp_path / "run" / "final.npz").preset == "aamas2024"


def test_one_network_plays_until_the_flag_is_held_and_another_learns_from_there(tiny, tmp_path):
    rules = {"max_time_s": 30.0}
    options = {"batch": 8, "updates": 1, "play_share": 0.5}
    changes = {"options": options, "decisions": 72, "rules": rules, "stages": [{"opponents": ["hold"]}]}
    settings = read_config(tiny(algorithm="qmix+ppo", **changes))
    training_of(settings, tmp_path / "run", False).run()
    pair, play = read_weights(tmp_path / "run" / "final.npz"), read_weights(tmp_path / "run" / "play" / "final.npz")
    assert pair.carrying is not None
    assert all((one == two).all() for one, two in zip(pair.weights, play.weights, strict=True))
    assert len(pair.carriers) == 3
    again = training_of(settings, tmp_path / "run", True)  # the first part is kept
    assert again.decisions == 72  # nothing is left
    again.run()
    assert again.decisions == 72
    check_half_a_pair_is_refused(tmp_path / "run" / "model.zip", tmp_path / "team.npz")


def check_half_a_pair_is_refused(model, out):
    """The model that SB3 saved is what plays once the flag is held, and nothing else."""
    for words in (
        ("export", model, "--out", out),
        ("evaluate", f"sb3:{model}", "--trust", "--opponents", "hold", "--games", 1, "--out", out.parent / "x"),
    ):
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exit_code == 2, result.output
        assert "holds one network of two" in result.stderr
        assert "final.npz" in result.stderr
    with pytest.raises(PolicyError, match="one network of two"):
        make_batch(f"sb3:{model}")
    assert not out.exists()


def test_a_training_does_not_begin_with_two_networks(tiny, tmp_path):
    path = str(write_weights(a_pair(), tmp_path / "pair.npz"))
    for changes in ({"start": path}, {"options": {"first": path}}):
        with pytest.raises(ConfigError, match="holds two networks"):
            training_of(read_config(tiny(**changes)), tmp_path / "run", False)


def a_pair():
    play = Network([np.zeros((1, 61, 17), np.float32)], [np.eye(17, dtype=np.float32)[3][None]], NONE, "tanh",
                   "discrete", 10, 61)  # fmt: skip
    return joined(play, play, np.array([8]))


def test_both_networks_of_a_pair_hold_decisions_as_long_as_export_is_asked(tmp_path):
    path = write_weights(a_pair(), tmp_path / "pair.npz")
    result = CliRunner().invoke(app, ["export", str(path), "--interval", "5", "--out", str(tmp_path / "team.npz")])
    assert result.exit_code == 0, result.output
    team = read_weights(tmp_path / "team.npz")
    assert (team.interval, team.carrying.interval) == (5, 5)


def test_the_mixture_never_falls_where_a_value_rises():
    torch.manual_seed(0)
    mixer, state = MonotoneMixer(3, 5), torch.randn(64, 5)
    values = torch.randn(64, 3, requires_grad=True)
    mixer(values, state).sum().backward()
    assert float(values.grad.min()) >= 0.0
    assert float(values.grad.max()) > 0.0


@pytest.mark.parametrize("algorithm", ["qmix", "raids"])
def test_what_begins_anew_does_not_resume(tiny, tmp_path, algorithm):
    with pytest.raises(ConfigError, match="leave out --resume"):
        training_of(read_config(tiny(algorithm=algorithm)), tmp_path, True)
