"""Logs that were tampered with: `steerclear replay` never calls them proved, and says what is wrong with them."""

import dataclasses
import json
import os

import numpy as np
import pytest
from forged_logs import read_records, write_records
from logged_runs import Encounter, header_of
from steerclear.experiments.cli import app
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.blackbox import McapWriter
from typer.testing import CliRunner

STEPS = 120
KEY = "11" * 32


def write(path, ticks, header=None, **more):
    writer = McapWriter(path, header or header_of(ShieldConfig()), flush_s=0.0, capacity=STEPS + 10, **more)
    for tick in ticks:
        writer.take(tick)
    writer.close()
    assert writer.fault == ""
    return path


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(header_of(ShieldConfig()), STEPS))


@pytest.fixture(scope="module")
def log(tmp_path_factory, ticks):
    return write(tmp_path_factory.mktemp("logs") / "run.mcap", ticks)


def run(*arguments):
    result = CliRunner().invoke(app, ["replay", *map(str, arguments)], terminal_width=200)
    return result.exit_code, " ".join(result.output.split())


def lied(tick, from_number=30):
    if tick.number < from_number:
        return tick
    decisions = dataclasses.replace(tick.decisions, safety_margin_m=tick.decisions.safety_margin_m + 1.0)
    return dataclasses.replace(tick, decisions=decisions)


def sent_at(tick, speed_mps):
    return dataclasses.replace(
        tick, sent={name: dataclasses.replace(sent, speed_mps=speed_mps) for name, sent in tick.sent.items()}
    )


def without(ticks, *numbers):
    return [tick for tick in ticks if tick.number not in numbers]


def bare(ticks, numbers=range(STEPS)):
    return [dataclasses.replace(tick, decisions=None) if tick.number in numbers else tick for tick in ticks]


def cut(ticks):
    """As an autopilot whose limit is 0.5 m/s was told."""
    return [
        dataclasses.replace(
            tick,
            sent={
                name: dataclasses.replace(one, speed_mps=min(one.speed_mps, 0.5), limit_mps=0.5)
                for name, one in tick.sent.items()
            },
        )
        for tick in ticks
    ]


WRITTEN_ANEW = {
    "a tick dropped and every later decision forged": (
        lambda ticks: [lied(tick) for tick in without(ticks, 29)],
        (3,),
        (f"{STEPS - 30} differ after missing ticks and are not proved (1 gaps)", "1 turns are missing", "NOT PROVED"),
    ),
    "a tick dropped": (lambda ticks: without(ticks, 29), (3,), ("1 turns are missing",)),
    "the first ticks left out": (lambda ticks: ticks[10:], (3,), ("10 turns are missing",)),
    "speeds of the links altered, the chain made anew": (
        lambda ticks: [sent_at(tick, 0.7) for tick in ticks],
        (1,),
        (
            f"{2 * STEPS} commands are not what was decided",
            "First of them: tick 0 at 0.00 s, blue_1, speed: decided 2.0",
        ),
    ),
    "no decisions": (
        bare,
        (3,),
        ("no decision of the shield: nothing is proved", f"{2 * STEPS} were sent without a decision"),
    ),
    "decisions left out in between": (lambda ticks: bare(ticks, (60, 61)), (1, 3), ("4 were sent without a decision",)),
    "a turn that stands twice": (lambda ticks: [*ticks[:20], ticks[19], *ticks[20:]], (3,), ("1 times they go back",)),
    "commands an autopilot cut": (cut, (0,), ("blue_1: its autopilot's limit of 0.5 m/s cut",)),
    "nothing": (lambda ticks: ticks, (0,), ("the same bit for bit", f"{STEPS} ticks")),
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
        ("The log is not as it was written: its end was cut off and the file closed again", "the same bit for bit"),
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
    code, said = run(write_records(tmp_path / "x.mcap", forge(read_records(log))))
    assert code == wanted
    assert all(word in said for word in words), said


def test_a_log_in_which_no_boat_was_decided_for_proves_nothing(tmp_path):
    class Nobody(Encounter):
        def fleet(self, number):
            seen = super().fleet(number)
            return dataclasses.replace(seen, controlled=np.zeros(4, dtype=bool))

    stopped = list(Nobody(header_of(ShieldConfig()), 20, edit=lambda tick: sent_at(tick, 0.0)))
    code, said = run(write(tmp_path / "x.mcap", stopped))
    assert code == 3
    assert "No boat was covered: nothing is proved" in said


def test_a_log_that_was_killed_is_told_as_such_and_not_as_forged(tmp_path, log):
    whole = log.read_bytes()
    for cut in range(len(whole) // 2, len(whole) // 2 + 12):  # within the head of a record, and its body
        (tmp_path / "x.mcap").write_bytes(whole[:cut])
        code, said = run(tmp_path / "x.mcap")
        assert code == 0, said
        assert "not closed (crash, power or kill)" in said
        assert "not as it was written" not in said


def test_codes_are_checked_with_the_key(tmp_path, ticks):
    path = write(tmp_path / "run.mcap", ticks, key=bytes.fromhex(KEY))
    for name, digits in (("boats.key", KEY), ("other.key", "22" * 32)):
        (tmp_path / name).write_text(digits)
        (tmp_path / name).chmod(0o600)
    code, said = run(path)
    assert code == 0
    assert "codes were not checked: give --key" in said
    code, said = run(path, "--key", tmp_path / "boats.key")
    assert code == 0
    assert "codes are of this key" in said
    code, said = run(path, "--key", tmp_path / "other.key")
    assert code == 3
    assert "is not of this key" in said
    assert run(path, "--key", tmp_path / "none.key")[0] == 2


def test_a_log_of_another_program_says_so_though_all_is_the_same(tmp_path, ticks):
    header = header_of(ShieldConfig(), versions={"steerclear": "0.9"}, sources="abcdef0123")
    code, said = run(write(tmp_path / "x.mcap", ticks, header))
    assert code == 0
    assert "Made by steerclear 0.9, sources abcdef01. Not all is as here, and this program may decide otherwise" in said


def test_the_json_says_all_of_it(tmp_path, log):
    records = read_records(log)
    forged = write_records(tmp_path / "x.mcap", records[: len(records) // 2])
    run(forged, "--json", tmp_path / "out.json")
    content = json.loads((tmp_path / "out.json").read_text())
    assert content["proved"] is False
    assert content["chain"]["chained"] is True
    assert content["chain"]["broken"] == len(content["chain"]["breaks"]) == 1
    assert content["strayed"] == content["unfounded"] == 0
    assert content["first_sent"] is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data + data, "after its end more bytes follow"),
        (lambda data: data + b"\0", "after its end more bytes follow"),
        (lambda data: data[:-1], "from some point on it makes no sense"),
    ],
)
def test_a_file_with_more_or_less_than_was_written_is_not_proved(tmp_path, log, change, words):
    path = tmp_path / "x.mcap"
    path.write_bytes(change(log.read_bytes()))
    code, said = run(path)
    assert code == 3
    assert words in said
    assert "NOT PROVED" in said


def test_a_pipe_is_no_log_and_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.mcap")
    code, said = run(tmp_path / "pipe.mcap")
    assert code == 2
    assert "it is no plain file" in said
