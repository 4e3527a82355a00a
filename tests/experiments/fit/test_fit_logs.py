"""Logs of every kind become the same runs, and what cannot be fitted is refused in one line."""

import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.fit.errors import FitError
from steerclear.experiments.fit.reading import read_logs
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

ORIGIN = (42.0, -71.0)
EARTH_M = 6378137.0


def drive(seconds=36.0, delay_steps=2):
    """Rows (time, x, y, heading, speed, told speed, told heading) of a rover: turns both ways, a stop, a start."""
    params, row = get_platform("ardurover_boat").pack(), fresh_state(0.0, 0.0, 0.0, 2.0)
    told = [(2.0, 0.0), (2.0, 90.0), (1.0, 20.0), (2.5, -60.0), (0.0, -60.0), (2.0, 30.0)]
    rows, commands = [], [told[0]] * delay_steps
    for k in range(round(seconds / 0.1)):
        now = told[min(len(told) - 1, int(k * 0.1 / 6.0))]
        rows.append((0.1 * k, row[L.X], row[L.Y], row[L.HEADING], row[L.SPEED], *now))
        commands.append(now)
        speed, heading = commands.pop(0)
        step_boat(params, row, speed, math.remainder(heading - row[L.HEADING], 360.0), 0.1)
    return np.array(rows)


def as_csv(path, rows):
    head = "t_s,x_m,y_m,heading_deg,speed_mps,told_speed_mps,told_heading_deg\n"
    path.write_text(head + "".join(",".join(f"{value:.6f}" for value in row) + "\n" for row in rows))


def as_alog(path, rows):
    names = ("NAV_X", "NAV_Y", "NAV_HEADING", "NAV_SPEED", "DESIRED_SPEED", "DESIRED_HEADING")
    lines = ["%% LOG FILE: made by a test", "0.0 APP_STARTED pLogger yes"]
    for row in rows:
        lines += [f"{row[0]:.3f} {name} src {value:.6f}" for name, value in zip(names, row[1:], strict=True)]
    path.write_text("\n".join(lines) + "\n")


def degrees_of(x_m, y_m):
    north = ORIGIN[0] + math.degrees(y_m / EARTH_M)
    return north, ORIGIN[1] + math.degrees(x_m / EARTH_M / math.cos(math.radians(ORIGIN[0])))


def as_tlog(path, rows, systems=(1,)):
    boat, ground = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 255, 190)
    with path.open("wb") as file:
        for row in rows:
            for system in systems:
                boat.srcSystem = system
                for message in messages_of(row, system):
                    mav = ground if message.get_type().startswith("SET") else boat
                    file.write(struct.pack(">Q", int(1e6 * (1.7e9 + row[0]))) + bytes(message.pack(mav)))


def messages_of(row, system):
    _, x, y, heading, speed, told_speed, told_heading = row
    latitude, longitude = degrees_of(x, y)
    yaw, half = math.radians(heading), math.radians(told_heading) / 2.0
    north, east = speed * math.cos(yaw), speed * math.sin(yaw)
    place = [round(1e7 * latitude), round(1e7 * longitude), 0, 0, round(100 * north), round(100 * east), 0]
    return [
        mavlink.MAVLink_param_value_message(b"WP_SPEED", 3.0, 9, 1, 0),
        mavlink.MAVLink_attitude_message(0, 0.0, 0.0, yaw, 0.0, 0.0, 0.0),
        mavlink.MAVLink_global_position_int_message(0, *place, round(100 * (heading % 360.0)) % 36000),
        mavlink.MAVLink_set_attitude_target_message(
            0, system, 1, 7, [math.cos(half), 0, 0, math.sin(half)], 0, 0, 0, told_speed / 3.0
        ),
    ]


FORMATS = {  # name: (type, format, columns)
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "POS": (130, "QLL", "TimeUS,Lat,Lng"),
    "ATT": (131, "Qf", "TimeUS,Yaw"),
    "GPS": (132, "Qf", "TimeUS,Spd"),
    "THR": (133, "Qf", "TimeUS,DesSpeed"),
    "NTUN": (134, "Qf", "TimeUS,DesYaw"),
}


def as_bin(path, rows, left_out=()):
    """An ArduPilot log: formats first, then the messages."""
    with path.open("wb") as file:
        for name, (number, letters, columns) in FORMATS.items():
            size = 3 + (86 if name == "FMT" else 8 + (8 if name == "POS" else 4))
            texts = name.encode(), letters.encode(), columns.encode()
            file.write(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, *texts))
        for time_s, x, y, heading, speed, told_speed, told_heading in rows:
            latitude, longitude = degrees_of(x, y)
            stamp = int(1e6 * (time_s + 100.0))
            place = struct.pack("<Qii", stamp, round(1e7 * latitude), round(1e7 * longitude))
            file.write(b"\xa3\x95" + bytes([130]) + place)
            values = {"ATT": heading % 360.0, "GPS": speed, "THR": told_speed, "NTUN": told_heading % 360.0}
            for name, value in values.items():
                if name not in left_out:
                    file.write(b"\xa3\x95" + bytes([FORMATS[name][0]]) + struct.pack("<Qf", stamp, value))


WRITERS = {"csv": as_csv, "alog": as_alog, "tlog": as_tlog, "bin": as_bin}


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
