"""What does not move around the boats: the geofence, obstacles, and the own flag's circle while there is a referee."""

import math

import numpy as np
import pytest
from bridge_fakes import FakeGame, World, fleet_of, game_of, straight
from steerclear.shield import Surroundings
from steerclear.shield.bridge.static_obstacles import StaticObstacles

CIRCLE = (10.0, 20.0, 4.35)
ROCK = (40.0, 10.0, 2.0)
PIER = ((50.0, 0.0), (52.0, 0.0), (51.0, 5.0))
GROUNDS = Surroundings((0.0, 0.0, 80.0, 40.0), circles=[ROCK], polygons=[PIER], stops=[CIRCLE])


@pytest.fixture
def file():
    return fleet_of(blue=2, red=0)


def test_the_geofence_takes_the_place_of_the_games_edge_and_obstacles_are_always_there(file):
    around = StaticObstacles(file, GROUNDS).around()
    assert around.field == file.geofence.box
    assert around.circles == (ROCK,)
    assert around.polygons == (PIER,)
    assert around.stops == ()


@pytest.mark.parametrize(
    ("game", "age_s", "is_there"),
    [
        (game_of(), 0.0, True),
        (game_of(), 2.0, True),
        (game_of(), 2.001, False),
        (game_of(), math.nan, False),
        (game_of(blue_taken=True), 0.0, True),
        (game_of(red_taken=True), 0.0, True),
        (game_of(over=True), 0.0, False),
        (None, math.inf, False),
    ],
    ids=["home", "just fresh", "silent", "no age", "taken", "the other taken", "over", "no referee"],
)
def test_the_own_flags_circle_is_there_while_a_referee_keeps_the_game(file, game, age_s, is_there):
    stops = StaticObstacles(file, GROUNDS).around(game, age_s).stops
    assert stops == ((CIRCLE,) if is_there else ())


def test_a_boat_told_to_cross_its_own_flag_stays_out_of_the_circle_whether_the_flag_is_home_or_not():
    """It may come home at any time. Without a referee the boat goes through; the tick holds what it was given."""

    def told(number):
        return game_of(blue_taken=number >= 120)

    def world_of(game):
        return World(
            fleet_of(blue=1, red=0),
            [(10.0, -5.0, 0.0, 2.0)],
            straight(0.0),
            game=game,
            grounds=GROUNDS,
        )

    nearest = [math.inf]

    def look(world):
        at = world.links["blue_1"].row[:2]
        nearest[0] = min(nearest[0], float(np.hypot(*(at - CIRCLE[:2]))))

    world = world_of(FakeGame(told)).run(30.0, look)
    assert CIRCLE[2] - 0.02 <= nearest[0] < CIRCLE[2] + 3.0  # paths are looked at from sample to sample
    assert {tick.game["flags"][0]["taken"] for tick in world.sink.ticks} == {False, True}
    assert {tick.surroundings.stops for tick in world.sink.ticks} == {(CIRCLE,)}
    nearest[0] = math.inf
    world_of(None).run(12.0, look)
    assert nearest[0] < 2.0, "without a referee nothing is in the way"


def test_a_referee_who_falls_silent_lifts_the_circle_and_the_next_word_sets_it_again():
    game = FakeGame(lambda number: game_of())
    world = World(fleet_of(blue=1, red=0), [(40.0, 30.0, 0.0, 0.0)], straight(0.0, 0.0), game=game, grounds=GROUNDS)
    seen = []
    for age_s in (0.0, 3.0, 0.1):
        game.age_s = age_s
        world.run(0.2)
        seen.append(world.last.surroundings.stops)
    assert seen == [(CIRCLE,), (), (CIRCLE,)]
