"""Logs of every kind become the same runs; what contradicts the rest is cut out, what says too little is refused."""

import math
import re
import struct

import numpy as np
import pytest
from fit_logs import WRITERS, as_alog, as_bin, as_csv, as_tlog, drive
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.fit.reading import read_logs
from steerclear.experiments.fit.runs import FitError


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_a_log_of_any_kind_gives_the_runs_that_were_driven(ending, tmp_path):
    rows = drive()
    paths = [tmp_path / f"{k}.{ending}" for k in range(3)]
    for path in paths:
        WRITERS[ending](path, rows)
    runs = read_logs(paths)
    assert len(runs) == 3
    for run in runs:
        assert run.seconds == pytest.approx(36.0, abs=0.5)
        k = np.arange(0, len(run.seen) - 5, 10)
        seen, driven = run.seen[k], rows[k]
        shift = seen[0, :2] - driven[0, 1:3]  # places from the log's own origin
        assert np.abs(seen[:, :2] - shift - driven[:, 1:3]).max() < 0.3
        assert np.abs((seen[:, 2] - driven[:, 3] + 180.0) % 360.0 - 180.0).max() < 12.0  # a row early or late
        assert np.abs(run.commanded[k, 0] - driven[:, 5]).mean() < 0.06


def test_of_a_log_with_several_boats_one_is_named(tmp_path):
    as_tlog(tmp_path / "two.tlog", drive(20.0), systems=(1, 4))
    with pytest.raises(FitError, match=r"tells of boats 1, 4; name one with --system-id"):
        read_logs([tmp_path / "two.tlog"])
    with pytest.raises(FitError, match="nothing of boat 9; it has 1, 4"):
        read_logs([tmp_path / "two.tlog"], system_id=9)


def still(path):
    as_csv(path, np.column_stack([np.arange(0.0, 60.0, 0.1), *np.zeros((6, 600))]))


BAD = {
    "no column": ("a.csv", lambda p: p.write_text("t_s,x_m\n0,1\n"), r"no column for y \(north\); name one y_m or"),
    "no number": ("a.csv", lambda p: as_csv(p, []), "has no rows"),
    "a word": (
        "a.csv",
        lambda p: p.write_text("t_s,x_m,y_m,heading_deg,speed_mps,cmd_speed,cmd_heading_deg\n0,1,2,3,fast,5,6\n"),
        "line 2: a value is missing or no number",
    ),
    "empty": ("a.csv", lambda p: p.write_text(""), "is empty"),
    "bytes": ("a.csv", lambda p: p.write_bytes(b"\xff\xfe\x00\x01"), "is no CSV"),
    "another ending": ("a.txt", lambda p: p.write_text("x"), "is no log that can be read; give .csv"),
    "knots": (
        "a.csv",
        lambda p: as_csv(p, drive() * np.array([1, 1, 1, 1, 40, 1, 1])),
        "a speed of .* m/s is no boat's; give speeds in m/s",
    ),
    "no motion": ("a.csv", still, "fewer than 3|too little motion"),
    "MOOS without commands": (
        "a.alog",
        lambda p: p.write_text("".join(f"{k} NAV_X s 1\n{k} NAV_Y s 1\n" for k in range(9))),
        r"tells no headings \(NAV_HEADING\), no speeds .*give a log in which the boat was commanded",
    ),
    "ArduPilot without nav tuning": (
        "a.bin",
        lambda p: as_bin(p, drive(10.0), ("NTUN",)),
        r"tells no headings commanded \(NTUN.DesYaw\)",
    ),
    "no MAVLink": ("a.tlog", lambda p: p.write_bytes(b"nothing of the kind" * 50), "tells no positions|cannot be read"),
    "no log there": ("b.csv", lambda p: None, "there is no log .*; give the path of one"),
}


@pytest.mark.parametrize("case", sorted(BAD))
def test_what_cannot_be_fitted_is_refused_in_one_line(case, tmp_path):
    name, write, words = BAD[case]
    write(tmp_path / name)
    with pytest.raises(FitError, match=words) as error:
        read_logs([tmp_path / name])
    assert "\n" not in str(error.value)


LEGS = [(2.0, 0.0), (2.0, 90.0), (0.0, 90.0), (2.0, 20.0), (1.0, 20.0), (2.0, -60.0), (0.0, -60.0), (2.0, 30.0)]


def long_drive(legs=LEGS):
    """Rows of a boat that obeys 0.3 s late, from rest."""
    return drive(100.0, legs, delay_steps=3, begin_mps=0.0)


def read(path, rows, write, **more):
    """Runs of a log of those rows, and what was told to be left out."""
    said = []
    write(path, rows, **more)
    return read_logs([path], notice=said.append), said


def test_positions_before_a_fix_are_left_out(tmp_path):
    rows = long_drive()
    plain, _ = read(tmp_path / "a.tlog", rows, as_tlog)
    late, _ = read(tmp_path / "b.tlog", rows, as_tlog, before_fix=40)
    ways = [sum(float(np.hypot(*np.diff(run.seen[:, :2], axis=0).T).sum()) for run in runs) for runs in (plain, late)]
    assert ways[1] == pytest.approx(ways[0], rel=1e-3)


def test_another_component_and_commands_to_another_boat_do_not_move_it(tmp_path):
    rows = long_drive()
    plain, _ = read(tmp_path / "a.tlog", rows, as_tlog)
    mixed, said = read(tmp_path / "b.tlog", rows, as_tlog, component=191)
    assert not said
    assert np.allclose(plain[0].seen, mixed[0].seen)
    assert np.allclose(plain[0].commanded, mixed[0].commanded)


@pytest.mark.parametrize("receivers", [(True, False), (False, True)])
def test_speeds_are_those_of_a_receiver_with_a_fix(receivers, tmp_path):
    rows = long_drive()
    runs, _ = read(tmp_path / "a.bin", rows, as_bin, receivers=receivers)
    assert max(run.seen[:, 3].max() for run in runs) == pytest.approx(rows[:, 4].max(), abs=0.05)


def test_a_share_of_top_speed_is_of_the_parameter_that_held_then(tmp_path):
    runs, _ = read(tmp_path / "a.tlog", long_drive(), as_tlog, top=lambda t: 2.0 if t < 50.0 else 4.0)
    assert max(run.commanded[:, 0].max() for run in runs) == pytest.approx(2.0, abs=1e-3)


def test_where_the_first_parameter_is_zero_the_cruise_speed_counts(tmp_path):
    rows, path = long_drive(), tmp_path / "a.tlog"
    as_tlog(path, rows)
    cruise = mavlink.MAVLink_param_value_message(b"CRUISE_SPEED", 3.0, 9, 1, 0).pack(mavlink.MAVLink(None, 1, 1))
    none = mavlink.MAVLink_param_value_message(b"WP_SPEED", 0.0, 9, 1, 0).pack(mavlink.MAVLink(None, 1, 1))
    head = struct.pack(">Q", round(1e6 * 1.7e9))
    body = path.read_bytes()
    first = 8 + len(none)
    assert body[8 : 8 + 10] == none[:10].replace(none[4:5], body[12:13], 1)  # the parameter is what comes first
    path.write_bytes(head + bytes(none) + head + bytes(cruise) + body[first:])
    runs = read_logs([path])
    assert max(run.commanded[:, 0].max() for run in runs) == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("every", [1, 5, 9])
def test_commands_keep_their_own_times_whatever_the_rate_of_positions(every, tmp_path):
    rows = long_drive()
    runs, _ = read(tmp_path / "a.tlog", rows, as_tlog, every=every)
    held = {run.begin_s % 1.7e9: run.commanded for run in runs}

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
    with pytest.raises(FitError, match=r"come every 0.5 s, from which no delay can be found; log them at least every"):
        read(tmp_path / "a.csv", long_drive()[::5], as_csv)
    with pytest.raises(FitError, match=r"positions come every 1.5 s"):
        read(tmp_path / "a.tlog", long_drive(), as_tlog, every=15)


UNITS = {"knots": 1.94384, "km/h": 3.6, "mph": 2.23694, "cm/s": 20.0}


@pytest.mark.parametrize("unit", sorted(UNITS))
@pytest.mark.parametrize("ending", ["csv", "alog"])
def test_speeds_in_another_unit_than_the_positions_are_refused(unit, ending, tmp_path):
    rows = long_drive(legs=[(speed / 2.0, heading) for speed, heading in LEGS])
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
        ("a jump of 200 m", "its position jumps 1 time, first at .* s, by 200 m at most; cut there"),
        ("one position 200 m off", "its position jumps .* cut there"),
        ("positions frozen", "are left out: by its speeds the boat went"),
        ("clock set back", "its clock was set back by 19.9 s; cut there"),
    ],
)
def test_what_contradicts_the_rest_is_cut_out_and_told(case, words, tmp_path):
    rows = np.concatenate([long_drive(), long_drive() + np.array([100.0, 0, 0, 0, 0, 0, 0])])
    rows[1000:, 1:3] += rows[999, 1:3] - rows[1000, 1:3]
    runs, said = read(tmp_path / "a.csv", broken(rows, case), as_csv)
    assert len(said) >= 1
    assert any(re.search(words, one) for one in said), said
    for run in runs:
        assert np.hypot(*np.diff(run.seen[:, :2], axis=0).T).max() < 0.5
        assert run.seen[:, 3].max() < 2.5
    assert case != "clock set back" or sum(run.seconds for run in runs) > 190.0, "no time was told twice"


@pytest.mark.parametrize("case", ["headings in radians", "x is north", "headings are 90 off"])
def test_headings_that_are_not_the_course_are_refused(case, tmp_path):
    words = r"headings are .* deg off the course .*give headings in degrees clockwise|, 2 deg turned"
    with pytest.raises(FitError, match=words):
        read(tmp_path / "a.csv", broken(long_drive(), case), as_csv)


def test_a_heading_that_is_not_known_is_no_heading(tmp_path):
    rows = long_drive()
    rows[200:240, 3] = 655.35
    runs, _ = read(tmp_path / "a.csv", rows, as_csv)
    assert len(runs) >= 2
    for run in runs:
        assert np.abs(np.diff(run.seen[:, 2])).max() < 20.0


@pytest.mark.parametrize(
    ("legs", "words"),
    [
        ([(2.0, 0.0), (2.0, 90.0), (2.0, 30.0)], "never seen commanded to stop and slow down: .*way to stop is not"),
        ([(2.0, 0.0), (1.5, 90.0), (2.0, 30.0)], "never seen commanded to stop and slow down"),
    ],
)
def test_a_boat_whose_stop_was_never_seen_is_refused(legs, words, tmp_path):
    with pytest.raises(FitError, match=words):
        read(tmp_path / "a.csv", long_drive(legs=legs), as_csv)


def test_a_boat_that_was_never_seen_to_start_is_refused(tmp_path):
    rows = long_drive(legs=[(2.0, 0.0), (2.0, 90.0), *[(0.0, 90.0)] * 15])
    with pytest.raises(FitError, match="never seen commanded to go and gain speed"):
        read(tmp_path / "a.csv", rows[40:], as_csv)


def test_files_as_other_programs_write_them_are_read(tmp_path):
    rows = long_drive()
    plain, _ = read(tmp_path / "plain.csv", rows, as_csv)
    text = (tmp_path / "plain.csv").read_text()
    (tmp_path / "bom.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode() + b"\r\n,,,,,,\r\n\r\n")
    assert np.allclose(read_logs([tmp_path / "bom.csv"])[0].seen, plain[0].seen)
    as_alog(tmp_path / "plain.alog", rows)
    lines = (tmp_path / "plain.alog").read_bytes().split(b"\n")
    lines.insert(9, b"0.1 NOTE somebody caf\xe9 \xff\xfe")
    (tmp_path / "odd.alog").write_bytes(b"\n".join(lines))
    assert np.allclose(read_logs([tmp_path / "odd.alog"])[0].seen, read_logs([tmp_path / "plain.alog"])[0].seen)
