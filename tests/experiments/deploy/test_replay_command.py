"""`steerclear replay`: what it proves, and that logs that were tampered with are never called proved."""

import dataclasses
import json
import os

import numpy as np
import pytest
from forged_logs import read_records, write_records
from json_keys import KEYS, undocumented
from logged_runs import Encounter, header_of, write_log
from steerclear.experiments.cli import app
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.blackbox import McapWriter
from typer.testing import CliRunner

STEPS = 160
KEY = "11" * 32
HEADER = header_of(ShieldConfig())


def write(path, ticks, header=HEADER, **more):
    writer = McapWriter(path, header, flush_s=0.0, capacity=STEPS + 10, **more)
    for tick in ticks:
        writer.take(tick)
    writer.close()
    assert writer.fault == ""
    return path


@pytest.fixture(scope="module")
def ticks():
    made = list(Encounter(HEADER, STEPS))
    assert any(tick.decisions.intervened.any() for tick in made), "otherwise these tests prove nothing"
    return made


@pytest.fixture(scope="module")
def log(tmp_path_factory, ticks):
    return write(tmp_path_factory.mktemp("logs") / "run.mcap", ticks)


def run(*arguments):
    result = CliRunner().invoke(app, ["replay", *map(str, arguments)], terminal_width=200)
    return result.exit_code, " ".join(result.output.split())


def lied(tick, by_m=1.0):
    decisions = dataclasses.replace(tick.decisions, safety_margin_m=tick.decisions.safety_margin_m + by_m)
    return dataclasses.replace(tick, decisions=decisions)


def sent_as(tick, change):
    return dataclasses.replace(tick, sent={name: dataclasses.replace(s, **change(s)) for name, s in tick.sent.items()})


def bare(ticks, numbers=range(STEPS)):
    return [dataclasses.replace(tick, decisions=None) if tick.number in numbers else tick for tick in ticks]


WRITTEN_ANEW = {
    "nothing": (
        lambda ticks: ticks,
        (0,),
        ("160 of 160 decisions made again, the same bit for bit.", "own boats blue_1, blue_2", "2026-09-21", "slow"),
    ),
    "a lie in the last bits": (
        lambda ticks: [lied(tick, 1e-12) if tick.number == 30 else tick for tick in ticks],
        (1,),
        ("159 of 160 decisions are the same, 1 differ", "First difference: turn 30 at 3.00 s, blue_1, safety_margin_m"),
    ),
    "a tick dropped and every later decision forged": (
        lambda ticks: [*ticks[:29], *map(lied, ticks[30:])],
        (3,),
        (
            f"{STEPS - 30} differ after turns missing from the log and are not proved (1 gaps)",
            "1 turns are missing from the log",
            "NOT PROVED",
        ),
    ),
    "a tick dropped": (lambda ticks: ticks[:29] + ticks[30:], (3,), ("1 turns are missing from the log",)),
    "the first ticks left out": (lambda ticks: ticks[10:], (3,), ("10 turns are missing from the log",)),
    "speeds of the links altered, the chain made anew": (
        lambda ticks: [sent_as(tick, lambda _: {"speed_mps": 0.7}) for tick in ticks],
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
    "a turn that stands twice": (lambda ticks: [*ticks[:20], ticks[19], *ticks[20:]], (3,), ("1 times they go back",)),
    "commands an autopilot cut": (
        lambda ticks: [
            sent_as(tick, lambda one: {"speed_mps": min(one.speed_mps, 0.5), "limit_mps": 0.5}) for tick in ticks
        ],
        (0,),
        ("blue_1: its autopilot's limit of 0.5 m/s cut",),
    ),
}
"""What is done to the ticks before they are written, the exit status, and what is said."""


@pytest.mark.parametrize("name", WRITTEN_ANEW)
def test_a_log_that_was_written_anew_is_told_for_what_it_is(tmp_path, ticks, name):
    forge, codes, words = WRITTEN_ANEW[name]
    code, said = run(write(tmp_path / "x.mcap", forge(ticks)))
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
    ("change", "words"),
    [
        (lambda data: data + data, "after its end more bytes follow"),
        (lambda data: data + b"\0", "after its end more bytes follow"),
        (lambda data: data[:-1], "from some point on it makes no sense"),
    ],
)
def test_a_file_with_more_or_less_than_was_written_is_not_proved(tmp_path, log, change, words):
    (tmp_path / "x.mcap").write_bytes(change(log.read_bytes()))
    code, said = run(tmp_path / "x.mcap")
    assert code == 3
    assert words in said
    assert "NOT PROVED" in said


def test_a_log_that_was_killed_is_told_as_such_not_as_forged(tmp_path, log):
    whole, path = log.read_bytes(), tmp_path / "x.mcap"
    for cut in (
        len(whole) // 2,
        len(whole) // 2 + 5,
        len(whole) // 2 + 11,
    ):  # within the head of a record, and its body
        path.write_bytes(whole[:cut])
        code, said = run(path)
        assert code == 0, said
        assert "not closed (crash, power or kill)" in said
        assert "Hash chain: verified up to where the log ends. It carries no codes" in said


def test_a_log_in_which_nothing_was_decided_proves_nothing(tmp_path):
    class Nobody(Encounter):
        def fleet(self, number):
            return dataclasses.replace(super().fleet(number), controlled=np.zeros(4, dtype=bool))

    stopped = list(Nobody(HEADER, 20, edit=lambda tick: sent_as(tick, lambda _: {"speed_mps": 0.0})))
    code, said = run(write(tmp_path / "x.mcap", stopped))
    assert code == 3
    assert "No boat was covered: nothing is proved" in said
    write_log(tmp_path / "y.mcap", 3, edit=lambda tick: dataclasses.replace(tick, fleet=None, decisions=None))
    code, said = run(tmp_path / "y.mcap")
    assert code == 3
    assert "no decision of the shield: nothing is proved" in said
    assert run(tmp_path / "y.mcap", "--judge")[0] == 2


def test_codes_are_checked_with_the_key(tmp_path, ticks):
    path = write(tmp_path / "run.mcap", ticks, key=bytes.fromhex(KEY))
    for name, digits in (("boats.key", KEY), ("other.key", "22" * 32)):
        (tmp_path / name).write_text(digits)
        (tmp_path / name).chmod(0o600)
    for options, wanted, words in (
        ((), 0, "codes were not checked: give --key"),
        (("--key", tmp_path / "boats.key"), 0, "codes are of this key"),
        (("--key", tmp_path / "other.key"), 3, "is not of this key"),
        (("--key", tmp_path / "none.key"), 2, ""),
    ):
        code, said = run(path, *options)
        assert code == wanted
        assert words in said


def test_a_log_of_another_program_says_so_though_all_is_the_same(tmp_path, ticks):
    header = header_of(ShieldConfig(), versions={"steerclear": "0.9"}, sources="abcdef0123")
    code, said = run(write(tmp_path / "x.mcap", ticks, header))
    assert code == 0
    assert "Made by steerclear 0.9, sources abcdef01. Not all is as here, and this program may decide otherwise" in said


@pytest.mark.parametrize("shielded", [True, False])
def test_breaches_that_happened_are_judged_and_drawn_when_asked_for(tmp_path, shielded):
    write_log(tmp_path / "x.mcap", STEPS, header=HEADER, shielded=shielded)
    files = {name: tmp_path / f"out.{name}" for name in ("html", "json")}
    code, said = run(tmp_path / "x.mcap", "--judge", "--html", files["html"], "--json", files["json"])
    assert code == 0, said
    content = json.loads(files["json"].read_text())
    assert undocumented(content, KEYS["replay"]) == []
    verdicts = {breach["verdict"] for breach in content["breaches"]}
    assert verdicts == (set() if shielded else {"avoidable"})
    assert len(verdicts) == (content["breaches_opponent"] + content["breaches_teammate"] > 0)
    assert (content["closest_opponent_m"] > 2.5) == shielded
    assert content["files"] == [str(files["html"])]
    assert "as it was" in files["html"].read_text()
    assert "closest teammate" in said
    assert ("Breaches of 2.5 m" in said) == (not shielded)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot open"),
        (b"not a log", "holds no header of a steerclear log"),
        (b"", "holds no header"),
        ("pipe", "it is no plain file"),
    ],
)
def test_bad_input_is_one_line_and_2_and_a_pipe_is_not_waited_for(tmp_path, content, words):
    path = tmp_path / "x.mcap"
    if content == "pipe":
        os.mkfifo(path)
    elif content is not None:
        path.write_bytes(content)
    code, said = run(path)
    assert code == 2
    assert words in said
