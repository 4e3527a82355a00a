"""Reading of actions: all environments and wrappers accept and refuse the same ones.

An action is a whole number (one of 17 discrete actions; -1 stops), a pair (speed m/s, relative heading deg) or the name
of a field point. Numbers may be Python's, numpy's or a tensor's, in an array without axes or with one entry, or
whole-valued floats.
"""

from __future__ import annotations

import difflib
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from ..arrays import NoNumbersError, holds_bools, numbers
from ..exceptions import GameError, PolicyError
from ..jit import Array

HEADINGS_DEG = (180.0, 135.0, 90.0, 45.0, 0.0, -45.0, -90.0, -135.0)
DISCRETE = np.array([(share, heading) for share in (1.0, 0.5) for heading in HEADINGS_DEG] + [(0.0, 0.0)])
"""(17, 2): share of top speed and relative heading (deg) of each discrete action. The last one stops the boat."""
STOP = len(DISCRETE) - 1

Command = tuple[float, float]
"""Speed, m/s, and relative heading, deg."""


class Seat(NamedTuple):
    """What `read_action` knows of the boat that acts."""

    name: str  # of the boat, for error messages
    top_mps: float  # its top speed, m/s
    # command that steers for a field point; None if the game has no field points
    to_point: Callable[[str], Command] | None = None
    points: Sequence[str] = ()  # names of the field points, if known
    numbered: bool = False  # whole numbers select field points, not discrete actions
    lowest: int = -1  # lowest number of a discrete action; negative ones count from the end, as Python indices do
    bools: bool = False  # True and False count as numbers
    longer: bool = False  # of a longer action the first two entries count
    pairs: bool = True  # pairs are accepted as well as numbers


def check_agents(actions: Any, agent_ids: Sequence[str]) -> None:
    """Check that actions are a dict whose keys are boats of the game. Boats without an action stop."""
    if not isinstance(actions, Mapping):
        raise GameError(f"actions are a {type(actions).__name__}; give a dict of agent id -> action")
    for agent_id in actions:
        if agent_id not in agent_ids:
            raise GameError(f"unknown agent {agent_id!r} in the actions; agents are {', '.join(agent_ids)}")


def check_boats(agent_ids: Sequence[str], known: Sequence[str]) -> None:
    """Check that these are different boats of the game (PolicyError)."""
    if isinstance(agent_ids, str):
        raise PolicyError(f"agent_ids is the text {agent_ids!r}; give a list of boats: [{agent_ids!r}]")
    if not agent_ids or len(set(agent_ids)) != len(agent_ids) or not set(agent_ids) <= set(known):
        raise PolicyError(f"agent_ids are {list(agent_ids)}; give different ones of {', '.join(known)}")


def team_answer(answer: Any, agent_ids: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """Split what a team policy's ``act`` answered.

    Returns:
        The actions of the team's boats that have one, and what is wrong, by boat: a boat without an action, or a name
        that is none of the team's boats, whose action counts for nothing.

    Raises:
        PolicyError: the answer is no mapping of boat to action.
    """
    if not isinstance(answer, Mapping):
        example = f"{{{agent_ids[0]!r}: 4, ...}}" if agent_ids else "{}"
        raise PolicyError(f"act answered {short(answer, 40)}; return a dict of boat to action, such as {example}")
    actions = {agent: answer[agent] for agent in agent_ids if agent in answer}
    faults = {agent: f"no action for {agent}" for agent in agent_ids if agent not in answer}
    faults |= {
        str(name): f"an action for {short(name, 40)}, which is no boat of this team ({', '.join(agent_ids)})"
        for name in answer
        if name not in agent_ids
    }
    return actions, faults


def read_action(seat: Seat, action: Any) -> Command:
    """Return the command of an action.

    Raises:
        GameError: the action is invalid; the message names the boat and what to give.
    """
    plain = plain_action(seat, action)
    if isinstance(plain, str):
        return _point(seat, plain)
    if isinstance(plain, int):
        share, heading_deg = DISCRETE[plain]
        return float(share) * seat.top_mps, float(heading_deg)
    return plain


def plain_action(seat: Seat, action: Any) -> int | str | Command:
    """Return an action in its plainest form: a number 0..16, a field point's name (not looked up) or two floats."""
    if type(action) is int and seat.lowest <= action <= STOP and not seat.numbered:  # most policies send these,
        return action % len(DISCRETE)
    if _is_plain_pair(action):  # the scripted ones these
        return action
    if isinstance(action, np.ndarray) and action.ndim == 0 and action.dtype.kind in "OU":
        action = action.item()
    if isinstance(action, str):
        return str(action)
    values = _values(seat, action)
    if values.shape in ((), (1,)):
        return _number(seat, action, float(values.reshape(())))
    if seat.longer and values.ndim == 1:
        values = values[:2]
    if values.shape != (2,):
        raise _unusable(seat, action)
    if not np.isfinite(values).all():
        raise GameError(
            f"action {short(action)} of {seat.name} is not finite; give finite speed m/s and relative heading deg"
        )
    return float(values[0]), float(values[1])


def _is_plain_pair(action: Any) -> TypeGuard[Command]:
    floats = type(action) is tuple and len(action) == 2 and type(action[0]) is type(action[1]) is float
    return floats and math.isfinite(action[0]) and math.isfinite(action[1])


def _values(seat: Seat, action: Any) -> Array:
    """Return the numbers of an action."""
    if not seat.bools and holds_bools(action):
        raise _unusable(seat, action)
    try:
        return numbers(action, seat.bools)
    except NoNumbersError:
        pass
    try:
        return np.array(float(operator.index(action)))  # anything that can index a list
    except Exception:  # foreign code may raise anything
        raise _unusable(seat, action) from None


def _number(seat: Seat, action: Any, value: float) -> int | str:
    if not np.isfinite(value) or value != np.floor(value):
        raise _unusable(seat, action)
    if seat.numbered:
        if not 0 <= value < len(seat.points):
            raise GameError(f"action {value:.0f} of {seat.name} is no field point; {_help(seat)}")
        return seat.points[int(value)]
    if not seat.lowest <= value <= STOP:
        raise GameError(f"action {_whole(value)} of {seat.name} is out of range; {_help(seat)}")
    return int(value) % len(DISCRETE)


def _point(seat: Seat, name: str) -> Command:
    if seat.to_point is None:
        raise GameError(f"action {short(name)} of {seat.name} names a field point, as in single games; {_help(seat)}")
    try:
        if not seat.points or name in seat.points:
            return seat.to_point(name)
    except KeyError:  # the game does not list its points, but knows them
        pass
    near = difflib.get_close_matches(name, seat.points, n=3)
    hint = f"did you mean {', '.join(near)}?" if near else f"there are {', '.join(seat.points) or 'others'}"
    raise GameError(f"unknown field point {short(name)}; {hint}")


def _unusable(seat: Seat, action: Any) -> GameError:
    return GameError(f"action {short(action)} of {seat.name} is not usable; {_help(seat)}")


def _help(seat: Seat) -> str:
    whole = f"0..{len(seat.points) - 1}" if seat.numbered else f"0..{STOP} (or -1 to stop)"
    if not seat.pairs:
        return f"give a whole number {whole}"
    point = "" if seat.to_point is None else " or a field point's name"
    comma = "," if point else " or"
    return f"give a whole number {whole}{comma} a pair (speed m/s, relative heading deg){point}"


def _whole(value: float) -> str:
    return f"{value:.0f}" if abs(value) < 1e9 else f"{value:g}"


def short(what: Any, length: int = 80) -> str:
    """Return the value's repr in one line of at most ``length`` characters."""
    what = what.item() if isinstance(what, np.generic) else what
    try:
        text = " ".join(repr(what).split())
    except Exception:  # foreign objects may raise anything
        text = f"<{type(what).__name__}>"
    return text if len(text) <= length else text[: length - 1] + "…"


def read_flat(actions: Any, top_mps: Array, seat_of: Callable[[int], Seat], pairs: bool) -> Array:
    """Return commands (n, 2) of n boats, speed m/s and relative heading deg, for an array or n actions of any kind.

    Arrays hold pairs (n, 2) or discrete actions (n,). ``seat_of`` describes a boat for error messages.
    """
    n = len(top_mps)
    try:
        given = numbers(actions)
    except NoNumbersError:
        rows = list(actions) if isinstance(actions, Iterable) and not isinstance(actions, (str, bytes, Mapping)) else []
    else:
        fits = given.shape == ((n, 2) if pairs else (n,))
        if fits and pairs and np.isfinite(given).all():
            return given.copy()
        whole = fits and not pairs and ((given == np.floor(given)) & (given >= -1) & (given <= STOP)).all()
        if whole:
            return DISCRETE[given.astype(np.int64)] * np.stack([top_mps, np.ones(n)], axis=1)
        rows = list(actions) if fits else []
    if len(rows) != n:
        wanted = f"finite actions of shape ({n}, 2): speed m/s, relative heading deg"
        raise GameError(f"give {wanted}" if pairs else f"give {n} discrete actions in 0..{STOP} (or -1 to stop)")
    return np.array([read_action(seat_of(i), row) for i, row in enumerate(rows)]).reshape(-1, 2)
