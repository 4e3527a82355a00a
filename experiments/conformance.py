"""What a policy, a boat, a reader or a barrier must be; each check raises `NotConforming` where it is not.

Run them over your own in a test: ``check_policy("mine")``, ``check_platform("mine")``, ``check_reader(make_env)``,
``check_barrier("mine")``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.protocol import TeamPolicy
from steerclear.shield.barriers.registry import Barrier, get_barrier, takes_values
from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import PlatformFile, parse_platform, to_text
from steerclear.shield.wrappers import reader_of

STEPS = 20
FALL = 1.05
"""Most a margin may fall by in a metre: 1, as a distance, and a little for curves."""
FASTEST_MPS = 8.0
"""A margin that falls faster may be below 0 between two samples of a path, by as much as in half of their time, m/s."""
SLOPE_OFF = 0.05
"""Most a slope may be off the differences of its margin, m per m, at nine of ten places: elsewhere there are edges."""


class NotConforming(SteerclearError):
    """Something registered is not what its registry promises."""


def _hold(condition: bool, what: str) -> None:
    if not condition:
        raise NotConforming(what)


def check_policy(name: str, preset: str = "aamas2024", **options: Any) -> None:
    """A policy plays both sides, gives every boat a usable action, and the same ones again from the same seed."""
    for side in (0, 1):
        games = [_actions_of(name, preset, side, options) for _ in range(2)]
        _hold(games[0] == games[1], f"policy {name!r} gives other actions from the same seed; draw from reset's seed")


def _actions_of(name: str, preset: str, side: int, options: dict[str, Any]) -> list[list[tuple[float, float]]]:
    policy, env = policies.make(name, **options), MctfEnv(preset)
    _hold(isinstance(policy, TeamPolicy), f"policy {name!r} is no TeamPolicy; give it name, reset and act")
    _hold(policy.name == name, f"policy {name!r} calls itself {policy.name!r}; its name is what finds it")
    observations, infos = env.reset(seed=1)
    size = env.config.team_size
    agents = env.possible_agents[side * size : (side + 1) * size]
    policy.reset(env, agents, seed=3)
    reader, played = policies.ActionReader(env), []
    for _ in range(STEPS):
        actions = policy.act(observations, infos)
        _hold(set(actions) == set(agents), f"policy {name!r} answers for {sorted(actions)}, not for {agents}")
        played.append([reader.command(agent, actions[agent]) for agent in agents])
        observations, _, _, _, infos = env.step(actions)
    env.close()
    return played


def check_platform(name: str | Platform) -> None:
    """A boat is known by its name, is written to a file and read again the same, stays finite and within its speed."""
    boat = get_platform(name)
    if isinstance(name, str):
        _hold(boat.name == name, f"platform {name!r} calls itself {boat.name!r}")
    again = parse_platform(to_text(PlatformFile(boat, {}))).platform
    _hold(again == boat, f"platform {boat.name!r} is another boat once it was written to a file and read")
    params, state = boat.pack(), fresh_state(0.0, 0.0, 0.0, 0.0)
    for error_deg in (0.0, 170.0, -170.0, 5.0):
        for _ in range(100):
            step_boat(params, state, boat.max_speed_mps, error_deg, 0.1)
            _hold(bool(np.isfinite(state[: L.SPEED + 1]).all()), f"platform {boat.name!r} leaves the numbers")
            fast = state[L.SPEED] > boat.max_speed_mps * (1.0 + 1e-9)
            _hold(not fast, f"platform {boat.name!r} exceeds its top speed of {boat.max_speed_mps:g} m/s")


def check_reader(make_env: Callable[[], Any]) -> None:
    """A reader sees all boats, and lets commands through as they are when nothing filters them.

    ``make_env`` builds the environment; each one, reset with the same seed, is the same game. Boats without discrete
    actions play samples of their ``action_space(agent)``.
    """
    if not callable(make_env):
        raise ConfigError(f"make_env is {type(make_env).__name__}; give a function that builds the env: lambda: env")
    plain, filtered = make_env(), make_env()
    plain_reader, reader = reader_of(plain), reader_of(filtered)
    facts, seen, agents = reader.facts(), list[Array](), reader.agent_ids
    for env in (plain, filtered):
        env.reset(seed=5)
    n = len(agents)
    _hold(len(facts.team) == n == len(facts.radius_m), f"facts are of {len(facts.team)} boats, agent_ids of {n}")
    moments = {reader.moment()}

    def passing(commands: Array) -> Array:
        seen.append(np.array(commands))
        return commands

    for step in range(STEPS):
        actions = {agent: _any_action(plain, agent, step + i) for i, agent in enumerate(agents)}
        plain.step(plain_reader.playable(actions))
        with reader.filtering(passing):
            filtered.step(reader.playable(actions))
        fleet, same = plain_reader.fleet(0, True), reader.fleet(0, True)
        _hold(len(fleet.names) == n and bool(np.isfinite(fleet.state[:, : L.SPEED + 1]).all()), "a fleet lacks boats")
        alike = np.array_equal(fleet.state, same.state, equal_nan=True)  # what a fleet does not know is NaN
        _hold(alike, "the game is another one under a filter that changes nothing")
        moments.add(reader.moment())
    _hold(len(moments) == STEPS + 1, "moment() is the same after a step; give the game's time")
    _hold(bool(seen) and all(c.shape == (n, 2) for c in seen), f"filtering hands over no commands of shape ({n}, 2)")
    for team in (0, 1):
        reader.surroundings(team, True)


def _any_action(env: Any, agent: str, number: int) -> Any:
    """Return an action for a boat: a whole number, or a sample where its action space is known to be another."""
    space = env.action_space(agent) if callable(getattr(env, "action_space", None)) else None
    if space is None or isinstance(space, Discrete):
        return number % 16
    space.seed(number)
    return space.sample()


def check_barrier(name: str, area_m: tuple[float, float, float, float] = (-100.0, -100.0, 100.0, 100.0)) -> None:
    """A barrier gives the same margins again, none that is no number, falls as a distance does, and so its slope says.

    It is tried in ``area_m`` (xmin, ymin, xmax, ymax), up to a minute ahead.
    """
    if not (np.shape(area_m) == (4,) and area_m[0] < area_m[2] and area_m[1] < area_m[3]):
        raise ConfigError(f"area_m is {area_m!r}; give (xmin, ymin, xmax, ymax), m")
    barrier, random = get_barrier(name), np.random.default_rng(1)
    values, h, off = _values(barrier), 0.05, list[bool]()
    _hold(len(values) == len(_values(barrier)), f"values of barrier {name!r} are not as many each time; give as many")
    for x, y, ahead in random.uniform((*area_m[:2], 0.0), (*area_m[2:], 60.0), (300, 3)).tolist():
        where = f"at ({x:.1f}, {y:.1f}) m, {ahead:.1f} s ahead"
        places_round = ((0.0, 0.0), (h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h))
        row = [_margin(barrier, x + dx, y + dy, ahead, values, where) for dx, dy in places_round]
        _hold(row[0] == _margin(barrier, x, y, ahead, values, where), f"barrier {name!r} gives another margin {where}")
        if not all(map(math.isfinite, row)):
            continue
        slopes = (row[1] - row[2]) / (2.0 * h), (row[3] - row[4]) / (2.0 * h)
        fall, late = math.hypot(*slopes), _margin(barrier, x, y, ahead + h, values, where)
        fast = (row[0] - late) / h
        _hold(
            not fast > FASTEST_MPS,
            f"barrier {name!r} falls by {fast:.3g} m in a second {where}, and paths are asked every 0.1 to 0.4 s; "
            f"no more than {FASTEST_MPS:g} m in a second is sure to be seen: give what moves so fast a wider domain",
        )
        _hold(fall <= FALL, f"barrier {name!r} falls by {fall:.3g} m in a metre {where}; divide its margin by that")
        if barrier.slope is not None:
            off.append(not math.dist(_slope(barrier, x, y, ahead, values, where), slopes) <= SLOPE_OFF)
    _hold(10 * sum(off) <= len(off), f"the slope of barrier {name!r} is not its margin's; mend it, or leave it out")


@contextmanager
def _foreign(what: str) -> Iterator[None]:
    """What foreign code raises, which may be anything, in words."""
    try:
        yield
    except Exception as error:
        raise NotConforming(f"{what}: {type(error).__name__}: {error}") from error


def _values(barrier: Barrier) -> Array:
    with _foreign(f"values of barrier {barrier.name!r} raise"):
        return barrier.now()


def _asked(barrier: Barrier, function: Callable[..., Any], *given: Any) -> Any:
    return function(*given) if takes_values(barrier.name, function) else function(*given[:-1])


def _slope(barrier: Barrier, x: float, y: float, ahead_s: float, values: Array, where: str) -> tuple[float, float]:
    assert barrier.slope is not None
    with _foreign(f"the slope of barrier {barrier.name!r} is no pair of numbers {where}"):
        along_x, along_y = (float(part) for part in _asked(barrier, barrier.slope, x, y, ahead_s, values))
    return along_x, along_y


def _margin(barrier: Barrier, x: float, y: float, ahead_s: float, values: Array, where: str) -> float:
    with _foreign(f"barrier {barrier.name!r} raises {where}"):
        margin = float(_asked(barrier, barrier.margin, x, y, ahead_s, values))
    _hold(not math.isnan(margin), f"barrier {barrier.name!r} is no number {where}; give +inf far from what is kept")
    return margin
