from copy import deepcopy
from pathlib import Path

import pytest
import yaml
from steerclear.experiments.training.unused import NO_USE, NO_USE_IN_STAGE

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


def of_use(algorithm):
    """The tiny config without what an algorithm has no use for."""
    content = deepcopy(TINY)
    for dotted in NO_USE[algorithm]:
        *parts, name = dotted.split(".")
        (content.get(parts[0], {}) if parts else content).pop(name, None)
    if algorithm in NO_USE_IN_STAGE:
        content["stages"] = [{"opponents": ["hold"]}]
    return content


@pytest.fixture
def tiny(tmp_path):
    """Write the tiny config, with changes; returns its path."""

    def write(name="tiny.yaml", **changes) -> Path:
        path = tmp_path / name
        path.write_text(yaml.safe_dump({**of_use(changes.get("algorithm", "ppo")), **changes}))
        return path

    return write
