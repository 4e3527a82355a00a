"""For the same states the loop decides what a simulator's step decides, bit for bit, delay or not."""

import math

import numpy as np
import pytest
from bridge_fakes import DT_S, FakeGame, World, fleet_of, game_of
from steerclear.shield import Commands, Fleet, Shield, Surroundings
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

OWN = [(20.0, 10.0, 0.0, 0.0), (20.4, 30.0, -180.0, 0.0), (40.0, 20.2, -90.0, 0.0)]
OTHERS = [("red_1", 10.0, 20.0, 90.0, 2.0), ("red_2", 30.0, 38.0, 180.0, 2.0), ("red_3", 60.0, 20.0, -90.0, 0.0)]
STEPS = 350
GROUNDS = Surroundings(circles=[(45.0, 32.0, 1.0)], stops=[(23.0, 18.0, 4.35)])
"""Where the boats are sent: a rock, and the circle of their own flag, which is home, taken, and home again."""


def wanted_at(k):
    """All six boats, (speed m/s, absolute heading rad): crossing courses that change now and then."""
    turn = math.radians(35.0 * ((k // 70) % 4))
    return np.array([[2.0, (base + turn) % (2 * math.pi)] for base in (0.0, math.pi, 1.5 * math.pi, 0.0, 0.0, 0.0)])


def told(k):
    """What the others do: (speed, heading deg)."""
    return [(2.0, 90.0 + 20.0 * (k // 100)), (2.0, 180.0 - 30.0 * (k // 120)), (1.5, -90.0)]


def simulate(fleet, late_steps):
    """The simulator's step with the shield in it: full states in, commands out, boats moved."""
    params = get_platform("heron").pack()
    world = World(fleet, OWN, lambda s: None, OTHERS)  # only for its starting states
    state = np.array([link.row for link in world.links.values()] + list(world.contacts.rows.values()))
    shield, sent, changed = Shield(fleet.shield_config, fleet.surroundings), [], 0
    around = Surroundings(fleet.geofence.box, GROUNDS.circles, GROUNDS.polygons, stops=GROUNDS.stops)
    queue = [None] * late_steps
    for k in range(STEPS):
        seen = state.copy()  # contacts come in rad: the last bit of a heading in deg is not what they are about
        seen[3:, L.HEADING] = [(math.degrees(math.radians(h)) + 180.0) % 360.0 - 180.0 for h in seen[3:, L.HEADING]]
        now = Fleet(seen, np.array([0, 0, 0, 1, 1, 1]), ("heron",) * 6, np.arange(6) < 3, fleet.names)
        answer = shield.decide(now, Commands.absolute_rad(wanted_at(k)), around)
        changed += answer.count_intervened
        sent.append([answer.filtered.absolute(i, now.heading_rad[i]) for i in range(3)])
        queue.append([(speed, float(np.degrees(heading))) for speed, heading in sent[-1]])
        works = queue.pop(0) or [None] * 3
        for row, command in zip(state, [*works, *told(k)], strict=True):
            if command is not None:
                error = (command[1] - row[L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(params, row, command[0], error, DT_S)
    return np.array(sent), changed


def run_loop(fleet, late_steps):
    """The loop on links whose boats obey ``late_steps`` late."""
    game = FakeGame(lambda k: game_of(blue_taken=100 <= k < 220))
    world = World(fleet, OWN, lambda snapshot: wanted_at(snapshot.number + 1), OTHERS, game=game, surroundings=GROUNDS)
    world.policy.offer(Snapshot(-1, world.clock.now_s(), np.full((6, 4), np.nan)))
    for link in world.links.values():
        _delay(link, late_steps)

    def each(world):
        k = len(world.sink.ticks)
        world.contacts.commands = {name: row[::-1] for name, row in zip(world.contacts.rows, told(k), strict=True)}

    return world.run(STEPS * DT_S, each)


def _delay(link, steps):
    queue, advance = [None] * steps, link.advance

    def late(dt_s):
        now = link.command
        queue.append(now)
        link.command = queue.pop(0)
        advance(dt_s)
        link.command = now

    link.advance = late


@pytest.mark.parametrize(("delay_s", "late_steps"), [(0.0, 0), (0.04, 1), (0.2, 2), (0.31, 4)])
def test_the_same_states_give_the_same_commands_bit_for_bit(delay_s, late_steps):
    """A delay between steps is counted up: else a boat would have carried out a command that the shield has yet to."""
    fleet = fleet_of(blue=3, red=3, more=f"shield: {{delay_s: {delay_s}, track_error_mps: 0.0}}")
    expected, changed = simulate(fleet, late_steps)
    world = run_loop(fleet, late_steps)
    decided = [
        [tick.decisions.filtered.absolute(i, tick.fleet.heading_rad[i]) for i in range(3)] for tick in world.sink.ticks
    ]
    np.testing.assert_array_equal(np.array(decided), expected)
    left = [[entry[1:] for entry in link.sent] for link in world.links.values()]
    np.testing.assert_array_equal(np.swapaxes(np.array(left), 0, 1)[..., ::-1], expected)
    assert changed > 50, "the comparison is worth something only where the shield has to act"
    assert world.closest_m > 2.4
