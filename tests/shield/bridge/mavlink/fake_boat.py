"""A boat of the tests' own: one thread, one UDP socket, as little autopilot as a link needs to see."""

import math
import select
import socket
import threading
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
TICK_S = 0.01


class FakeBoat:
    """Sends to ``send_to`` (a link's udpin port), or waits at ``port`` to be spoken to (udpout).

    What it does is in plain attributes that tests change while it runs.
    """

    def __init__(self, send_to=None, *, system_id=1, key=None, speed=1.0):
        self.system_id = system_id
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.peer = None if send_to is None else ("127.0.0.1", send_to)
        self.mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
        if key is not None:
            self.mav.signing.secret_key, self.mav.signing.sign_outgoing = key, True
            self.mav.signing.timestamp = round((time.time() - 1_420_070_400) * 1e5)
        self.reader = mavlink.MAVLink(None)
        self.reader.robust_parsing = True
        self.vehicle, self.autopilot = mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        self.mode, self.armed = 0, False
        self.parameters = {"WP_SPEED": 2.0, "FS_GCS_ENABLE": 0.0, "GUID_TIMEOUT": 3.0, "SYSID_MYGCS": 255.0}
        self.parameters |= {"SYSID_ENFORCE": 0.0, "ARMING_CHECK": 1.0}
        self.version, self.capabilities = (4, 6, 0), 64 | 128 | 8192
        self.refuses_mode = self.refuses_arming = ""
        self.answers, self.speaks = True, True
        self.rates_given = True
        self.latitude, self.longitude = 42.0001, -70.9999
        self.speed, self.yaw, self.turn_rate = 0.0, 0.5, 0.0
        self.obeys = True
        self.targets = []
        self.intervals = {}
        self.heard = []
        self._sent = {}
        self.pace = speed
        self._began = self.now_s()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def now_s(self):
        """Time on the clock of a link with the same speed."""
        return time.monotonic() * self.pace

    @property
    def uptime_s(self):
        return self.now_s() - self._began + 100.0

    def reboot(self):
        """Begin again: its clock near zero, nothing asked of it remembered."""
        self._began = self.now_s() + 95.0
        self.mode, self.armed = 0, False
        self.intervals.clear()

    def send(self, message):
        with self._lock:
            frame = bytes(message.pack(self.mav))
            self.mav.seq = (self.mav.seq + 1) % 256
            if self.peer is not None:
                self.socket.sendto(frame, self.peer)
        return frame

    def say(self, text):
        self.send(mavlink.MAVLink_statustext_message(4, text.encode()))

    def send_position(self, **changes):
        values = {
            "lat": round(self.latitude * 1e7),
            "lon": round(self.longitude * 1e7),
            "vx": round(100 * self.speed * math.cos(self.yaw)),
            "vy": round(100 * self.speed * math.sin(self.yaw)),
        } | changes
        heading = round(math.degrees(self.yaw) * 100) % 36000
        boot_ms = round(self.uptime_s * 1000)
        self.send(
            mavlink.MAVLink_global_position_int_message(
                boot_ms, values["lat"], values["lon"], 0, 0, values["vx"], values["vy"], 0, heading
            )
        )

    def send_attitude(self):
        yaw = (self.yaw + math.pi) % (2 * math.pi) - math.pi
        self.send(mavlink.MAVLink_attitude_message(round(self.uptime_s * 1000), 0, 0, yaw, 0, 0, self.turn_rate))

    def send_heartbeat(self):
        base = 1 | (128 if self.armed else 0)
        self.send(mavlink.MAVLink_heartbeat_message(self.vehicle, self.autopilot, base, self.mode, 4, 3))

    def send_parameter(self, name):
        self.send(mavlink.MAVLink_param_value_message(name.encode(), self.parameters[name], 9, len(self.parameters), 0))

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ending.set()
        self._thread.join(5.0)
        self.socket.close()

    def _run(self):
        last = self.now_s()
        while not self._ending.is_set():
            ready, _, _ = select.select([self.socket], [], [], TICK_S)
            if ready:
                self._receive()
            now = self.now_s()
            self._move(now - last)
            last = now
            if self.speaks:
                self._speak(now)

    def _speak(self, now):
        self._periodic("heartbeat", 0.1, now, self.send_heartbeat)
        for message, send in ((33, self.send_position), (30, self.send_attitude)):
            if message in self.intervals and self.rates_given:
                self._periodic(message, self.intervals[message], now, send)

    def _periodic(self, key, interval, now, send):
        """Send what is due; what a slow machine left out by more than a few times is not made up for."""
        due = max(self._sent.get(key, 0.0), now - 5.0 * interval)
        while now - due >= interval:
            due += interval
            send()
        self._sent[key] = due

    def _move(self, dt):
        self.latitude += math.degrees(self.speed * math.cos(self.yaw) * dt / 6.37e6)
        self.longitude += math.degrees(self.speed * math.sin(self.yaw) * dt / 6.37e6 / math.cos(math.radians(42)))

    def _receive(self):
        data, peer = self.socket.recvfrom(65535)
        if self.peer is None:
            self.peer = peer
        for message in self.reader.parse_buffer(data) or []:
            self.heard.append(message)
            if self.answers:
                getattr(self, f"_on_{message.get_type().lower()}", lambda message: None)(message)

    def _on_timesync(self, message):
        if message.tc1 == 0:
            self.send(mavlink.MAVLink_timesync_message(round(self.uptime_s * 1e9), message.ts1))

    def _on_param_request_read(self, message):
        name = message.param_id.rstrip("\x00")
        if name in self.parameters:
            self.send_parameter(name)

    def _on_command_long(self, message):
        result = ACCEPTED
        if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.intervals[int(message.param1)] = message.param2 * 1e-6
        elif message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            packed = self.version[0] << 24 | self.version[1] << 16 | self.version[2] << 8
            self.send(
                mavlink.MAVLink_autopilot_version_message(
                    self.capabilities, packed, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
                )
            )
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            result = self._set_mode(int(message.param2))
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            result = self._arm(message.param1 == 1.0, message.param2)
        self.send(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, 255, 191))

    def _set_mode(self, mode):
        if self.refuses_mode:
            self.say(self.refuses_mode)
            return FAILED
        self.mode = mode
        return ACCEPTED

    def _arm(self, arm, force):
        if self.refuses_arming and not force:
            self.say(self.refuses_arming)
            return FAILED
        self.armed = arm
        return ACCEPTED

    def _on_set_attitude_target(self, message):
        if self.mode != 15 or message.target_system != self.system_id:
            return
        self.targets.append(message)
        if self.obeys:
            self.speed = message.thrust * self.parameters["WP_SPEED"]
            if not message.type_mask & 128:
                self.yaw = 2 * math.atan2(message.q[3], message.q[0])

    def _on_set_position_target_local_ned(self, message):
        if self.mode == 15 and message.target_system == self.system_id:
            self.targets.append(message)
            self.speed, self.yaw = math.hypot(message.vx, message.vy), math.atan2(message.vy, message.vx)
