from copy import deepcopy
from pathlib import Path

import pytest
import yaml

pytest.importorskip("stable_baselines3", reason="the extra [train]")

TINY = {
    "preset": "aamas2024",
    "rules": {"max_time_s": 6.0},
    "games": 2,
    "decisions": 144,
    "interval": 10,
    "ppo": {"steps": 6, "batch": 18, "epochs": 2},
    "net": {"hidden": [16]},
    "stages": [{"opponents": ["hold"], "games": 2, "net": -5}, {"opponents": ["medium", "self"]}],
    "league": {"every": 1, "keep": 2},
    "evaluation": {"every": 3, "games": 2},
    "checkpoint_every": 1,
}


@pytest.fixture(scope="session")
def tiny_content():
    return TINY


OF_ALL = ("preset", "rules", "games")
OF_LEARNING = (*OF_ALL, "decisions", "interval")


def content_of(algorithm):
    """The tiny config, as an algorithm takes it."""
    if algorithm == "ppo":
        return deepcopy(TINY)
    if algorithm == "qmix+ppo":
        return {**deepcopy(TINY), "stages": [{"opponents": ["hold"]}]}
    kept = {name: TINY[name] for name in (OF_ALL if algorithm == "cloning" else OF_LEARNING)}
    kept["stages"] = [{"opponents": ["hold"]}]
    if algorithm != "cloning":
        kept |= {"net": {"hidden": [16]}, "evaluation": {"games": 2}}
    return kept


@pytest.fixture
def tiny(tmp_path):
    """Write the tiny config, with changes; returns its path."""

    def write(name="tiny.yaml", **changes) -> Path:
        path = tmp_path / name
        path.write_text(yaml.safe_dump({**content_of(changes.get("algorithm", "ppo")), **changes}))
        return path

    return write
