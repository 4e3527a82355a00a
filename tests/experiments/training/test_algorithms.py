"""QMIX, and QMIX with PPO behind it."""

import json

import numpy as np
import pytest
import torch
from steerclear.experiments.cli import app
from steerclear.experiments.training.config import read_config
from steerclear.experiments.training.qmix import MonotoneMixer
from steerclear.experiments.training.training import training_of
from steerclear.policies import make_batch
from steerclear.policies.entrants.learned import read_weights
from steerclear.shield.exceptions import ConfigError, PolicyError
from typer.testing import CliRunner

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


def test_qmix_keeps_its_weights_where_the_evaluation_fails(tiny, tmp_path, monkeypatch):
    def failing(*arguments):
        raise RuntimeError("an opponent's file is gone")

    monkeypatch.setattr("steerclear.experiments.training.training.play_games", failing)
    training = training_of(read_config(tiny(algorithm="qmix", decisions=24)), tmp_path / "run", False)
    with pytest.raises(RuntimeError, match="is gone"):
        training.run()
    assert read_weights(tmp_path / "run" / "final.npz").preset == "aamas2024"


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
        result = CliRunner().invoke(app, [str(word) for word in words])
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
