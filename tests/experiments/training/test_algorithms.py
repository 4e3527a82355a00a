"""QMIX, QMIX with PPO behind it, and cloning: a chooser of options that decides as a demonstrator does."""

import json

import numpy as np
import pytest
import torch
from commands import run
from steerclear.experiments.training.cloning import fitted
from steerclear.experiments.training.config import CloningOptions, read_config
from steerclear.experiments.training.qmix import MonotoneMixer
from steerclear.experiments.training.training import training_of
from steerclear.policies import make_batch
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.cloned import read_chooser
from steerclear.shield.exceptions import ConfigError, PolicyError

OPTIONS = {"batch": 8, "updates": 1}


def test_qmix_learns_from_a_replay_and_its_network_plays(tiny, tmp_path):
    training = training_of(read_config(tiny(algorithm="qmix", options=OPTIONS, decisions=240)), tmp_path / "run", False)
    training.run()
    assert training.learner.updates > 10
    network = read_weights(tmp_path / "run" / "final.npz")
    seen = np.random.default_rng(0).uniform(-1, 1, (30, network.n_obs)).astype(np.float32)
    with torch.no_grad():
        values = training.agent(torch.as_tensor(seen)).numpy()
    np.testing.assert_allclose(network.outputs(seen, np.arange(30) % 3), values, atol=1e-5)
    assert json.loads((tmp_path / "run" / "curve.json").read_text())["rows"][-1]["evaluation"]["medium"]["games"] == 2


def test_one_network_plays_until_the_flag_is_held_and_another_learns_from_there(tiny, tmp_path):
    changes = {"algorithm": "qmix+ppo", "options": {**OPTIONS, "play_share": 0.5}, "decisions": 72}
    run, settings = tmp_path / "run", read_config(tiny(**changes))
    training_of(settings, run, False).run()
    pair, play = read_weights(run / "final.npz"), read_weights(run / "play" / "final.npz")
    assert pair.carrying is not None
    assert all((one == two).all() for one, two in zip(pair.weights, play.weights, strict=True))
    assert len(pair.carriers) == 3
    run = run.rename(tmp_path / "moved")
    again = training_of(settings, run, True)  # the first part is kept
    assert again.decisions == 72  # nothing is left
    again.run()
    assert again.decisions == 72
    with pytest.raises(ConfigError, match="learned in other games; begin anew in another --out"):
        training_of(read_config(tiny(**changes, interval=5)), run, True).run()
    check_half_a_pair_is_refused(run / "model.zip", tmp_path / "team.npz")


def check_half_a_pair_is_refused(model, out):
    """The model that SB3 saved is what plays once the flag is held, and nothing else."""
    for words in (
        ("export", model, "--out", out),
        ("evaluate", f"sb3:{model}", "--trust", "--opponents", "hold", "--games", 1, "--out", out.parent / "x"),
    ):
        result = run(*words)
        assert result.exit_code == 2, result.output
        assert "holds one network of two" in result.stderr
        assert "final.npz" in result.stderr
    with pytest.raises(PolicyError, match="one network of two"):
        make_batch(f"sb3:{model}")
    assert not out.exists()


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


def test_a_clone_agrees_with_a_rule_it_was_shown():
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(600):
        x, y = rng.uniform(0, 80), rng.uniform(0, 40)
        rows.append({"time_s": 0.0, "option": "attack" if x + y > 60 else "guard", "own_x": x, "own_y": y})
    _, curve = fitted(rows, CloningOptions(epochs=60, rate=1e-2, hidden=16, batch=64), 0, {})
    assert curve[-1]["agrees"] > 0.93


def test_cloning_ends_in_a_chooser_that_can_be_read(tiny, tmp_path):
    config = tiny(algorithm="cloning", options={"epochs": 20}, rules={"max_time_s": 12.0})
    training_of(read_config(config), tmp_path / "run", False).run()
    chooser = read_chooser(tmp_path / "run" / "best.npz")
    assert chooser.card["demonstrations"] == "scripted demonstrator"
    assert "own_x" in chooser.names
