"""Replays prove that the shield decides the same, bit for bit, and find whatever does not."""

import dataclasses
import math

import numpy as np
import pytest
from logged_runs import FIELD, Encounter, header_of, write_log
from steerclear.experiments.deploy.proof import exact, prove
from steerclear.experiments.deploy.replay import origin_of, replay_log
from steerclear.shield import Commands, Fleet, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox import LogReader, platforms_of

STEPS = 200
BOTH = platforms_of(["heron", "surveyor"])


class OddEncounter(Encounter):
    """Relative commands, some unusable; ages, errors and fixed things that change; resets now and then."""

    def fleet(self, number):
        random = np.random.default_rng(number)
        ages = {"age_s": random.uniform(0.0, 0.5, 4), "position_error_m": random.uniform(0.0, 0.4, 4)}
        return dataclasses.replace(super().fleet(number), **ages)

    def fixed(self, number):
        stops = [(42.0, 20.0, 4.35)] if number // 50 % 2 else []  # the own flag is home now and then
        return (
            Surroundings(FIELD.field, circles=[(40.0 + 0.01 * number, 30.0, 1.0)], stops=stops) if number % 3 else None
        )

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


def read(path):
    with LogReader(path) as reader:
        return reader.header, list(reader.ticks())


def edited(ticks, number, **parts):
    """The ticks with parts of one decision replaced."""
    found = list(ticks)
    found[number] = dataclasses.replace(ticks[number], decisions=dataclasses.replace(ticks[number].decisions, **parts))
    return found


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An encounter in which the shield intervenes, as read from its log: header, ticks."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    write_log(path, STEPS)
    return read(path)


def test_a_log_proves_itself(log):
    header, ticks = log
    proof = prove(header, ticks)
    assert (proof.ticks, proof.decisions, proof.same) == (STEPS, STEPS, STEPS)
    assert proof.holds
    assert proof.first is None
    assert proof.missing == []
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
    write_log(tmp_path / "run.mcap", 120, header=header_of(ShieldConfig(**settings), platforms=BOTH), kind=kind)
    proof = prove(*read(tmp_path / "run.mcap"))
    assert proof.same == proof.decisions == 120


@pytest.mark.parametrize("name", ["safety_margin_m", "slack_m", "reason", "bound", "intervened"])
def test_a_value_that_differs_in_its_last_bit_is_found_and_named(log, name):
    header, ticks = log
    values = getattr(ticks[50].decisions, name).copy()
    values[1] = np.nextafter(values[1], np.inf) if values.dtype == np.float64 else not values[1]
    proof = prove(header, edited(ticks, 50, **{name: values}))
    assert not proof.holds
    assert (proof.different, proof.same) == (1, STEPS - 1)
    assert (proof.first.tick, proof.first.boat, proof.first.what) == (50, "blue_2", name)
    assert proof.first.time_s == pytest.approx(5.0)
    assert proof.first.recorded != proof.first.replayed


def test_a_command_that_differs_in_its_last_bit_is_found(log):
    header, ticks = log
    values = ticks[60].decisions.filtered.values.copy()
    values[0, 1] = np.nextafter(values[0, 1], -9.0)
    proof = prove(header, edited(ticks, 60, filtered=Commands(values, False)))
    assert proof.first.what == "sent heading"
    assert proof.first.boat == "blue_1"


def test_a_zero_of_another_sign_is_another_bit(log):
    header, ticks = log
    slack = ticks[5].decisions.slack_m.copy()
    slack[0] = -slack[0]
    assert ticks[5].decisions.slack_m[0] == 0.0
    assert prove(header, edited(ticks, 5, slack_m=slack)).first.what == "slack_m"


def test_other_settings_decide_otherwise(log):
    header, ticks = log
    other = dataclasses.replace(header, config=dataclasses.replace(header.config, separation_m=2.6))
    assert prove(other, ticks).different > 10


def test_a_boat_of_another_build_decides_otherwise(tmp_path):
    """The parameters in the log count, not those this version has for the name."""
    from steerclear.shield.platforms import get_platform

    slow = dataclasses.replace(get_platform("heron"), max_dec=0.1)

    class Slow(Encounter):
        def fleet(self, number):
            return dataclasses.replace(super().fleet(number), platforms=(slow,) * 4)

    write_log(tmp_path / "run.mcap", 120, header=header_of(platforms={"heron": slow}), kind=Slow)
    header, ticks = read(tmp_path / "run.mcap")
    assert prove(header, ticks).same == 120
    plain = [dataclasses.replace(t, decisions=dataclasses.replace(t.decisions, fleet=_plain(t.fleet))) for t in ticks]
    assert prove(header, plain).different > 0


def _plain(fleet):
    return Fleet(fleet.state, fleet.team, ("heron",) * 4, fleet.controlled, fleet.names)


def test_resets_are_followed_and_needed(tmp_path):
    write_log(tmp_path / "run.mcap", STEPS, kind=OddEncounter)
    header, ticks = read(tmp_path / "run.mcap")
    assert prove(header, ticks).same == STEPS
    deaf = [dataclasses.replace(tick, shield_reset=tick.number == 0) for tick in ticks]
    assert prove(header, deaf).different > 0


def test_after_missing_ticks_nothing_is_proved_until_the_next_reset(tmp_path):
    write_log(tmp_path / "run.mcap", STEPS, kind=OddEncounter)
    header, ticks = read(tmp_path / "run.mcap")
    holed = [tick for tick in ticks if not 50 <= tick.number < 60]
    proof = prove(header, holed)
    assert proof.missing == [(49, 60)]
    assert proof.holds
    assert proof.same + proof.unproven == STEPS - 10
    values = ticks[70].decisions.safety_margin_m + 1.0
    lied = prove(header, [t for t in edited(ticks, 70, safety_margin_m=values) if not 50 <= t.number < 60])
    assert lied.holds  # not provable: before the reset at 80
    assert lied.unproven == proof.unproven + 1
    late = prove(header, [t for t in edited(ticks, 90, safety_margin_m=values) if not 50 <= t.number < 60])
    assert late.different == 1
    assert late.first.tick == 90


def test_a_log_that_begins_in_the_middle_proves_nothing_until_a_reset(tmp_path):
    write_log(tmp_path / "run.mcap", STEPS, kind=OddEncounter)
    header, ticks = read(tmp_path / "run.mcap")
    lied = edited(ticks, 30, safety_margin_m=ticks[30].decisions.safety_margin_m + 1.0)
    assert prove(header, lied).different == 1
    assert prove(header, lied[25:]).different == 0


def test_a_change_of_the_fleet_makes_the_shield_forget_as_well(log):
    header, ticks = log
    known = prove(header, edited(ticks, 90, safety_margin_m=ticks[90].decisions.safety_margin_m + 1.0)[70:])
    assert known.different == 0
    three = [_without_last(tick) if tick.number < 80 else tick for tick in ticks[70:]]
    decided = _decided_again(header, three)
    lied = edited(decided, 20, safety_margin_m=decided[20].decisions.safety_margin_m + 1.0)
    assert prove(header, decided).same == len(decided)
    assert prove(header, lied).different == 1


def _without_last(tick):
    fleet = tick.fleet
    fewer = Fleet(fleet.state[:3], fleet.team[:3], fleet.platforms[:3], fleet.controlled[:3], fleet.names[:3])
    return dataclasses.replace(tick, fleet=fewer, wanted=Commands(tick.wanted.values[:3], tick.wanted.relative))


def _decided_again(header, ticks):
    from steerclear.shield import Shield

    shield = Shield(header.config, header.surroundings)
    return [dataclasses.replace(t, decisions=shield.decide(t.fleet, t.wanted, t.surroundings)) for t in ticks]


def test_ticks_without_a_decision_are_passed_over(log):
    header, ticks = log
    found = list(ticks)
    found[0] = dataclasses.replace(ticks[0], fleet=None, wanted=None, decisions=None, shield_reset=False)
    found[1] = dataclasses.replace(ticks[1], shield_reset=True)
    again = _decided_again_from(header, found)
    proof = prove(header, again)
    assert (proof.ticks, proof.decisions, proof.same) == (STEPS, STEPS - 1, STEPS - 1)


def _decided_again_from(header, ticks):
    first = next(k for k, tick in enumerate(ticks) if tick.fleet is not None)
    return [*ticks[:first], *_decided_again(header, ticks[first:])]


def test_a_decision_that_is_refused_now_is_a_difference(log):
    header, ticks = log
    state = ticks[3].fleet.state.copy()
    state[0, 0] = math.nan
    fleet = dataclasses.replace(ticks[3].fleet, state=state)
    found = edited(ticks, 3, fleet=fleet)
    found[3] = dataclasses.replace(found[3], fleet=fleet)
    proof = prove(header, found)
    assert proof.first.what == "decision"
    assert "refused: position of boat 'blue_1'" in proof.first.replayed


def test_what_differs_from_the_logs_program_is_told(log):
    header, _ = log
    assert origin_of(header) == []
    parts = {"machine": "riscv", "sources": "", "tables": {"heron with heron": "?"}}
    told = origin_of(dataclasses.replace(header, versions={**header.versions, "numpy": "0.1"}, **parts))
    assert told[0].startswith("numpy 0.1 there, ")
    assert "sources of the shield" in told[1]
    assert "value tables" in told[2]
    assert told[3].startswith("machine riscv there, ")


def test_the_header_names_the_value_tables_there_are(tmp_path, monkeypatch):
    monkeypatch.setenv("STEERCLEAR_TABLES", str(tmp_path))
    surveyors = platforms_of(["surveyor"])
    shipped = header_of(platforms=surveyors).tables
    assert set(shipped) == {"surveyor with surveyor"}
    (tmp_path / "surveyor-surveyor-worst-case.npz").write_bytes(b"made on demand")
    assert header_of(platforms=surveyors).tables != shipped
    assert header_of(platforms=platforms_of(["di"])).tables == {}


def test_reasons_and_actions_are_counted(tmp_path):
    write_log(tmp_path / "run.mcap", 60)
    with LogReader(tmp_path / "run.mcap") as reader:
        found = replay_log(reader, keep_tracks=False)
    assert found.actions == {("contact", "slow", "red_1"): 20}
    assert sum(found.reasons.values()) == 120
    assert found.complete
    assert found.seconds == pytest.approx(5.9)


def test_exact_shows_every_bit():
    assert exact(0.1) != exact(np.nextafter(0.1, 1.0).item())
    assert exact(3) == "3"
