"""What is said of a learned policy that plays another game than the one it learned in, once a command."""

import shutil
import zipfile

import pytest
from steerclear.env.config import GameConfig
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.demo import demo_file
from steerclear.experiments.policy_checks import words_of_elsewhere
from steerclear.policies.entrants.learned import FILES
from steerclear.policies.entrants.learned.sb3_file import add_card
from steerclear.shield.exceptions import ConfigError, PolicyError
from typer.testing import CliRunner

HELD_LONGER = "where a step is 1 s, not 0.1 s, and its decisions last 10 times as long"


@pytest.fixture
def weights(tmp_path):
    return f"weights:{shutil.copy(FILES['jin'], tmp_path / 'team.npz')}"


def model(path, card):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", "{}")
    if card is not None:
        add_card(path, card)
    return f"sb3:{path}"


def test_weights_models_and_entrants_tell_of_the_preset_they_learned_in(weights, tmp_path):
    for policy in (weights, "jin", model(tmp_path / "model.zip", {"preset": "aamas2024"})):
        assert words_of_elsewhere(policy, GameConfig.preset("aamas2024")) == ""
        for preset, longer in (("mctf2025", False), ("mctf2026", True)):
            words = words_of_elsewhere(policy, GameConfig.preset(preset))
            assert words.startswith(f"{policy} learned in preset aamas2024 and plays {preset} here")
            assert "play it by preset aamas2024" in words
            assert (HELD_LONGER in words) == longer


def test_nothing_is_said_of_who_learned_nothing_or_does_not_say_where(tmp_path):
    for policy in ("medium", "lucas", model(tmp_path / "model.zip", None)):
        assert words_of_elsewhere(policy, GameConfig.preset("mctf2026")) == ""


def test_a_preset_that_nobody_knows_here_is_named(tmp_path):
    policy = model(tmp_path / "model.zip", {"preset": "mctf2031"})
    words = words_of_elsewhere(policy, GameConfig.preset("aamas2024"))
    assert "learned in preset mctf2031 and plays aamas2024" in words


def test_a_card_that_is_none_is_refused(tmp_path):
    policy = model(tmp_path / "model.zip", None)
    with zipfile.ZipFile(tmp_path / "model.zip", "a") as archive:
        archive.writestr("steerclear_card.json", "[]")
    with pytest.raises(PolicyError, match="its card is none"):
        words_of_elsewhere(policy, GameConfig.preset("aamas2024"))


@pytest.mark.parametrize(("preset", "told"), [("mctf2026", 1), ("aamas2024", 0)])
@pytest.mark.parametrize(
    "words",
    [
        ("evaluate", "{}", "--no-shield", "--opponents", "hold", "--games", "2", "--jobs", "1", "--judge", "none"),
        ("play", "--own", "hold", "--opponent", "{}"),
        ("tournament", "--teams", "hold,{}", "--quick", "--shield", "off", "--jobs", "1"),
    ],
)
def test_commands_say_it_once(words, preset, told, weights, tmp_path):
    place = () if words[0] == "play" else ("--out", str(tmp_path / "x"))
    given = [word.format(weights) for word in words]
    result = CliRunner().invoke(app, [*given, *place, "--preset", preset, "--max-time", "1"])
    assert result.exit_code == 0, result.output
    assert result.stderr.count("learned in preset aamas2024") == told


def test_deploy_says_it_before_boats_are_spoken_to(weights, tmp_path, monkeypatch):
    def begun(*arguments):
        raise ConfigError("boats would be spoken to now")

    monkeypatch.setattr("steerclear.experiments.cli_boats.run_boats", begun)
    file = demo_file(tmp_path)
    file.write_text(file.read_text().replace("preset: aamas2024", "preset: mctf2025"))
    result = CliRunner().invoke(app, ["deploy", str(file), "--policy", weights])
    assert "would be spoken to" in result.stderr
    assert result.stderr.count("learned in preset aamas2024 and plays mctf2025 here") == 1
