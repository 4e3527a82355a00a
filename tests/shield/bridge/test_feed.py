"""The position and game feed: what is taken, what is refused, whose word counts, and that a key keeps others out."""

import hmac
import json
import math
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from bridge_fakes import FakeLink, game_of
from fed_world import CLOCK, Deaf
from hypothesis import example, given, settings
from hypothesis import strategies as st
from logged_runs import Encounter, header_of, numbered
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.feed import GONE_S, MAX_SENDERS, MOST_AHEAD, REFEREE_GONE_S, FeedReceiver
from steerclear.shield.bridge.feed_packets import (
    MAX_BYTES,
    PUBLISH_EVERY,
    SEAL_BYTES,
    BoatStatus,
    FeedSender,
    Fix,
    FlagStatus,
    GameState,
    Packet,
    PositionPublisher,
    Seal,
    game_state,
    is_sealed,
    parse_packet,
)
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.signing import TICKS_PER_S
from steerclear.shield.bridge.messages import TELEMETRY, BoatReading, contacts_heard
from steerclear.shield.exceptions import BridgeError, ConfigError, FeedError
from waiting import wait_for

FRAME = FieldFrame(42.0, -71.0, 30.0)
LOCAL = "127.0.0.1"
KEY, OTHER = bytes(range(32)), bytes(32)
TRUE = Fix("red_1", 42.0001, -71.0001, 90.0, 1.0, 0.0, 0.1)
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
    with Deaf("127.0.0.1:0", FRAME, ManualClock(100.0), boats=("blue_1", "red_1")) as opened:
        yield opened


@pytest.fixture
def keyed():
    with Deaf("127.0.0.1:0", FRAME, ManualClock(100.0), boats=("red_1",), key=KEY) as opened:
        yield opened


def test_a_fix_becomes_a_contact_in_the_field(receiver):
    latitude, longitude = FRAME.to_geodetic_deg(12.0, 34.0)
    receiver.take(positions(contact(latitude_deg=latitude, longitude_deg=longitude)), LOCAL)
    (found,) = receiver.read()
    assert found.position_m == pytest.approx((12.0, 34.0), abs=1e-6)
    assert found.heading_rad == pytest.approx(math.radians(45.0))
    assert (found.boat, found.source, found.speed_mps, found.error_m) == ("red_1", "hub", 1.5, 0.5)
    assert found.fixed_s == 99.75
    assert receiver.faults() == {}


def test_where_our_boats_are_is_published_now_and_then_and_heard_as_it_was_seen(receiver):
    sent = []
    publisher = PositionPublisher(SimpleNamespace(send_positions=sent.append), FRAME, 0.3)
    ticks = [numbered([*Encounter(header_of(), 1)], number) for number in range(2 * PUBLISH_EVERY)]
    for tick in ticks:
        publisher.take(tick)
    assert len(sent) == 2
    receiver.take(Packet("deploy_blue", 1, 1, fixes=tuple(sent[0])).encode(), LOCAL)
    (found,), seen = receiver.read(), ticks[0].readings["blue_1"]
    assert (*found.position_m, found.heading_rad) == pytest.approx((*seen.position_m, seen.heading_rad), abs=1e-6)
    assert (found.speed_mps, found.error_m) == (seen.speed_mps, 0.3)
    assert found.fixed_s == pytest.approx(100.0 - seen.age_s)
    assert receiver.faults() == {"unknown boat": 1}, "blue_2 is not of this receiver's fleet"
    blank = {"blue_1": BoatReading("blue_1", 0.0), "blue_2": ticks[0].readings["blue_2"]}
    publisher.take(replace(ticks[0], readings=blank))
    assert [fix.boat for fix in sent[-1]] == ["blue_2"], "what nobody knows is not told"


def test_a_boat_that_the_file_does_not_have_is_told_of_while_it_is_heard_but_not_by_refused_packets(receiver, keyed):
    def unlisted(heard):
        return [alarm.boat for alarm in heard.alarms() if alarm.unlisted]

    receiver.take(positions(contact(boat="ferry"), contact(boat="red_1")), LOCAL)
    assert unlisted(receiver) == ["ferry"]
    assert "nobody keeps clear of 'ferry', which is not in the fleet file: add it" in receiver.alarms()[0].text
    assert [found.boat for found in receiver.read()] == ["red_1"]
    receiver._clock.sleep_until(104.9)
    assert unlisted(receiver) == ["ferry"]
    receiver._clock.sleep_until(105.1)
    assert unlisted(receiver) == []
    for packet, host in (
        (positions(contact(boat="ferry"), seq=1), LOCAL),  # an old one
        (positions(contact(boat="ferry"), seq=2), "10.0.0.1"),
        (positions(contact(boat="ferry", latitude_deg=0.0), seq=3), LOCAL),  # on another water
    ):
        receiver._senders["hub"].heard_s = receiver._clock.now_s()
        receiver.take(packet, host)
        assert unlisted(receiver) == []
    keyed.take(positions(contact(boat="ferry")), LOCAL)
    assert unlisted(keyed) == []
    for k in range(100):
        receiver.take(positions(contact(boat=f"boat_{k}"), seq=4 + k), LOCAL)
    assert len(unlisted(receiver)) == 16


def test_a_boat_that_is_only_listened_to_is_a_contact_once_it_has_told_all():
    link = FakeLink("red_1", ManualClock(100.0), x=3.0, y=4.0, heading_deg=90.0, speed=1.0)
    (found,) = contacts_heard((), {"red_1": link}, 0.3)
    assert (found.boat, found.position_m, found.source, found.error_m) == ("red_1", (3.0, 4.0), TELEMETRY, 0.3)
    assert (found.heading_rad, found.speed_mps, found.fixed_s) == (pytest.approx(math.pi / 2.0), 1.0, 100.0)
    link.changed = {"speed_mps": math.nan}
    assert contacts_heard((), {"red_1": link}, 0.3) == ()


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
    assert (receiver.read(), receiver.game()) == ((), None)


BAD_FIXES = [
    {"latitude_deg": math.nan},
    {"latitude_deg": 89.5},
    {"latitude_deg": 43.0},
    {"longitude_deg": 181.0},
    {"heading_deg": math.inf},
    {"heading_deg": "75"},
    {"heading_deg": 721.0},
    {"heading_deg": -400.0},
    *({"heading_deg": value} for value in (360, 360.0, -360, 511, 655.35, 65535, 3600, 36000)),
    {"speed_mps": 51.0},
    {"speed_mps": 102.3},
    {"speed_mps": True},
    {"age_s": -0.1},
    {"age_s": 65535},
    {"error_m": -1.0},
    {"error_m": 655.35},
    {"error_m": None},
    {"boat": 7},
    {"boat": ""},
    {"boat": "blue_1"},  # given twice
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
    receiver.take(positions(5, contact(), seq=2), LOCAL)  # no object at all
    assert receiver.faults()["fix"] == 2


@pytest.mark.parametrize("heading", [360.0, 720.0, -1e-17, -360.0, 0.0])
def test_a_full_turn_of_our_own_is_sent_as_north(receiver, heading):
    data = Packet("hub", 1, 1, fixes=(Fix("red_1", 42.0, -71.0, heading, 1.0, 0.0, 0.1),)).encode()
    receiver.take(data, LOCAL)
    assert receiver.faults() == {}
    assert parse_packet(data).fixes[0].heading_deg == 0.0


@pytest.mark.parametrize("key", list(contact()))
def test_nothing_is_assumed_for_what_a_fix_lacks(receiver, key):
    receiver.take(positions({name: value for name, value in contact().items() if name != key}), LOCAL)
    assert receiver.read() == ()
    assert key in receiver.fault_texts()["fix"]


def test_strangers_are_not_boats_of_the_fleet(receiver):
    receiver.take(positions(contact(boat="red_9"), contact()), LOCAL)
    assert [found.boat for found in receiver.read()] == ["red_1"]
    receiver.take(game(boats={"blue_9": vars(STATUS)}), LOCAL)
    assert receiver.game() is None
    assert receiver.faults() == {"unknown boat": 2}


def test_packets_from_hosts_not_allowed_are_not_even_read():
    with Deaf("127.0.0.1:0", FRAME, ManualClock(), allow=["10.1.0.0/16", "::1"]) as receiver:
        for host in (LOCAL, "10.2.0.1", "fe80::1%eth0", "nonsense"):
            receiver.take(positions(contact()), host)
        assert receiver.faults() == {"foreign": 4}
        assert receiver.read() == ()
        for seq, host in enumerate(("10.1.200.3", "::1", "::ffff:10.1.0.9")):
            receiver.take(positions(contact(speed_mps=0.25 * seq), seq=seq), host)
        assert [found.speed_mps for found in receiver.read()] == [0.5]
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
    receiver.take(game(**wrong, seq=2), LOCAL)
    assert receiver.game() == GAME
    assert receiver.alarms() == ()


def test_senders_and_boats_without_end_do_not_fill_the_memory():
    with Deaf("127.0.0.1:0", FRAME, ManualClock()) as receiver:
        for k in range(200):
            receiver.take(positions(contact(boat=f"boat_{k}"), sender=f"hub_{k}"), LOCAL)
        for k in range(400):
            receiver.take(positions(*(contact(boat=f"b{k}_{j}") for j in range(8)), sender="hub_0", seq=k + 2), LOCAL)
        assert len(receiver.read()) == 256
        assert len(receiver._senders) == MAX_SENDERS
        assert "hub_0" in receiver._senders, "who was there first stays"
        for k in range(400):
            receiver.take(positions(contact(boat="boat_0"), sender=f"liar_{k}"), LOCAL)
        assert len(receiver.read()) <= 256 + 8


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)
KEYS = st.sampled_from([*contact(), *GAME.as_dict(), *vars(STATUS), "contacts", "kind", "sender", "seq", "run", "x_m"])
QUIET = Deaf("127.0.0.1:0", FRAME, ManualClock(100.0))
QUIET.close()
HALF_A_GAME = b'{"steerclear":1,"kind":"game","sender":"r","seq":1,"boats":{},"flags":[{},{}]}'


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.booleans(), KEYS, JSON, st.integers(0, 400), st.integers(0, 255), st.binary(max_size=200))
@example(True, "time_s", 1.0, 0, 0, HALF_A_GAME)
def test_mutated_packets_never_crash_nor_leave_what_is_not_finite(is_game, key, value, at, byte, junk):
    content = json.loads(game() if is_game else positions(contact(), contact(boat="blue_1")))
    for place in (content, *content.get("contacts", ()), *content.get("boats", {}).values(), *content.get("flags", ())):
        if key in place:
            place[key] = value
    whole = json.dumps(content).encode()
    flipped = bytearray(whole)
    flipped[at % len(flipped)] ^= byte
    QUIET._senders.clear()
    for data in (whole, bytes(flipped), junk):
        QUIET.take(data, LOCAL)
    for found in QUIET.read():
        assert all(map(math.isfinite, (*found.position_m, found.heading_rad, found.speed_mps, found.fixed_s)))
        assert found.fixed_s <= 100.0
    state = QUIET.game()
    assert state is None or math.isfinite(state.time_s)


def problem(receiver, now_s, seq, run=7, sender="hub", game=None, stamp=None):
    """Kind and text of what is refused of a packet; None: it is taken."""
    receiver._clock.sleep_until(now_s)
    before = receiver.faults()
    data = Packet(sender, run, seq, game=game, stamp=stamp).encode()
    receiver.take(data if receiver._seal is None else receiver._seal.close(data), LOCAL)
    new = (kind for kind, count in receiver.faults().items() if kind != "late" and count > before.get(kind, 0))
    return next(((kind, receiver.fault_texts()[kind]) for kind in new), None)


@pytest.fixture
def order():
    with Deaf("127.0.0.1:0", FRAME, ManualClock()) as opened:
        yield opened


def told(order, seconds, now_s=0.0, first=1):
    """Lets a sender speak for so long at 20 Hz; how many of its packets were refused, of how many."""
    count = round(seconds * 20.0)
    return sum(problem(order, now_s + k / 20.0, first + k) is not None for k in range(count)), count


@pytest.mark.parametrize(
    "intruder", [{"run": 8, "seq": 0}, {"run": 8, "seq": 2**62}, {"seq": 2**62}, {"seq": 5_000}, {"seq": 0}]
)
def test_one_packet_in_a_senders_name_costs_it_none_of_its_own(order, intruder):
    assert told(order, 1.0) == (0, 20)
    kind, text = problem(order, 1.0, **intruder)
    assert kind in ("second run", "old")
    assert "hub" in text
    assert told(order, 12.0, 1.05, first=21) == (0, 240), "234 of 240 were refused before"


def test_a_count_moved_within_bounds_costs_a_sender_seconds_and_not_the_rest_of_the_day(order):
    told(order, 1.0)
    assert problem(order, 1.0, 20 + MOST_AHEAD) is None
    assert told(order, 12.0, 1.05, first=21)[0] <= GONE_S * 20.0
    assert told(order, 1.0, 14.0, first=261) == (0, 20)


def test_an_intruder_that_speaks_on_never_gets_in_beside_the_one_that_was_there(order):
    counts = {7: 0, 8: 0}
    for k in range(2400):  # 12 s: the true one at 20 Hz, the other at 200 Hz
        counts[8] += k > 0 and problem(order, k / 200.0, k, run=8) is None
        if k % 10 == 0:
            counts[7] += problem(order, k / 200.0, k // 10, run=7) is None
    assert counts == {7: 240, 8: 0}


def test_a_new_start_counts_after_the_old_ones_silence_and_so_does_the_old_one_again(order):
    told(order, 1.0)
    assert problem(order, 1.0 + 0.5 * GONE_S, 0, run=8)[0] == "second run"
    assert problem(order, 1.0 + GONE_S, 1, run=8) is None
    assert problem(order, 1.5 + GONE_S, 21, run=7)[0] == "second run", "a late one of the old start"
    assert problem(order, 1.0 + 2.0 * GONE_S, 22, run=7) is None, "it held its place while it spoke, no longer"


def test_a_second_hub_on_the_same_file_is_said_and_the_first_goes_on(receiver):
    for seq, run, speed in ((0, 1, 1.0), (0, 2, 2.0), (1, 1, 1.5)):
        assert receiver.alarms() == () or seq
        receiver.take(positions(contact(speed_mps=speed), seq=seq, run=run), LOCAL)
    assert receiver.faults() == {"second run": 1}
    assert [found.speed_mps for found in receiver.read()] == [1.5, 2.0], "the other may be the right one"
    (alarm,) = receiver.alarms()
    assert "two programs send as hub; end one of them" in alarm.text


def test_small_disorder_is_old_and_no_sign_of_a_second_program(order):
    told(order, 1.0)
    assert problem(order, 1.0, 20)[0] == "repeated"
    assert problem(order, 1.0, 18)[0] == "old"
    problem(order, 1.0, 900)
    assert problem(order, 1.1, 20)[0] == "second run", "somebody counts far behind"


@pytest.mark.parametrize("junk", [64, 1000])
def test_junk_names_keep_nobody_out_and_push_out_nobody_who_was_there(order, junk):
    counts = {"hub": 0, "late": 0}
    for k in range(4000):  # 20 s of junk at 200 Hz, each name speaking again before it is silent for long
        problem(order, k / 200.0, k, sender=f"junk_{k % junk}")
        if k % 10 == 5:
            counts["hub"] += problem(order, k / 200.0, k, sender="hub") is None
            counts["late"] += k > 2000 and problem(order, k / 200.0, k, sender="late") is None
    assert counts == {"hub": 400, "late": 200}
    assert len(order._senders) <= MAX_SENDERS


def test_a_game_is_kept_by_one_referee_and_taken_over_only_after_its_silence(order):
    def said(now_s, seq, sender, run=7):
        return (problem(order, now_s, seq, run, sender, game_of()) or ("",))[0]

    assert said(0.0, 1, "referee") == ""
    assert said(0.1, 0, "referee", run=99) == "second run"
    assert said(0.1, 1, "other") == "second referee"
    assert said(0.2, 2, "referee") == ""
    assert said(0.2 + REFEREE_GONE_S, 2, "other") == ""


def test_sealed_packets_must_be_of_our_time_and_rise(keyed):
    now = CLOCK.now()
    assert problem(keyed, 0.0, 1)[0] == "malformed"
    for off_s in (-61.0, 61.0, 1e9, -1e8):
        assert problem(keyed, 0.0, 1, stamp=int(now + off_s * TICKS_PER_S))[0] == "old_signature"
    assert problem(keyed, 100.0, 1, stamp=now) is None
    assert problem(keyed, 100.1, 2, stamp=now)[0] == "replayed"
    assert problem(keyed, 100.1, 2, stamp=now + 1) is None


def test_sealed_packets_are_not_believed_again_however_long_their_sender_is_silent(keyed):
    now, entries = CLOCK.now(), []
    for run, begun_s, ticks in ((7, 100.0, now - 1000), (8, 150.0, now)):
        for k in range(10):
            entries.append({"seq": k, "run": run, "stamp": ticks + k})
            assert problem(keyed, begun_s + 0.1 * k, **entries[-1]) is None
    for entry in entries:
        assert problem(keyed, 600.0, **entry)[0] == "replayed"


def sealed(key, seq, fixes=(), game=None):
    """A true packet."""
    return Seal(key).close(Packet("hub", 1, seq, fixes=fixes, game=game, stamp=CLOCK.take()).encode())


def test_a_sealed_packet_is_taken_once(keyed):
    data = sealed(KEY, 1, fixes=(TRUE,))
    for _ in range(3):
        keyed.take(data, LOCAL)
    assert [found.boat for found in keyed.read()] == ["red_1"]
    assert keyed.faults() == {"replayed": 2}


@pytest.mark.parametrize("content", [{"fixes": (TRUE,)}, {"game": game_of()}], ids=["positions", "game"])
def test_what_is_not_sealed_with_the_key_is_dropped_and_counted_by_kind(keyed, content):
    good = sealed(KEY, 1, **content)
    bare = good[:-SEAL_BYTES]
    assert json.loads(bare)["stamp"] > 0
    changed = bare.replace(b'"seq":1', b'"seq":9') + good[-SEAL_BYTES:]
    for data in (bare, bare + b"\n", bare + b"\nhmac-sha256:" + b"0" * 63, b"", b"\nhmac-sha256:"):
        keyed.take(data, LOCAL)
    for data in (sealed(OTHER, 1, **content), changed, bare + b"\nhmac-sha256:" + b"0" * 64, good[1:]):
        keyed.take(data, LOCAL)
    assert keyed.faults() == {"unsigned": 5, "bad_signature": 4}
    assert (keyed.read(), keyed.game()) == ((), None)
    assert keyed.alarms() == (), "nobody without the key can make an alarm"


def test_a_sender_of_your_own_as_documented_is_heard(keyed):
    text = (Path(__file__).parents[3] / "docs" / "boat_reference.md").read_text()
    (block,) = (part.split("```")[0] for part in text.split("```python\n")[1:] if "feed_key" in part)
    packet = json.loads(Packet("mine", 1, 1, fixes=(TRUE,)).encode())
    names = {"json": json, "hmac": hmac, "time": time, "packet": packet, "key": KEY}
    exec(block, names)
    keyed.take(names["datagram"], LOCAL)
    assert [found.source for found in keyed.read()] == ["mine"]


def test_every_changed_bit_is_found():
    seal, data = Seal(KEY), sealed(KEY, 1, fixes=(TRUE,))
    assert seal.fault(data) == ""
    for at in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[at] ^= 1 << bit
            assert seal.fault(bytes(changed)), (at, bit)


def test_keys_of_another_length_and_packets_that_leave_no_room_for_the_seal_are_refused():
    with pytest.raises(ConfigError, match="32"):
        FeedSender("hub", ["127.0.0.1:9"], b"short")
    with pytest.raises(ConfigError, match="32"):
        FeedReceiver("127.0.0.1:0", FRAME, ManualClock(), key=b"short")
    assert not is_sealed(Packet("hub", 1, 1, fixes=(TRUE,)).encode())
    with pytest.raises(FeedError, match="fewer boats"):
        Packet("hub", 1, 1, fixes=(Fix("b" * 60, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),) * 200).encode()
    assert len(Seal(KEY).close(b"x" * (MAX_BYTES - SEAL_BYTES))) == MAX_BYTES


def test_fixes_of_packets_that_were_held_back_are_not_fresh(keyed, monkeypatch):
    now = keyed._stamps.now
    held = [sealed(KEY, seq, fixes=(TRUE,)) for seq in (1, 2)]
    keyed.take(held[0], LOCAL)
    monkeypatch.setattr(keyed._stamps, "now", lambda: now() + 30 * TICKS_PER_S)
    keyed.take(held[1], LOCAL)
    (contact,) = keyed.read()
    assert 100.0 - contact.fixed_s == pytest.approx(30.0, abs=0.5)
    assert keyed.faults() == {"late": 1}
    assert "packets of hub come 30.0 s late" in keyed.fault_texts()["late"]


def hearing(key=None):
    return FeedReceiver("127.0.0.1:0", FRAME, MonotonicClock(), boats=("red_1",), key=key)


def flood(receiver, data, goes_on):
    """Send a datagram again and again as long as told."""
    host, port = receiver.address.rsplit(":", 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        while goes_on():
            out.sendto(data, (host, int(port)))


def test_what_cannot_be_sent_and_addresses_that_are_none_are_one_clear_error(receiver):
    with FeedSender("hub", ["127.0.0.1:9"]) as sender:
        with pytest.raises(FeedError, match="give finite numbers"):
            sender.send_positions([Fix("red_1", math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)])
        with pytest.raises(FeedError, match="fewer boats"):
            sender.send_positions([Fix("b" * 60, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)] * 250)
    for address, words in (("127.0.0.1", "no address"), ("no-such-host.invalid:9", "nobody knows the host")):
        with pytest.raises(ConfigError, match=words):
            FeedSender("hub", [address])
    with pytest.raises(BridgeError, match=r"cannot hear the feed at .*another runner\? end .* or give another address"):
        FeedReceiver(receiver.address, FRAME, ManualClock())
    with pytest.raises(ConfigError, match='give "HOST:PORT"'):
        FeedReceiver("14700", FRAME, ManualClock())
    with pytest.raises(ConfigError, match="no host to allow"):
        FeedReceiver("127.0.0.1:0", FRAME, ManualClock(), allow=["somewhere"])


def test_the_feed_is_heard_over_ipv6_at_the_address_it_names():
    try:
        receiver = FeedReceiver("[::1]:0", FRAME, MonotonicClock(), allow=["::1"], boats=("red_1",))
    except BridgeError:
        pytest.skip("this machine has no IPv6")
    with receiver, FeedSender("hub", [receiver.address]) as sender:
        wait_for(lambda: sender.send_positions([TRUE]) or time.sleep(0.01) or receiver.read())


def test_a_flood_is_dropped_and_afterwards_packets_are_fresh_again():
    with hearing() as receiver, FeedSender("hub2", [receiver.address]) as sender:
        stop = threading.Event()
        thread = threading.Thread(target=flood, args=(receiver, positions(contact()), lambda: not stop.is_set()))
        thread.start()
        try:
            wait_for(lambda: "flood" in receiver.faults(), 30.0)
        finally:
            stop.set()
            thread.join()
        wait_for(lambda: sender.send_positions([TRUE]) or time.sleep(0.01) or receiver.read()[0].source == "hub2", 20.0)


def test_forged_packets_cost_a_tenth_so_that_more_of_them_leave_the_true_ones_room():
    with hearing(KEY) as receiver, FeedSender("gps_hub", [receiver.address], KEY) as hub:
        left = iter(range(3000))
        data = Packet("gps_hub", 4711, 1, fixes=(TRUE,), stamp=CLOCK.now()).encode()
        flood(receiver, data, lambda: time.sleep(0.0001) or next(left, None) is not None)
        wait_for(lambda: hub.send_positions([TRUE]) or time.sleep(0.02) or receiver.read())
        assert "flood" not in receiver.faults()
