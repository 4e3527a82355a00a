"""The position and game feed: what is taken, what is refused, whose word counts."""

import contextlib
import json
import math
import random
import socket
import threading
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.feed import (
    BoatStatus,
    FeedReceiver,
    FeedSender,
    Fix,
    FlagStatus,
    GameState,
    Packet,
    game_state,
    parse_packet,
)
from steerclear.shield.bridge.feed_packets import MAX_BYTES
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import BridgeError, ConfigError, FeedError

FRAME = FieldFrame(42.0, -71.0, 30.0)
LOCAL = "127.0.0.1"
STATUS = BoatStatus(tagged=True, has_flag=False, oob=False, on_side=True, cooldown_s=7.25, driven=True)
GAME = GameState(
    time_s=12.5,
    boats={"blue_1": STATUS},
    flags=(FlagStatus(10.0, 20.0, False), FlagStatus(33.25, 8.125, True)),
    captures=(1, 0),
    grabs=(2, 1),
    tags=(0, 4),
)


def contact(**changes):
    entry = {"boat": "red_1", "latitude_deg": 42.0, "longitude_deg": -71.0, "heading_deg": 75.0, "speed_mps": 1.5}
    return {**entry, "age_s": 0.25, "error_m": 0.5, **changes}


def positions(*contacts, **changes):
    packet = {"steerclear": 1, "kind": "positions", "sender": "hub", "run": 1, "seq": 1, "contacts": list(contacts)}
    return json.dumps({**packet, **changes}).encode()


def game(**changes):
    packet = {"steerclear": 1, "kind": "game", "sender": "referee", "run": 1, "seq": 1, **GAME.as_dict()}
    return json.dumps({**packet, **changes}).encode()


@pytest.fixture
def receiver():
    with FeedReceiver("127.0.0.1:0", FRAME, ManualClock(100.0), boats=("blue_1", "red_1")) as opened:
        yield opened


def test_a_fix_becomes_a_contact_in_the_field(receiver):
    x_m, y_m = 12.0, 34.0
    latitude, longitude = FRAME.to_geodetic_deg(x_m, y_m)
    receiver.take(positions(contact(latitude_deg=latitude, longitude_deg=longitude)), LOCAL)
    (found,) = receiver.read()
    assert found.position_m == pytest.approx((x_m, y_m), abs=1e-6)
    assert found.heading_rad == pytest.approx(math.radians(45.0))
    assert (found.boat, found.source, found.speed_mps, found.error_m) == ("red_1", "hub", 1.5, 0.5)
    assert found.fixed_s == 99.75
    assert receiver.faults() == {}


def test_the_state_of_the_game_comes_through_exactly(receiver):
    receiver.take(game(), LOCAL)
    assert receiver.game() == GAME
    assert receiver.game_age_s() == 0.0
    assert game_state(GAME.as_dict()) == GAME


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b"\xff\xfe\x00",
        b"[" * 20000,
        b'{"steerclear": true, "kind": "positions", "sender": "hub", "seq": 1, "contacts": []}',
        positions(steerclear=2),
        positions(kind="velocity"),
        positions(kind=["positions"]),
        positions(sender=""),
        positions(sender="x" * 65),
        positions(sender="a\nb"),
        positions(seq=-1),
        positions(seq=1.0),
        positions(seq=True),
        positions(seq=10**30),
        positions(run="1"),
        positions(contacts={}),
        positions(contacts=[contact()] * 65),
        b" " * (MAX_BYTES + 1),
        game(time_s=math.nan),
        game(time_s=-1.0),
        game(time_s="12"),
        game(boats=[]),
        game(boats={"blue_1": {**vars(STATUS), "tagged": 1}}),
        game(boats={"blue_1": {**vars(STATUS), "cooldown_s": math.inf}}),
        game(boats={"blue_1": None}),
        game(boats={"": vars(STATUS)}),
        game(flags=[]),
        game(flags=[{"x_m": 1.0, "y_m": 1e300, "taken": False}] * 2),
        game(captures=[1]),
        game(grabs=[1, -1]),
        game(tags=[1, 0.5]),
        game(over=None),
        game(note=3),
    ],
)
def test_malformed_packets_are_refused_whole(receiver, data):
    with pytest.raises(FeedError, match=r"^[^\n]{1,300}$"):
        parse_packet(data)
    receiver.take(data, LOCAL)
    assert receiver.faults() == {"malformed": 1}
    assert receiver.read() == ()
    assert receiver.game() is None


BAD_FIXES = [
    {"latitude_deg": math.nan},
    {"latitude_deg": 89.5},
    {"longitude_deg": 181.0},
    {"heading_deg": math.inf},
    {"heading_deg": "75"},
    {"heading_deg": 721.0},
    {"speed_mps": 51.0},
    {"speed_mps": True},
    {"age_s": -0.1},
    {"age_s": 1e6},
    {"error_m": -1.0},
    {"error_m": None},
    {"boat": 7},
    {"boat": ""},
    {"latitude_deg": 43.0},
    {"heading_deg": -400.0},
    {"latitude_deg": 91.0},
    {"longitude_deg": 181.0},
    {"speed_mps": 102.3},
    {"speed_mps": 655.35},
    {"error_m": 655.35},
    {"age_s": 65535},
    *({"heading_deg": value} for value in (360, 360.0, -360, 511, 511.0, 655.35, 65535, 3600, 36000)),
]


@pytest.mark.parametrize("fault", BAD_FIXES, ids=lambda fault: "-".join(map(str, *fault.items())))
def test_a_bad_fix_does_not_cost_the_others_theirs(receiver, fault):
    data = positions(contact(**fault), contact(boat="blue_1"))
    if b"NaN" in data or b"Infinity" in data:  # Python writes what JSON has no word for: the whole packet is refused
        receiver.take(data, LOCAL)
        assert receiver.faults() == {"malformed": 1}
        data = data.replace(b"NaN", b"1e999").replace(b"Infinity", b"1e999")
    receiver.take(data, LOCAL)
    assert [found.boat for found in receiver.read()] == ["blue_1"]
    assert receiver.faults()["fix"] == 1


@pytest.mark.parametrize("heading", [360.0, 720.0, -1e-17, -360.0, 0.0])
def test_a_full_turn_of_our_own_is_sent_as_north(receiver, heading):
    data = Packet("hub", 1, 1, fixes=(Fix("red_1", 42.0, -71.0, heading, 1.0, 0.0, 0.1),)).encode()
    receiver.take(data, LOCAL)
    assert receiver.faults() == {}
    assert parse_packet(data).fixes[0].heading_deg == 0.0


@pytest.mark.parametrize(
    "key", ["boat", "latitude_deg", "longitude_deg", "heading_deg", "speed_mps", "age_s", "error_m"]
)
def test_nothing_is_assumed_for_what_a_fix_lacks(receiver, key):
    entry = contact()
    del entry[key]
    receiver.take(positions(entry), LOCAL)
    assert receiver.read() == ()
    assert key in receiver.fault_texts()["fix"]


def test_strangers_are_not_boats_of_the_fleet(receiver):
    receiver.take(positions(contact(boat="red_9"), contact()), LOCAL)
    assert [found.boat for found in receiver.read()] == ["red_1"]
    receiver.take(game(boats={"blue_9": vars(STATUS)}), LOCAL)
    assert receiver.game() is None
    assert receiver.faults() == {"unknown boat": 2}


def test_packets_from_hosts_not_allowed_are_not_even_read():
    with FeedReceiver("127.0.0.1:0", FRAME, ManualClock(), allow=["10.1.0.0/16", "::1"]) as receiver:
        for host in (LOCAL, "10.2.0.1", "fe80::1%eth0", "nonsense"):
            receiver.take(positions(contact()), host)
        assert receiver.faults() == {"foreign": 4}
        assert receiver.read() == ()
        receiver.take(positions(contact()), "10.1.200.3")
        receiver.take(positions(contact(), seq=2), "::1")
        receiver.take(positions(contact(speed_mps=0.25), seq=3), "::ffff:10.1.0.9")
        assert [found.speed_mps for found in receiver.read()] == [0.25]
        assert receiver.faults() == {"foreign": 4}


def test_of_two_senders_neither_counts_for_being_fresher(receiver):
    receiver.take(positions(contact(speed_mps=1.0, age_s=0.1)), LOCAL)
    receiver.take(positions(contact(speed_mps=2.0, age_s=0.0), sender="other"), LOCAL)
    assert [(found.source, found.speed_mps) for found in receiver.read()] == [("hub", 1.0), ("other", 2.0)]
    receiver._clock.sleep_until(103.0)
    receiver.take(positions(contact(speed_mps=3.0), sender="other", seq=2), LOCAL)
    assert [found.source for found in receiver.read()] == ["other", "hub"], "who is silent comes last"


@pytest.mark.parametrize("wrong", [{"boats": {"blue_9": vars(STATUS)}, "sender": "other"}, {"sender": "telemetry"}])
def test_who_is_refused_takes_no_referees_seat(receiver, wrong):
    receiver.take(game(**wrong), LOCAL)
    receiver.take(game(), LOCAL)
    assert receiver.game() == GAME
    assert receiver.alarms() == ()
    receiver.take(game(**wrong, seq=2), LOCAL)
    assert receiver.alarms() == ()


def test_senders_and_boats_without_end_do_not_fill_the_memory():
    with FeedReceiver("127.0.0.1:0", FRAME, ManualClock()) as receiver:
        for k in range(200):
            receiver.take(positions(contact(boat=f"boat_{k}"), sender=f"hub_{k}"), LOCAL)
        for k in range(400):
            receiver.take(positions(*(contact(boat=f"b{k}_{j}") for j in range(8)), sender="hub_0", seq=k + 2), LOCAL)
        assert len(receiver.read()) == 256
        assert len(receiver._senders) == 64
        assert "hub_0" in receiver._senders, "who was there first stays"
        for k in range(400):
            receiver.take(positions(contact(boat="boat_0"), sender=f"liar_{k}"), LOCAL)
        assert len(receiver.read()) <= 256 + 8


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.binary(max_size=200))
@example(b'{"steerclear":1,"kind":"game","sender":"r","seq":1,"boats":{},"flags":[{},{}]}')
def test_no_bytes_raise_anything_else(data):
    with contextlib.suppress(FeedError):
        assert parse_packet(data).sender


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)
KEYS = st.sampled_from([*contact(), *GAME.as_dict(), *vars(STATUS), "contacts", "kind", "sender", "seq", "run", "x_m"])


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.booleans(), KEYS, JSON, st.integers(0, 400), st.integers(0, 255))
def test_mutated_packets_never_crash_nor_leave_what_is_not_finite(is_game, key, value, at, byte):
    content = json.loads(game() if is_game else positions(contact(), contact(boat="blue_1")))
    for place in (content, *content.get("contacts", ()), *content.get("boats", {}).values(), *content.get("flags", ())):
        if key in place:
            place[key] = value
    whole = json.dumps(content).encode()
    flipped = bytearray(whole)
    flipped[at % len(flipped)] ^= byte
    receiver = QUIET
    receiver._senders.clear()
    for data in (whole, bytes(flipped)):
        receiver.take(data, LOCAL)
    for found in receiver.read():
        assert all(map(math.isfinite, (*found.position_m, found.heading_rad, found.speed_mps, found.fixed_s)))
        assert found.fixed_s <= 100.0
    state = receiver.game()
    assert state is None or math.isfinite(state.time_s)


class Deaf(FeedReceiver):
    """A receiver without a socket: packets are handed to it."""

    def _hear(self):
        pass


QUIET = Deaf("127.0.0.1:0", FRAME, ManualClock(100.0))
QUIET.close()


def wait_for(condition, limit_s=10.0):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.005)


def test_a_second_hub_on_the_same_file_is_said_and_the_first_goes_on():
    with (
        FeedReceiver("127.0.0.1:0", FRAME, MonotonicClock(), boats=("red_1",)) as receiver,
        FeedSender("gps_hub", [receiver.address]) as first,
        FeedSender("gps_hub", [receiver.address]) as second,
    ):
        first.send_positions([Fix("red_1", 42.0, -71.0, 75.0, 1.0, 0.0, 0.5)])
        wait_for(receiver.read)
        assert receiver.alarms() == ()
        for _ in range(10):
            second.send_positions([Fix("red_1", 42.0001, -71.0, 75.0, 2.0, 0.0, 0.5)])
            first.send_positions([Fix("red_1", 42.0, -71.0, 75.0, 1.0, 0.0, 0.5)])
        wait_for(lambda: receiver.faults().get("second run") == 10)
        assert [found.speed_mps for found in receiver.read()] == [1.0, 2.0], "the other may be the right one"
        (alarm,) = receiver.alarms()
        assert "two programs send as gps_hub; end one of them" in alarm.text


def test_what_cannot_be_sent_is_said_at_the_sender():
    with FeedSender("hub", ["127.0.0.1:9"]) as sender:
        with pytest.raises(FeedError, match="give finite numbers"):
            sender.send_positions([Fix("red_1", math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)])
        with pytest.raises(FeedError, match="fewer boats"):
            sender.send_positions([Fix("b" * 60, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)] * 250)
    with pytest.raises(ConfigError, match="no address"):
        FeedSender("hub", ["127.0.0.1"])
    with pytest.raises(ConfigError, match="nobody knows the host"):
        FeedSender("hub", ["no such host.invalid:9"])


def test_a_taken_port_and_wrong_addresses_are_one_clear_error():
    with FeedReceiver("127.0.0.1:0", FRAME, ManualClock()) as receiver:
        with pytest.raises(BridgeError, match=r"cannot hear the feed at .* give another address"):
            FeedReceiver(receiver.address, FRAME, ManualClock())
        receiver.close()
    with pytest.raises(ConfigError, match='give "HOST:PORT"'):
        FeedReceiver("14700", FRAME, ManualClock())
    with pytest.raises(ConfigError, match="no host to allow"):
        FeedReceiver("127.0.0.1:0", FRAME, ManualClock(), allow=["somewhere"])


def test_a_flood_is_dropped_and_afterwards_packets_are_fresh_again():
    with FeedReceiver("127.0.0.1:0", FRAME, MonotonicClock(), boats=("red_1",)) as receiver:
        data = positions(contact())
        stop = threading.Event()
        host, port = receiver.address.rsplit(":", 1)

        def flood():
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
                while not stop.is_set():
                    out.sendto(data, (host, int(port)))

        thread = threading.Thread(target=flood)
        thread.start()
        try:
            wait_for(lambda: "flood" in receiver.faults(), 30.0)
        finally:
            stop.set()
            thread.join()
        with FeedSender("hub2", [receiver.address]) as sender:
            wait_for(lambda: sender.send_positions([fresh()]) or receiver.read()[0].source == "hub2", 20.0)
        assert receiver.read()[0].source == "hub2"


def fresh():
    time.sleep(0.01 + 0.001 * random.random())
    return Fix("red_1", 42.0, -71.0, 0.0, 1.0, 0.0, 0.1)
