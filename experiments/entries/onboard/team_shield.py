"""The shielded team of a zip: asks the entry for its team's actions, and answers with safe ones.

Nothing here may end a game. An action that is none, and one that the entry raises instead of, count as a command that
is not finite: the shield tells that boat to stop, and keeps it clear meanwhile. Where the shield itself cannot decide
(the state lacks a boat, or is normalised), the team's boats are told to stop. The log (standard error) says so, once,
and `ShieldedTeam.failure` tells whoever asks for a boat's action.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.experiments.entries.onboard.state import GameSpec, Observation, fleet_of, see
from steerclear.shield.commands import Commands
from steerclear.shield.config import ShieldConfig
from steerclear.shield.foreign import describe_error
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.shield import Shield
from steerclear.shield.surroundings import Surroundings
from steerclear.shield.wrappers.actions import Command, Seat, read_action

logger = logging.getLogger("steerclear")

Ask = Callable[[str], Any]
STOP = (0.0, 0.0)
UNDECIDED = "shield could not decide"
JUMP_M = 5.0
"""A boat that is farther than this beyond its reach from where it was, m, is in another game."""


class ShieldedTeam:
    """Keeps one entry's boats apart, whichever team it plays.

    Args:
        spec: of the game.
    """

    def __init__(self, spec: GameSpec) -> None:
        self._spec = spec
        self._shields: dict[int, TeamShield] = {}

    @classmethod
    def packed(cls) -> ShieldedTeam:
        """The team of the zip that this file is in."""
        packed = json.loads((Path(__file__).parent / "facts.json").read_text())
        team = cls(GameSpec(**{name: _tuples(value) for name, value in packed.items()}))
        team._shield_of(0)  # what has to be read and worked out once is, before boats move
        return team

    def action(self, ask: Ask, agent_id: Any, state: Mapping[Any, Any]) -> Any:
        """The safe action of a boat, an array (speed m/s, relative heading deg).

        Args:
            ask: asks the entry for the action of one of its boats.
            agent_id: the boat that is asked for.
            state: the global state.
        """
        if agent_id not in self._spec.agent_ids:
            _say_once(f"unknown boat {agent_id!r}: it is told to stop")
            return np.array(STOP)
        state = unwrapped(agent_id, state)
        place = self._spec.agent_ids.index(agent_id)
        team = int(2 * place >= len(self._spec.agent_ids))
        return np.array(self._shield_of(team).command(ask, place, state))

    def failure(self, agent_id: Any) -> tuple[str, str] | None:
        """What went wrong in the latest decision for a boat, as (kind, explanation); None when nothing did."""
        if agent_id not in self._spec.agent_ids:
            return UNDECIDED, f"unknown boat {agent_id!r}"
        place = self._spec.agent_ids.index(agent_id)
        shield = self._shields.get(int(2 * place >= len(self._spec.agent_ids)))
        return None if shield is None else shield.failures.get(place)

    def _shield_of(self, team: int) -> TeamShield:
        if team not in self._shields:
            self._shields[team] = TeamShield(self._spec, team)
        return self._shields[team]


class TeamShield:
    """The boats of one team: all are decided for when the first of them is asked for in a moment of the game.

    Args:
        spec: of the game.
        team: 0 for blue, 1 for red.

    Attributes:
        failures: by place of a boat, what went wrong in the latest decision: (kind, explanation).
    """

    def __init__(self, spec: GameSpec, team: int) -> None:
        self._spec, self._team = spec, team
        self.failures: dict[int, tuple[str, str]] = {}
        half = len(spec.agent_ids) // 2
        self._places = range(team * half, (team + 1) * half)
        stops = tuple(tuple(circle) for circle in spec.stops[team])
        self._around = Surroundings((0.0, 0.0, *spec.size), stops=stops)
        self._shield = Shield(ShieldConfig.of(**spec.shield))
        self._answered: dict[int, Command] = {}
        self._observation: Observation | None = None
        self._disabled_s = np.zeros(2 * half)
        self._get_ready()

    def command(self, ask: Ask, place: int, state: Mapping[Any, Any]) -> Command:
        """The safe command of a boat."""
        try:
            observed = see(self._spec, state)
        except Exception as error:
            text = describe_error(error)
            self.failures[place] = UNDECIDED, f"the global state cannot be read: {text}"
            _say_once(f"the global state cannot be read ({text}); all boats are told to stop")
            return STOP
        if (
            place not in self._answered
            or self._observation is None
            or not np.array_equal(observed.rows, self._observation.rows, True)
        ):
            self._answered = self._decide(ask, observed)
        return self._answered.pop(place)

    def _decide(self, ask: Ask, observed: Observation) -> dict[int, Command]:
        """Safe commands of all boats of the team."""
        self._follow(observed)
        self.failures = {}
        wanted = np.zeros((len(self._spec.agent_ids), 2))
        for place in self._places:
            wanted[place] = self._asked(ask, place, observed)
        try:
            fleet = fleet_of(self._spec, observed, self._team, self._disabled_s)
            with np.errstate(all="ignore"):  # as compiled code, which divides by zero and goes on
                sent = self._shield.decide(fleet, Commands.game_deg(wanted), self._around).filtered.values
        except Exception as error:  # whatever it is, boats that nobody decides for must stop
            text = describe_error(error)
            self.failures = dict.fromkeys(self._places, (UNDECIDED, text))
            _say_once(f"the shield could not decide ({text}); all boats are told to stop")
            return dict.fromkeys(self._places, STOP)
        return {
            place: (float(sent[place, 0]), float(sent[place, 1])) if np.isfinite(sent[place]).all() else STOP
            for place in self._places
        }

    def _asked(self, ask: Ask, place: int, observed: Observation) -> Command:
        """The entry's command for a boat; not finite where it has none."""
        name = self._spec.agent_ids[place]
        try:
            action = ask(name)
        except (Exception, SystemExit) as error:  # an entry that calls exit() does not end the game
            return self._failed(place, f"raised {type(error).__name__}", describe_error(error))
        try:
            command = read_action(self._seat(place, observed), action)
        except Exception as error:
            return self._failed(place, "no action", describe_error(error))
        if not all(map(math.isfinite, command)):
            return self._failed(place, "not finite", f"{command} is not finite")
        return command

    def _failed(self, place: int, kind: str, text: str) -> Command:
        """A command that is none; what is wrong with it is kept and said."""
        self.failures[place] = kind, text
        _say_once(f"the entry has no usable action for {self._spec.agent_ids[place]} ({text}); it is told to stop")
        return math.nan, math.nan

    def _seat(self, place: int, observed: Observation) -> Seat:
        top_mps = float(get_platform(self._spec.platforms[place]).max_speed_mps)
        row = observed.rows[place]

        def to_point(name: str) -> Command:
            x, y = self._spec.points[name]
            if self._team == 1:
                x, y = self._spec.size[0] - x, self._spec.size[1] - y
            bearing = math.degrees(math.atan2(x - row[L.X], y - row[L.Y]))
            return top_mps, (bearing - row[L.HEADING] + 180.0) % 360.0 - 180.0

        return Seat(self._spec.agent_ids[place], top_mps, to_point, tuple(self._spec.points), lowest=-17, longer=True)

    def _follow(self, observed: Observation) -> None:
        """Note for how long boats are disabled yet, at least; and that another game has begun."""
        before, self._observation = self._observation, observed
        if before is None or self._is_another_game(before, observed):
            self._shield.reset()
            self._disabled_s[:] = 0.0
            return
        fresh = observed.disabled & ~before.disabled
        self._disabled_s = np.where(fresh, self._spec.power_s, self._disabled_s)
        self._disabled_s = np.where(observed.disabled, np.maximum(self._disabled_s - self._spec.decision_s, 0.0), 0.0)

    def _is_another_game(self, before: Observation, now: Observation) -> bool:
        gone_m = np.hypot(*(now.rows[:, [L.X, L.Y]] - before.rows[:, [L.X, L.Y]]).T)
        fastest = np.maximum(np.abs(before.rows[:, L.SPEED]), np.abs(now.rows[:, L.SPEED]))
        return bool((gone_m > fastest * self._spec.decision_s + JUMP_M).any())

    def _get_ready(self) -> None:
        """One decision about boats far apart, which reads tables and works out what the boats can do."""
        rows = np.zeros((len(self._spec.agent_ids), L.N_STATE))
        rows[:, [L.THRUST, L.RUDDER, L.SPEED_ERROR, L.HEADING_ERROR]] = math.nan
        rows[:, L.X] = 10.0 + 20.0 * np.arange(len(rows))
        rows[:, L.Y] = 30.0
        nobody = np.zeros(len(rows), np.bool_)
        fleet = fleet_of(self._spec, Observation(rows, nobody, nobody, nobody, nobody), self._team, self._disabled_s)
        with np.errstate(all="ignore"):
            self._shield.decide(fleet, Commands.game_deg(np.zeros((len(rows), 2))), self._around)
        self._shield.reset()


def unwrapped(agent_id: Any, state: Mapping[Any, Any]) -> Mapping[Any, Any]:
    """The global state itself, where a runner hands in an info, or infos by boat, that it is in."""
    for key in (agent_id, "global_state", agent_id):
        if (agent_id, "pos") not in state and isinstance(state.get(key), Mapping):
            state = state[key]
    return state


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


_SAID: set[str] = set()


def _say_once(words: str) -> None:
    kind = words.partition("(")[0]
    if kind not in _SAID:
        _SAID.add(kind)
        logger.warning("shielded entry: %s", words)
