"""The boat that a human steers is marked, and the keys are told."""

from dataclasses import replace

import numpy as np
import pytest
from steerclear.env.record import read_meta
from steerclear.env.render import Arena, Picture, Scene
from steerclear.env.render.boats import boats_in_breach
from steerclear.experiments.cli_games import STEERING
from steerclear.experiments.play.match import Match
from steerclear.experiments.play.spec import MatchSpec
from steerclear.policies.keyboard import AHEAD, BACK, LEFT, RIGHT


def drawn(record, **changes):
    arena = replace(Arena.from_meta(read_meta(record)), **changes)
    surface = Picture(arena, 1280, "light").draw(Scene.from_record(record, 20, 0.1), True)
    return np.frombuffer(surface.get_buffer().raw, np.uint8).reshape(surface.get_height(), -1).copy()


def test_the_steered_boat_is_ringed_and_the_keys_stand_below(game_record):
    plain, marked = drawn(game_record), drawn(game_record, steered=frozenset(["agent_0"]))
    changed = (plain != marked).any(axis=1)
    assert changed[-40:].any(), "the keys"
    assert changed[62:-40].any(), "the ring and the name"
    assert not (drawn(game_record, steered=frozenset()) != plain).any()


@pytest.mark.parametrize("keys", [AHEAD, BACK, LEFT, RIGHT])
def test_the_keys_told_are_those_that_are_read(keys):
    assert all(key in STEERING.replace(",", "").replace(":", "").split() for key in keys)


@pytest.mark.parametrize(("own", "opponent", "steered"), [
    ("keyboard", "hold", {"agent_0"}), ("hold", "keyboard", {"agent_3"}), ("hold", "easy", set()),
])  # fmt: skip
def test_the_first_boat_of_a_keyboard_team_is_steered(own, opponent, steered):
    match = Match(MatchSpec(preset="aamas2024", own=own, opponent=opponent), "human" if steered else None)
    try:
        assert match._steered() == steered
    finally:
        match.close()


def test_breaches_of_others_among_themselves_are_not_marked_where_boats_are_shielded(game_record):
    """Boats 2 and 3 are nobody's that is shielded: their picture is the same however close they are."""
    record = {name: array.copy() for name, array in game_record.items()}
    record["position"][:, 3] = record["position"][:, 2] + [0.0, 1.0]
    arena = Arena.from_meta(read_meta(record))
    scene = Scene.from_record(record, 20, 0.1)
    assert (2, 3) in boats_in_breach(scene, arena.separation_m)
    shielded, other = drawn(record), drawn(record, shielded=frozenset(["agent_2"]))
    breach = np.array([190, 24, 147])
    count = [
        int((rows.reshape(len(rows), -1, 4)[..., 2::-1] == breach).all(axis=2).sum()) for rows in (shielded, other)
    ]
    assert count[0] < count[1]
