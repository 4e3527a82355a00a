"""Contents of a platform file: words on kinds, gains and measured entries, and units that others use."""

from __future__ import annotations

from .platform import ENTRIES, Entry

__all__ = ["ENTRIES", "GAINS", "KIND_WORDS", "MEASURED", "UNITS_TAKEN_FOR_OTHERS"]

KIND_WORDS = {
    "usv": "rudder and thrust behind a PID (MOOS-IvP's uSimMarine and pMarinePID): it turns with its thrust",
    "rate": "a turn-rate loop (ArduPilot rovers and boats) or two propellers: it turns as fast as its speed lets it",
    "double_integrator": "speed and turn rate change within acceleration limits",
    "single_integrator": "speed and turn rate are there at once",
}


GAINS = {
    "kp": "proportional gain",
    "ki": "integral gain, 1/s",
    "kd": "derivative gain, s",
    "integral_limit": "bound on the integral's part",
}

MEASURED: dict[str, Entry] = {
    "delay_s": Entry("s", "from command to first effect"),
    "position_error_m": Entry("m", "covers 99 % of the errors of positions predicted 1 s ahead"),
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
"""Endings of keys that mean another unit than the file's, and how to convert."""
