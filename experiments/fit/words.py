"""What a fit says to the user: what the boat does, what the shield then promises, and what to do about it."""

from __future__ import annotations

import numpy as np
from steerclear.shield.platforms import Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import PlatformFile
from steerclear.shield.platforms.limits import cruise

SEPARATION_M = 2.5
MUCH_M = 1.0
LATE_S = 0.4
LONGEST_S = 120.0


def what_it_does(platform: Platform) -> dict[str, float]:
    """How the boat behaves in its own model, from top speed.

    Returns:
        ``stop_s`` and ``stop_m``: until below 5 % of top speed; ``turn_90_s``: until within 5 deg of a right angle
        (NaN: longer than `LONGEST_S`); ``turn_rate_dps``: the highest on the way; ``speed_up_s``: from rest to 90 %.
    """
    top, dt_s = platform.max_speed_mps, 0.1
    params, row = cruise(platform)
    stop_s = 0.0
    while row[L.SPEED] > 0.05 * top and stop_s < LONGEST_S:
        step_boat(params, row, 0.0, 0.0, dt_s)
        stop_s += dt_s
    stop_m = float(np.hypot(row[L.X], row[L.Y]))
    speed_up_s = 0.0
    while row[L.SPEED] < 0.85 * top and speed_up_s < LONGEST_S:
        step_boat(params, row, top, 0.0, dt_s)
        speed_up_s += dt_s
    params, row = cruise(platform)
    turn_s, fastest = 0.0, 0.0
    while abs(90.0 - row[L.HEADING]) > 5.0 and turn_s < LONGEST_S:
        before = row[L.HEADING]
        step_boat(params, row, top, 90.0 - row[L.HEADING], dt_s)
        fastest = max(fastest, float(row[L.HEADING] - before) / dt_s)
        turn_s += dt_s
    turned = turn_s if turn_s < LONGEST_S else float("nan")
    return {
        "stop_s": stop_s,
        "stop_m": stop_m,
        "turn_90_s": turned,
        "turn_rate_dps": fastest,
        "speed_up_s": speed_up_s,
    }


def about_the_boat(platform: Platform) -> list[str]:
    """The same in sentences."""
    does = what_it_does(platform)
    top = platform.max_speed_mps
    return [
        f"From {top:g} m/s it stops in {does['stop_s']:.1f} s and {does['stop_m']:.1f} m, turns 90 deg (to within 5) "
        f"in {does['turn_90_s']:.1f} s, at most {does['turn_rate_dps']:.0f} deg/s; from rest it is up to speed in "
        f"{does['speed_up_s']:.1f} s."
    ]


def promise(file: PlatformFile) -> list[str]:
    """What the shield then keeps, and what to do where that is little."""
    measured = file.measured
    if not measured:
        return ["Nothing was measured of it: fit it to a log, so that the shield knows delay and margin."]
    error = file.error_m(3.0)
    lines = [
        f"Commands work after {measured.get('delay_s', 0.0):.2f} s; of places predicted 1, 3 and 6 s ahead 99 of 100 "
        f"are within {', '.join(format(measured.get(f'error_{at}_s_m', float('nan')), '.2f') for at in (1, 3, 6))} m.",
        "deploy counts on that delay, rounded up to whole turns of its loop, and keeps the boat "
        f"{file.error_m(1.0):.2f} m farther from everybody for what its model misses; what it misses on the day widens "
        "that, see the log's tracking.",
    ]
    if error > MUCH_M:
        lines.append(
            f"{error:.1f} m at 3 s is much beside a separation of {SEPARATION_M:g} m: drive a longer sea-trial in "
            "still water, tune the autopilot, or keep more separation_m."
        )
    if measured.get("delay_s", 0.0) > LATE_S:
        lines.append("That delay is long: a faster link or telemetry rate is worth more than any margin.")
    return lines
