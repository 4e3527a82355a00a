"""Settings that an algorithm does not honour are refused before anything is played."""

import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest
from steerclear.experiments.cli import app
from steerclear.experiments.training.algorithms import training_of
from steerclear.experiments.training.config_file import read_config
from steerclear.experiments.training.settings import (
    ALGORITHMS,
    Evaluation,
    League,
    Net,
    Ppo,
    Stage,
    TrainingSettings,
    settings_of,
)
from steerclear.experiments.training.unused import NO_USE, NO_USE_IN_STAGE, check_used
from steerclear.shield.exceptions import ConfigError
from typer.testing import CliRunner

ROOT = Path(__file__).parents[3]
TEAMS = sorted((ROOT / "policies" / "entrants" / "learned" / "teams").glob("*.yaml"))
STUDY = ROOT / "docs" / "studies" / "learning.yaml"
ABOUT_SETTINGS = {"settings.py", "unused.py", "curve.py", "dataclasses.py", "copy.py", "test_unused.py"}
"""Files that read every setting."""
HANDED_ON = {"actions", "decisions", "shield_every", "league.power", "league.floor"}
"""Read where any algorithm builds its games and pool of opponents, or to show how far it is."""
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
"""Values that differ from the defaults; of numbers that are not here another one is made."""


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


@pytest.mark.parametrize("path", [*TEAMS, STUDY], ids=lambda path: path.stem)
def test_configs_that_are_here_ask_for_nothing_else(path):
    check_used(read_config(path))


@pytest.mark.parametrize("algorithm", ["qmix", "cloning"])
def test_what_learns_on_the_cpu_may_say_so(algorithm):
    check_used(settings_of({"algorithm": algorithm, "device": "cpu"}))
    with pytest.raises(ConfigError, match="learns on the CPU"):
        check_used(settings_of({"algorithm": algorithm, "device": "cuda"}))


def test_nothing_is_made_for_a_training_that_is_refused(tiny, tmp_path):
    config = tiny(algorithm="cloning", shield="training")
    result = CliRunner().invoke(app, ["train", str(config), "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    assert "no use for shield; leave it out" in " ".join(result.output.split())
    assert not (tmp_path / "run").exists()


@pytest.fixture
def read(monkeypatch):
    """Dotted names of the settings that a training reads."""
    found = set()
    parts = {Ppo: "ppo.", Net: "net.", Evaluation: "evaluation.", League: "league.", TrainingSettings: ""}

    def recorder(kind, prefix):
        names = {entry.name for entry in fields(kind)}

        def get(self, name):
            if name in names and Path(sys._getframe(1).f_code.co_filename).name not in ABOUT_SETTINGS:
                found.add(prefix + name)
            return object.__getattribute__(self, name)

        return get

    for kind, prefix in parts.items():
        monkeypatch.setattr(kind, "__getattribute__", recorder(kind, prefix), raising=False)
    return found


@pytest.mark.parametrize(
    ("algorithm", "changes", "reads"),
    [
        ("qmix", {"decisions": 24}, {"ppo.discount", "threads", "evaluation.games"}),
        ("cloning", {"options": {"epochs": 2}}, {"games", "stages", "seed"}),
        (
            "raids",
            {
                "rules": {"max_time_s": 150.0},
                "games": 8,
                "ppo": {"steps": 40, "batch": 300, "epochs": 1},
                "stages": [{"opponents": ["medium"]}],
                "options": {"recorded": [0.0, 0.3]},
                "decisions": 300,
                "seed": 1,
            },
            {"ppo.clip", "ppo.gae_lambda", "net.hidden", "device"},
        ),
    ],
)
def test_a_training_reads_nothing_of_what_it_is_said_to_have_no_use_for(
    algorithm, changes, reads, tiny, tmp_path, read
):
    settings = read_config(tiny(algorithm=algorithm, **changes))
    (tmp_path / "run").mkdir()
    training_of(settings, tmp_path / "run", False).run()
    assert reads <= read
    assert read & set(NO_USE[algorithm]) <= HANDED_ON
