"""Whether what a scene file holds can be played: compiled code trusts every number it is given."""

from __future__ import annotations

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

from .scenes import DT_S, Scenes
from .script import AIM, AIM_NOWHERE, AT_S, AUTHORITY, N_PHASE, N_SCRIPT, PHASE, PHASES, REACHED_M, TARGET, WITHIN_M

LONGEST_S = 3600.0
MOST_STATES = 2_000_000
"""Boats times games times steps: all of them are kept until the last is played."""
FARTHEST_M = 1e5
FASTEST_MPS = 50.0


def check_scenes(scenes: Scenes) -> None:
    """Refuse scenes that cannot be played.

    Raises:
        ConfigError: names what cannot be.
    """
    _check_fleet(scenes)
    _check_shapes(scenes)
    _check_script(scenes.script, len(scenes.platforms))
    if not (np.isfinite(scenes.state).all() and np.isfinite(scenes.goals).all() and np.isfinite(scenes.current).all()):
        raise ConfigError("the scene holds a state, a goal or a current that is not finite")
    places = (scenes.state[..., L.X], scenes.state[..., L.Y], scenes.goals)
    if max(float(np.abs(place).max(initial=0.0)) for place in places) > FARTHEST_M:
        raise ConfigError(f"the scene holds a place over {FARTHEST_M / 1e3:g} km away; give m")
    if float(np.abs(scenes.state[..., L.SPEED]).max()) > FASTEST_MPS:
        raise ConfigError(f"a boat of the scene is faster than {FASTEST_MPS:g} m/s; give m/s")
    if float(np.hypot(*scenes.current.T).max()) > 1.0 + 1e-6:
        raise ConfigError("the scene's current is a direction of length 1 (or 0); its speed stands in the conditions")
    if not 0.0 < scenes.length_s <= LONGEST_S:
        raise ConfigError(f"the scene lasts {scenes.length_s} s; give more than 0 and at most an hour")
    states = len(scenes.state) * len(scenes.platforms) * (scenes.length_s / DT_S)
    if states > MOST_STATES:
        raise ConfigError(f"the scene is {states:,.0f} states of boats, at most {MOST_STATES:,} are played; divide it")


def _check_fleet(scenes: Scenes) -> None:
    for name in scenes.platforms:
        get_platform(name)
    team = scenes.team
    if team.ndim != 1 or len(team) == 0 or not np.isin(team, (0, 1)).all() or team[0] != 0 or (np.diff(team) < 0).any():
        raise ConfigError("the scene's team is 0 for each own boat, which come first, then 1 for each other")
    box = scenes.field
    if box is not None and not (
        len(box) == 4 and np.abs(box).max() <= FARTHEST_M and box[0] < box[2] and box[1] < box[3]
    ):
        raise ConfigError("the scene's field is xmin, ymin, xmax, ymax in m, or null for open water")


def _check_shapes(scenes: Scenes) -> None:
    games, n = len(scenes.state), len(scenes.platforms)
    goals = scenes.goals.shape[2] if scenes.goals.ndim == 4 else 1
    shapes = {
        "team": (n,),
        "state": (games, n, L.N_STATE),
        "script": (games, n, N_SCRIPT),
        "goals": (games, n, max(goals, 1), 2),
        "current": (games, 2),
        "noise_seed": (games,),
        "number": (games,),
    }
    for name, shape in shapes.items():
        if getattr(scenes, name).shape != shape or games < 1:
            raise ConfigError(f"{name} of the scene has shape {getattr(scenes, name).shape}; expected {shape}")


def _check_script(script: np.ndarray, n: int) -> None:
    """Numbers of boats and of aims must be such; only times and distances at which something begins may be infinite."""
    phases = script[..., PHASE:].reshape(*script.shape[:-1], PHASES, N_PHASE)
    target, aim = script[..., TARGET], phases[..., AIM]
    if not (np.isin(target, np.arange(-1, n)).all() and np.isin(aim, np.arange(AIM_NOWHERE + 1)).all()):
        raise ConfigError("the scene's script names a boat or an aim that there is not")
    if not np.isin(script[..., AUTHORITY], (0, 1)).all():
        raise ConfigError("the scene's script has an authority other than 0 and 1")
    later = [AT_S, WITHIN_M]
    steady = np.delete(phases, later, axis=-1)
    if np.isnan(phases[..., later]).any() or not (np.abs(steady) <= FARTHEST_M).all():
        raise ConfigError("the scene's script holds a number that is not finite, or out of all bounds")
    if not (np.abs(script[..., REACHED_M]) <= FARTHEST_M).all():
        raise ConfigError("the scene's script reaches goals at a distance out of all bounds")
