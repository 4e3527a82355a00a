"""Logs of every kind that tests write, of a simulated boat that was driven."""

import math
import struct

import numpy as np
from logged_runs import START_S, header_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.blackbox import McapWriter
from steerclear.shield.bridge.messages import BoatReading, Sent, Tick
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

ORIGIN = (42.0, -71.0)
EARTH_M = 6378137.0


LEGS = [(2.0, 0.0), (2.0, 90.0), (1.0, 20.0), (2.5, -60.0), (0.0, -60.0), (2.0, 30.0)]


def drive(seconds=36.0, legs=LEGS, delay_steps=2, begin_mps=2.0):
    """Rows (time, x, y, heading, speed, told speed, told heading) of a rover: legs of 6 s, obeyed so much later."""
    params, row = get_platform("ardurover_boat").pack(), fresh_state(0.0, 0.0, 0.0, begin_mps)
    rows, commands = [], [legs[0]] * delay_steps
    for k in range(round(seconds / 0.1)):
        now = legs[int(k * 0.1 / 6.0) % len(legs)]
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


def as_tlog(path, rows, systems=(1,), every=1, top=lambda time_s: 3.0, before_fix=0, component=None):
    """A telemetry log: commands each row, positions every so many, WP_SPEED where it changes.

    First some positions without a fix; another component is elsewhere, and another boat is told to stop.
    """
    boat, ground = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 255, 190)
    told = None
    with path.open("wb") as file:

        def put(sender, message, time_s):
            file.write(struct.pack(">Q", round(1e6 * (1.7e9 + time_s))) + bytes(message.pack(sender)))

        for k in range(before_fix):
            put(boat, place_message(0, 0), (k - before_fix) / 5.0)
        for k, row in enumerate(rows):
            for system in systems:
                boat.srcSystem = system
                attitude, place, command = messages_of(row, system, top(row[0]))
                if top(row[0]) != told:
                    told = top(row[0])
                    put(boat, mavlink.MAVLink_param_value_message(b"WP_SPEED", told, 9, 1, 0), row[0])
                if component is not None:
                    put(ground, messages_of((*row[:5], 0.0, 0.0), 9, 3.0)[2], row[0])
                put(ground, command, row[0])
                if k % every == 0:
                    put(boat, attitude, row[0])
                    put(boat, place, row[0])
                    if component is not None:
                        put(mavlink.MAVLink(None, 1, component), place_message(100, 100), row[0])


def place_message(latitude, longitude, *more):
    return mavlink.MAVLink_global_position_int_message(0, latitude, longitude, 0, 0, *(more or (0, 0, 0, 0)))


def messages_of(row, system, top_mps):
    _, x, y, heading, speed, told_speed, told_heading = row
    latitude, longitude = degrees_of(x, y)
    yaw, half = math.radians(heading), math.radians(told_heading) / 2.0
    velocity = round(100 * speed * math.cos(yaw)), round(100 * speed * math.sin(yaw)), 0
    q, thrust = [math.cos(half), 0, 0, math.sin(half)], told_speed / top_mps
    return [
        mavlink.MAVLink_attitude_message(0, 0.0, 0.0, yaw, 0.0, 0.0, 0.0),
        place_message(round(1e7 * latitude), round(1e7 * longitude), *velocity, round(100 * (heading % 360.0)) % 36000),
        mavlink.MAVLink_set_attitude_target_message(0, system, 1, 7, q, 0, 0, 0, thrust),
    ]


FORMATS = {  # name: (type, format, columns)
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "POS": (130, "QLL", "TimeUS,Lat,Lng"),
    "ATT": (131, "Qf", "TimeUS,Yaw"),
    "GPS": (132, "Qf", "TimeUS,Spd"),
    "THR": (133, "Qf", "TimeUS,DesSpeed"),
    "NTUN": (134, "Qf", "TimeUS,DesYaw"),
}


def as_bin(path, rows, left_out=(), receivers=()):
    """An ArduPilot log: formats first, then the messages; of several GPS ``receivers``, which has a fix."""
    forms = {**FORMATS, "GPS": (132, "QBBf", "TimeUS,I,Status,Spd")} if receivers else FORMATS
    with path.open("wb") as file:
        for name, (number, letters, columns) in forms.items():
            size = 3 + {"FMT": 86, "POS": 16, "GPS": 14 if receivers else 12}.get(name, 12)
            texts = name.encode(), letters.encode(), columns.encode()
            file.write(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, *texts))
        for time_s, x, y, heading, speed, told_speed, told_heading in rows:
            stamp, place = round(1e6 * (time_s + 100.0)), [round(1e7 * value) for value in degrees_of(x, y)]
            said = [(130, "<Qii", *place), (131, "<Qf", heading % 360.0), (133, "<Qf", told_speed)]
            said += [] if "NTUN" in left_out else [(134, "<Qf", told_heading % 360.0)]
            said += [] if receivers else [(132, "<Qf", speed)]
            said += [(132, "<QBBf", k, 4 if fix else 1, speed if fix else 0.0) for k, fix in enumerate(receivers)]
            for number, form, *values in said:
                file.write(b"\xa3\x95" + bytes([number]) + struct.pack(form, stamp, *values))


def as_mcap(path, rows):
    """A black box of ours, a turn of the loop for each row."""
    writer = McapWriter(path, header_of(), capacity=len(rows) + 10)
    for number, (time_s, x, y, heading, speed, told_speed, told_heading) in enumerate(rows):
        now_s = START_S + time_s
        reading = BoatReading("blue_1", now_s, (x, y), 0.0, math.radians(heading), 0.0, speed, velocity_age_s=0.0)
        sent = Sent("blue_1", now_s, math.radians(told_heading), told_speed, "fake", True)
        told = {"readings": {"blue_1": reading}, "sent": {"blue_1": sent}}
        parts = {"fleet": None, "nominal": None, "surroundings": None, "decisions": None, "shield_reset": False}
        writer.take(Tick(number, now_s, now_s, now_s, contacts=(), policy_age_s=0.0, **told, **parts))
    writer.close()


WRITERS = {"csv": as_csv, "alog": as_alog, "tlog": as_tlog, "bin": as_bin, "mcap": as_mcap}
