"""The distance a command's shield keeps where none is given: that at which the game counts collisions."""

import pytest
from steerclear.experiments.commands.options import with_distance
from steerclear.shield.exceptions import ConfigError


@pytest.mark.parametrize(
    ("preset", "rules", "asked", "kept_m"),
    [
        ("aamas2024", {}, {}, None),
        ("mctf2025", {}, {}, 4.0),
        ("mctf2026", {}, {"profile": "rammers"}, 4.0),
        ("mctf2025", {}, {"separation_m": 2.5}, 2.5),
        ("aamas2024", {"agent_radius_m": 3.0}, {}, 6.0),
        ("mctf2025", {"agent_radius_m": 0.5}, {}, None),
    ],
)
def test_it_is_the_games_unless_one_is_given_or_the_usual_is_larger(preset, rules, asked, kept_m):
    found = with_distance(asked, preset, rules)
    assert found.get("separation_m") == kept_m
    assert {**found, **asked} == found


def test_rules_that_are_none_are_refused():
    with pytest.raises(ConfigError, match="agent_radius_m"):
        with_distance({}, "mctf2025", {"agent_radius_m": -1.0})
