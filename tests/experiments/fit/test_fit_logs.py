"""A CSV of steps and a black box become the runs that were driven; what cannot be fitted is refused in one line."""

import numpy as np
import pytest
from fit_logs import as_csv, drive
from logged_runs import write_log
from steerclear.experiments.fit.reading import read_box, read_logs
from steerclear.experiments.fit.runs import FitError, untold


def test_a_csv_gives_the_runs_that_were_driven(tmp_path):
    rows = drive()
    paths = [tmp_path / f"{k}.csv" for k in range(3)]
    for path in paths:
        as_csv(path, rows)
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


def test_of_a_black_box_with_several_boats_one_is_named_and_read(tmp_path):
    log = tmp_path / "run.mcap"
    header, ticks = write_log(log, 100)
    with pytest.raises(FitError, match=r"tells of boats blue_1, blue_2; name one with --boat"):
        read_logs([log])
    with pytest.raises(FitError, match="nothing of boat red_1; it has blue_1, blue_2"):
        read_logs([log], "red_1")
    (run,) = read_box(log, untold, "blue_2")
    assert run.seconds == pytest.approx(100 * header.config.dt_s, abs=0.2)
    assert run.seen[40, :2] == pytest.approx(ticks[40].fleet.state[1, :2], abs=0.3)
    assert run.told[40, 0] == pytest.approx(ticks[40].sent["blue_2"].speed_mps, abs=0.05)


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
    "another ending": ("a.txt", lambda p: p.write_text("x"), "is no log that can be read; give a .csv"),
    "knots": (
        "a.csv",
        lambda p: as_csv(p, drive() * np.array([1, 1, 1, 1, 40, 1, 1])),
        "a speed of .* m/s is no boat's; give speeds in m/s",
    ),
    "no motion": ("a.csv", still, "fewer than 3|too little motion"),
    "no log there": ("b.csv", lambda p: None, "there is no log"),
}


@pytest.mark.parametrize("case", sorted(BAD))
def test_what_cannot_be_fitted_is_refused_in_one_line(case, tmp_path):
    name, write, words = BAD[case]
    write(tmp_path / name)
    with pytest.raises(FitError, match=words) as error:
        read_logs([tmp_path / name])
    assert "\n" not in str(error.value)
