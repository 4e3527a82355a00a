"""Logs of every kind become the same runs, and what cannot be fitted is refused in one line."""

import numpy as np
import pytest
from fit_logs import WRITERS, as_bin, as_csv, as_tlog, drive
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
        assert np.abs(run.told[k, 0] - driven[:, 5]).mean() < 0.06


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
    "no log there": ("b.csv", lambda p: None, "there is no log"),
}


@pytest.mark.parametrize("case", sorted(BAD))
def test_what_cannot_be_fitted_is_refused_in_one_line(case, tmp_path):
    name, write, words = BAD[case]
    write(tmp_path / name)
    with pytest.raises(FitError, match=words) as error:
        read_logs([tmp_path / name])
    assert "\n" not in str(error.value)
