"""Settings that an algorithm does not honour are refused before anything is played."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from steerclear.experiments.training.algorithms import training_of
from steerclear.experiments.training.config_file import read_config
from steerclear.experiments.training.settings import ALGORITHMS, Stage, settings_of
from steerclear.experiments.training.unused import NO_USE, NO_USE_IN_STAGE, check_used
from steerclear.shield.exceptions import ConfigError

TEAMS = sorted((Path(__file__).parents[3] / "policies" / "entrants" / "learned" / "teams").glob("*.yaml"))
OTHER = {
    "actions": "normalised",
    "rewards": {"sparse": 2.0},
    "shield": "training",
    "shield_settings": {"separation_m": 3.0},
    "start": "first.npz",
    "device": "cpu",
    "hidden": [16],
    "activation": "relu",
    "roles": "each",
    "features": False,
    "opponents": ["easy"],
    "tag_probability": 0.5,
    "cooldown_s": 20.0,
    "shielded": False,
    "rules": {"max_time_s": 60.0},
}
"""Values that differ from the defaults; numbers that are not here are raised by one."""


def other_value(part, name):
    return OTHER.get(name, getattr(part, name) * 0.5 if isinstance(getattr(part, name), float) else 77)


def with_other(dotted):
    usual = settings_of({})
    *parts, name = dotted.split(".")
    part = getattr(usual, parts[0]) if parts else usual
    value = {name: other_value(part, name)}
    return {parts[0]: value} if parts else value


@pytest.mark.parametrize(("algorithm", "name"), [(a, name) for a in ALGORITHMS for name in NO_USE[a]])
def test_what_an_algorithm_has_no_use_for_is_refused_by_name(algorithm, name, tmp_path):
    given = settings_of({"algorithm": algorithm, **with_other(name)})
    words = f"algorithm {algorithm} has no use for {name}; leave it out"
    with pytest.raises(ConfigError, match=re.escape(words)):
        training_of(given, tmp_path / "run", False)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("algorithm", "name"), [(a, name) for a in NO_USE_IN_STAGE for name in NO_USE_IN_STAGE[a]])
def test_so_is_what_its_only_stage_has_no_use_for(algorithm, name):
    stage = {name: other_value(Stage(), name)}
    with pytest.raises(ConfigError, match=f"algorithm {algorithm} has no use for {name} in its stage"):
        check_used(settings_of({"algorithm": algorithm, "stages": [stage]}))


@pytest.mark.parametrize("algorithm", sorted(NO_USE_IN_STAGE))
def test_one_stage_and_no_snapshots(algorithm):
    with pytest.raises(ConfigError, match="learns in one stage"):
        check_used(settings_of({"algorithm": algorithm, "stages": [{}, {}]}))
    with pytest.raises(ConfigError, match="leave 'self' out"):
        check_used(settings_of({"algorithm": algorithm, "stages": [{"opponents": ["medium", "self"]}]}))


def test_ppo_uses_all_there_is():
    later = [Stage(), Stage(opponents=("self",), net=1.0, most=5, shielded=False)]
    check_used(replace(settings_of({}), stages=tuple(later), checkpoint_every=3, start="w.npz", device="cpu"))


@pytest.mark.parametrize("path", TEAMS, ids=[path.stem for path in TEAMS])
def test_configs_that_are_here_ask_for_nothing_else(path):
    check_used(read_config(path))
