"""Every message of a log is valid by the very schema the log carries for it, whatever happened."""

import dataclasses
import json
import math

import jsonschema
import numpy as np
import pytest
from forged_logs import read_records
from hypothesis import given
from logged_runs import Encounter, header_of
from steerclear.shield.bridge.blackbox import McapWriter
from steerclear.shield.bridge.blackbox.format import TICK, tick_from_json, tick_to_json
from steerclear.shield.exceptions import LogError
from test_log_round_trip import HERON, quick, same, ticks

CHECKERS = (jsonschema.Draft7Validator, jsonschema.Draft202012Validator)


def odd_tick(number, tick):
    """Ticks in which something is not finite, or not there."""
    state = tick.fleet.state.copy()
    state[2:, 4:] = math.nan
    age_s = np.array([0.0, math.inf, math.nan, 0.1])
    fleet = dataclasses.replace(tick.fleet, state=state, age_s=age_s)
    decisions = dataclasses.replace(
        tick.decisions,
        fleet=fleet,
        safety_margin_m=np.array([math.inf, -math.inf, math.nan, 1.0]),
        solve_time_s=math.nan,
    )
    wanted = dataclasses.replace(tick.wanted, values=np.full((4, 2), math.nan))
    reading = dataclasses.replace(tick.readings["blue_1"], course_rad=math.nan, turn_rate_age_s=math.inf,
                                  position_m=(math.nan, 1.0))  # fmt: skip
    sent = dataclasses.replace(tick.sent["blue_1"], heading_rad=math.nan, speed_mps=math.nan, delivered=False)
    odd = dataclasses.replace(
        tick, fleet=fleet, wanted=wanted, decisions=dataclasses.replace(decisions, nominal=wanted),
        readings={"blue_1": reading}, sent={"blue_1": sent}, policy_age_s=math.inf,
    )  # fmt: skip
    bare = dataclasses.replace(tick, fleet=None, wanted=None, decisions=None, readings={}, contacts=(), sent={})
    return (odd, bare, tick)[number % 3]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    writer = McapWriter(path, header_of(), flush_s=0.0, key=bytes(32))
    for number, tick in enumerate(Encounter(header_of(), 30)):
        writer.take(dataclasses.replace(odd_tick(number, tick), number=number))
    writer.note("a line")
    writer.close()
    assert writer.fault == ""
    return path


@pytest.mark.parametrize("checker", CHECKERS)
def test_every_message_is_valid(log, checker):
    topics = set()
    for record in read_records(log):
        schema = json.loads(record.schema[2])
        checker.check_schema(schema)
        errors = [error.message for error in checker(schema).iter_errors(record.content)]
        assert errors == [], record.topic
        topics.add(record.topic)
    assert {"/header", "/tick", "/log", "/scene", "/field", "/fix/red_1", "/link"} <= topics


def test_what_is_not_finite_was_in_it(log):
    found = [entry for record in read_records(log) if record.topic == "/tick" for entry in record.content["odd"]]
    places = {entry["at"].split(".", 1)[0] for entry in found}
    assert {"boats", "readings", "sent", "policy_age_s", "solve_time_s"} <= places
    assert {"nan", "inf", "-inf"} <= {entry["value"] for entry in found}


@quick
@given(ticks())
def test_any_tick_is_valid_and_comes_back(tick):
    message = json.loads(json.dumps(tick_to_json(tick, HERON), allow_nan=False))
    jsonschema.Draft7Validator(TICK).validate(message)
    assert same(tick, tick_from_json(message, HERON))


def test_a_gap_is_left_for_viewers_and_a_zero_in_a_list():
    tick = odd_tick(0, next(iter(Encounter(header_of(), 1))))
    message = tick_to_json(tick, HERON)
    first, second = message["boats"][:2]
    assert "safety_margin_m" not in first
    assert "safety_margin_m" not in second
    assert message["boats"][2]["state"][4:] == [0.0] * 7
    assert first["wanted"] == []
    assert message["readings"][0]["position_m"] == [0.0, 1.0]
    assert "policy_age_s" not in message


@pytest.mark.parametrize(
    "entries",
    [[{"at": "boats.9.state.0", "value": "nan"}], [{"at": "boats", "value": "nan"}, {"at": "boats.0", "value": "nan"}],
     [{"at": "number", "value": "seven"}], [{"at": "boats.0.state.50", "value": "nan"}], [{}], [5], 5, "nan",
     [{"at": "boats.x", "value": "nan"}], [{"at": "number.0", "value": "nan"}]],
)  # fmt: skip
def test_a_list_of_odd_numbers_that_does_not_fit_is_damage(entries):
    message = tick_to_json(next(iter(Encounter(header_of(), 1))), HERON)
    with pytest.raises(LogError, match="damaged"):
        tick_from_json({**message, "odd": entries}, HERON)
