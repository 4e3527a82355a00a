"""Replays prove that the shield decides the same, bit for bit, and that only what a link may change was changed."""

import dataclasses
import math

import numpy as np
import pytest
from logged_runs import FIELD, Encounter, header_of, write_log
from steerclear.experiments.deploy.proof import SentCheck, prove
from steerclear.experiments.deploy.replay import origin_of
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox import LogReader, platforms_of
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.commands import AttitudeRoute, VelocityRoute
from steerclear.shield.bridge.messages import Action
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import get_platform

STEPS = 200
HEADER = header_of()
BOTH = platforms_of(["heron", "surveyor"])


class OddEncounter(Encounter):
    """Relative commands, some unusable; ages, errors and fixed things that change; resets now and then."""

    def fleet(self, number):
        random = np.random.default_rng(number)
        ages = {"age_s": random.uniform(0.0, 0.5, 4), "position_error_m": random.uniform(0.0, 0.4, 4)}
        return dataclasses.replace(super().fleet(number), **ages)

    def fixed(self, number):
        stops = [(42.0, 20.0, 4.35)] if number // 50 % 2 else []  # the own flag is home now and then
        circles = [(40.0 + 0.01 * number, 30.0, 1.0)]
        return Surroundings(FIELD.field, circles=circles, stops=stops) if number % 3 else None

    def resets(self, number):
        return number % 40 == 0

    def wanted(self, number, fleet):
        values = super().wanted(number, fleet).as_relative_deg(fleet.state[:, 2])
        if number % 17 == 0:
            values[0] = math.nan, math.inf
        if number % 5 == 0:
            values[1, 1] = -0.0
        return Commands.relative_deg(values)


class Surveyors(Encounter):
    """Boats whose opponents are looked up in value tables."""

    def fleet(self, number):
        return dataclasses.replace(super().fleet(number), platforms=("surveyor",) * 4)


def logged(folder, steps=STEPS, **settings):
    """Header and ticks as read from a log."""
    write_log(folder / "run.mcap", steps, **settings)
    with LogReader(folder / "run.mcap") as reader:
        return reader.header, list(reader.ticks())


def edited(ticks, number, **parts):
    """The ticks with parts of one decision replaced."""
    found = list(ticks)
    found[number] = dataclasses.replace(ticks[number], decisions=dataclasses.replace(ticks[number].decisions, **parts))
    return found


def lied(ticks, number):
    return edited(ticks, number, safety_margin_m=ticks[number].decisions.safety_margin_m + 1.0)


def decided_again(header, ticks):
    shield = Shield(header.config, header.surroundings)
    return [
        t if t.fleet is None else dataclasses.replace(t, decisions=shield.decide(t.fleet, t.wanted, t.surroundings))
        for t in ticks
    ]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An encounter in which the shield intervenes, as read from its log: header, ticks."""
    return logged(tmp_path_factory.mktemp("log"))


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    return logged(tmp_path_factory.mktemp("log"), kind=OddEncounter)


def test_a_log_proves_itself(log):
    header, ticks = log
    proof = prove(header, ticks)
    assert (proof.ticks, proof.decisions, proof.same) == (STEPS, STEPS, STEPS)
    assert proof.holds
    assert (proof.first, proof.missing) == (None, [])
    assert sum(tick.decisions.intervened.any() for tick in ticks) > 20  # otherwise this proves little


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"coordination": "per_boat", "delay_s": 0.3},
        {"opponent_model": "value_table", "position_error_m": 0.3, "cbf_rate_per_s": math.inf},
        {"separation_m": 4.0, "edge_m": None, "solver": "quadprog", "opponent_model": "turning_circle"},
    ],
    ids=lambda settings: ",".join(settings) or "defaults",
)
@pytest.mark.parametrize("kind", [Encounter, OddEncounter, Surveyors])
def test_any_settings_and_inputs_come_back(tmp_path, settings, kind):
    header = header_of(ShieldConfig(**settings), platforms=BOTH)
    proof = prove(*logged(tmp_path, 120, header=header, kind=kind))
    assert proof.same == proof.decisions == 120


@pytest.mark.parametrize("name", ["safety_margin_m", "slack_m", "reason", "bound", "intervened", "sent heading"])
def test_a_value_that_differs_in_its_last_bit_is_found_and_named(log, name):
    header, ticks = log
    if name == "sent heading":
        values = ticks[50].decisions.filtered.values.copy()
        values[1, 1] = np.nextafter(values[1, 1], -9.0)
        parts = {"filtered": Commands(values, False)}
    else:
        values = getattr(ticks[50].decisions, name).copy()
        values[1] = np.nextafter(values[1], np.inf) if values.dtype == np.float64 else not values[1]
        parts = {name: values}
    proof = prove(header, edited(ticks, 50, **parts))
    assert not proof.holds
    assert (proof.different, proof.same) == (1, STEPS - 1)
    assert (proof.first.tick, proof.first.boat, proof.first.what) == (50, "blue_2", name)
    assert proof.first.time_s == pytest.approx(5.0)
    assert proof.first.recorded != proof.first.replayed


def test_other_settings_and_a_boat_of_another_build_decide_otherwise(log, tmp_path):
    """The parameters in the log count, not those this version has for the name."""
    header, ticks = log
    other = dataclasses.replace(header, config=dataclasses.replace(header.config, separation_m=2.6))
    assert prove(other, ticks).different > 10
    slow = dataclasses.replace(get_platform("heron"), max_dec=0.1)

    class Slow(Encounter):
        def fleet(self, number):
            return dataclasses.replace(super().fleet(number), platforms=(slow,) * 4)

    header, ticks = logged(tmp_path, 120, header=header_of(platforms={"heron": slow}), kind=Slow)
    assert prove(header, ticks).same == 120
    plain = [dataclasses.replace(tick.fleet, platforms=("heron",) * 4) for tick in ticks]
    swapped = [edited([tick], 0, fleet=fleet)[0] for tick, fleet in zip(ticks, plain, strict=True)]
    assert prove(header, swapped).different > 0


def test_resets_are_followed_and_needed(odd):
    header, ticks = odd
    assert prove(header, ticks).same == STEPS
    deaf = [dataclasses.replace(tick, shield_reset=tick.number == 0) for tick in ticks]
    assert prove(header, deaf).different > 0


def test_after_missing_ticks_nothing_is_proved_until_the_next_reset(odd):
    header, ticks = odd

    def holed(ticks):
        return prove(header, [tick for tick in ticks if not 50 <= tick.number < 60])

    proof = holed(ticks)
    assert proof.missing == [(49, 60)]
    assert proof.holds
    assert proof.same + proof.unproven == STEPS - 10
    early = holed(lied(ticks, 70))
    assert early.holds  # not provable: before the reset at 80
    assert early.unproven == proof.unproven + 1
    late = holed(lied(ticks, 90))
    assert (late.different, late.first.tick) == (1, 90)
    assert prove(header, lied(ticks, 30)).different == 1
    assert prove(header, lied(ticks, 30)[25:]).different == 0, "a log that begins in the middle"


def test_a_change_of_the_fleet_makes_the_shield_forget_as_well(log):
    header, ticks = log
    assert prove(header, lied(ticks, 90)[70:]).different == 0
    three = [_without_last(tick) if tick.number < 80 else tick for tick in ticks[70:]]
    decided = decided_again(header, three)
    assert prove(header, decided).same == len(decided)
    assert prove(header, lied(decided, 20)).different == 1


def _without_last(tick):
    fleet = tick.fleet
    fewer = Fleet(fleet.state[:3], fleet.team[:3], fleet.platforms[:3], fleet.controlled[:3], fleet.names[:3])
    return dataclasses.replace(tick, fleet=fewer, wanted=Commands(tick.wanted.values[:3], tick.wanted.relative))


def test_what_differs_from_the_logs_program_is_told(log):
    header, _ = log
    assert origin_of(header) == []
    parts = {"machine": "riscv", "sources": "", "tables": {"heron with heron": "?"}}
    told = origin_of(dataclasses.replace(header, versions={**header.versions, "numpy": "0.1"}, **parts))
    words = ("numpy 0.1 there, ", "the sources of the shield", "the value tables", "machine riscv there, ")
    assert [text.startswith(word) for text, word in zip(told, words, strict=True)] == [True] * 4


def test_the_header_names_the_value_tables_there_are(tmp_path, monkeypatch):
    monkeypatch.setenv("STEERCLEAR_TABLES", str(tmp_path))
    surveyors = platforms_of(["surveyor"])
    shipped = header_of(platforms=surveyors).tables
    assert set(shipped) == {"surveyor with surveyor"}
    (tmp_path / "surveyor-surveyor-worst-case.npz").write_bytes(b"made on demand")
    assert header_of(platforms=surveyors).tables != shipped
    assert header_of(platforms=platforms_of(["di"])).tables == {}


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(HEADER, 60))


def with_decided(tick, speed_mps, heading_rad=1.0):
    """The tick with another decision for blue_1, and the same for blue_2."""
    values = tick.decisions.filtered.values.copy()
    values[0] = speed_mps, heading_rad
    return edited([tick], 0, filtered=dataclasses.replace(tick.decisions.filtered, values=values))[0]


def with_sent(tick, name="blue_1", **parts):
    return dataclasses.replace(tick, sent={**tick.sent, name: dataclasses.replace(tick.sent[name], **parts)})


def strayed(tick, header=HEADER):
    return [(entry.boat, entry.what) for entry in SentCheck(header).strayed(tick)]


def encoded(route, tick, y_axis_deg=30.0):
    """The tick with blue_1's command as a real link would have encoded it."""
    frame = FieldFrame(42.0, -71.0, y_axis_deg)
    speed_mps, heading_rad = tick.decisions.filtered.absolute(0, float(tick.fleet.heading_rad[0]))
    said = route.encode((1, 1), 0, frame.heading_to_true_rad(heading_rad), speed_mps)
    parts = {"heading_rad": frame.heading_to_field_rad(said.heading_rad), "speed_mps": said.speed_mps}
    return with_sent(tick, **parts, route=route.name, limit_mps=said.limit_mps)


@pytest.mark.parametrize("route", [AttitudeRoute(2.0), AttitudeRoute(1.3), VelocityRoute(2.0), VelocityRoute(None)])
def test_rounding_and_limit_of_real_messages_are_let_pass(ticks, route):
    random, check = np.random.default_rng(1), SentCheck(HEADER)
    assert [check.strayed(tick) for tick in ticks] == [[]] * len(ticks), "what was decided was sent"
    lowest = -2.0 if isinstance(route, AttitudeRoute) else 0.0
    for _ in range(300):
        tick = with_decided(ticks[5], random.uniform(lowest, 2.0), random.uniform(0.0, 2 * math.pi))
        assert check.strayed(encoded(route, tick)) == []


def test_a_link_that_cannot_go_astern_creeps(ticks):
    for speed_mps in (-1.0, 0.0):
        assert strayed(encoded(VelocityRoute(2.0), with_decided(ticks[5], speed_mps))) == []


@pytest.mark.parametrize(
    ("parts", "what"),
    [
        ({"speed_mps": 1.0}, "speed"), ({"speed_mps": 2.001}, "speed"), ({"speed_mps": -2.0}, "speed"),
        ({"speed_mps": 0.0}, "speed"), ({"speed_mps": math.nan}, "speed"), ({"speed_mps": math.inf}, "speed"),
        ({"heading_rad": 1.001}, "heading"), ({"heading_rad": 1.0 + math.pi}, "heading"),
        ({"heading_rad": math.nan}, "heading"), ({"heading_rad": math.inf}, "heading"),
        ({"speed_mps": 1.5, "limit_mps": 1.6}, "speed"),
    ],
)  # fmt: skip
def test_another_command_than_the_one_decided_is_found(ticks, parts, what):
    tick = with_sent(with_decided(ticks[5], 2.0), heading_rad=1.0, speed_mps=2.0, limit_mps=2.0)
    assert strayed(tick) == []
    assert strayed(with_sent(tick, **parts)) == [("blue_1", what)]
    assert strayed(dataclasses.replace(tick, sent={"blue_2": tick.sent["blue_2"]})) == [("blue_1", "command")]


def test_a_boat_that_a_person_steers_is_told_nothing_or_stopped(ticks):
    fleet = dataclasses.replace(ticks[5].fleet, controlled=np.array([False, True, False, False]))
    tick = edited([dataclasses.replace(ticks[5], fleet=fleet)], 0, fleet=fleet)[0]
    parts = {"speed_mps": math.nan, "heading_rad": math.nan}
    assert strayed(with_sent(tick, **parts, route="none: does not obey", delivered=False)) == []
    assert strayed(with_sent(tick, **parts)) == strayed(tick) == [("blue_1", "sent without a decision")]
    for speed_mps in (0.0, 1e-3):
        assert strayed(with_sent(tick, speed_mps=speed_mps)) == []
        assert strayed(with_sent(tick, speed_mps=speed_mps, heading_rad=math.nan)) == []


def test_a_links_own_stop_needs_its_declaration_or_a_decided_stop(ticks):
    stopped = with_sent(with_decided(ticks[5], 2.0), speed_mps=0.0, heading_rad=0.3)
    told = dataclasses.replace(stopped, actions=(Action("blue_1", "send", "stop", "not sent"),))
    assert strayed(told) == []
    assert strayed(with_sent(told, speed_mps=1.0)) != [], "that is no stop"
    for action in ((), (Action("blue_2", "send", "stop", ""),), (Action("blue_1", "navigation", "stop", "old"),)):
        assert strayed(dataclasses.replace(stopped, actions=action)) != []
    stopped = with_sent(with_decided(ticks[5], 0.0), speed_mps=0.0, heading_rad=0.3)
    reason = stopped.decisions.reason.copy()
    reason[0] = Reason.STOPPED
    asked = edited([stopped], 0, reason=reason)[0]
    assert strayed(stopped) == [("blue_1", "heading")]
    assert strayed(asked) == []
    assert strayed(with_sent(asked, speed_mps=1.0)) != []


def test_whose_commands_are_compared(ticks):
    boats = tuple(dataclasses.replace(boat, ours=boat.name == "blue_1") for boat in HEADER.boats)
    tick = dataclasses.replace(ticks[5], sent={"blue_1": ticks[5].sent["blue_1"]})
    alone = dataclasses.replace(HEADER.config, coordination="per_boat")
    assert strayed(tick, dataclasses.replace(HEADER, boats=boats, config=alone)) == [], "a mate of another process"
    assert strayed(tick, dataclasses.replace(HEADER, boats=boats)) == [("blue_2", "command")]
    header = dataclasses.replace(HEADER, boats=tuple(dataclasses.replace(boat, ours=False) for boat in boats))
    assert strayed(with_sent(ticks[5], speed_mps=0.7), header) == [("blue_1", "speed")], "nothing is hidden by it"
    silent = dataclasses.replace(ticks[5], sent={})
    assert strayed(silent, header) == [("blue_1", "command"), ("blue_2", "command")]


def test_commands_that_a_limit_cut_are_counted_and_what_strayed_is_named(ticks):
    cut = [with_sent(with_decided(tick, 2.0), speed_mps=0.5, heading_rad=1.0, limit_mps=0.5) for tick in ticks]
    check = SentCheck(HEADER)
    assert [check.strayed(tick) for tick in cut] == [[]] * len(ticks)
    assert check.cut == {("blue_1", 0.5): len(ticks)}
    forged = [with_sent(tick, speed_mps=0.5) if 20 <= tick.number < 30 else tick for tick in ticks]
    proof = prove(HEADER, forged)
    assert (proof.same, proof.strayed, proof.unfounded) == (60, 10, 0)
    assert (proof.holds, proof.proved) == (False, False)
    assert (proof.first_sent.tick, proof.first_sent.boat, proof.first_sent.what) == (20, "blue_1", "speed")
    assert "0.5" in proof.first_sent.replayed
