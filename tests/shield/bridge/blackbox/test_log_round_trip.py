"""Ticks and headers through JSON and back: nothing is lost that the shield was given or answered."""

import contextlib
import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logged_runs import Encounter, header_of
from steerclear.shield import Commands, Fleet, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox.format import tick_from_json, tick_to_json
from steerclear.shield.bridge.blackbox.header import LogHeader, platforms_of
from steerclear.shield.bridge.messages import Action, BoatReading, Contact, Sent, Tick
from steerclear.shield.decision import Decisions
from steerclear.shield.exceptions import LogError
from steerclear.shield.platforms import PLATFORMS, get_platform
from steerclear.shield.platforms import layout as L

quick = settings(max_examples=60, deadline=None, derandomize=True)
HERON = platforms_of(["heron"])


def through_json(tick, platforms=HERON):
    text = json.dumps(tick_to_json(tick, platforms), allow_nan=False)
    return tick_from_json(json.loads(text), platforms)


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
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | floats | words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=6,
)


def arrays(*shape):
    size = math.prod(shape)
    return st.lists(floats, min_size=size, max_size=size).map(lambda v: np.array(v, dtype=np.float64).reshape(shape))


@st.composite
def fleets(draw, n):
    flags = st.lists(st.booleans(), min_size=n, max_size=n)
    return Fleet(
        state=draw(arrays(n, L.N_STATE)),
        team=np.array(draw(st.lists(st.integers(0, 2), min_size=n, max_size=n)), dtype=np.int64),
        platforms=tuple(draw(st.lists(st.sampled_from(sorted(PLATFORMS)), min_size=n, max_size=n))),
        controlled=np.array(draw(flags), dtype=np.bool_),
        names=tuple(f"boat_{i}" for i in range(n)),
        age_s=draw(st.none() | arrays(n)),
        position_error_m=draw(st.none() | arrays(n)),
    )


@st.composite
def decided(draw, fleet, wanted):
    n = len(fleet)
    sent = wanted if draw(st.booleans()) else Commands(draw(arrays(n, 2)), draw(st.booleans()))
    return Decisions(
        fleet=fleet,
        nominal=wanted,
        filtered=sent,
        intervened=np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)), dtype=np.bool_),
        reason=np.array(draw(st.lists(st.integers(0, 6), min_size=n, max_size=n)), dtype=np.int64),
        safety_margin_m=draw(arrays(n)),
        slack_m=draw(arrays(n)),
        bound=np.array(draw(st.lists(st.integers(-2, n - 1), min_size=n, max_size=n)), dtype=np.int64),
        solve_time_s=draw(floats),
    )


@st.composite
def ticks(draw):
    fleet = draw(st.none() | st.integers(1, 4).flatmap(fleets))
    wanted = None if fleet is None else draw(st.none() | arrays(len(fleet), 2).map(lambda v: Commands(v, True)))
    metres = st.floats(-1e6, 1e6)
    fixed = Surroundings(
        field=(-5.0, -5.0, 85.0, 45.0),
        circles=draw(st.lists(st.tuples(metres, metres, st.floats(0.0, 9.0)), max_size=2)),
        polygons=draw(st.lists(st.lists(st.tuples(metres, metres), min_size=3, max_size=4), max_size=2)),
        keep_out=[(1.0, 2.0, 3.0)],
        stops=draw(st.lists(st.tuples(metres, metres, st.floats(0.0, 9.0)), max_size=1)),
    )
    reading = BoatReading(
        "blue_1", draw(floats), (draw(floats), draw(floats)), heading_rad=draw(floats), texts=(draw(words),),
        faults={"signature": draw(st.integers(0, 9))}, mode=draw(words),
    )  # fmt: skip
    around = draw(st.sampled_from([None, fixed, Surroundings()]))
    decisions = None if wanted is None else draw(st.none() | decided(fleet, wanted))
    return Tick(
        number=draw(st.integers(0, 10**9)),
        due_s=draw(floats),
        began_s=draw(floats),
        sent_s=draw(floats),
        readings={"blue_1": reading},
        contacts=(Contact("red_1", (draw(floats), 0.0), draw(floats), 1.0, 2.0, 0.3, draw(words)),),
        fleet=fleet,
        wanted=wanted,
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
def test_any_tick_comes_back_bit_for_bit(tick):
    assert same(tick, through_json(tick))


def test_a_platform_the_header_does_not_hold_is_written_out():
    own = dataclasses.replace(get_platform("heron"), name="tub", max_speed_mps=1.25)
    tick = next(iter(Encounter(header_of(), 1)))
    fleet = dataclasses.replace(tick.fleet, platforms=(own, "surveyor", "heron", "heron"))
    back = through_json(dataclasses.replace(tick, fleet=fleet)).fleet
    assert tuple(map(get_platform, back.platforms)) == tuple(map(get_platform, fleet.platforms))


def test_a_platform_whose_parameters_have_changed_since_is_the_logs():
    other = dataclasses.replace(get_platform("heron"), max_speed_mps=1.5)
    tick = next(iter(Encounter(header_of(), 1)))
    fleet = dataclasses.replace(tick.fleet, platforms=(other,) * 4)
    back = through_json(dataclasses.replace(tick, fleet=fleet), {"heron": other}).fleet
    assert set(map(get_platform, back.platforms)) == {other}


@pytest.mark.parametrize("key", ["boats", "number", "readings", "began_s", "has_fleet"])
def test_a_tick_without_a_part_is_refused(key):
    message = tick_to_json(next(iter(Encounter(header_of(), 1))), HERON)
    del message[key]
    with pytest.raises(LogError, match="damaged or of another version"):
        tick_from_json(message, HERON)


@pytest.mark.parametrize(
    ("key", "is_refused"),
    [("field", True), ("circles", True), ("polygons", True), ("keep_out", True), ("stops", False)],
)
def test_surroundings_without_a_part_are_refused_except_stops_which_older_logs_lack(key, is_refused):
    fixed = Surroundings(field=(-5.0, -5.0, 85.0, 45.0), keep_out=[(1.0, 2.0, 3.0)])
    tick = dataclasses.replace(next(iter(Encounter(header_of(), 1))), surroundings=fixed)
    message = tick_to_json(tick, HERON)
    del message["surroundings"][0][key]
    with pytest.raises(LogError, match="damaged") if is_refused else contextlib.nullcontext():
        tick_from_json(message, HERON)


@quick
@given(st.data())
def test_a_tick_with_anything_in_it_reads_or_is_refused(data):
    message = tick_to_json(next(iter(Encounter(header_of(), 1))), HERON)
    key = data.draw(st.sampled_from(sorted(message)))
    message[key] = data.draw(anything)
    with contextlib.suppress(LogError):  # and nothing else
        assert isinstance(tick_from_json(message, HERON), Tick)


def test_a_header_comes_back():
    config = ShieldConfig(cbf_rate_per_s=math.inf, edge_m=None, max_track_age_s=math.inf, delay_s=0.1 + 0.2)
    header = header_of(config, notes={"accepted": "rates:blue_1"})
    back = LogHeader.from_message(json.loads(json.dumps(header.to_message(), allow_nan=False)))
    assert back == header


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
