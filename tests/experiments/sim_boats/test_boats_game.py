import math
import socket

import numpy as np
import pytest
from boat_links import READY, station
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import load, save
from steerclear.experiments.sim_boats import SimBoat, SimFleet
from steerclear.experiments.sim_boats.game import start_places
from steerclear.experiments.sim_boats.hull import STEP_S
from steerclear.experiments.sim_boats.world import Mark, circumstances, last_commanded
from steerclear.shield.bridge.feed_packets import parse_packet
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.platforms import layout as L


def six(blue="medium_attack", red="medium", **settings):
    boats = [SimBoat(f"blue_{i}", address=None, policy=blue) for i in range(3)]
    boats += [SimBoat(f"red_{i}", team=1, address=None, policy=red) for i in range(3)]
    return SimFleet(boats, autopilot=READY, waits=False, **settings)


def test_plays_the_simulators_own_game_state_for_state():
    fleet = six("medium_attack", "easy", seed=5, rules={"flag_keepout_m": 0.0})
    env = MctfEnv(fleet._world._game.core.config.replace())
    env.reset()
    teams = [policies.make("medium_attack"), policies.make("easy")]
    for number, team in enumerate(teams):
        team.reset(env, env.possible_agents[3 * number : 3 * number + 3], 2 * 5 + number)
    try:
        for step in range(250):
            env.step(teams[0].act({}, {}) | teams[1].act({}, {}))
            fleet.advance(0.1)
            here = np.array(list(fleet.states().values()))
            there = env.core.state[0]
            # not to the last bit: the env works out a policy's change of heading error in single precision
            assert np.allclose(here[:, :4], there[:, :4], rtol=0.0, atol=1e-4), step
        core = fleet._world._game.core
        assert (core.is_tagged == env.core.is_tagged).all()
        assert (core.has_flag == env.core.has_flag).all()
        assert (core.time_s == env.core.time_s).all()
    finally:
        fleet.close()


def test_policies_wait_until_every_link_is_commanded():
    boats = [SimBoat("blue"), SimBoat("red", team=1, address=None, policy="medium_attack")]
    fleet = SimFleet(boats, autopilot=READY)
    with station(fleet) as ground:
        ground.run(5.0)
        assert not fleet.is_playing
        assert fleet.states()["red"][L.SPEED] == 0.0
        ground.guide(1)
        ground.run(4.5, lambda: ground.steer(1, 0.0, 0.1))
        assert not fleet.is_playing
        ground.run(3.0, lambda: ground.steer(1, 0.0, 0.1))
        assert fleet.is_playing
        assert fleet.states()["red"][L.SPEED] > 0.1


def test_the_record_is_a_games_and_the_oracle_judges_it(tmp_path):
    fleet = six(record=True)
    try:
        fleet.advance(20.0)
        record = load(save(fleet.truth_record(), tmp_path / "truth.npz"))
        states = np.array(list(fleet.states().values()))
        assert record["position"].shape == (201, 6, 2)
        assert np.array_equal(record["state"][-1], states, equal_nan=True)
        assert np.array_equal(record["position"][-1], states[:, [L.X, L.Y]])
        assert (record["filtered"][:, :, 0] > 0.5).any()
        closest = fleet.closest_approaches()[0]
        names = list(fleet.boats)
        pair = [names.index(closest.first), names.index(closest.second)]
        apart = np.linalg.norm(record["position"][:, pair[0]] - record["position"][:, pair[1]], axis=1)
        assert closest.distance_m == apart[1:].min()
        assert closest.time_s == pytest.approx(0.1 * (1 + int(apart[1:].argmin())))
        inside = [row for row in record["violations"] if row[3] <= 2.5]
        judged = fleet.judge(0)
        assert len(judged) == sum(min(row[1], row[2]) < 3 for row in inside) > 0
        assert {entry["verdict"] for entry in judged} <= {"avoidable", "unavoidable", "started_inside"}
    finally:
        fleet.close()


def test_start_places_are_their_own_the_games_or_drawn_apart():
    boats = [SimBoat(f"b{i}", team=i // 3) for i in range(6)]
    fixed, drawn = start_places(boats, None, None), start_places(boats, None, 4)
    assert fixed[0][:2] == (25.0, 30.0)
    assert {place[0] for place in fixed} == {25.0, 55.0}
    assert drawn == start_places(boats, None, 4) != fixed
    assert min(math.dist(a[:2], b[:2]) for i, a in enumerate(drawn) for b in drawn[:i]) >= 40.0 / 6.0
    own, placed = start_places([SimBoat("a", start=(1.0, 2.0, 3.0)), SimBoat("b")], None, None)
    assert (own, placed) == ((1.0, 2.0, 3.0), pytest.approx((25.0, 40.0 / 3.0, 90.0)))


@pytest.fixture
def listener():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(2.0)
        heard.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        yield heard


def packets(listener, count):
    return [parse_packet(listener.recv(65536)) for _ in range(count)]


def test_the_feed_says_where_all_boats_are_and_faults_reach_it(listener):
    frame = FieldFrame(42.0, -71.0, 30.0)
    fleet = six(feed_to=[f"127.0.0.1:{listener.getsockname()[1]}"], y_axis_deg=30.0)
    try:
        fleet.advance(2.0)
        told = packets(listener, 20)
        assert [packet.seq for packet in told] == list(range(told[0].seq, told[0].seq + 20))
        before = {fix.boat: fix for fix in told[-1].fixes}
        assert set(before) == set(fleet.boats)
        for name, state in fleet.states().items():
            fix = before[name]
            assert frame.to_field_m(fix.latitude_deg, fix.longitude_deg) == pytest.approx(state[:2], abs=1e-6)
            assert fix.heading_deg == pytest.approx((state[L.HEADING] + 30.0) % 360.0)
            assert (fix.speed_mps, fix.age_s) == (pytest.approx(state[L.SPEED]), 0.0)
        fleet.fault("red_0", "telemetry_stop")
        fleet.fault("red_1", "freeze")
        fleet.fault("red_2", "late", delay_s=1.0)
        fleet.fault("blue_0", "jump", distance_m=30.0, course_deg=90.0)
        fleet.advance(1.5)
        told = {fix.boat: fix for fix in packets(listener, 15)[-1].fixes}
        assert set(told) == set(before) - {"red_0"}
        assert told["red_1"].latitude_deg == before["red_1"].latitude_deg
        assert told["red_1"].age_s == 0.0
        assert told["red_2"].age_s == pytest.approx(1.0, abs=1e-6)
        x, _ = fleet.frame.to_field_m(told["blue_0"].latitude_deg, told["blue_0"].longitude_deg)
        assert x == pytest.approx(fleet.states()["blue_0"][L.X] + 30.0, abs=0.01)
        fleet.clear("red_0")
        fleet.advance(0.1)
        assert "red_0" in {fix.boat for fix in packets(listener, 1)[0].fixes}
    finally:
        fleet.close()


def test_a_policys_boat_with_a_link_tells_where_it_is_and_obeys_who_commands_it():
    boats = [SimBoat("blue", policy="medium_attack"), SimBoat("red", team=1, policy="medium_attack")]
    fleet = SimFleet(boats, autopilot=READY, waits=False)
    with station(fleet, fleet.addresses["red"]) as ground:
        ground.run(0.2)
        ground.guide(2)
        ground.run(4.0)
        told = ground.positions(2)
        assert math.dist(told[0][1:], told[-1][1:]) > 1.0  # its policy drives it while nobody commands
        ground.run(12.0, lambda: ground.steer(2, 0.0, 0.5))
        assert fleet.states()["red"][L.HEADING] == pytest.approx(0.0, abs=5.0)


STEERED = Mark(True, (), True)
ALONE = Mark(False, ("link_loss",))
PLAYED = Mark(True)
LEFT = Mark(False, held=True)


def held_by(rows, step, boats):
    return circumstances(rows, last_commanded(rows), step, boats)


def test_how_long_a_boat_was_steered_by_nobody_is_told():
    rows = [*[(STEERED, PLAYED)] * 3, *[(ALONE, PLAYED)] * 4, (STEERED, PLAYED)]
    assert held_by(rows, 7, (0, 1)) == {"unsteered_s": [0.4, 0.0], "faults": ["link_loss"], "after_run": False}
    assert held_by(rows, 3, (0, 1)) == {"unsteered_s": [0.0, 0.0], "faults": [], "after_run": False}


@pytest.mark.parametrize(
    ("gap_s", "then", "in_order"),
    [
        (0.0, LEFT, True),
        (1.5, LEFT, True),  # its commands timed out while HOLD was asked for
        (3.5, LEFT, False),  # its own failsafe
        (0.0, Mark(False), False),  # GUIDED, and nobody there
    ],
)
def test_a_runner_that_dies_does_not_end_the_run(gap_s, then, in_order):
    gap = round(gap_s / STEP_S)
    rows = [*[(STEERED, PLAYED, STEERED)] * 5, *[(Mark(False), PLAYED, LEFT)] * gap, *[(then, PLAYED, LEFT)] * 5]
    assert held_by(rows, len(rows), (0, 1))["after_run"] == in_order
    assert held_by(rows, len(rows), (2, 1))["after_run"], "the other was left in order"
    assert held_by(rows, len(rows), (2, 0))["after_run"] == in_order


def test_violations_of_a_simulated_game_carry_them():
    boats = [SimBoat(f"b{i}", team=i // 2, start=(10.0 + i, 10.0, 0.0), policy="hold") for i in range(4)]
    fleet = SimFleet(boats, autopilot=READY, record=True, waits=False)
    fleet.fault("b0", "freeze", duration_s=1.0)
    fleet.advance(1.0)
    violations, commanded = fleet.judge(0), fleet.truth_record()["commanded"]
    fleet.close()
    assert violations
    assert commanded.shape[1] == 4
    assert not commanded.any()
    assert all(violation["unsteered_s"] == [0.0, 0.0] and not violation["after_run"] for violation in violations)
    assert any(violation["faults"] == ["freeze"] for violation in violations)
