"""Ticks and headers through JSON and back: nothing is lost, and every message is valid by the log's own schema."""

import contextlib
import dataclasses
import json
import math

import jsonschema
import numpy as np
import pytest
from forged_logs import read_records
from hypothesis import given, settings
from hypothesis import strategies as st
from logged_runs import Encounter, header_of
from steerclear.shield import Commands, Fleet, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox import McapWriter
from steerclear.shield.bridge.blackbox.format import TICK, tick_from_json, tick_to_json
from steerclear.shield.bridge.blackbox.header import LogHeader, platforms_of
from steerclear.shield.bridge.messages import Action, BoatReading, Contact, Sent, Tick
from steerclear.shield.decision import Decisions
from steerclear.shield.exceptions import LogError
from steerclear.shield.platforms import PLATFORMS, get_platform
from steerclear.shield.platforms import layout as L

quick = settings(max_examples=60, deadline=None, derandomize=True)
HERON = platforms_of(["heron"])
CHECKERS = (jsonschema.Draft7Validator, jsonschema.Draft202012Validator)


def first_tick():
    return next(iter(Encounter(header_of(), 1)))


def through_json(tick, platforms=HERON):
    return tick_from_json(json.loads(json.dumps(tick_to_json(tick, platforms), allow_nan=False)), platforms)


def same(a, b):
    """Equal in every bit, whatever the parts are."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(v, getattr(b, name)) for name, v in vars(a).items())
    if isinstance(a, float):
        return isinstance(b, float) and (a == b or (math.isnan(a) and math.isnan(b)))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


floats = st.floats()
words = st.text(max_size=8)


def arrays(*shape, of=floats, dtype=np.float64):
    size = math.prod(shape)
    return st.lists(of, min_size=size, max_size=size).map(lambda v: np.array(v, dtype=dtype).reshape(shape))


@st.composite
def fleets(draw, n):
    return Fleet(
        state=draw(arrays(n, L.N_STATE)),
        team=draw(arrays(n, of=st.integers(0, 2), dtype=np.int64)),
        platforms=tuple(draw(st.lists(st.sampled_from(sorted(PLATFORMS)), min_size=n, max_size=n))),
        controlled=draw(arrays(n, of=st.booleans(), dtype=np.bool_)),
        names=tuple(f"boat_{i}" for i in range(n)),
        age_s=draw(st.none() | arrays(n)),
        position_error_m=draw(st.none() | arrays(n)),
    )


@st.composite
def decided(draw, fleet, wanted):
    n = len(fleet)
    return Decisions(
        fleet=fleet,
        nominal=wanted,
        filtered=wanted if draw(st.booleans()) else Commands(draw(arrays(n, 2)), draw(st.booleans())),
        intervened=draw(arrays(n, of=st.booleans(), dtype=np.bool_)),
        reason=draw(arrays(n, of=st.integers(0, 6), dtype=np.int64)),
        safety_margin_m=draw(arrays(n, of=floats.filter(lambda margin_m: margin_m != 1e6))),
        slack_m=draw(arrays(n)),
        active_constraint=draw(arrays(n, of=st.integers(-2, n - 1), dtype=np.int64)),
        solve_time_s=draw(floats),
    )


@st.composite
def ticks(draw):
    fleet = draw(st.none() | st.integers(1, 4).flatmap(fleets))
    wanted = None if fleet is None else draw(st.none() | arrays(len(fleet), 2).map(lambda v: Commands(v, True)))
    metres = st.floats(-1e6, 1e6)
    circle = st.tuples(metres, metres, st.floats(0.0, 9.0))
    fixed = Surroundings(
        field=(-5.0, -5.0, 85.0, 45.0),
        circles=draw(st.lists(circle, max_size=2)),
        polygons=draw(st.lists(st.lists(st.tuples(metres, metres), min_size=3, max_size=4), max_size=2)),
        keep_out=[(1.0, 2.0, 3.0)],
        stops=draw(st.lists(circle, max_size=1)),
    )
    faults, place = {"signature": draw(st.integers(0, 9))}, (draw(floats), draw(floats))
    said = {"heading_rad": draw(floats), "texts": (draw(words),), "faults": faults, "mode": draw(words)}
    around = draw(st.sampled_from([None, fixed, Surroundings()]))
    decisions = None if wanted is None else draw(st.none() | decided(fleet, wanted))
    return Tick(
        number=draw(st.integers(0, 10**9)),
        due_s=draw(floats),
        began_s=draw(floats),
        sent_s=draw(floats),
        readings={"blue_1": BoatReading("blue_1", draw(floats), place, **said)},
        contacts=(Contact("red_1", (draw(floats), 0.0), draw(floats), 1.0, 2.0, 0.3, draw(words)),),
        fleet=fleet,
        nominal=wanted,
        surroundings=around,
        decisions=None if decisions is None else dataclasses.replace(decisions, area=around and around.field),
        shield_reset=draw(st.booleans()),
        sent={"blue_1": Sent("blue_1", 1.0, draw(floats), draw(floats), "attitude", draw(st.booleans()))},
        policy_age_s=draw(floats),
        actions=(Action("blue_1", "link", "stop", draw(words)),),
        game=draw(st.sampled_from([{}, {"boats": {"blue_1": {"tagged": True}}, "captures": [1, 0], "over": False}])),
    )


@quick
@given(ticks())
def test_any_tick_is_valid_and_comes_back_bit_for_bit(tick):
    message = json.loads(json.dumps(tick_to_json(tick, HERON), allow_nan=False))
    jsonschema.Draft7Validator(TICK).validate(message)
    assert same(tick, tick_from_json(message, HERON))


@quick
@given(ticks().filter(lambda tick: tick.decisions is not None))
def test_a_margin_of_an_old_log_where_nobody_is_near_is_infinite(tick):
    message = tick_to_json(tick, HERON)
    message["boats"][0]["certificate_m"] = 1e6
    message["odd"] = [entry for entry in message["odd"] if entry["at"] != "boats.0.certificate_m"]
    assert tick_from_json(message, HERON).decisions[0].safety_margin_m == math.inf


def odd_tick(number, tick):
    """Ticks in which something is not finite, or not there."""
    state = tick.fleet.state.copy()
    state[2:, 4:] = math.nan
    fleet = dataclasses.replace(tick.fleet, state=state, age_s=np.array([0.0, math.inf, math.nan, 0.1]))
    wanted = dataclasses.replace(tick.nominal, values=np.full((4, 2), math.nan))
    margins = np.array([math.inf, -math.inf, math.nan, 1.0])
    odd = {"fleet": fleet, "nominal": wanted, "safety_margin_m": margins, "solve_time_s": math.nan}
    decisions = dataclasses.replace(tick.decisions, **odd)
    odd = {"course_rad": math.nan, "turn_rate_age_s": math.inf, "position_m": (math.nan, 1.0)}
    readings = {"blue_1": dataclasses.replace(tick.readings["blue_1"], **odd)}
    odd = {"heading_rad": math.nan, "speed_mps": math.nan, "delivered": False}
    sent = {"blue_1": dataclasses.replace(tick.sent["blue_1"], **odd)}
    parts = {"fleet": fleet, "nominal": wanted, "decisions": decisions, "readings": readings, "sent": sent}
    odd = dataclasses.replace(tick, **parts, policy_age_s=math.inf)
    bare = dataclasses.replace(tick, fleet=None, nominal=None, decisions=None, readings={}, contacts=(), sent={})
    return (odd, bare, tick)[number % 3]


def test_every_message_of_a_log_is_valid_and_what_is_not_finite_was_in_it(tmp_path):
    writer = McapWriter(tmp_path / "run.mcap", header_of(), flush_s=0.0, key=bytes(32))
    for number, tick in enumerate(Encounter(header_of(), 12)):
        writer.take(dataclasses.replace(odd_tick(number, tick), number=number))
    writer.note("a line")
    writer.close()
    assert writer.fault == ""
    topics, odd = set(), []
    for record in read_records(tmp_path / "run.mcap"):
        schema = json.loads(record.schema[2])
        for checker in CHECKERS:
            checker.check_schema(schema)
            errors = [error.message for error in checker(schema).iter_errors(record.content)]
            assert errors == [], record.topic
        topics.add(record.topic)
        odd += record.content["odd"] if record.topic == "/tick" else []
    assert {"/header", "/tick", "/log", "/scene", "/field", "/fix/red_1", "/link"} <= topics
    places = {entry["at"].split(".", 1)[0] for entry in odd}
    assert {"boats", "readings", "sent", "policy_age_s", "solve_time_s"} <= places
    assert {"nan", "inf", "-inf"} <= {entry["value"] for entry in odd}


def test_a_gap_is_left_for_viewers_and_a_zero_in_a_list():
    message = tick_to_json(odd_tick(0, first_tick()), HERON)
    first, second, third, _ = message["boats"]
    assert "safety_margin_m" not in first
    assert "safety_margin_m" not in second
    assert third["state"][4:] == [0.0] * 7
    assert first["wanted"] == []
    assert message["readings"][0]["position_m"] == [0.0, 1.0]
    assert "policy_age_s" not in message


@pytest.mark.parametrize(
    "entries",
    [
        [{"at": "boats.9.state.0", "value": "nan"}],
        [{"at": "boats", "value": "nan"}, {"at": "boats.0", "value": "nan"}],
        [{"at": "number", "value": "seven"}],
        [{"at": "boats.0.state.50", "value": "nan"}],
        [{"at": "boats.x", "value": "nan"}],
        [{}],
        5,
        "nan",
    ],
)
def test_a_list_of_odd_numbers_that_does_not_fit_is_damage(entries):
    message = tick_to_json(first_tick(), HERON)
    with pytest.raises(LogError, match="damaged"):
        tick_from_json({**message, "odd": entries}, HERON)


def test_a_platform_that_the_header_does_not_hold_or_that_has_changed_since_is_the_logs():
    tub = dataclasses.replace(get_platform("heron"), name="tub", max_speed_mps=1.25)
    changed = dataclasses.replace(get_platform("heron"), max_speed_mps=1.5)
    tick = first_tick()
    for kinds, known in (((tub, "surveyor", "heron", "heron"), HERON), ((changed,) * 4, {"heron": changed})):
        fleet = dataclasses.replace(tick.fleet, platforms=kinds)
        back = through_json(dataclasses.replace(tick, fleet=fleet), known).fleet
        assert tuple(map(get_platform, back.platforms)) == tuple(map(get_platform, kinds))


@pytest.mark.parametrize(
    ("part", "is_refused"),
    [
        *((key, True) for key in ("boats", "number", "readings", "began_s", "has_fleet")),
        *((f"surroundings.{key}", True) for key in ("field", "circles", "polygons", "keep_out")),
        ("surroundings.stops", False),  # which older logs lack
        *((f"readings.{key}", key != "released") for key in ("mode", "speed_mps", "released")),
    ],
)
def test_a_tick_without_a_part_is_refused(part, is_refused):
    fixed = Surroundings(field=(-5.0, -5.0, 85.0, 45.0), keep_out=[(1.0, 2.0, 3.0)])
    message = tick_to_json(dataclasses.replace(first_tick(), surroundings=fixed), HERON)
    owner, _, key = part.rpartition(".")
    del (message[owner][0] if owner else message)[key]
    with pytest.raises(LogError, match="damaged or of another") if is_refused else contextlib.nullcontext():
        tick_from_json(message, HERON)


def test_a_header_comes_back():
    config = ShieldConfig(cbf_rate_per_s=math.inf, edge_m=None, max_track_age_s=math.inf, delay_s=0.1 + 0.2)
    header = header_of(config, notes={"accepted": "rates:blue_1"})
    assert LogHeader.from_message(json.loads(json.dumps(header.to_message(), allow_nan=False))) == header


def test_a_header_with_a_setting_nobody_knows_says_who_wrote_it():
    message = header_of(versions={"steerclear": "9.9"}).to_message()
    message["shield"] = json.dumps(json.loads(message["shield"]) | {"zeal": 1.0})
    with pytest.raises(LogError, match=r"unknown shield setting 'zeal'.*written by 9\.9"):
        LogHeader.from_message(message)


@pytest.mark.parametrize("moment", ["-1", str(2**63), "1e9"])
def test_a_header_of_no_time_is_damaged(moment):
    message = {**LogHeader(ShieldConfig()).to_message(), "unix_ns": moment}
    with pytest.raises(LogError, match="the log's header is damaged"):
        LogHeader.from_message(message)
