"""For the same states the loop decides what a simulator's step decides, bit for bit, delay or not."""

import math

import numpy as np
import pytest
from bridge_fakes import DT_S, FakeGame, World, fleet_of, game_of
from steerclear.shield import Commands, Fleet, Shield, Surroundings
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER

OWN = [(20.0, 10.0, 0.0, 0.0), (20.4, 30.0, -180.0, 0.0), (40.0, 20.2, -90.0, 0.0)]
OTHERS = [("red_1", 10.0, 20.0, 90.0, 2.0), ("red_2", 30.0, 38.0, 180.0, 2.0), ("red_3", 60.0, 20.0, -90.0, 0.0)]
STEPS = 350
GROUNDS = Surroundings(circles=[(45.0, 32.0, 1.0)], stops=[(23.0, 18.0, 4.35)])
"""Where the boats are sent: a rock, and the circle of their own flag."""


def wanted_at(k):
    """All six boats, (speed m/s, absolute heading rad): crossing courses that change now and then."""
    turn = math.radians(35.0 * ((k // 70) % 4))
    return np.array([[2.0, (base + turn) % (2 * math.pi)] for base in (0.0, math.pi, 1.5 * math.pi, 0.0, 0.0, 0.0)])


def told(k):
    """What the others do: (speed, heading deg)."""
    return [(2.0, 90.0 + 20.0 * (k // 100)), (2.0, 180.0 - 30.0 * (k // 120)), (1.5, -90.0)]


def told_of_flags(k):
    """What the referee says at step k: our flag is home, is taken, is home again."""
    return game_of(blue_taken=100 <= k < 220)


def simulate(fleet, grounds=OPEN_WATER):
    """The simulator's step with the shield in it: full states in, commands out, boats moved."""
    params = get_platform("heron").pack()
    world = World(fleet, OWN, lambda s: None, OTHERS)  # only for its starting states
    rows = [link.row for link in world.links.values()] + list(world.contacts.rows.values())
    state = np.array(rows)
    shield, sent, changed = Shield(fleet.shield_config, fleet.surroundings), [], 0
    delay = round(fleet.shield_config.delay_s / DT_S)
    queue = [None] * delay
    for k in range(STEPS):
        seen = state.copy()
        seen[3:, L.HEADING] = [_through_radians(heading) for heading in seen[3:, L.HEADING]]
        now = Fleet(seen, np.array([0, 0, 0, 1, 1, 1]), ("heron",) * 6, np.arange(6) < 3, fleet.names)
        around = Surroundings(fleet.geofence.box, grounds.circles, grounds.polygons, stops=grounds.stops)
        answer = shield.decide(now, Commands.absolute_rad(wanted_at(k)), around)
        changed += answer.count_intervened
        own = [answer.filtered.absolute(i, now.heading_rad[i]) for i in range(3)]
        sent.append(own)
        queue.append([(speed, float(np.degrees(heading))) for speed, heading in own])
        works = queue.pop(0)
        for i in range(6):
            command = told(k)[i - 3] if i >= 3 else None if works is None else works[i]
            if command is not None:
                error = (command[1] - state[i, L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(params, state[i], command[0], error, DT_S)
    return np.array(sent), changed


def _through_radians(heading_deg):
    """Contacts come in rad: the last bit of a heading in deg is not what they are about."""
    return (math.degrees(math.radians(heading_deg)) + 180.0) % 360.0 - 180.0


def run_loop(fleet, late_steps, grounds=OPEN_WATER):
    """The loop on links whose boats obey ``late_steps`` late."""
    game = FakeGame(told_of_flags)
    world = World(fleet, OWN, lambda snapshot: wanted_at(snapshot.number + 1), OTHERS, game=game, grounds=grounds)
    world.policy.offer(Snapshot(-1, world.clock.now_s(), np.full((6, 4), np.nan)))
    for link in world.links.values():
        _delay(link, late_steps)

    def each(world):
        k = len(world.sink.ticks)
        world.contacts.commands = {name: row[::-1] for name, row in zip(world.contacts.rows, told(k), strict=True)}

    world.run(STEPS * DT_S, each)
    return world


def _delay(link, steps):
    queue, advance = [None] * steps, link.advance

    def late(dt_s):
        now = link.command
        queue.append(now)
        link.command = queue.pop(0)
        advance(dt_s)
        link.command = now

    link.advance = late


@pytest.mark.parametrize("late_steps", [0, 2])
@pytest.mark.parametrize("grounds", [OPEN_WATER, GROUNDS], ids=["open water", "flag and rock"])
def test_the_same_states_give_the_same_commands_bit_for_bit(late_steps, grounds):
    fleet = fleet_of(blue=3, red=3, more=f"shield: {{delay_s: {0.1 * late_steps}, track_error_mps: 0.0}}")
    expected, changed = simulate(fleet, grounds)
    world = run_loop(fleet, late_steps, grounds)
    decided = [
        [tick.decisions.filtered.absolute(i, tick.fleet.heading_rad[i]) for i in range(3)] for tick in world.sink.ticks
    ]
    np.testing.assert_array_equal(np.array(decided), expected)
    left = [[entry[1:] for entry in link.sent] for link in world.links.values()]
    np.testing.assert_array_equal(np.swapaxes(np.array(left), 0, 1)[..., ::-1], expected)
    assert changed > 50, "the comparison is worth something only where the shield has to act"
    assert world.closest_m > 2.4
