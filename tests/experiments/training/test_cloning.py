"""Cloning: a chooser of options that decides as a demonstrator does."""

import numpy as np
import pytest
from steerclear.experiments.training.cloning import fitted
from steerclear.experiments.training.config import CloningOptions, read_config
from steerclear.experiments.training.training import training_of
from steerclear.policies.entrants.learned.cloned import read_chooser
from steerclear.shield.exceptions import PolicyError


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
    (tmp_path / "cut.npz").write_bytes((tmp_path / "run" / "best.npz").read_bytes()[:200])
    with pytest.raises(PolicyError, match="holds no chooser"):
        read_chooser(tmp_path / "cut.npz")
