"""The boats written down a second time, in plain Python and numpy, from their published description.

Shares no code and no numbers with the package: the table below is typed in from the same source.
"""

import math

import numpy as np

BOATS = {
    "heron": {
        "top": 2.0,
        "map": [(0, 0), (40, 1), (100, 2)],
        "max_thrust": 100,
        "turn_loss": 0.85,
        "turn_rate": 60,
        "max_acc": 0.0,
        "max_dec": 0.5,
        "speed_factor": 0.0,
        "speed_pid": (1.0, 0.0, 0.0, 0.07),
        "heading_pid": (0.9, 0.0, 0.6, 0.3),
    },
    "surveyor": {
        "top": 3.0,
        "map": [(-100, -2), (0, 0), (20, 1), (40, 1.5), (60, 2), (70, 2.25), (100, 3)],
        "max_thrust": 100,
        "turn_loss": 0.85,
        "turn_rate": 10,
        "max_acc": 0.15,
        "max_dec": 0.25,
        "speed_factor": 0.0,
        "speed_pid": (0.5, 0.0, 0.0, 0.0),
        "heading_pid": (1.2, 0.0, 3.0, 0.0),
    },
    "large_usv": {
        "top": 12.0,
        "map": [(-100, -3), (0, 0), (20, 3), (40, 6), (60, 9), (80, 12), (100, 12)],
        "max_thrust": 70,
        "turn_loss": 0.85,
        "turn_rate": 50,
        "max_acc": 0.5,
        "max_dec": 0.5,
        "speed_factor": 20 / 3,
        "speed_pid": (1.0, 0.0, 0.0, 0.07),
        "heading_pid": (0.35, 0.0, 0.07, 0.07),
    },
    "mctf2024_sim": {
        "top": 1.5,
        "map": [(-100, -2), (0, 0), (20, 1), (40, 2), (60, 3), (80, 5), (100, 5)],
        "max_thrust": 70,
        "turn_loss": 0.85,
        "turn_rate": 70,
        "max_acc": 1.0,
        "max_dec": 1.0,
        "speed_factor": 0.0,
        "speed_gain": 20.0,
        "speed_pid": (1.0, 0.0, 0.0, 0.07),
        "heading_pid": (0.35, 0.0, 0.07, 0.07),
    },
}
BOATS["heron_v22"] = {**BOATS["heron"], "full_turn_speed": 5.0}


class Pid:
    """p + i + d on the error, integral clamped, output clamped, no derivative on the first call."""

    def __init__(self, gains, limit):
        self.kp, self.ki, self.kd, self.integral_limit = gains
        self.limit = limit
        self.integral = 0.0
        self.last = None

    def __call__(self, error, dt):
        change = 0.0 if self.last is None else (error - self.last) / dt
        self.last = error
        self.integral = float(np.clip(self.integral + self.ki * error * dt, -self.integral_limit, self.integral_limit))
        return float(np.clip(self.kp * error + self.integral + self.kd * change, -self.limit, self.limit))


class ThrustBoat:
    """A boat with thrust, rudder and two controllers."""

    def __init__(self, boat, x, y, heading, speed):
        self.boat = boat
        self.x, self.y, self.heading, self.speed, self.thrust = x, y, heading, speed, 0.0
        self.speed_pid = Pid(self.boat["speed_pid"], self.boat["max_thrust"])
        self.heading_pid = Pid(self.boat["heading_pid"], 100.0)

    def step(self, speed, error, dt):
        """Controllers, then hull."""
        boat = self.boat
        if boat["speed_factor"]:
            thrust = speed * boat["speed_factor"]
        else:
            thrust = self.thrust + boat.get("speed_gain", 1.0) * self.speed_pid(speed - self.speed, dt)
        thrust = 0.0 if thrust < 0.01 else thrust
        self.thrust = float(np.clip(thrust, -boat["max_thrust"], boat["max_thrust"]))
        rudder = self.heading_pid(error, dt) if self.thrust > 0 else 0.0
        self._hull(rudder, dt)

    def _hull(self, rudder, dt):
        boat = self.boat
        thrusts, speeds = zip(*boat["map"], strict=True)
        new = float(np.interp(self.thrust, thrusts, speeds)) * (1 - abs(rudder) / 100 * boat["turn_loss"])
        if boat["max_acc"] > 0:
            new = min(new, self.speed + boat["max_acc"] * dt)
        if boat["max_dec"] > 0:
            new = max(new, self.speed - boat["max_dec"] * dt)
        turn = rudder * boat["turn_rate"] / 100 * dt * (1 + (abs(self.thrust) - 50) / 50) if new != 0 else 0.0
        if boat.get("full_turn_speed"):
            turn *= float(np.clip(new / boat["full_turn_speed"], 0.0, 1.0))
        _move(self, new, self.heading + turn, dt)
        self.speed = float(np.clip((new + self.speed) / 2, 0.0, boat["top"]))


class Integrator:
    """`si`: speed and turn at once. `di`: within 1 m/s2 and 180 deg/s2. Both: 10 m/s and 90 deg/s."""

    def __init__(self, name, x, y, heading, speed):
        self.name, self.x, self.y, self.heading, self.speed, self.rate = name, x, y, heading, speed, 0.0

    def step(self, speed, error, dt):
        """Speed and turn rate, then the move along their means."""
        new, rate = float(np.clip(speed, -10, 10)), float(np.clip(error / dt, -90, 90))
        if self.name == "di":
            acc = np.clip((speed - self.speed) / dt, -1, 1)
            new = float(np.clip(self.speed + acc * dt, -10, 10))
            angular = np.clip((error / dt - self.rate) / dt, -180, 180)
            rate = self.rate = float(np.clip(self.rate + angular * dt, -90, 90))
        _move(self, new, self.heading + rate * dt, dt)
        self.speed = float(np.clip(new, 0.0, 10.0))


RATE_BOATS = {  # top, acc, dec, speed lag, most turn, angular acc, turn at rest, turn per speed, turn lag, loss, gain
    "ardurover_boat": (3.0, 1.059, 1.143, 0.04515, 108.5, 104.9, 2.398, 66.79, 0.1787, 0.01376, 1.699),
    "blueboat": (3.0, 0.8, 0.8, 0.4, 45.0, 45.0, 45.0, -8.0, 0.25, 0.15, 1.5),
    "otter": (3.2, 1.2, 1.31, 0.5, 12.0, 6.0, 12.0, -1.5, 0.6, 0.2, 0.225),
}


class RateBoat:
    """A turn-rate loop behind ArduPilot's square-root controller, and a speed with limits and a lag."""

    def __init__(self, name, x, y, heading, speed):
        self.numbers, self.x, self.y, self.heading, self.speed, self.rate = RATE_BOATS[name], x, y, heading, speed, 0.0

    def step(self, speed, error, dt):
        """Turn rate, then speed, then the move along their means."""
        top, acc, dec, speed_lag, most, angular, rest, per_speed, turn_lag, loss, gain = self.numbers
        error -= dt * self.rate / 2
        corner = angular / gain**2
        asked = gain * error
        if abs(error) > corner:
            asked = math.copysign(math.sqrt(2 * angular * (abs(error) - corner / 2)), error)
        limit = np.clip(rest + per_speed * self.speed, 0, most)
        change = (1 - math.exp(-dt / turn_lag)) * (np.clip(asked, -limit, limit) - self.rate)
        self.rate += float(np.clip(change, -angular * dt, angular * dt))
        wanted = np.clip(speed, 0, top) * (1 - loss * abs(self.rate) / most)
        change = (1 - math.exp(-dt / speed_lag)) * (wanted - self.speed)
        new = self.speed + float(np.clip(change, -dec * dt, acc * dt))
        _move(self, new, self.heading + self.rate * dt, dt)
        self.speed = float(np.clip(new, 0, top))


def _move(boat, new_speed, new_heading, dt):
    """Mean speed along the mean heading; headings stay within 180 deg."""
    mean, course = (new_speed + boat.speed) / 2, math.radians((boat.heading + new_heading) / 2)
    boat.x += math.sin(course) * mean * dt
    boat.y += math.cos(course) * mean * dt
    boat.heading = math.remainder(new_heading, 360.0)


def oracle(name, x, y, heading, speed):
    """A boat of either sort."""
    if name in RATE_BOATS:
        return RateBoat(name, x, y, heading, speed)
    if name in ("si", "di"):
        return Integrator(name, x, y, heading, speed)
    return ThrustBoat(BOATS[name], x, y, heading, speed)
