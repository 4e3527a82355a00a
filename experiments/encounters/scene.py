"""Encounters to be played: where boats start, what steers them, the conditions, and the files that hold them.

What steers a boat is a script: one row of numbers, read by compiled code. It has three phases. A boat starts in phase 0
and moves on to the next once the time ``AT_S`` of that phase has come or its target is within ``WITHIN_M`` of it. In a
phase it aims at something, at a speed, off by an angle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.calls import checked_calls
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

from ..play.conditions import MOST as MOST_CONDITIONS
from ..play.conditions import Conditions as GameConditions
from ..play.conditions import check_values
from ..result_files import read_json, write_json

DT_S = 0.1
MOST = {"radius_m": 20.0, **MOST_CONDITIONS}
FORMAT = 1
"""Of scene files."""
PER_GAME: dict[str, Any] = dict.fromkeys(("state", "script", "goals", "current"), float)
PER_GAME |= {"noise_seed": "u8", "number": "i8"}
"""Arrays of scenes with an entry per game, and what they hold."""
LONGEST_S, FARTHEST_M, FASTEST_MPS = 3600.0, 1e5, 50.0
MOST_STATES = 2_000_000
"""Boats times games times steps of a scene file: all of them are kept until the last is played."""
Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax, m."""


TARGET, AUTHORITY, REACHED_M, PHASE = range(4)
"""Columns of a row: the boat that is hunted (-1: the nearest of the other team); whether it turns with all the rudder
there is, through the derivative of its own autopilot, rather than ask for headings; distance within which a goal counts
as reached, m; the first column of the phases."""
PHASES = 3
AIM, SPEED_MPS, LEAD, ANGLE_DEG, STANDOFF_M, AT_S, WITHIN_M, N_PHASE = range(8)
"""Columns of a phase: what is aimed at; speed; share of the way to the meeting point by which a hunter aims ahead (0 is
pure pursuit); angle added to the bearing (the heading itself for `AIM_HEADING`); how far ahead of the target's bow it
aims, m; time and distance to the target at which the phase begins, s and m (0: never)."""
N_SCRIPT = PHASE + PHASES * N_PHASE
AIM_GOALS, AIM_HEADING, AIM_TARGET, AIM_NOWHERE = range(4)
"""Values of ``AIM``; nowhere: it stays where it is, without speed."""


def phase(
    aim: int,
    speed_mps: float = 0.0,
    lead: float = 0.0,
    angle_deg: float = 0.0,
    standoff_m: float = 0.0,
    at_s: float = math.inf,
    within_m: float = 0.0,
) -> Array:
    """One phase, (N_PHASE,); its columns are described above."""
    return np.array([aim, speed_mps, lead, angle_deg, standoff_m, at_s, within_m], dtype=np.float64)


def script(*phases: Array, target: int = -1, authority: bool = False, reached_m: float = 3.0) -> Array:
    """A script row, (N_SCRIPT,); phases that are left out never begin."""
    never = [phase(AIM_NOWHERE)] * (PHASES - len(phases))
    return np.concatenate([[target, authority, reached_m], *phases, *never])


def to_goals(speed_mps: float, reached_m: float) -> Array:
    """Script of a boat that makes for its goals in turn."""
    return script(phase(AIM_GOALS, speed_mps), reached_m=reached_m)


@checked_calls()
@dataclass(frozen=True)
class Conditions(GameConditions):
    """What holds for all encounters of a run: that of games, and ``radius_m``, the separation to keep, m.

    Raises:
        ConfigError: a value that is not finite, negative or too large.
    """

    radius_m: float = 2.5

    def __post_init__(self) -> None:
        check_values(asdict(self), MOST)
        if not self.radius_m > 0.0:
            raise ConfigError(f"radius_m is {self.radius_m}; give a radius above 0")


@dataclass(frozen=True)
class Scenes:
    """A batch of B games of the same fleet; the own boats are team 0 and come first.

    Attributes:
        family: name of their family.
        platforms: of the n boats.
        team: (n,) 0 own, 1 other.
        state: (B, n, N_STATE) at the start.
        script: (B, n, N_SCRIPT) what steers each boat.
        goals: (B, n, G, 2) m.
        current: (B, 2) direction of the current, unit length.
        noise_seed: (B,) uint64, of each game's position errors.
        number: (B,) encounter a game belongs to; games of the same number are variants, of which the worst counts.
        field: where own boats are to stay, or None for open water.
        length_s: how long they last, s.
    """

    family: str
    platforms: tuple[str, ...]
    team: IntArray
    state: Array
    script: Array
    goals: Array
    current: Array
    noise_seed: NDArray[np.uint64]
    number: IntArray
    field: Box | None
    length_s: float

    dt_s = DT_S
    """Step, s."""

    @property
    def games(self) -> int:
        """Number of games B."""
        return len(self.state)

    @property
    def steps(self) -> int:
        """Steps of each game."""
        return round(self.length_s / DT_S)

    @property
    def own(self) -> NDArray[np.bool_]:
        """(n,) boats of the own team."""
        return np.asarray(self.team == 0)

    @property
    def params(self) -> Array:
        """(n, N_PARAM) platform rows."""
        return np.array([get_platform(name).pack() for name in self.platforms])

    def take(self, games: Sequence[int] | IntArray) -> Scenes:
        """Some of the games."""
        chosen = np.asarray(games, dtype=np.int64)
        arrays: dict[str, Any] = {name: getattr(self, name)[chosen] for name in PER_GAME}
        return replace(self, **arrays)


def scene_content(scenes: Scenes, conditions: Conditions, **notes: Any) -> dict[str, Any]:
    """What a scene file holds: every number in full, infinite times as null, ``notes`` kept beside it."""
    return {
        "format": FORMAT,
        **{name: getattr(scenes, name) for name in ("family", "platforms", "field", "length_s")},
        **{name: _plain(getattr(scenes, name)) for name in ("team", *PER_GAME)},
        "conditions": asdict(conditions),
        **notes,
    }


def _plain(array: NDArray[Any]) -> Any:
    """Nested lists, with None for what JSON has no number for."""
    plain: Any = array.astype(object)
    plain[~np.isfinite(array)] = None
    return plain.tolist()


def write_scene(path: Path, scenes: Scenes, conditions: Conditions, **notes: Any) -> Path:
    """Write scenes.

    Raises:
        ConfigError: the file cannot be written.
    """
    write_json(path, scene_content(scenes, conditions, **notes))
    return path


def read_scene(path: Path) -> tuple[Scenes, Conditions]:
    """Read what `write_scene` wrote.

    Raises:
        ConfigError: the file cannot be read or is no scene; the message says what is wrong.
    """
    content = read_json(path, "a scene", "give a file that `steerclear attack` wrote")
    try:
        return scenes_of(content)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        why = str(error) if isinstance(error, ConfigError) else f"{type(error).__name__}: {error}"
        raise ConfigError(f"{path} is no scene ({why}); give a file that `steerclear attack` wrote") from None


def scenes_of(content: Mapping[str, Any]) -> tuple[Scenes, Conditions]:
    """Scenes and conditions of what a scene file holds: compiled code trusts every number it is given.

    Raises:
        ConfigError: another format, or scenes that cannot be played; the message names what is wrong.
        KeyError: something is missing.
    """
    if content["format"] != FORMAT:
        raise ConfigError(f"the scene has format {content['format']}; this version reads {FORMAT}")
    arrays: dict[str, Any] = {name: np.array(content[name], dtype=kind) for name, kind in PER_GAME.items()}
    arrays["script"][np.isnan(arrays["script"])] = np.inf
    box: Any = None if content["field"] is None else tuple(map(float, content["field"]))
    scenes = Scenes(
        family=str(content["family"]),
        platforms=tuple(content["platforms"]),
        team=np.array(content["team"], dtype=np.int64),
        field=box,
        length_s=float(content["length_s"]),
        **arrays,
    )
    for sound, words in _checks(scenes):
        if not sound:
            raise ConfigError(f"the scene {words}")
    return scenes, Conditions(**content["conditions"])


def _checks(scenes: Scenes) -> Iterator[tuple[Any, str]]:
    """What makes scenes playable, and what is said where it is not so; each is asked only if all before it are."""
    team, box, games, n = scenes.team, scenes.field, scenes.games, len(scenes.params)
    in_order = team.ndim == 1 and len(team) and np.isin(team, (0, 1)).all() and team[0] == 0
    yield in_order and (np.diff(team) >= 0).all(), "has a team other than 0 for the own boats, first, then 1 for others"
    is_box = box is None or (len(box) == 4 and np.abs(box).max() <= FARTHEST_M and box[0] < box[2] and box[1] < box[3])
    yield is_box, "has a field that is neither xmin, ymin, xmax, ymax in m nor null for open water"
    goals = max(scenes.goals.shape[2], 1) if scenes.goals.ndim == 4 else 1
    shapes = ((n,), (games, n, L.N_STATE), (games, n, N_SCRIPT), (games, n, goals, 2), (games, 2), (games,), (games,))
    for name, shape in zip(("team", *PER_GAME), shapes, strict=True):
        found = getattr(scenes, name).shape
        yield found == shape and games, f"has a {name} of shape {found}; expected {shape}"
    script, later = scenes.script, [AT_S, WITHIN_M]
    phases = script[..., PHASE:].reshape(*script.shape[:-1], PHASES, N_PHASE)
    known = np.isin(script[..., TARGET], np.arange(-1, n)).all()
    known = known and np.isin(phases[..., AIM], np.arange(AIM_NOWHERE + 1)).all()
    yield known, "has a script that names a boat or an aim that there is not"
    yield np.isin(script[..., AUTHORITY], (0, 1)).all(), "has a script with an authority other than 0 and 1"
    sizes = np.abs(np.delete(phases, later, axis=-1)).max(), np.abs(script[..., REACHED_M]).max()
    yield max(sizes) <= FARTHEST_M, "has a script with a number that is not finite, or out of all bounds"
    finite = all(np.isfinite(array).all() for array in (scenes.state, scenes.goals, scenes.current))
    yield finite, "holds a state, a goal or a current that is not finite"
    farthest_m = max(float(np.abs(part).max(initial=0.0)) for part in (scenes.state[..., [L.X, L.Y]], scenes.goals))
    yield farthest_m <= FARTHEST_M, f"holds a place over {FARTHEST_M / 1e3:g} km away; give m"
    fast = np.abs(scenes.state[..., L.SPEED]).max() > FASTEST_MPS
    yield not fast, f"holds a boat faster than {FASTEST_MPS:g} m/s; give m/s"
    yield np.hypot(*scenes.current.T).max() <= 1.0 + 1e-6, "has a current that is no direction, of length 1 or 0"
    length_s = scenes.length_s
    yield 0.0 < length_s <= LONGEST_S, f"lasts {length_s} s; give more than 0 and at most an hour"
    states = games * n * (length_s / DT_S)
    yield states <= MOST_STATES, f"is {states:,.0f} states of boats, at most {MOST_STATES:,} are played; divide it"
