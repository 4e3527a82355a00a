"""Does a log agree with itself? Its positions, speeds, headings and times are held against each other before any fit.

What contradicts the rest is cut out and told; a log that contradicts itself as a whole is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from steerclear.shield.jit import Array

from .runs import SHORTEST_S, STEP_S, FitError, Run

FASTEST_MPS = 40.0
JUMP_M, JUMP_SHARE = 1.5, 1.5
"""A position that moves farther in a step than so many metres and so many times the top speed's way has jumped."""
WINDOW_STEPS = 20
"""Ways are compared over so many steps."""
CHUNK_S = 12.0
"""A log is judged in stretches of about this length, s."""
LEAST_WAY_M = 5.0
"""Shorter ways of a stretch are not compared."""
MOST_BAD = 0.5
"""A log of which more than this share, by time under way, contradicts itself is refused as a whole."""
WAY_RATIO = (0.65, 1.55)
"""The way by speeds over the way by positions: a current explains no more than this."""
OFF_DEG = 30.0
"""Median angle from heading to course beyond which a heading is another quantity, deg."""
UNITS = {"knots": 1.944, "mph": 2.237, "ft/s": 3.281, "km/h": 3.6, "cm/s": 100.0}
"""Speeds of 1 m/s in other units."""


def consistent(name: str, runs: Sequence[Run], tell: Callable[[str], None]) -> list[Run]:
    """Cut out what contradicts the rest.

    Args:
        name: of the log.
        runs: of it.
        tell: is told what is cut out.

    Raises:
        FitError: the log contradicts itself as a whole.
    """
    top_mps = max((float(np.abs(run.seen[:, 3]).max()) for run in runs), default=0.0)
    if top_mps > FASTEST_MPS:
        raise FitError(f"{name}: a speed of {top_mps:.0f} m/s is no boat's; give speeds in m/s")
    pieces = [piece for run in runs for piece in _without_jumps(run, top_mps, tell)]
    chunks = [chunk for piece in pieces for chunk in _chunks(piece)]
    ways = [_ways(chunk) for chunk in chunks]
    faults = [_contradiction(way) for way in ways]
    moving_s = sum(chunk.seconds for chunk, way in zip(chunks, ways, strict=True) if _moves(way))
    bad = [n for n, fault in enumerate(faults) if fault]
    if bad and sum(chunks[n].seconds for n in bad) > MOST_BAD * moving_s:
        raise FitError(f"{name}: {_contradiction(np.concatenate([ways[n] for n in bad], axis=1)) or faults[bad[0]]}")
    for n in bad:
        tell(f"{name}: {chunks[n].seconds:.0f} s from {chunks[n].begin_s:.1f} s on are left out: {faults[n]}")
    return [run for piece in pieces for run in _without(piece, [chunks[n] for n in bad])] if bad else pieces


def _chunks(run: Run) -> list[Run]:
    """Stretches of about `CHUNK_S`, each judged alone."""
    bounds = np.linspace(0, len(run.seen), max(1, round(run.seconds / CHUNK_S)) + 1).astype(int)
    return [run.part(a, b) for a, b in pairwise(bounds)]


def _without(run: Run, bad: Sequence[Run]) -> list[Run]:
    """What is left of a run without stretches of it."""
    fine = np.ones(len(run.seen), dtype=bool)
    for chunk in bad:
        begin = round((chunk.begin_s - run.begin_s) / STEP_S)
        if 0 <= begin < len(fine):
            fine[begin : begin + len(chunk.seen)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fine, [False]])))
    spans = zip(edges[::2], edges[1::2], strict=True)
    return [run.part(a, b) for a, b in spans if (b - a) * STEP_S >= SHORTEST_S]


def _without_jumps(run: Run, top_mps: float, tell: Callable[[str], None]) -> list[Run]:
    """The run, cut wherever its position jumps."""
    steps = np.hypot(*np.diff(run.seen[:, :2], axis=0).T)
    jumps = np.flatnonzero(steps > JUMP_M + JUMP_SHARE * top_mps * STEP_S)
    if len(jumps) == 0:
        return [run]
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 1) + 1)
    far_m = max(float(np.hypot(*(run.seen[group[-1] + 1, :2] - run.seen[group[0], :2]))) for group in groups)
    tell(
        f"{run.name}: its position jumps {len(groups)} times, first at {run.begin_s + jumps[0] * STEP_S:.1f} s, "
        f"by {far_m:.0f} m at most; cut there"
    )
    bounds = [0, *(int(jump) + 1 for jump in jumps), len(run.seen)]
    return [run.part(a, b) for a, b in pairwise(bounds) if (b - a) * STEP_S >= SHORTEST_S]


def _ways(run: Run) -> Array:
    """Ways made in each window (2, windows, 2), m east and north: by positions, and by speeds along headings."""
    at = np.arange(0, len(run.seen), WINDOW_STEPS)
    heading = np.radians(run.seen[:-1, 2])
    moved = STEP_S * run.seen[:-1, 3, None] * np.column_stack([np.sin(heading), np.cos(heading)])
    reckoned = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return np.stack([np.diff(run.seen[at, :2], axis=0), np.diff(reckoned[at], axis=0)])


def _moves(ways: Array) -> bool:
    """Whether ways are long enough to be compared."""
    return bool(np.hypot(ways[..., 0], ways[..., 1]).sum(axis=1).max() >= LEAST_WAY_M)


def _contradiction(ways: Array) -> str:
    """What is wrong with ways made (2, windows, 2), in words; empty: nothing."""
    if not _moves(ways):
        return ""
    by_positions, by_speeds = np.hypot(ways[..., 0], ways[..., 1])
    made, told = float(by_positions.sum()), float(by_speeds.sum())
    ratio = told / max(made, 1e-9)
    if not WAY_RATIO[0] <= ratio <= WAY_RATIO[1]:
        unit = min(UNITS, key=lambda unit: abs(ratio / UNITS[unit] - 1.0))
        unit = f" (they look like {unit})" if abs(ratio / UNITS[unit] - 1.0) < 0.1 else ""
        return (
            f"by its speeds the boat went {told:.0f} m, by its positions {made:.0f} m; "
            f"give speeds in m/s{unit} and positions in m"
        )
    going = np.minimum(by_positions, by_speeds) > 0.5 * float(np.median(by_speeds[by_speeds > 0.0]))
    courses = np.arctan2(ways[..., 0], ways[..., 1])[:, going]
    off = np.degrees(np.abs(np.angle(np.exp(1j * (courses[0] - courses[1])))))
    if len(off) and float(np.median(off)) > OFF_DEG:
        return (
            f"its headings are {np.median(off):.0f} deg off the course that its positions make, half of the time; "
            "give headings in degrees clockwise from north (from the y axis)"
        )
    return ""
