"""`steerclear replay`: every decision is made again bit for bit and what was sent was decided, or it is told."""

import dataclasses
import json
import math
import os

import numpy as np
import pytest
from forged_logs import read_records, write_records
from json_keys import KEYS, undocumented
from logged_runs import Encounter, header_of, write_log
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.proof import SentCheck, prove
from steerclear.experiments.deploy.replay import origin_of
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox import LogReader, platforms_of
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.commands import AttitudeRoute, VelocityRoute
from steerclear.shield.bridge.messages import Action
from steerclear.shield.decision import Reason
from steerclear.shield.platforms import get_platform
from typer.testing import CliRunner

STEPS = 180
KEY = "11" * 32
HEADER = header_of()


class OddEncounter(Encounter):
    """Relative commands, some unusable; ages, errors and fixed things that change; resets now and then."""

    def fleet(self, number):
        random = np.random.default_rng(number)
        ages = {"age_s": random.uniform(0.0, 0.5, 4), "position_error_m": random.uniform(0.0, 0.4, 4)}
        return dataclasses.replace(super().fleet(number), **ages)

    def fixed(self, number):
        stops = [(42.0, 20.0, 4.35)] if number // 50 % 2 else []  # the own flag is home now and then
        circles = [(40.0 + 0.01 * number, 30.0, 1.0)]
        field = self.header.surroundings.field
        return Surroundings(field, circles=circles, stops=stops) if number % 3 else None

    def resets(self, number):
        return number % 40 == 0

    def wanted(self, number, fleet):
        values = super().wanted(number, fleet).as_relative_deg(fleet.state[:, 2])
        if number % 17 == 0:
            values[0] = math.nan, math.inf
        if number % 5 == 0:
            values[1, 1] = -0.0
        return Commands.relative_deg(values)


class Built(Encounter):
    """Boats of a platform of the header's."""

    def fleet(self, number):
        (platform,) = self.header.platforms.values()
        return dataclasses.replace(super().fleet(number), platforms=(platform,) * 4)


def logged(folder, ticks=STEPS, header=HEADER, kind=Encounter, **more):
    """Header and ticks as read from a log."""
    write_log(folder / "run.mcap", ticks, header, kind, **more)
    with LogReader(folder / "run.mcap") as reader:
        return reader.header, list(reader.ticks())


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An encounter in which the shield intervenes: its file."""
    folder = tmp_path_factory.mktemp("log")
    write_log(folder / "run.mcap", STEPS, HEADER, box={"flush_s": 0.0})
    return folder / "run.mcap"


@pytest.fixture(scope="module")
def ticks(log):
    with LogReader(log) as reader:
        return list(reader.ticks())


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    return logged(tmp_path_factory.mktemp("log"), kind=OddEncounter)[1]


def written(path, ticks, header=HEADER, **box):
    """A log of those ticks."""

    class Made(Encounter):
        def __iter__(self):
            return iter(ticks)

    write_log(path, STEPS, header, Made, box={"flush_s": 0.0, **box})
    return path


def edited(ticks, number, **parts):
    """The ticks with parts of one decision replaced."""
    decisions = dataclasses.replace(ticks[number].decisions, **parts)
    return [*ticks[:number], dataclasses.replace(ticks[number], decisions=decisions), *ticks[number + 1 :]]


def lied(ticks, number, by_m=1.0):
    return edited(ticks, number, safety_margin_m=ticks[number].decisions.safety_margin_m + by_m)


def all_sent(ticks, change):
    """The ticks with every sent command changed."""
    return [
        dataclasses.replace(
            tick, sent={name: dataclasses.replace(one, **change(one)) for name, one in tick.sent.items()}
        )
        for tick in ticks
    ]


def bare(ticks, numbers=range(STEPS)):
    return [dataclasses.replace(tick, decisions=None) if tick.number in numbers else tick for tick in ticks]


def test_a_log_proves_itself(ticks):
    proof = prove(HEADER, ticks)
    assert (proof.ticks, proof.decisions, proof.same) == (STEPS, STEPS, STEPS)
    assert proof.holds
    assert (proof.first, proof.missing) == (None, [])
    assert sum(tick.decisions.intervened.any() for tick in ticks) > 20, "otherwise this proves little"


@pytest.mark.parametrize(
    ("kind", "platform", "settings"),
    [
        (OddEncounter, "heron", {"coordination": "per_boat", "delay_s": 0.3}),
        (Built, "surveyor", {"opponent_model": "value_table", "position_error_m": 0.3, "cbf_rate_per_s": math.inf}),
        (OddEncounter, "heron", {"separation_m": 4.0, "edge_m": None, "solver": "quadprog"}),
        (Encounter, "heron", {"opponent_model": "turning_circle"}),
    ],
)
def test_any_settings_and_inputs_come_back(tmp_path, kind, platform, settings):
    header = header_of(ShieldConfig(**settings), platforms=platforms_of([platform]))
    proof = prove(*logged(tmp_path, 120, header, kind))
    assert proof.same == proof.decisions == 120


@pytest.mark.parametrize(
    "name", ["safety_margin_m", "slack_m", "reason", "active_constraint", "intervened", "sent heading"]
)
def test_a_value_that_differs_in_its_last_bit_is_found_and_named(ticks, name):
    if name == "sent heading":
        values = ticks[50].decisions.filtered.values.copy()
        values[1, 1] = np.nextafter(values[1, 1], -9.0)
        parts = {"filtered": Commands(values, False)}
    else:
        values = getattr(ticks[50].decisions, name).copy()
        values[1] = np.nextafter(values[1], np.inf) if values.dtype == np.float64 else not values[1]
        parts = {name: values}
    proof = prove(HEADER, edited(ticks, 50, **parts))
    assert not proof.holds
    assert (proof.different, proof.same) == (1, STEPS - 1)
    assert (proof.first.tick, proof.first.boat, proof.first.what) == (50, "blue_2", name)
    assert proof.first.time_s == pytest.approx(5.0)
    assert proof.first.recorded != proof.first.replayed


def test_other_settings_and_a_boat_of_another_build_decide_otherwise(ticks, tmp_path):
    """The parameters in the log count, not those this version has for the name."""
    other = dataclasses.replace(HEADER, config=dataclasses.replace(HEADER.config, separation_m=2.6))
    assert prove(other, ticks).different > 10
    slow = dataclasses.replace(get_platform("heron"), max_dec=0.1)
    header, built = logged(tmp_path, 120, header_of(platforms={"heron": slow}), Built)
    assert prove(header, built).same == 120
    plain = [dataclasses.replace(tick.fleet, platforms=("heron",) * 4) for tick in built]
    swapped = [edited([tick], 0, fleet=fleet)[0] for tick, fleet in zip(built, plain, strict=True)]
    assert prove(header, swapped).different > 0


def test_resets_are_needed_and_after_missing_ticks_nothing_is_proved_until_the_next(odd):
    assert prove(HEADER, odd).same == STEPS
    deaf = [dataclasses.replace(tick, shield_reset=tick.number == 0) for tick in odd]
    assert prove(HEADER, deaf).different > 0

    def holed(ticks):
        return prove(HEADER, [tick for tick in ticks if not 50 <= tick.number < 60])

    proof = holed(odd)
    assert proof.missing == [(49, 60)]
    assert proof.holds
    assert proof.same + proof.unproven == STEPS - 10
    early = holed(lied(odd, 70))
    assert early.holds, "not provable: before the reset at 80"
    assert early.unproven == proof.unproven + 1
    late = holed(lied(odd, 90))
    assert (late.different, late.first.tick) == (1, 90)
    assert prove(HEADER, lied(odd, 30)[25:]).different == 0, "a log that begins in the middle"


def test_a_change_of_the_fleet_makes_the_shield_forget_as_well(ticks):
    def without_last(tick):
        parts = {name: getattr(tick.fleet, name)[:3] for name in ("state", "team", "platforms", "controlled", "names")}
        wanted = Commands(tick.nominal.values[:3], tick.nominal.relative)
        return dataclasses.replace(tick, fleet=Fleet(**parts), nominal=wanted)

    assert prove(HEADER, lied(ticks, 90)[70:]).different == 0
    shield = Shield(HEADER.config, HEADER.surroundings)
    three = [without_last(tick) if tick.number < 80 else tick for tick in ticks[70:]]
    decided = [
        dataclasses.replace(tick, decisions=shield.decide(tick.fleet, tick.nominal, tick.surroundings))
        for tick in three
    ]
    assert prove(HEADER, decided).same == len(decided)
    assert prove(HEADER, lied(decided, 20)).different == 1


def test_what_differs_from_the_logs_program_is_told(tmp_path, monkeypatch):
    assert origin_of(HEADER) == []
    parts = {"machine": "riscv", "sources": "", "tables": {"heron with heron": "?"}}
    told = origin_of(dataclasses.replace(HEADER, versions={**HEADER.versions, "numpy": "0.1"}, **parts))
    words = ("numpy 0.1 there, ", "the sources of the shield", "the value tables", "machine riscv there, ")
    assert [text.startswith(word) for text, word in zip(told, words, strict=True)] == [True] * 4
    monkeypatch.setenv("STEERCLEAR_TABLES", str(tmp_path))
    surveyors = platforms_of(["surveyor"])
    shipped = header_of(platforms=surveyors).tables
    assert set(shipped) == {"surveyor with surveyor"}
    (tmp_path / "surveyor-surveyor-worst-case.npz").write_bytes(b"made on demand")
    assert header_of(platforms=surveyors).tables != shipped
    assert header_of(platforms=platforms_of(["di"])).tables == {}


def with_decided(tick, speed_mps, heading_rad=1.0):
    """The tick with another decision for blue_1, and the same for blue_2."""
    values = tick.decisions.filtered.values.copy()
    values[0] = speed_mps, heading_rad
    return edited([tick], 0, filtered=dataclasses.replace(tick.decisions.filtered, values=values))[0]


def with_sent(tick, name="blue_1", **parts):
    return dataclasses.replace(tick, sent={**tick.sent, name: dataclasses.replace(tick.sent[name], **parts)})


def strayed(tick, header=HEADER):
    return [(entry.boat, entry.what) for entry in SentCheck(header).strayed(tick)]


def encoded(route, tick):
    """The tick with blue_1's command as a real link would have encoded it."""
    frame = FieldFrame(42.0, -71.0, 30.0)
    speed_mps, heading_rad = tick.decisions.filtered.absolute(0, float(tick.fleet.heading_rad[0]))
    said = route.encode((1, 1), 0, frame.heading_to_true_rad(heading_rad), speed_mps)
    parts = {"heading_rad": frame.heading_to_field_rad(said.heading_rad), "speed_mps": said.speed_mps}
    return with_sent(tick, **parts, route=route.name, limit_mps=said.limit_mps)


@pytest.mark.parametrize("route", [AttitudeRoute(2.0), AttitudeRoute(1.3), VelocityRoute(2.0), VelocityRoute(None)])
def test_rounding_and_limit_of_real_messages_are_let_pass(ticks, route):
    """A link that cannot go astern creeps."""
    random, lowest = np.random.default_rng(1), -2.0 if isinstance(route, AttitudeRoute) else -1.0
    for _ in range(300):
        tick = with_decided(ticks[5], random.uniform(lowest, 2.0), random.uniform(0.0, 2 * math.pi))
        assert strayed(encoded(route, tick)) == []


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


def run(*arguments):
    result = CliRunner().invoke(app, ["replay", *map(str, arguments)], terminal_width=200)
    return result.exit_code, " ".join(result.output.split())


WRITTEN_ANEW = {
    "nothing": (
        lambda ticks: ticks,
        (0,),
        (
            f"{STEPS} of {STEPS} decisions made again, the same bit for bit.",
            "own boats blue_1, blue_2",
            "2026-09-21",
            "slow",
        ),
    ),
    "a lie in the last bits": (
        lambda ticks: lied(ticks, 30, 1e-12),
        (1,),
        (
            f"{STEPS - 1} of {STEPS} decisions made again the same, 1 differ",
            "First difference: turn 30 at 3.00 s, blue_1, safety_margin_m",
        ),
    ),
    "a tick dropped and every later decision forged": (
        lambda ticks: [*ticks[:29], *(lied([tick], 0)[0] for tick in ticks[30:])],
        (3,),
        (
            f"{STEPS - 30} differ after turns missing from the log and are not proved (1 gap)",
            "1 turn is missing from the log",
            "NOT PROVED",
        ),
    ),
    "the first ticks left out": (lambda ticks: ticks[10:], (3,), ("10 turns are missing from the log",)),
    "speeds of the links altered, the chain made anew": (
        lambda ticks: all_sent(ticks, lambda _: {"speed_mps": 0.7}),
        (1,),
        (
            f"{2 * STEPS} commands are not what was decided",
            "First of them: turn 0 at 0.00 s, blue_1, speed: decided 2.0",
        ),
    ),
    "no decisions": (
        bare,
        (3,),
        ("no decision of the shield: nothing is proved", f"{2 * STEPS} were sent without a decision"),
    ),
    "decisions left out in between": (lambda ticks: bare(ticks, (60, 61)), (1, 3), ("4 were sent without a decision",)),
    "a turn that stands twice": (lambda ticks: [*ticks[:20], ticks[19], *ticks[20:]], (3,), ("1 time they go back",)),
    "commands an autopilot cut": (
        lambda ticks: all_sent(ticks, lambda one: {"speed_mps": min(one.speed_mps, 0.5), "limit_mps": 0.5}),
        (0,),
        ("blue_1: its autopilot's limit of 0.5 m/s cut",),
    ),
}
"""What is done to the ticks before they are written, the exit status, and what is said."""


@pytest.mark.parametrize("name", WRITTEN_ANEW)
def test_a_log_that_was_written_anew_is_told_for_what_it_is(tmp_path, ticks, name):
    forge, codes, words = WRITTEN_ANEW[name]
    code, said = run(written(tmp_path / "x.mcap", forge(ticks)))
    assert code in codes
    assert all(word in said for word in words), said


def changed_tick(records, change):
    """The records with one changed: the tick of number 50."""
    k = next(k for k, record in enumerate(records) if record.topic == "/tick" and record.content["number"] == 50)
    records[k] = records[k].with_content(**change(records[k].content))
    return records


ALTERED = {
    "cut and closed again": (
        lambda records: records[: len(records) // 2],
        3,
        (
            "Hash chain: damaged. The log is not as it was written: its end was cut off and the file closed again",
            "the same bit for bit",
        ),
    ),
    "speeds altered": (
        lambda records: changed_tick(
            records, lambda tick: {"sent": [{**row, "speed_mps": 0.1} for row in tick["sent"]]}
        ),
        1,
        ("2 commands are not what was decided", "some are not as they were written"),
    ),
    "a certificate altered": (
        lambda records: changed_tick(
            records, lambda tick: {"boats": [{**tick["boats"][0], "certificate_m": 9.0}, *tick["boats"][1:]]}
        ),
        1,
        ("1 differ", "some are not as they were written"),
    ),
    "lines taken out": (
        lambda records: [record for record in records if record.topic != "/log"],
        3,
        ("records are missing",),
    ),
}
"""What is done to the records of a file, the exit status, and what is said."""


@pytest.mark.parametrize("name", ALTERED)
def test_a_file_that_was_altered_is_told_for_what_it_is(tmp_path, log, name):
    forge, wanted, words = ALTERED[name]
    forged = write_records(tmp_path / "x.mcap", forge(read_records(log)))
    code, said = run(forged, "--json", tmp_path / "out.json")
    assert code == wanted
    assert all(word in said for word in words), said
    content = json.loads((tmp_path / "out.json").read_text())
    assert (content["proved"], content["chain"]["chained"]) == (False, True)
    assert content["chain"]["broken"] >= len(content["chain"]["breaks"]) >= 1


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda data: data + data, 3, ("after its end more bytes follow", "NOT PROVED")),
        (lambda data: data + b"\0", 3, ("after its end more bytes follow", "NOT PROVED")),
        (lambda data: data[:-1], 3, ("from some point on it makes no sense", "NOT PROVED")),
        (
            lambda data: data[: len(data) // 2],  # killed, not forged
            0,
            ("not closed (crash, power or kill)", "verified up to where the log ends. It carries no codes"),
        ),
        (lambda data: data[: len(data) // 2 + 11], 0, ("not closed (crash, power or kill)",)),
        (lambda data: b"not a log", 2, ("holds no header of a steerclear log",)),
        (lambda data: b"", 2, ("holds no header",)),
    ],
)
def test_a_file_with_more_or_less_than_was_written_is_told_for_what_it_is(tmp_path, log, change, code, words):
    (tmp_path / "x.mcap").write_bytes(change(log.read_bytes()))
    found, said = run(tmp_path / "x.mcap")
    assert found == code
    assert all(word in said for word in words), said


def test_a_log_in_which_nothing_was_decided_proves_nothing(tmp_path):
    class Nobody(Encounter):
        def fleet(self, number):
            return dataclasses.replace(super().fleet(number), controlled=np.zeros(4, dtype=bool))

    stopped = all_sent(Nobody(HEADER, 20), lambda _: {"speed_mps": 0.0})
    code, said = run(written(tmp_path / "x.mcap", stopped))
    assert code == 3
    assert "No boat was covered: nothing is proved" in said
    write_log(tmp_path / "y.mcap", 3, edit=lambda tick: dataclasses.replace(tick, fleet=None, decisions=None))
    code, said = run(tmp_path / "y.mcap")
    assert code == 3
    assert "no decision of the shield: nothing is proved" in said
    assert run(tmp_path / "y.mcap", "--judge")[0] == 2
    os.mkfifo(tmp_path / "pipe.mcap")
    code, said = run(tmp_path / "pipe.mcap")
    assert (code, "it is no plain file" in said) == (2, True), "a pipe is not waited for"


def test_codes_are_checked_with_the_key_and_another_program_is_named(tmp_path, ticks):
    header = header_of(versions={"steerclear": "0.9"}, sources="abcdef0123")
    path = written(tmp_path / "run.mcap", ticks, header, key=bytes.fromhex(KEY))
    for name, digits in (("boats.key", KEY), ("other.key", "22" * 32)):
        (tmp_path / name).write_text(digits)
        (tmp_path / name).chmod(0o600)
    program = "Made by steerclear 0.9, sources abcdef01. Not all is as here, and this program may decide otherwise"
    for options, wanted, words in (
        ((), 0, ("codes were not checked: give --key", program)),
        (("--key", tmp_path / "boats.key"), 0, ("codes are of this key",)),
        (
            ("--key", tmp_path / "other.key"),
            3,
            ("none of its codes is of this key: another key", "the chain itself holds"),
        ),
        (("--key", tmp_path / "none.key"), 2, ()),
    ):
        code, said = run(path, *options)
        assert code == wanted
        assert all(word in said for word in words), said


@pytest.mark.parametrize("shielded", [True, False])
def test_violations_that_happened_are_judged_and_drawn_when_asked_for(tmp_path, shielded):
    write_log(tmp_path / "x.mcap", STEPS, header=HEADER, shielded=shielded)
    files = {name: tmp_path / f"out.{name}" for name in ("html", "json")}
    code, said = run(tmp_path / "x.mcap", "--judge", "--html", files["html"], "--json", files["json"])
    assert code == 0, said
    content = json.loads(files["json"].read_text())
    assert undocumented(content, KEYS["replay"]) == []
    verdicts = {violation["verdict"] for violation in content["violations"]}
    assert verdicts == (set() if shielded else {"avoidable"})
    assert len(verdicts) == (content["violations_opponent"] + content["violations_teammate"] > 0)
    assert (content["closest_opponent_m"] > 2.5) == shielded
    assert content["files"] == [str(files["html"])]
    assert "as it was" in files["html"].read_text()
    assert "closest teammate" in said
    assert ("Violations of 2.5 m" in said) == (not shielded)
