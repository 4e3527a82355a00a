"""Encounters to be played: where boats start, what steers them, the conditions, and the files that hold them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

from ..play.conditions import MOST as MOST_CONDITIONS
from ..play.conditions import check_values
from ..result_files import read_json, write_json
from . import script as S

DT_S = 0.1
RADIUS_M = 2.5
MOST = {"radius_m": 20.0, **MOST_CONDITIONS}
FORMAT = 1
"""Of scene files."""
PER_GAME = ("state", "script", "goals", "current", "noise_seed", "number")
"""Arrays of scenes with an entry per game."""
LONGEST_S, FARTHEST_M, FASTEST_MPS = 3600.0, 1e5, 50.0
MOST_STATES = 2_000_000
"""Boats times games times steps of a scene file: all of them are kept until the last is played."""
Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax, m."""


@dataclass(frozen=True)
class Conditions:
    """What holds for all encounters of a run.

    Attributes:
        radius_m: separation to keep, m.
        delay_s: time from a command of an own boat to its effect, s.
        noise_m: bound on the error of every position that the own team sees, m.
        current_mps: speed of the current, m/s; each encounter draws its direction, of which no guard is told.

    Raises:
        ConfigError: a value that is not finite, negative or beyond `MOST`.
    """

    radius_m: float = RADIUS_M
    delay_s: float = 0.0
    noise_m: float = 0.0
    current_mps: float = 0.0

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

    def take(self, games: Sequence[int] | IntArray) -> Scenes:
        """Some of the games."""
        chosen = np.asarray(games, dtype=np.int64)
        arrays: dict[str, Any] = {name: getattr(self, name)[chosen] for name in PER_GAME}
        return replace(self, **arrays)


def join(scenes: Sequence[Scenes]) -> Scenes:
    """Put batches of the same fleet into one."""
    arrays: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in scenes]) for name in PER_GAME}
    return replace(scenes[0], **arrays)


def scene_content(scenes: Scenes, conditions: Conditions, **notes: Any) -> dict[str, Any]:
    """What a scene file holds: every number in full, infinite times as null, ``notes`` kept beside it."""
    return {
        "format": FORMAT,
        "family": scenes.family,
        "platforms": list(scenes.platforms),
        "team": scenes.team.tolist(),
        "field": None if scenes.field is None else list(scenes.field),
        "length_s": scenes.length_s,
        "conditions": asdict(conditions),
        **{name: _mapped(getattr(scenes, name).tolist(), _finite_or_none) for name in PER_GAME},
        **notes,
    }


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
    kinds = {"noise_seed": np.uint64, "number": np.int64}
    arrays: dict[str, Any] = {
        name: np.array(_mapped(content[name], _number_or_inf), dtype=kinds.get(name, np.float64)) for name in PER_GAME
    }
    box: Any = None if content["field"] is None else tuple(map(float, content["field"]))
    scenes = Scenes(
        family=str(content["family"]),
        platforms=tuple(content["platforms"]),
        team=np.array(content["team"], dtype=np.int64),
        field=box,
        length_s=float(content["length_s"]),
        **arrays,
    )
    for wrong, words in _faults(scenes):
        if wrong:
            raise ConfigError(words)
    return scenes, Conditions(**content["conditions"])


def _mapped(value: Any, change: Any) -> Any:
    return [_mapped(item, change) for item in value] if isinstance(value, list) else change(value)


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number_or_inf(value: Any) -> Any:
    return math.inf if value is None else value


def _faults(scenes: Scenes) -> Iterator[tuple[bool, str]]:
    """What makes scenes unplayable, and whether it is so; each is asked only if none before it is."""
    team, box, games, n = scenes.team, scenes.field, len(scenes.state), len(scenes.platforms)
    for name in scenes.platforms:
        get_platform(name)
    in_order = team.ndim == 1 and len(team) > 0 and np.isin(team, (0, 1)).all() and team[0] == 0
    yield (
        not in_order or bool((np.diff(team) < 0).any()),
        "the scene's team is 0 for each own boat, which come first, then 1 for each other",
    )
    is_box = box is None or (len(box) == 4 and np.abs(box).max() <= FARTHEST_M and box[0] < box[2] and box[1] < box[3])
    yield not is_box, "the scene's field is xmin, ymin, xmax, ymax in m, or null for open water"
    goals = max(scenes.goals.shape[2], 1) if scenes.goals.ndim == 4 else 1
    shapes = ((n,), (games, n, L.N_STATE), (games, n, S.N_SCRIPT), (games, n, goals, 2), (games, 2), (games,), (games,))
    for name, shape in zip(("team", *PER_GAME), shapes, strict=True):
        found = getattr(scenes, name).shape
        yield found != shape or games < 1, f"{name} of the scene has shape {found}; expected {shape}"
    yield from _script_faults(scenes.script, n)
    finite = all(np.isfinite(array).all() for array in (scenes.state, scenes.goals, scenes.current))
    yield not finite, "the scene holds a state, a goal or a current that is not finite"
    farthest_m = max(float(np.abs(part).max(initial=0.0)) for part in (scenes.state[..., [L.X, L.Y]], scenes.goals))
    yield farthest_m > FARTHEST_M, f"the scene holds a place over {FARTHEST_M / 1e3:g} km away; give m"
    fastest_mps = float(np.abs(scenes.state[..., L.SPEED]).max())
    yield fastest_mps > FASTEST_MPS, f"a boat of the scene is faster than {FASTEST_MPS:g} m/s; give m/s"
    words = "the scene's current is a direction of length 1 (or 0); its speed stands in the conditions"
    yield float(np.hypot(*scenes.current.T).max()) > 1.0 + 1e-6, words
    length_s = scenes.length_s
    yield not 0.0 < length_s <= LONGEST_S, f"the scene lasts {length_s} s; give more than 0 and at most an hour"
    states = games * n * (length_s / DT_S)
    words = f"the scene is {states:,.0f} states of boats, at most {MOST_STATES:,} are played; divide it"
    yield states > MOST_STATES, words


def _script_faults(script: Array, n: int) -> Iterator[tuple[bool, str]]:
    """Numbers of boats and of aims must be such; only times and distances at which something begins may be infinite."""
    phases = script[..., S.PHASE :].reshape(*script.shape[:-1], S.PHASES, S.N_PHASE)
    known = np.isin(script[..., S.TARGET], np.arange(-1, n)).all()
    known = known and np.isin(phases[..., S.AIM], np.arange(S.AIM_NOWHERE + 1)).all()
    yield not known, "the scene's script names a boat or an aim that there is not"
    flags = np.isin(script[..., S.AUTHORITY], (0, 1)).all()
    yield not flags, "the scene's script has an authority other than 0 and 1"
    later = [S.AT_S, S.WITHIN_M]
    bounded = (np.abs(np.delete(phases, later, axis=-1)) <= FARTHEST_M).all()
    sound = bounded and not np.isnan(phases[..., later]).any()
    yield not sound, "the scene's script holds a number that is not finite, or out of all bounds"
    reached = (np.abs(script[..., S.REACHED_M]) <= FARTHEST_M).all()
    yield not reached, "the scene's script reaches goals at a distance out of all bounds"
