"""What a policy, a boat, a reader or a barrier must be; each check raises `NotConforming` where it is not.

Run them over your own in a test: ``check_policy("mine")``, ``check_platform("mine")``, ``check_reader(make_env)``,
``check_barrier("mine")``.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.protocol import TeamPolicy
from steerclear.shield.barriers.registry import Barrier, get_barrier, takes_values
from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array
from steerclear.shield.platforms import Platform, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import PlatformFile, parse_platform, to_text
from steerclear.shield.wrappers import reader_of
from steerclear.shield.wrappers.checks import check_boats, facts_of

from .reader_motion import Motion

STEPS, MOST_STEPS = 20, 400
PLAYED_S, HELD_S = 15.0, 1.5
"""A reader's game is played for so long, and each action held, s."""
TURNS_DEG, SPEEDS = (20.0, 0.0, -20.0, 60.0, 0.0, -8.0, -60.0, 8.0), (1.0, 1.0, 0.5)
"""Commands by which a reader's boats are steered: turns, and speeds as shares of the top speed."""
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
    """A reader sees all boats as they move, and lets commands through as they are when nothing filters them.

    Boats have to move along their headings by their speeds, and as their platforms do by the commands: those that
    ``commands`` reads from actions, and those that ``filtering`` plays in their place.

    ``make_env`` builds the environment; each one, reset with the same seed, is the same game. Boats without discrete
    actions play samples of their ``action_space(agent)``.
    """
    if not callable(make_env):
        raise ConfigError(f"make_env is {type(make_env).__name__}; give a function that builds the env: lambda: env")
    games = [_Played(make_env()) for _ in range(3)]
    plain, passed, steered = games
    begun, again = (game.motion.fleets[0].state for game in (plain, passed))
    _hold(
        np.array_equal(begun, again, equal_nan=True),
        "the game begins otherwise each time it is reset with the same seed; give an env whose starts follow the seed, "
        "or are fixed",
    )
    steps = min(MOST_STEPS, max(STEPS, round(PLAYED_S / plain.step_s)))
    for step in range(steps):
        if not all(game.goes_on() for game in games):
            break
        number = step // plain.held
        actions = {agent: _any_action(plain.env, agent, number + i) for i, agent in enumerate(plain.reader.agent_ids)}
        nominal = plain.step(actions)
        passed.step(actions, lambda commands: commands)
        steered.step(actions, partial(steered.turning, number))
        fleet, same = (game.motion.fleets[-1] for game in (plain, passed))
        alike = np.array_equal(fleet.state, same.state, equal_nan=True)  # what a fleet does not know is NaN
        _hold(
            alike,
            "the game is another one under a filter that changes nothing; play what safe leaves as it is as it came",
        )
        passed.check_handed_over(nominal)
    for game, source in ((plain, "commands() reads from the actions"), (steered, "filtering plays")):
        _hold(len(game.moments) == len(game.motion.fleets), "moment() is the same after a step; give the game's time")
        fault = game.motion.fault(source)
        _hold(not fault, fault)
    for team in (0, 1):
        plain.reader.surroundings(team, True)


@contextmanager
def _global_generators(seed: int) -> Iterator[None]:
    """Seed the generators of the whole process, from which Pyquaticus draws its starts, and put them back after."""
    before = random.getstate(), np.random.get_state()  # noqa: NPY002 - theirs
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(before[0])
        np.random.set_state(before[1])  # noqa: NPY002


class _Played:
    """A game that `check_reader` plays, and what its reader says of it."""

    def __init__(self, env: Any) -> None:
        self.env, self.reader = env, reader_of(env)
        facts = facts_of(self.reader)
        check_boats(env, self.reader.agent_ids, self.reader)
        self.step_s = facts.moves * facts.dt_s
        self.held = max(1, round(HELD_S / self.step_s))
        self.motion, self.given = Motion(self.step_s, facts.moves), list[Array]()
        with _global_generators(5):
            env.reset(seed=5)
        self.moments = {self.reader.moment()}
        self._see()

    def goes_on(self) -> bool:
        """Return whether the game has boats left that act."""
        return bool(getattr(self.env, "agents", True))

    def step(self, actions: dict[str, Any], safe: Callable[[Array], Array] | None = None) -> Array:
        """Play the actions, all commands by way of ``safe`` where one is given; return the commands that are played."""
        commands = np.array(self.reader.commands(actions), dtype=np.float64)
        if safe is None:
            self.env.step(self.reader.playable(actions))
        else:
            commands = self._filtered(actions, safe)
        self.motion.commands.append(commands)
        self._see()
        self.moments.add(self.reader.moment())
        return commands

    def _filtered(self, actions: dict[str, Any], safe: Callable[[Array], Array]) -> Array:
        n, played = len(self.reader.agent_ids), list[Array]()
        self.given.clear()

        def noting(commands: Array) -> Array:
            self.given.append(np.array(commands))
            _hold(self.given[-1].shape == (n, 2), f"filtering hands over no commands of shape ({n}, 2)")
            played.append(np.array(safe(commands)))
            return played[-1].copy()

        with self.reader.filtering(noting):
            self.env.step(self.reader.playable(actions))
        _hold(bool(played), "filtering never calls safe; let step play safe(commands) before the boats move")
        return played[0]

    def check_handed_over(self, nominal: Array) -> None:
        """Hold that ``safe`` was given what ``commands`` reads, of the boats that the game does not drive."""
        free = self.motion.free[-1] & self.motion.free[-2]
        same = np.allclose(self.given[0][free], nominal[free], rtol=1e-3, atol=1e-3)
        _hold(same, "filtering hands over other commands than commands() reads from the same actions; give it those")

    def turning(self, number: int, nominal: Array) -> Array:
        """Return commands that turn the boats both ways, ``number`` for ``number``, at half and full speed."""
        commands = np.array(nominal)
        for i, kind in enumerate(self.motion.fleets[0].platforms):
            share, turn_deg = (of[(number + i) % len(of)] for of in (SPEEDS, TURNS_DEG))
            commands[i] = share * get_platform(kind).max_speed_mps, turn_deg
        return commands

    def _see(self) -> None:
        fleet, n = self.reader.fleet(0, True), len(self.reader.agent_ids)
        whole = isinstance(fleet, Fleet) and len(fleet) == n and np.isfinite(fleet.state[:, : L.SPEED + 1]).all()
        _hold(bool(whole), f"fleet() lacks boats, or values of them; give a Fleet of the {n} boats of agent_ids")
        free = [self.reader.fleet(team, False).controlled for team in (0, 1)]
        self.motion.see(fleet, free[0] | free[1])


def _any_action(env: Any, agent: str, number: int) -> Any:
    """Return an action for a boat: a whole number, or a sample where its action space is known to be another."""
    space = env.action_space(agent) if callable(getattr(env, "action_space", None)) else None
    if isinstance(space, Discrete):
        return int(space.start + number % space.n)
    if space is None:
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
