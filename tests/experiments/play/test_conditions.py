"""Conditions as settings: on the command line, in results, reports and pages, and when a run is resumed."""

import json
from dataclasses import replace
from pathlib import Path

import json_keys as keys
import numpy as np
import pytest
from commands import run
from steerclear.experiments.ablation import AblationSettings
from steerclear.experiments.console import ExitCode
from steerclear.experiments.docs import write_pages
from steerclear.experiments.play.conditions import CALM, Conditions, draw, words_of, words_of_settings
from steerclear.experiments.play.spec import MatchSpec

ROUGH = Conditions(delay_s=0.3, noise_m=0.5, current_mps=0.3)
TINY = ["--opponents", "hold", "--games", "1", "--max-time", "2", "--jobs", "1"]
GIVEN = ["--delay", "0.3", "--noise", "0.5", "--current", "0.3"]


@pytest.mark.parametrize(
    ("delay_s", "steps"), [(0.0, 0), (0.01, 1), (0.1, 1), (0.3, 3), (0.31, 4), (0.7, 7), (2.0, 20)]
)
def test_a_delay_is_whole_steps_rounded_up(delay_s, steps):
    assert Conditions(delay_s=delay_s).delay_steps(0.1) == steps


def test_words_and_draws_of_conditions():
    assert ROUGH.words == "0.3 s delay, 0.5 m position noise, 0.3 m/s current"
    assert (CALM.words, CALM.calm, ROUGH.calm) == ("", True, False)
    assert words_of({"noise_m": 1, "radius_m": 2.5}) == "1 m position noise"
    assert words_of_settings({"separation_m": 4.0, "barriers": ["a", "b"]}) == "separation_m 4.0, barriers a+b"
    first, again, other = (draw(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first == again != other
    assert np.hypot(*first[0]) == pytest.approx(1.0)


def test_games_under_other_conditions_are_other_games(tmp_path):
    spec = MatchSpec("aamas2024", "medium", "easy")
    others = [Conditions(delay_s=0.3), Conditions(noise_m=0.3), Conditions(current_mps=0.3)]
    assert len({spec.key, *(replace(spec, conditions=entry).key for entry in others)}) == 4
    settings = AblationSettings(opponents=("hold",), games=1, rules={"max_time_s": 2.0}, conditions=ROUGH)
    played = {spec.key for spec in settings.specs()}
    for conditions, same in ((ROUGH, 2), (CALM, 0), (replace(ROUGH, delay_s=0.2), 0)):
        assert len(played & {spec.key for spec in replace(settings, conditions=conditions).specs()}) == same


def test_a_run_says_under_which_conditions_it_was_played(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("ablate", *TINY, *GIVEN, "--out", "out")
    assert done.exit_code == ExitCode.OK, done.output
    assert f"All games with {ROUGH.words}." in done.stdout
    content = json.loads(Path("out/results.json").read_text())
    assert keys.undocumented(content, keys.KEYS["ablate"]) == []
    assert content["settings"]["conditions"] == {"delay_s": 0.3, "noise_m": 0.5, "current_mps": 0.3}
    assert content["replay"]["same_as_played"] is True
    report = Path("out/report.html").read_text()
    assert ROUGH.words in report
    assert ROUGH.words in Path("out/replay.html").read_text()
    again = run("ablate", *TINY, *GIVEN, "--out", "out", "--resume")
    assert json.loads(Path("out/results.json").read_text())["games_resumed"] == 3, again.output
    calm = run("ablate", *TINY, "--out", "out", "--resume")
    assert calm.exit_code == ExitCode.BAD_INPUT
    assert "conditions.delay_s was 0.3, is 0.0" in calm.stderr
    assert json.loads(Path("out/results.json").read_text())["games_resumed"] == 3, "what is there stays"
    played = run("play", "--opponent", "hold", "--max-time", "2", *GIVEN, "--json", "a.json")
    assert played.exit_code == ExitCode.OK, played.output
    assert keys.undocumented(json.loads(Path("a.json").read_text()), keys.KEYS["play"]) == []
    pages = [path.name for path in write_pages([content], tmp_path / "docs")]
    assert "ablation_aamas2024_delay0.3_noise0.5_current0.3.md" in pages
    page = tmp_path / "docs" / "ablation_aamas2024_delay0.3_noise0.5_current0.3.md"
    assert ROUGH.words in page.read_text()
