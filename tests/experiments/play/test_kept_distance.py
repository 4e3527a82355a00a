"""The distance a command's shield keeps where none is given: that at which the game counts collisions."""

import pytest
from steerclear.env.config import GameConfig
from steerclear.experiments.cli import app
from steerclear.experiments.cli_options import with_distance
from steerclear.experiments.play.spec import check_shield, counted_m, words_of_less
from typer.testing import CliRunner


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


def test_the_whole_shorter_side_is_allowed():
    assert check_shield({"separation_m": 40.0}, GameConfig.preset("aamas2024")).separation_m == 40.0


@pytest.mark.parametrize(("shield", "told"), [("--shield", 1), ("--no-shield", 0)])
def test_a_shield_that_keeps_less_than_the_game_counts_says_so_once(shield, told, tmp_path):
    words = "evaluate", "hold", shield, "--opponents", "hold", "--games", "1", "--max-time", "1", "--jobs", "1"
    result = CliRunner().invoke(
        app, [*words, "--preset", "mctf2025", "--separation", "2.5", "--judge", "none", "--out", str(tmp_path / "x")]
    )
    assert result.exit_code == 0, result.output
    assert result.stderr.count("the shield keeps 2.5 m (separation_m), but this game counts collisions at 4 m") == told


def test_nothing_is_said_of_a_distance_that_is_the_games():
    for preset in ("aamas2024", "mctf2025"):
        game = GameConfig.preset(preset)
        assert words_of_less(counted_m(game), game) == ""
