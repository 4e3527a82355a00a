"""Faults on the wire while two boats of ours are told to run into each other: how near they truly come.

The table of drills says what strikes, what is counted or declared for it, and within how many seconds; one driver runs
them all, and the documentation tells their figures.
"""

import math
import re
import socket
from pathlib import Path

import pytest
from lake import KEY, Lake
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.mavlink.signing import SigningClock
from steerclear.shield.platforms import layout as L

DOC = Path(__file__).parents[3] / "docs" / "studies" / "boats.md"
STRIKE_S, AFTER_S = 4.0, 14.0


def boats_fault(kind, lasts_s=math.inf):
    """A fault of the simulated boat's radio or autopilot."""

    def strike(lake, since_s):
        if since_s == 0.0:
            lake.water.fault("blue_1", kind)
        if since_s == lasts_s:
            lake.water.clear("blue_1")

    return strike


def forged(lake, since_s, key):
    """A stranger says ten times a second that the boat is 30 m east of where it is."""
    row = lake.water.states()["blue_1"]
    latitude, longitude = lake.water.frame.to_geodetic_deg(float(row[L.X]) + 30.0, float(row[L.Y]))
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    if key is not None:
        mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.link_id = key, True, 1
        mav.signing.timestamp = SigningClock().now()
    said = mavlink.MAVLink_global_position_int_message(
        int(1000.0 * since_s) + 60000, round(1e7 * latitude), round(1e7 * longitude), 0, 0, 0, 200, 0, 0
    )
    send(lake, [bytes(said.pack(mav))])


def unsigned(lake, since_s):
    forged(lake, since_s, None)


def wrongly_signed(lake, since_s):
    forged(lake, since_s, KEY[::-1])


def replayed(lake, since_s):
    """What the boat said before is said again and again, bit for bit."""
    if since_s == 0.0:
        lake.heard = heard_of(1, lake.station.fleet.log_dir)
        assert len(lake.heard) > 20
    start = round(10.0 * since_s) * 4 % (len(lake.heard) - 4)
    send(lake, lake.heard[start : start + 4])


def heard_of(system_id, folder):
    """Packets of a boat in the log of raw packets."""
    log = mavutil.mavlink_connection(str(next(folder.glob("*.tlog"))))
    frames = []
    while (message := log.recv_match()) is not None:
        if message.get_srcSystem() == system_id and message.get_type() != "BAD_DATA":
            frames.append(bytes(message.get_msgbuf()))
    log.close()
    return frames


def send(lake, frames):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for frame in frames:
            stranger.sendto(frame, ("127.0.0.1", lake.port))


DRILLS = {
    "packets up to 0.3 s out of order": (boats_fault("out_of_order"), "out_of_order", 1.0),
    "packets twice": (boats_fault("duplicate"), "out_of_order", 1.0),
    "GPS fix lost, dead reckoning told": (boats_fault("gps_lost"), "no_fix", 1.0),
    "packets with bits turned": (boats_fault("corrupt"), "bad_checksum", 1.0),
    "a stranger's unsigned positions": (unsigned, "unsigned", 0.5),
    "a stranger's wrongly signed positions": (wrongly_signed, "bad_signature", 0.5),
    "a stranger's replayed packets": (replayed, "replayed", 0.5),
    "link lost for 4 s and back, by radio": (boats_fault("link_loss", 4.0), "link", 1.5),
}
"""What strikes the first boat, what is counted or declared for it, and within how many seconds."""


@pytest.mark.parametrize("name", DRILLS)
def test_a_fault_on_the_wire_is_told_in_time_and_brings_no_breach(name, tmp_path):
    strike, told, within_s = DRILLS[name]
    with Lake(tmp_path, signed=name.startswith("a stranger")) as lake:
        closest_m, began_s = math.inf, lake.clock.now_s()
        for k in range(round((STRIKE_S + AFTER_S) / 0.1)):
            since_s = round(0.1 * k - STRIKE_S, 6)
            if since_s >= 0.0:
                strike(lake, since_s)
            closest_m = min(closest_m, lake.turn())
    assert closest_m >= 2.5
    assert told in lake.told
    assert lake.told[told] - began_s - STRIKE_S <= within_s
    said, said_m = row_of(name)
    assert said.startswith(told.replace("_", " "))
    assert said_m == pytest.approx(closest_m, abs=2.0), "threads decide what is heard when: no two runs are alike"


def row_of(name):
    """What the documentation says of a drill: what is counted or declared, and closest, m."""
    found = re.search(rf"^\| {re.escape(name)} \| ([^|]+) \| ([\d.]+) m \|$", DOC.read_text(), re.MULTILINE)
    assert found, f"no row of {name!r} in {DOC.name}"
    return found[1], float(found[2])
