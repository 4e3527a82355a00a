"""What a platform file may say: each entry with its unit and a word on it, and which kinds of boats it is for."""

from __future__ import annotations

from dataclasses import dataclass

ALL = ("usv", "rate", "double_integrator", "single_integrator")
USV, RATE = ("usv",), ("rate",)

KIND_WORDS = {
    "usv": "rudder and thrust behind a PID (MOOS-IvP's uSimMarine and pMarinePID): it turns with its thrust",
    "rate": "a turn-rate loop (ArduPilot rovers and boats) or two propellers: it turns as fast as its speed lets it",
    "double_integrator": "speed and turn rate change within acceleration limits",
    "single_integrator": "speed and turn rate are there at once",
}


@dataclass(frozen=True)
class Entry:
    """One entry of a file.

    Attributes:
        unit: of its value; empty: none.
        words: what it is.
        kinds: of boats it is for.
    """

    unit: str
    words: str
    kinds: tuple[str, ...] = ALL


ENTRIES: dict[str, Entry] = {
    "max_speed_mps": Entry("m/s", "top speed"),
    "max_acc": Entry("m/s2", "limit on gaining speed; of kind usv 0 is none", ("usv", "rate", "double_integrator")),
    "max_dec": Entry("m/s2", "limit on losing speed; 0: of kind rate as max_acc, of kind usv none", ("usv", "rate")),
    "speed_lag_s": Entry("s", "lag of the speed behind its command", RATE),
    "max_turn_rate_dps": Entry(
        "deg/s", "highest turn rate at any speed", ("rate", "double_integrator", "single_integrator")
    ),
    "max_angular_acc_dps2": Entry("deg/s2", "limit on changing the turn rate", ("rate", "double_integrator")),
    "turn_rate_at_rest_dps": Entry("deg/s", "highest turn rate without way; 0: it has to go to steer", RATE),
    "turn_rate_per_mps": Entry("deg/s per m/s", "turn rate gained with speed; below 0: two propellers lose it", RATE),
    "turn_lag_s": Entry("s", "lag of the turn rate behind what is asked for", RATE),
    "turn_loss": Entry("share", "of speed lost at full rudder, or at the highest turn rate; 0 to 1", ("usv", "rate")),
    "heading_pid": Entry(
        "", "heading controller: rudder percent per deg (usv), deg/s per deg (rate: kp alone)", ("usv", "rate")
    ),
    "thrust_map": Entry("percent, m/s", "(thrust, steady speed) points, thrust rising", USV),
    "speed_factor": Entry("percent per m/s", "thrust per commanded speed; 0: speed_pid changes the thrust", USV),
    "max_thrust": Entry("percent", "largest thrust", USV),
    "max_rudder": Entry("percent", "largest rudder", USV),
    "turn_gain": Entry("deg/s", "turn rate at full rudder and thrust 50; twice that at thrust 100", USV),
    "rotate_speed_dps": Entry("deg/s", "turn rate that is always there", USV),
    "speed_gain": Entry("percent per output", "of speed_pid, added to the thrust in each step", USV),
    "speed_pid": Entry("", "speed controller: output per m/s", USV),
}
"""Entries of a boat besides its name and kind, in the order files have them."""

GAINS = {
    "kp": "proportional gain",
    "ki": "integral gain, 1/s",
    "kd": "derivative gain, s",
    "integral_limit": "bound on the integral's part",
}

MEASURED: dict[str, Entry] = {
    "delay_s": Entry("s", "from command to first effect"),
    "position_error_m": Entry("m", "covers 99 % of the errors of places foretold 1 s ahead"),
    "error_growth_mps": Entry("m/s", "by which that grows for every second beyond, to cover 99 % at 3 and 6 s"),
    "error_1_s_m": Entry("m", "99th percentile of held-out errors 1 s ahead"),
    "error_3_s_m": Entry("m", "99th percentile of held-out errors 3 s ahead"),
    "error_6_s_m": Entry("m", "99th percentile of held-out errors 6 s ahead"),
    "median_3_s_m": Entry("m", "median of held-out errors 3 s ahead"),
    "runs": Entry("", "number of runs it was fitted to"),
    "held_out": Entry("", "number of runs it was judged by"),
}
"""Entries of the section ``measured``, which `steerclear fit` writes."""

UNITS_TAKEN_FOR_OTHERS = {
    "knots": "m/s: knots times 0.514444",
    "knot": "m/s: knots times 0.514444",
    "kn": "m/s: knots times 0.514444",
    "kts": "m/s: knots times 0.514444",
    "kmh": "m/s: km/h divided by 3.6",
    "kph": "m/s: km/h divided by 3.6",
    "mph": "m/s: mph times 0.44704",
    "rad": "deg: radians times 57.2958",
    "rads": "deg/s: rad/s times 57.2958",
    "radps": "deg/s: rad/s times 57.2958",
    "rps": "deg/s: rad/s times 57.2958",
    "rads2": "deg/s2: rad/s2 times 57.2958",
    "ft": "m: feet times 0.3048",
    "ms": "s or m/s",
    "g": "m/s2: g times 9.80665",
    "cm": "m: centimetres divided by 100",
    "deg": "the unit the entry's name ends with",
}
"""Endings of keys that say another unit than the file's, and how to convert."""
