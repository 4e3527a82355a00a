import hashlib
import itertools
import math

import pytest
from boat_bench import ARM, ID, INTERVAL, MODE, Bench, attitude, stream, velocity
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.mavlink.signing import SigningClock
from steerclear.shield.platforms import layout as L

GPI = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE


def test_boots_as_measured():
    bench = Bench(boot_s=42.0)
    stream(bench, GPI, 10)
    stream(bench, ATTITUDE, 40)
    bench.run(8.0)
    yaws = [(t, m.yaw) for t, m in bench.heard if m.get_type() == "ATTITUDE"]
    assert max(abs(yaw) for t, yaw in yaws if t < 1.0) > 0.5, "not to be believed yet"
    assert max(abs(yaw) for t, yaw in yaws if t > 1.1) < 1e-6
    assert bench.command(MODE, 1, 15) == mavlink.MAV_RESULT_FAILED  # GUIDED needs a position
    assert bench.last("GLOBAL_POSITION_INT").lat == 0
    bench.run(2.0)
    assert bench.last("GLOBAL_POSITION_INT").lat == pytest.approx(420000900, abs=100)
    assert bench.command(MODE, 1, 15) == mavlink.MAV_RESULT_ACCEPTED
    bench.run(30.0)
    assert bench.command(ARM, 1) == mavlink.MAV_RESULT_FAILED
    bench.run(0.1)
    assert "Arm: AHRS: not using configured AHRS type" in bench.texts()
    assert not bench.last("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    bench.run(2.5)
    assert bench.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
    bench.run(1.1)
    assert bench.last("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert (bench.last("HEARTBEAT").custom_mode, bench.last("HEARTBEAT").type) == (15, 11)


@pytest.mark.parametrize(
    ("command", "parameters", "result"),
    [
        (MODE, (0, 15), mavlink.MAV_RESULT_DENIED),
        (MODE, (1, 77), mavlink.MAV_RESULT_FAILED),
        (MODE, (1, 10), mavlink.MAV_RESULT_FAILED),
        (MODE, (1, 4), mavlink.MAV_RESULT_ACCEPTED),
        (MODE, (1, 0), mavlink.MAV_RESULT_ACCEPTED),  # it is in it already
        (ARM, (3,), mavlink.MAV_RESULT_UNSUPPORTED),
        (ARM, (math.nan,), mavlink.MAV_RESULT_UNSUPPORTED),
        (INTERVAL, (9999, 1e5), mavlink.MAV_RESULT_FAILED),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (), mavlink.MAV_RESULT_UNSUPPORTED),
        (mavlink.MAV_CMD_REQUEST_MESSAGE, (9999,), mavlink.MAV_RESULT_FAILED),
        (mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (0,), mavlink.MAV_RESULT_DENIED),
    ],
)
def test_commands_are_acknowledged(command, parameters, result):
    bench = Bench()
    bench.run(0.1)
    assert bench.command(command, *parameters) == result
    assert bench.command(command, *parameters, target=ID + 1) is None


def steady(bench, message):
    """Heading over ground deg, speed along the bow m/s, and turn rate deg/s under a command held for a while."""
    bench.run(18.0, message)
    return math.degrees(bench.hull.heading_rad), bench.hull.speed_mps, math.degrees(bench.hull.turn_rate_rads)


@pytest.mark.parametrize(
    ("message", "heading_deg", "speed_mps"),
    [
        (attitude(math.radians(60), 0.5), 60.0, 1.0),
        (attitude(math.radians(60), 5.0), 60.0, 2.0),  # thrust beyond 1 is 1
        (attitude(math.radians(60), -0.5), 60.0, -1.0),
        (velocity(0.0, 1.5), 90.0, 1.5),
        (velocity(-3.0, 0.0), 180.0, 2.0),  # clamped to WP_SPEED, and southward ahead
    ],
)
def test_routes_in_guided(message, heading_deg, speed_mps):
    heading, speed, _ = steady(Bench().guided(), message)
    assert (heading - heading_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=2.0)
    assert speed == pytest.approx(speed_mps, abs=0.08)
    _, speed, rate = steady(Bench().guided(), attitude(0.0, 0.5, mask=3, rate=0.3))
    assert math.radians(rate) == pytest.approx(0.3, abs=0.02)
    assert 0.0 < speed <= 1.05


@pytest.mark.parametrize(
    "message",
    [
        attitude(1.0, 0.5, mask=7 | 64),  # thrust ignored: dropped
        attitude(1.0, 0.5, target=ID + 1),
        attitude(math.nan, 0.5),
        attitude(1.0, math.inf),
        velocity(1.0, 1.0, frame=3),
        velocity(math.nan, 1.0),
        velocity(1.0, 1.0, mask=3527 & ~64),  # an acceleration
        velocity(0.0, 0.0, mask=3576),  # a place
    ],
)
def test_what_is_dropped_is_dropped_silently(message):
    bench = Bench().guided()
    start = bench.hull.state[:3].copy()
    heard = len(bench.heard)
    bench.run(2.0, message)
    assert (bench.hull.state[:3] == start).all()
    assert {m.get_type() for _, m in bench.heard[heard:]} <= {"HEARTBEAT", "STATUSTEXT"}


@pytest.mark.parametrize("order", [(MODE, 1, 0), (MODE, 1, 4), (MODE, 1, 5), (ARM, 0)])
def test_outside_guided_and_disarmed_nothing_moves(order):
    bench = Bench().guided()
    bench.command(*order)
    before = len(bench.heard)
    bench.run(2.0, attitude(1.0, 0.5))
    assert bench.hull.state[L.SPEED] == 0.0
    assert "COMMAND_ACK" not in {m.get_type() for _, m in bench.heard[before:]}


@pytest.mark.parametrize(("speed_mps", "still_after_s", "run_m"), [(1.0, 3.9, 3.4), (2.0, 4.7, 7.7), (3.0, 5.6, 13.2)])
def test_commands_time_out_as_measured(speed_mps, still_after_s, run_m):
    bench = Bench("surveyor", parameters={"WP_SPEED": 3.0}).guided()
    bench.run(60.0, attitude(0.0, speed_mps / 3.0), every_s=2.5)
    assert "target not received last 3secs, stopping" not in bench.texts()
    start_s, y = bench.now_s, bench.hull.state[L.Y]
    assert bench.hull.speed_mps == pytest.approx(speed_mps, abs=0.05)
    while bench.hull.speed_mps > 0.1:
        bench.run(0.1)
    assert bench.now_s - start_s == pytest.approx(still_after_s, abs=0.25)
    furthest = bench.hull.state[L.Y]
    assert furthest - y == pytest.approx(run_m, rel=0.08)
    assert "target not received last 3secs, stopping" in bench.texts()
    bench.run(30.0)
    assert furthest - bench.hull.state[L.Y] == pytest.approx(2.0, abs=0.2)  # it backs up
    assert (bench.last("HEARTBEAT").custom_mode, bench.last("HEARTBEAT").system_status) == (15, 4)
    bench.run(3.0, attitude(0.0, 0.5))
    assert bench.hull.speed_mps > 0.2  # resumes at the next command


@pytest.mark.parametrize("watched", [False, True])
def test_ground_station_failsafe_is_off_by_default_and_holds_when_on(watched):
    heartbeat, command = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), attitude(0.0, 0.5)
    bench = Bench(parameters={"FS_GCS_ENABLE": int(watched)}).guided()
    bench.run(8.0, command)
    assert bench.last("HEARTBEAT").custom_mode == 15, "never heard of one"
    bench.say(heartbeat)
    start_s = bench.now_s
    bench.run(10.0, command)
    failed = [t - start_s for t, m in bench.heard if m.get_type() == "STATUSTEXT" and m.text == "Radio Failsafe"]
    assert failed == ([pytest.approx(6.5, abs=0.15)] if watched else [])
    bench.say(heartbeat)
    bench.run(1.0, command)
    assert bench.last("HEARTBEAT").custom_mode == (4 if watched else 15), "GUIDED must be asked for again"


@pytest.mark.parametrize(("asked_hz", "rate_hz"), [(4, 4), (20, 20), (200, 40)])
def test_rates_of_messages(asked_hz, rate_hz):
    bench = Bench()
    bench.run(0.1)
    assert stream(bench, GPI, asked_hz) == mavlink.MAV_RESULT_ACCEPTED
    bench.run(10.0)
    times = bench.times("GLOBAL_POSITION_INT")
    assert len(times) == pytest.approx(10 * rate_hz, abs=5)
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert max(gaps) <= 1.0 / rate_hz + 0.021
    assert min(gaps) >= 0.019
    bench.command(INTERVAL, GPI, -1)
    before = len(bench.times("GLOBAL_POSITION_INT"))
    bench.run(1.0)
    assert len(bench.times("GLOBAL_POSITION_INT")) == before


def test_telemetry_says_where_the_hull_is():
    bench = Bench(y_axis_deg=37.0).guided()
    for message in (GPI, ATTITUDE):
        stream(bench, message, 10)
    bench.run(10.0, attitude(math.radians(100.0), 0.5))
    told, hull = bench.last("GLOBAL_POSITION_INT"), bench.hull
    x, y = bench.frame.to_field_m(told.lat * 1e-7, told.lon * 1e-7)
    assert (x, y) == pytest.approx((hull.state[L.X], hull.state[L.Y]), abs=0.02)
    assert told.hdg / 100.0 == pytest.approx(math.degrees(hull.heading_rad) + 37.0, abs=0.02)
    assert math.degrees(bench.last("ATTITUDE").yaw) == pytest.approx(told.hdg / 100.0, abs=0.02)
    assert math.hypot(told.vx, told.vy) / 100.0 == pytest.approx(hull.speed_mps, abs=0.02)
    assert math.degrees(math.atan2(told.vy, told.vx)) == pytest.approx(told.hdg / 100.0, abs=2.0)


def test_parameters():
    bench = Bench()

    def told(message):
        before = len(bench.heard)
        bench.say(message)
        return [m for _, m in bench.heard[before:]]

    def read(name=b"", index=-1):
        return told(mavlink.MAVLink_param_request_read_message(ID, 1, name, index))

    assert read(b"WP_SPEED")[0].param_value == 2.0, "the platform's top speed"
    assert read(b"NO_SUCH_NAME") == read(index=10_000) == []
    for value in (1.25, math.nan):
        bench.say(mavlink.MAVLink_param_set_message(ID, 1, b"WP_SPEED", value, 9))
        assert read(b"WP_SPEED")[0].param_value == 1.25
    every = told(mavlink.MAVLink_param_request_list_message(ID, 1))
    assert len(every) == every[0].param_count == len({m.param_id for m in every})
    assert read(index=3)[0].param_id == every[3].param_id


def test_restart_forgets_all_but_parameters():
    bench = Bench(boot_s=2.0)
    bench.run(2.1)
    bench.guided()
    stream(bench, GPI, 20)
    bench.say(mavlink.MAVLink_param_set_message(ID, 1, b"WP_SPEED", 1.5, 9))
    bench.run(5.0, attitude(0.0, 1.0))
    assert bench.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mavlink.MAV_RESULT_ACCEPTED
    speed = bench.hull.speed_mps
    before = len(bench.heard)
    bench.run(1.0, attitude(0.0, 1.0))
    assert {m.get_type() for _, m in bench.heard[before:]} == {"HEARTBEAT", "STATUSTEXT"}
    assert bench.last("HEARTBEAT").custom_mode == 0
    assert 0.0 < bench.hull.speed_mps < speed  # it runs on without motors
    assert bench.command(ARM, 1) == mavlink.MAV_RESULT_FAILED
    bench.run(1.2)
    bench.guided()
    assert bench.boat.autopilot.vehicle.parameters["WP_SPEED"] == 1.5


KEY = hashlib.sha256(b"test").digest()


def signing_bench():
    bench = Bench(key=KEY)
    bench.ground.signing.secret_key = KEY
    bench.ground.signing.timestamp = SigningClock().now()
    bench.ground.signing.sign_outgoing = True
    return bench


def test_unsigned_replayed_and_wrongly_signed_packets_are_refused():
    bench = signing_bench()
    bench.run(0.1)
    message = mavlink.MAVLink_command_long_message(ID, 1, MODE, 0, 1, 15, 0, 0, 0, 0, 0)
    packet = bytes(message.pack(bench.ground))
    bench.boat.hear(packet, 0.1)
    assert bench.boat.autopilot.vehicle.mode == 15
    assert all(told[2] & 1 for told in bench.packets), "what it says is signed as well"
    bench.command(MODE, 1, 4)
    bench.boat.hear(packet, 0.1)  # again
    assert bench.boat.autopilot.vehicle.mode == 4
    bench.ground.signing.sign_outgoing = False
    assert bench.command(MODE, 1, 15) is None
    bench.ground.signing.sign_outgoing = True
    bench.ground.signing.secret_key = bytes(32)
    bench.ground.signing.timestamp += 10**9  # far ahead: it must not lock the rightful one out
    assert bench.command(MODE, 1, 15) is None
    assert bench.boat.autopilot.counts["refused"] == 3
    bench.ground.signing.secret_key = KEY
    bench.ground.signing.timestamp -= 10**9
    assert bench.command(MODE, 1, 15) == 0
