"""What commands say once before they play: a policy that learned by other rules, a shield that keeps less."""

import shutil
import zipfile

import pytest
from commands import run
from steerclear.env.config import GameConfig
from steerclear.experiments.cli_options import with_distance
from steerclear.experiments.deploy.demo import demo_file
from steerclear.experiments.play.spec import check_shield, counted_m, words_of_less
from steerclear.experiments.policy_checks import words_of_elsewhere
from steerclear.policies.entrants.learned import FILES
from steerclear.policies.entrants.learned.sb3_file import add_card
from steerclear.shield.exceptions import ConfigError, PolicyError

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


def test_a_card_that_is_none_is_refused_and_a_preset_that_nobody_knows_is_named(tmp_path):
    later = model(tmp_path / "later.zip", {"preset": "mctf2031"})
    words = words_of_elsewhere(later, GameConfig.preset("aamas2024"))
    assert "learned in preset mctf2031 and plays aamas2024" in words
    policy = model(tmp_path / "model.zip", None)
    with zipfile.ZipFile(tmp_path / "model.zip", "a") as archive:
        archive.writestr("steerclear_card.json", "[]")
    with pytest.raises(PolicyError, match="its card is none"):
        words_of_elsewhere(policy, GameConfig.preset("aamas2024"))


@pytest.mark.parametrize(
    "words",
    [
        ("evaluate", "{}", "--no-shield", "--opponents", "hold", "--games", "2", "--jobs", "1", "--judge", "none"),
        ("play", "--own", "hold", "--opponent", "{}"),
        ("tournament", "--teams", "hold,{}", "--shield", "off", "--jobs", "1"),
    ],
)
def test_commands_say_it_once(words, weights, tmp_path):
    place = () if words[0] == "play" else ("--out", tmp_path / "x")
    result = run(*(word.format(weights) for word in words), *place, "--preset", "mctf2026", "--max-time", "1")
    assert result.exit_code == 0, result.output
    assert result.stderr.count("learned in preset aamas2024") == 1


def test_deploy_says_it_before_boats_are_spoken_to(weights, tmp_path, monkeypatch):
    def begun(*arguments):
        raise ConfigError("boats would be spoken to now")

    monkeypatch.setattr("steerclear.experiments.cli_boats.run_boats", begun)
    file = demo_file(tmp_path)
    file.write_text(file.read_text().replace("preset: aamas2024", "preset: mctf2025"))
    result = run("deploy", file, "--policy", weights)
    assert "would be spoken to" in result.stderr
    assert result.stderr.count("learned in preset aamas2024 and plays mctf2025 here") == 1


@pytest.mark.parametrize(
    ("preset", "rules", "asked", "kept_m"),
    [
        ("aamas2024", {}, {}, None),
        ("mctf2025", {}, {}, 4.0),
        ("mctf2026", {}, {"profile": "ramming"}, 4.0),
        ("mctf2025", {}, {"separation_m": 2.5}, 2.5),
        ("aamas2024", {"agent_radius_m": 3.0}, {}, 6.0),
        ("mctf2025", {"agent_radius_m": 0.5}, {}, None),
    ],
)
def test_it_is_the_games_unless_one_is_given_or_the_usual_is_larger(preset, rules, asked, kept_m):
    found = with_distance(asked, preset, rules)
    assert found.get("separation_m") == kept_m
    assert {**found, **asked} == found


@pytest.mark.parametrize(("shield", "told"), [("--shield", 1), ("--no-shield", 0)])
def test_a_shield_that_keeps_less_than_the_game_counts_says_so_once(shield, told, tmp_path):
    words = "evaluate", "hold", shield, "--opponents", "hold", "--games", "1", "--max-time", "1", "--jobs", "1"
    result = run(*words, "--preset", "mctf2025", "--separation", "2.5", "--judge", "none", "--out", tmp_path / "x")
    assert result.exit_code == 0, result.output
    assert result.stderr.count("the shield keeps 2.5 m (separation_m), but this game counts collisions at 4 m") == told


def test_nothing_is_said_of_a_distance_that_is_the_games_and_the_whole_shorter_side_is_allowed():
    for preset in ("aamas2024", "mctf2025"):
        game = GameConfig.preset(preset)
        assert words_of_less(counted_m(game), game) == ""
    assert check_shield({"separation_m": 40.0}, GameConfig.preset("aamas2024")).separation_m == 40.0
