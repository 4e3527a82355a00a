"""Whether boats move as their reader says: displacement and turn of what it reads, against speed, heading, command.

Displacements are complex numbers, east + i north. Every fit is of many steps of all boats, so that positions with noise
tell as much as exact ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import fill_memory

OFF = 0.25
"""Most a fitted factor may be off, beyond its own uncertainty, where 1 is as it must be."""
UNSURE = 0.15
"""Standard errors of fits beyond this say nothing."""
MISSED, GAINED = 0.75, 0.15
"""Most of a gain in speed that may be other than expected, where gains are more than this share of the top speed."""
JUMP = 8.0
"""Boats that move more in a step than so many times what is usual, or their top speed, were put there by the game."""
WAY_M = 2.0
"""Boats that moved less than this on average, m, have shown nothing."""
MOST_TURN_DEG = 150.0
"""Turns of commands beyond this, deg, are not compared: boats may take them either way round."""
STRETCH_S = 1.5
"""Ways and turns are compared over stretches of about this, s, in which errors of a single look count for less."""


class Fit(NamedTuple):
    """A factor between what is said and what is seen, and its standard error; nan and inf: nothing to fit."""

    factor: float
    error: float

    def is_off(self) -> bool:
        """Return whether it is surely not 1."""
        return bool(abs(self.factor - 1.0) > OFF + 3.0 * self.error)


@dataclass
class Motion:
    """What a reader read while a game was played: a fleet before and after each step, and the commands in between.

    Attributes:
        step_s: time that boats move for an action, s.
        moves: substeps of it, in each of which the command is the same.
    """

    step_s: float
    moves: int
    fleets: list[Fleet] = field(default_factory=list)
    free: list[BoolArray] = field(default_factory=list)
    commands: list[Array] = field(default_factory=list)

    def see(self, fleet: Fleet, free: BoolArray) -> None:
        """Note the boats, and which of them (n,) go by their commands now."""
        self.fleets.append(fleet)
        self.free.append(free)

    def fault(self, source: str) -> str:
        """Return what is wrong with the reader, and the remedy; empty: nothing.

        Args:
            source: where the commands are from, for the message.
        """
        x = np.array([fleet.state for fleet in self.fleets])
        free = np.array(self.free[:-1]) & np.array(self.free[1:])
        place = x[:, :, L.X] + 1j * x[:, :, L.Y]
        went, said = place[1:] - place[:-1], self._said(x)
        if not free.any():
            return (
                "fleet() controls no boat of team 0 nor of team 1; give Fleet.of team numbers 0 and 1, or controlled="
            )
        way_m = float(np.abs(said[free]).sum())
        if not way_m >= WAY_M * int(free.any(axis=0).sum()):
            return (
                f"boats moved by {way_m:.2g} m in all by their speeds while they were played, too little to compare; "
                "look at speed_mps (m/s) and at what filtering plays, and give a game that goes on"
            )
        usual_m = np.maximum(self._top_mps() * self.step_s, float(np.median(np.abs(went)[free])))
        free &= np.abs(went) <= JUMP * usual_m
        fault = self._off_model(x, free)
        return self._off_course(place, said, free) or (fault and f"{fault} (by the commands that {source})")

    def _top_mps(self) -> Array:
        return np.array([get_platform(kind).max_speed_mps for kind in self.fleets[0].platforms])

    def _said(self, x: Array) -> np.ndarray:
        """Return displacements (steps, n) by speed and heading, means of before and after."""
        heading, speed = np.radians(x[:, :, L.HEADING]), x[:, :, L.SPEED]
        turned = (heading[1:] - heading[:-1] + np.pi) % (2.0 * np.pi) - np.pi
        along = heading[:-1] + turned / 2.0
        way_m = (speed[:-1] + speed[1:]) / 2.0 * self.step_s
        return np.asarray(way_m * (np.sin(along) + 1j * np.cos(along)))

    def _off_course(self, place: np.ndarray, said: np.ndarray, free: BoolArray) -> str:
        """Return in what frame or unit displacements are not those of speed and heading; empty: they are."""
        seen, ways = [], []
        for part, boat in self._stretches(free, 2.0 * STRETCH_S):
            at, way = place[part.start : part.stop + 1, boat], np.append(0.0, np.cumsum(said[part, boat]))
            seen.append(at - at.mean())
            ways.append(way - way.mean())
        far, way = (np.concatenate([np.zeros(0), *parts]) for parts in (seen, ways))
        design = np.concatenate([_pairs(way), _pairs(way.conj())], axis=1)
        (straight, mirrored), errors = _solved(design, np.concatenate([far.real, far.imag]))
        if max(errors) > UNSURE:
            return (
                "headings hardly change while boats are played, or places err by as much as boats move, so that they "
                "cannot be compared; give heading_deg in deg (heading_rad in rad), or a game of 15 s, with less noise"
            )
        slack = OFF + 3.0 * max(errors)
        if abs(straight - 1.0) <= slack and abs(mirrored) <= slack:
            return ""
        if abs(mirrored) > abs(straight):
            return (
                "boats move along the mirror image of their headings; give Fleet.of headings clockwise from north (90 "
                "- deg of those counter-clockwise from east) and position_m as east and north, north upwards"
            )
        off_deg = -math.degrees(float(np.angle(straight)))
        if abs(off_deg) > 15.0:
            return (
                f"boats move {off_deg:.0f} deg to the right of their headings; give Fleet.of headings clockwise from "
                "north, by the argument of their unit (heading_deg, heading_rad), and position_m as east and north"
            )
        return (
            f"boats move {abs(straight):.2f} times as far as speed_mps and the step of {self.step_s:g} s say; give "
            "position_m in m, speed_mps in m/s (a foot is 0.3048 m, a knot 0.514 m/s) and the game's own dt_s"
        )

    def _stretches(self, free: BoolArray, seconds: float) -> Iterator[tuple[slice, int]]:
        """Yield stretches of so long, each of one boat that was free all the time."""
        size = self._steps_in(seconds)
        for first in range(0, len(free) - size + 1, size):
            for boat in range(free.shape[1]):
                if free[first : first + size, boat].all():
                    yield slice(first, first + size), boat

    def _steps_in(self, seconds: float) -> int:
        return max(1, round(seconds / self.step_s))

    def _off_model(self, x: Array, free: BoolArray) -> str:
        """Return what boats do not do as their platform would by the commands; empty: nothing."""
        expected, turned = self._predicted(x), _wrapped(x[1:, :, L.HEADING] - x[:-1, :, L.HEADING])
        clear = free & (np.abs(_wrapped(np.array(self.commands)[:, :, 1])) <= MOST_TURN_DEG)
        sums = [
            (expected[part, boat, 0].sum(), turned[part, boat].sum())
            for part, boat in self._stretches(clear, STRETCH_S)
        ]
        turns = _fit(*np.array(sums, dtype=np.float64).reshape(-1, 2).T)
        if turns.factor < -OFF - 3.0 * turns.error:
            return (
                "boats turn the other way than their commands say; the second column of a command is the turn to the "
                "right, clockwise, deg"
            )
        if turns.is_off():
            return (
                f"boats turn {turns.factor:.2f} times as far as their platforms do; the second column of a command is "
                "the turn from the boat's own heading, deg, and the platform has to turn as the game's boats do"
            )
        if not turns.error <= UNSURE:
            return "boats do not turn by their commands; give rows of speed, m/s, and turn, deg (not rad), clockwise"
        return self._off_speed(x[:, :, L.SPEED], expected[:, :, 1], free)

    def _off_speed(self, speed_mps: Array, expected_mps: Array, free: BoolArray) -> str:
        """Return how speeds (steps + 1, n) are not those expected after each step (steps, n); empty: they are."""
        speeds = _fit(expected_mps[free], speed_mps[1:][free])
        if speeds.is_off():
            return (
                f"boats are {speeds.factor:.2f} times as fast as their platforms by these commands; the first column "
                "of a command is the speed in m/s, and the platform has to gain speed as the game's boats do"
            )
        gained, missed, most = [], [], []
        for part, boat in self._stretches(free, STRETCH_S):
            seen_mps = speed_mps[part.start + 1 : part.stop + 1, boat]
            gained.append(seen_mps - speed_mps[part.start, boat])
            missed.append(seen_mps - expected_mps[part, boat])
            most.append(self._top_mps()[boat])
        if gained and _size(missed) > MISSED * _size(gained) and _size(gained) > GAINED * max(most):
            return (
                f"boats gain speed otherwise than their platforms, by {_size(missed):.2g} m/s of {_size(gained):.2g}; "
                "the platform has to gain speed as the game's boats do"
            )
        return ""

    def _predicted(self, x: Array) -> Array:
        """Return (steps, n, 2) the turn in each step, deg, and the speed after it, m/s, as the platforms have them.

        Each stretch begins with what the reader reads. What it does not know of a boat's memory (NaN) goes on from the
        stretch before.
        """
        params = np.array([get_platform(kind).pack() for kind in self.fleets[0].platforms])
        expected, now = np.zeros((*x[1:].shape[:2], 2)), np.full(x.shape[1:], np.nan)
        for step, commands in enumerate(self.commands):
            if step % self._steps_in(STRETCH_S) == 0:
                now = np.where(np.isnan(x[step]), now, x[step])
                fill_memory(now, params)
            before_deg = now[:, L.HEADING].copy()
            for boat, (speed_mps, turn_deg) in enumerate(commands):
                for _ in range(self.moves):
                    step_boat(params[boat], now[boat], speed_mps, turn_deg, self.step_s / self.moves)
            expected[step] = np.column_stack([_wrapped(now[:, L.HEADING] - before_deg), now[:, L.SPEED]])
        return expected


def _pairs(way: np.ndarray) -> Array:
    """Return real columns of the factors of complex numbers: real parts above imaginary ones."""
    return np.block([[way.real[:, None], -way.imag[:, None]], [way.imag[:, None], way.real[:, None]]])


def _solved(design: Array, seen: Array) -> tuple[tuple[complex, complex], Array]:
    """Return the two complex factors that fit best, and the standard errors of their parts."""
    if len(seen) < 2 * design.shape[1]:
        return (math.nan, math.nan), np.full(design.shape[1], np.inf)
    found, *_ = np.linalg.lstsq(design, seen, rcond=None)
    rest = seen - design @ found
    spread = rest @ rest / max(1, len(seen) - design.shape[1])
    errors = np.sqrt(np.maximum(0.0, np.diag(np.linalg.pinv(design.T @ design))) * spread)
    if np.linalg.matrix_rank(design, tol=1e-2 * np.linalg.norm(design)) < design.shape[1]:
        errors = np.full(4, np.inf)
    return (complex(*found[:2]), complex(*found[2:])), errors


def _fit(expected: Array, seen: Array) -> Fit:
    """Return the factor by which what is seen is more than what is expected."""
    weight = float(expected @ expected)
    if weight < 1e-12 or len(seen) < 2:
        return Fit(math.nan, math.inf)
    factor = float(expected @ seen) / weight
    rest = seen - factor * expected
    return Fit(factor, math.sqrt(float(rest @ rest) / (len(seen) - 1) / weight))


def _size(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _wrapped(deg: Array) -> Array:
    return np.asarray((deg + 180.0) % 360.0 - 180.0)
