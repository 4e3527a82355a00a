"""A log is held against itself before it is fitted: what contradicts the rest is cut out and told, or refused."""

import math
import re
import struct

import fit_logs
import numpy as np
import pytest
from fit_logs import FORMATS, WRITERS, as_alog, as_csv, degrees_of, messages_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.fit.reading import read_logs
from steerclear.experiments.fit.runs import FitError

LEGS = [(2.0, 0.0), (2.0, 90.0), (0.0, 90.0), (2.0, 20.0), (1.0, 20.0), (2.0, -60.0), (0.0, -60.0), (2.0, 30.0)]


def drive(legs=LEGS):
    """Rows (time, x, y, heading, speed, told speed, told heading) of a boat that obeys 0.3 s late, from rest."""
    return fit_logs.drive(100.0, legs, delay_steps=3, begin_mps=0.0)


def as_tlog(path, rows, every=1, top=lambda t: 3.0, before_fix=0, component=None):
    """A telemetry log: commands each row, positions every so many; first some positions without a fix."""
    boat, ground = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 255, 190)
    with path.open("wb") as file:

        def put(sender, message, time_s):
            file.write(struct.pack(">Q", round(1e6 * (1.7e9 + time_s))) + bytes(message.pack(sender)))

        for k in range(before_fix):
            put(
                boat, mavlink.MAVLink_global_position_int_message(0, 0, 0, 0, 0, 0, 0, 0, 0), k / 5.0 - before_fix / 5.0
            )
        told = None
        for k, row in enumerate(rows):
            _, attitude, place, command = messages_of(row, 1)
            if top(row[0]) != told:
                told = top(row[0])
                put(boat, mavlink.MAVLink_param_value_message(b"WP_SPEED", told, 9, 1, 0), row[0])
            command.thrust = row[5] / told
            put(ground, command, row[0])
            if k % every == 0:
                put(boat, attitude, row[0])
                put(boat, place, row[0])
                if component is not None:
                    put(mavlink.MAVLink(None, 1, component), mavlink.MAVLink_global_position_int_message(
                        0, 100, 100, 0, 0, 0, 0, 0, 0), row[0])  # fmt: skip


def read(path, rows, write, **more):
    """Runs of a log of those rows, and what was told to be left out."""
    said = []
    write(path, rows, **more)
    return read_logs([path], tell=said.append), said


def test_positions_before_a_fix_are_left_out(tmp_path):
    rows = drive()
    plain, _ = read(tmp_path / "a.tlog", rows, as_tlog)
    late, _ = read(tmp_path / "b.tlog", rows, as_tlog, before_fix=40)
    ways = [sum(float(np.hypot(*np.diff(run.seen[:, :2], axis=0).T).sum()) for run in runs) for runs in (plain, late)]
    assert ways[1] == pytest.approx(ways[0], rel=1e-3)


def test_another_component_of_the_boat_does_not_move_it(tmp_path):
    rows = drive()
    plain, _ = read(tmp_path / "a.tlog", rows, as_tlog)
    mixed, said = read(tmp_path / "b.tlog", rows, as_tlog, component=191)
    assert not said
    assert np.allclose(plain[0].seen, mixed[0].seen)


@pytest.mark.parametrize("first_has_fix", [True, False])
def test_speeds_are_those_of_a_receiver_with_a_fix(first_has_fix, tmp_path):
    rows, path = drive(), tmp_path / "a.bin"
    forms = {**FORMATS, "GPS": (132, "QBBf", "TimeUS,I,Status,Spd")}
    with path.open("wb") as file:
        for name, (number, letters, columns) in forms.items():
            size = 3 + {"FMT": 86, "POS": 16, "GPS": 14}.get(name, 12)
            texts = name.encode(), letters.encode(), columns.encode()
            file.write(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, *texts))
        for time_s, x, y, heading, speed, told_speed, told_heading in rows:
            stamp, place = round(1e6 * (time_s + 100.0)), [round(1e7 * value) for value in degrees_of(x, y)]
            file.write(b"\xa3\x95" + bytes([130]) + struct.pack("<Qii", stamp, *place))
            for k, value in ((131, heading % 360.0), (133, told_speed), (134, told_heading % 360.0)):
                file.write(b"\xa3\x95" + bytes([k]) + struct.pack("<Qf", stamp, value))
            for receiver in (0, 1):
                fixed = (receiver == 0) == first_has_fix
                values = (receiver, 4 if fixed else 1, speed if fixed else 0.0)
                file.write(b"\xa3\x95" + bytes([132]) + struct.pack("<QBBf", stamp, *values))
    runs = read_logs([path])
    assert max(run.seen[:, 3].max() for run in runs) == pytest.approx(rows[:, 4].max(), abs=0.05)


def test_a_share_of_top_speed_is_of_the_parameter_that_held_then(tmp_path):
    runs, _ = read(tmp_path / "a.tlog", drive(), as_tlog, top=lambda t: 2.0 if t < 50.0 else 4.0)
    assert max(run.told[:, 0].max() for run in runs) == pytest.approx(2.0, abs=1e-3)


def test_where_the_first_parameter_is_zero_the_cruise_speed_counts(tmp_path):
    rows, path = drive(), tmp_path / "a.tlog"
    as_tlog(path, rows)
    cruise = mavlink.MAVLink_param_value_message(b"CRUISE_SPEED", 3.0, 9, 1, 0).pack(mavlink.MAVLink(None, 1, 1))
    none = mavlink.MAVLink_param_value_message(b"WP_SPEED", 0.0, 9, 1, 0).pack(mavlink.MAVLink(None, 1, 1))
    head = struct.pack(">Q", round(1e6 * 1.7e9))
    body = path.read_bytes()
    first = 8 + len(none)
    assert body[8 : 8 + 10] == none[:10].replace(none[4:5], body[12:13], 1)  # the parameter is what comes first
    path.write_bytes(head + bytes(none) + head + bytes(cruise) + body[first:])
    runs = read_logs([path])
    assert max(run.told[:, 0].max() for run in runs) == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("every", [1, 5, 9])
def test_commands_keep_their_own_times_whatever_the_rate_of_positions(every, tmp_path):
    rows = drive()
    runs, _ = read(tmp_path / "a.tlog", rows, as_tlog, every=every)
    held = {run.begin_s % 1.7e9: run.told for run in runs}

    def told_at(row):
        found = [told[k] for s, told in held.items() if 0 <= (k := round((row[0] - s) / 0.1)) < len(told)]
        return found[0] if found else None

    for k in range(20, len(rows) - 20):
        before, after = told_at(rows[k - 1]), told_at(rows[k])
        if tuple(rows[k, 5:]) != tuple(rows[k - 1, 5:]) and before is not None and after is not None:
            assert before[0] == pytest.approx(rows[k - 1, 5], abs=1e-3)
            assert after[0] == pytest.approx(rows[k, 5], abs=1e-3)
            assert abs(math.remainder(after[1] - rows[k, 6], 360.0)) < 0.01


def test_rows_too_seldom_to_tell_a_delay_are_refused(tmp_path):
    with pytest.raises(FitError, match=r"come every 0.5 s, from which no delay can be told; log them at least every"):
        read(tmp_path / "a.csv", drive()[::5], as_csv)
    with pytest.raises(FitError, match=r"positions come every 1.5 s"):
        read(tmp_path / "a.tlog", drive(), as_tlog, every=15)


UNITS = {"knots": 1.94384, "km/h": 3.6, "mph": 2.23694, "cm/s": 20.0}


@pytest.mark.parametrize("unit", sorted(UNITS))
@pytest.mark.parametrize("ending", ["csv", "alog"])
def test_speeds_in_another_unit_than_the_positions_are_refused(unit, ending, tmp_path):
    rows = drive(legs=[(speed / 2.0, heading) for speed, heading in LEGS])
    rows[:, 4] *= UNITS[unit]
    words = "is no boat's|by its speeds the boat went" if unit == "cm/s" else f"they look like {unit}"
    with pytest.raises(FitError, match=words):
        read(tmp_path / f"a.{ending}", rows, WRITERS[ending])


def broken(rows, case):
    """The rows with one thing wrong with some or all of them."""
    rows, half = rows.copy(), slice(len(rows) // 2, len(rows) // 2 + 1)
    if case == "a jump of 200 m":
        rows[half.start :, 1] += 200.0
    elif case == "one position 200 m off":
        rows[half, 2] -= 200.0
    elif case == "positions frozen":
        rows[1400:, 1:3] = rows[1400, 1:3]
    elif case == "clock set back":
        rows[half.start :, 0] -= 20.0
    elif case == "headings in radians":
        rows[:, 3] = np.radians(rows[:, 3])
    elif case == "x is north":
        rows[:, [1, 2]] = rows[:, [2, 1]]
    elif case == "headings are 90 off":
        rows[:, 3] += 90.0
    return rows


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("a jump of 200 m", "its position jumps 1 times, first at .* s, by 200 m at most; cut there"),
        ("one position 200 m off", "its position jumps .* cut there"),
        ("positions frozen", "are left out: by its speeds the boat went"),
        ("clock set back", "its clock was set back by 19.9 s; cut there"),
    ],
)
def test_what_contradicts_the_rest_is_cut_out_and_told(case, words, tmp_path):
    rows = np.concatenate([drive(), drive() + np.array([100.0, 0, 0, 0, 0, 0, 0])])
    rows[1000:, 1:3] += rows[999, 1:3] - rows[1000, 1:3]
    runs, said = read(tmp_path / "a.csv", broken(rows, case), as_csv)
    assert len(said) >= 1
    assert any(re.search(words, one) for one in said), said
    for run in runs:
        assert np.hypot(*np.diff(run.seen[:, :2], axis=0).T).max() < 0.5
        assert run.seen[:, 3].max() < 2.5


@pytest.mark.parametrize("case", ["headings in radians", "x is north", "headings are 90 off"])
def test_headings_that_are_not_the_course_are_refused(case, tmp_path):
    words = r"headings are .* deg off the course .*give headings in degrees clockwise|, 2 deg turned"
    with pytest.raises(FitError, match=words):
        read(tmp_path / "a.csv", broken(drive(), case), as_csv)


def test_a_heading_that_is_not_known_is_no_heading(tmp_path):
    rows = drive()
    rows[200:240, 3] = 655.35
    runs, _ = read(tmp_path / "a.csv", rows, as_csv)
    assert len(runs) >= 2
    for run in runs:
        assert np.abs(np.diff(run.seen[:, 2])).max() < 20.0


@pytest.mark.parametrize(
    ("legs", "words"),
    [
        ([(2.0, 0.0), (2.0, 90.0), (2.0, 30.0)], "never seen told to stop and slow down: .*way to stop is not known"),
        ([(2.0, 0.0), (1.5, 90.0), (2.0, 30.0)], "never seen told to stop and slow down"),
    ],
)
def test_a_boat_whose_stop_was_never_seen_is_refused(legs, words, tmp_path):
    with pytest.raises(FitError, match=words):
        read(tmp_path / "a.csv", drive(legs=legs), as_csv)


def test_a_boat_that_was_never_seen_to_start_is_refused(tmp_path):
    rows = drive(legs=[(2.0, 0.0), (2.0, 90.0), *[(0.0, 90.0)] * 15])
    with pytest.raises(FitError, match="never seen told to go and gain speed"):
        read(tmp_path / "a.csv", rows[40:], as_csv)


def test_files_as_other_programs_write_them_are_read(tmp_path):
    rows = drive()
    plain, _ = read(tmp_path / "plain.csv", rows, as_csv)
    text = (tmp_path / "plain.csv").read_text()
    (tmp_path / "bom.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode() + b"\r\n,,,,,,\r\n\r\n")
    assert np.allclose(read_logs([tmp_path / "bom.csv"])[0].seen, plain[0].seen)
    as_alog(tmp_path / "plain.alog", rows)
    lines = (tmp_path / "plain.alog").read_bytes().split(b"\n")
    lines.insert(9, b"0.1 NOTE somebody caf\xe9 \xff\xfe")
    (tmp_path / "odd.alog").write_bytes(b"\n".join(lines))
    assert np.allclose(read_logs([tmp_path / "odd.alog"])[0].seen, read_logs([tmp_path / "plain.alog"])[0].seen)
