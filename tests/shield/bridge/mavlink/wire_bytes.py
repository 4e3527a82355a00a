"""What leaves for a scripted boat, and what is made of what it says, by bytes alone: knows nothing of the inside."""

import json
import math
import time
from pathlib import Path

from fake_boat import FakeBoat, wait_for
from pymavlink.dialects.v20 import ardupilotmega as mavlink

GOLDEN = Path(__file__).parents[1] / "data" / "golden_wire.json"
COMMANDS = [
    *((0.0, 0.0), (0.5, 1.0), (1.5, 2.0), (3.1, 0.3), (3.2, -0.5)),
    *((4.7, 1.9), (6.2, 1.23456), (2.0, 9.0), (5.5, -9.0), (6.28318, 1e-4)),
]
SAID = [
    "Radio Failsafe",
    "EKF failsafe cleared",
    "x" * 50,
    "tab\tand\x07bell",
    "PreArm: Compass",
    "a",
    "ü",
    "Crash: 1",
    "",
    "ok",
]
MODES = [
    *((15, True), (4, True), (15, False), (0, True), (5, True)),
    *((10, True), (11, False), (1, True), (99, True), (15, True)),
]
_STAMPED = {"SET_ATTITUDE_TARGET": 4, "SET_POSITION_TARGET_LOCAL_NED": 4, "TIMESYNC": 16}
"""Bytes of the payload that are a time of day."""


class Recorder(FakeBoat):
    """A scripted boat that keeps the frames it is sent."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.frames = []

    def _receive(self):
        data, peer = self.socket.recvfrom(65535)
        self.peer = self.peer or peer
        for message in self.reader.parse_buffer(data) or []:
            self.frames.append(bytes(message.get_msgbuf()))
            self.heard.append(message)
            getattr(self, f"_on_{message.get_type().lower()}", lambda message: None)(message)


def plain(frame):
    """Sender, kind and payload of a frame, its times of day left out; trailing zeros are MAVLink's to cut."""
    kind = mavlink.mavlink_map[int.from_bytes(frame[7:10], "little")].msgname
    payload = frame[10 : 10 + frame[1]]
    skip = _STAMPED.get(kind, 0)
    return [frame[5], frame[6], kind, payload[skip:].rstrip(b"\0").hex()]


def sent_by(make_link, route):
    """Frames of one connection from nothing to HOLD, and those of ten commands."""
    link, endpoint, clock = make_link(route)
    with Recorder(endpoint.port, speed=clock.speed) as boat:
        link.connect(20.0)
        link.prepare(20.0)
        commands = []
        for heading, speed in COMMANDS:
            boat.targets.clear()
            boat.frames.clear()
            sent = link.send(heading, speed)
            assert wait_for(lambda: any(plain(frame)[2].startswith("SET_") for frame in list(boat.frames)))
            frame = next(frame for frame in boat.frames if plain(frame)[2].startswith("SET_"))
            commands.append([plain(frame), round(sent.heading_rad, 12), round(sent.speed_mps, 12), sent.limit_mps])
        said = link.close()
        heard = {}
        for message in boat.heard:
            frame = plain(bytes(message.get_msgbuf()))
            if not frame[2].startswith("SET_"):
                heard.setdefault(f"{frame[2]}", set()).add(frame[3])
    return {"commands": commands, "asked": {kind: sorted(found) for kind, found in heard.items()}, "left": said}


def read_of(make_link):
    """Readings after each of ten positions, attitudes, heartbeats and texts of a boat."""
    link, endpoint, clock = make_link("auto")
    found = {"position": [], "attitude": [], "heartbeat": [], "text": []}
    with Recorder(endpoint.port, speed=clock.speed) as boat:
        link.connect(20.0)
        link.prepare(20.0)
        boat.rates_given = False
        time.sleep(0.3)
        for k in range(10):
            course = (0.3 * k - math.radians(30.0)) % (2.0 * math.pi)

            def told(k=k, course=course):
                """Say it, again until it is heard: the boat's own thread may have moved it meanwhile."""
                boat.obeys = False
                boat.latitude, boat.longitude = 42.0001 + 1e-6 * k, -70.9999 - 1e-6 * k
                boat.speed, boat.yaw = 0.1 * k, 0.3 * k
                place = boat.latitude, boat.longitude
                boat.send_attitude()
                boat.send_position(lat=round(place[0] * 1e7), lon=round(place[1] * 1e7))
                time.sleep(0.02)
                said = link.read()
                return abs(said.heading_rad - course) < 0.002 and abs(said.speed_mps - 0.1 * k) < 0.006

            assert wait_for(told)
            reading = link.read()
            found["position"].append([round(v, 3) for v in (*reading.position_m, reading.speed_mps)])
            found["attitude"].append(
                [
                    round(reading.heading_rad, 3),
                    None if math.isnan(reading.course_rad) else round(reading.course_rad, 2),
                ]
            )
        for mode, armed in MODES:
            boat.mode, boat.armed = mode, armed
            time.sleep(0.12)
            reading = link.read()
            found["heartbeat"].append([reading.mode, reading.ready, reading.released, reading.why_not.split(";")[0]])
        link.read()
        for text in SAID:
            boat.say(text)
            time.sleep(0.05)
            found["text"].append([t for t in link.read().texts if "switched" not in t and "disarmed" not in t])
        link.release()
    endpoint.close()
    return found


def kept():
    """The golden bytes."""
    return json.loads(GOLDEN.read_text())
