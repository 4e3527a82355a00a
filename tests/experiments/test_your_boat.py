"""Every command of the page "from your boat to a shielded boat", as it stands there, on simulated boats."""

import re

import pytest
import yaml
from boat_page import PAGE, commands, follow, lines
from commands import run
from steerclear.experiments.deploy.player import NEED_NO_GAME
from steerclear.shield.platforms.files import load_platform


def test_the_page_shows_each_step_and_all_of_them_exist():
    named = [words[1] for words in commands()]
    assert named == ["platform"] * 3 + ["sea-trial", "fit", "platform", "preflight", "deploy", "replay"]
    for words in commands() + commands("sim"):
        command = words[1 : 3 if words[1] == "platform" else 2]
        result = run(*command, "--help-all")
        assert result.exit_code == 0, words
        options = [word for word in words if word.startswith("--")]
        assert all(option in result.output for option in options), words


def test_the_first_description_is_one_that_the_shield_takes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in commands()[:3]:
        result = run(*words[1:])
        assert result.exit_code == 0, (words, result.output)
    assert load_platform("my_boat.yaml").platform.name == "my_boat"
    assert "turns 90 deg" in result.output


def test_the_page_has_no_command_write_over_a_file():
    """What a command would refuse to write is moved away by the page before."""
    there = set()
    for words in lines():
        if words[0] == "mv":
            there = there - {words[1]} | {words[2]}
        elif words[1] == "fit" or words[1:3] == ["platform", "new"]:
            file = words[words.index("--out") + 1] if "--out" in words else f"{words[3]}.yaml"
            assert file not in there, words
            there.add(file)
    assert there == {"first.yaml", "my_boat.yaml"}


def test_the_first_run_is_by_a_policy_that_the_fleet_of_the_page_can_play():
    (fleet,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text(), flags=re.M | re.S)
    assert not any("agent" in boat for boat in yaml.safe_load(fleet)["boats"])
    (deploy,) = [words for words in commands() if words[1] == "deploy"]
    assert deploy[deploy.index("--policy") + 1] in NEED_NO_GAME


@pytest.mark.study
def test_the_whole_page_on_a_boat_that_is_not_what_it_was_said_to_be(tmp_path):
    """Sim-boats at some times real time; the fit must foretell the true boat to half a metre at 3 s."""
    follow(tmp_path)
    assert load_platform(tmp_path / "my_boat.yaml").measured["median_3_s_m"] < 0.5
