"""The shield around a policy instead of an environment: the policy's answers are filtered."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import ConfigError, FleetError, PolicyError
from ..fleet import Fleet
from ..foreign import describe_error
from ..platforms import layout as L
from ..shield import Shield
from .actions import team_answer
from .checks import Serving, ShieldedGame, one_game_shield, words_of
from .readers import GameReader, reader_of

logger = logging.getLogger(__name__)
STOPPED = (0.0, 0.0)
"""What `steerclear.policies` answers for a boat whose code gave nothing usable, and names in ``held``."""


class ShieldedTeamPolicy:
    """A team policy (``reset(env, agent_ids, seed)``, ``act(observations, infos)``) whose commands pass the shield.

    The shield reaches only the policy's own commands, not game-controlled boats. `ShieldedParallelEnv` on our env
    covers those too. If the game moves its boats several times for an action, this shield decides once for all
    substeps, and its predictions hold the command (`ShieldConfig.move_s`). `ShieldedParallelEnv` decides before each
    substep. In a Pyquaticus env all answers are (speed m/s, relative heading deg) pairs, because that env accepts one
    kind of action from a boat.

    Attributes:
        policy: the policy inside.
        shield: its shield: the given one, or a copy with the game's distances, see `ShieldedParallelEnv`.
        decisions: the last decisions, or None.

    Raises:
        ConfigError: the shield is none, or the policy has one already.
    """

    def __init__(self, policy: Any, shield: Shield, keep_out: bool = True) -> None:
        if isinstance(policy, ShieldedTeamPolicy):
            raise ConfigError("this policy has a shield already; wrap its .policy instead")
        self.policy = policy
        self.shield: Shield = one_game_shield(shield)
        self.keep_out = keep_out
        self.name = f"shielded {getattr(policy, 'name', type(policy).__name__)}"
        self.decisions: Decisions | None = None
        self._game: ShieldedGame | None = None
        self._agent_ids: tuple[str, ...] = ()
        self._shown: tuple[float, Any] | None = None
        self._said: set[str] = set()

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            ConfigError: the env cannot be read, has settings that no shield can be built for, or does not accept pairs
                from these boats; the shield is for another step; or ``agent_ids`` is empty, names boats that are not in
                the game, or boats of both teams.
        """
        reader = reader_of(env)
        team = _team_of(reader, agent_ids)
        reader.check_answers(agent_ids)
        self._game = ShieldedGame(self.shield, reader, team, False, self.keep_out, held=True)
        self.shield, self._agent_ids, self._shown = self._game.shield, tuple(agent_ids), None
        self._said.clear()
        self._game.begin()
        self.policy.reset(env, agent_ids, seed)

    def act(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> dict[str, Any]:
        """Return the boats' actions. Those that the shield changed are (speed m/s, relative heading deg) pairs.

        A boat without an action, or whose foreign code gave none that can be used, is held (`Reason.HELD`).

        Exceptions of the policy itself pass through: the caller decides what to send then.

        Raises:
            PolicyError: `reset` has not been called, another game is played than the one given to it, or the policy's
                answer is no mapping of boat to action.
            GameError: an answer is no action: not finite, True or False, of another length, or an unknown field point.
            ConfigError: the env's settings have changed since the reset, or the shield has begun to serve someone else.
        """
        if self._game is None:
            raise PolicyError("call reset(env, agent_ids, seed) before act()")
        reader = self._game.reader
        self._game.check()
        self._check_played(reader.moment(), observations)
        actions, faults = team_answer(self.policy.act(observations, infos), self._agent_ids)
        self._say(faults)
        reader.check_answers(self._agent_ids)
        commands = np.array(reader.commands(actions))
        for agent in self._unanswered(actions):
            commands[reader.agent_ids.index(agent)] = np.nan
        self.decisions = self._game.decide(commands)
        actions = reader.playable(actions)
        for agent in self._agent_ids:
            i = reader.agent_ids.index(agent)
            sent = self.decisions.filtered.values[i]
            if self.decisions.intervened[i] or (reader.takes_pairs_only and np.isfinite(sent).all()):
                actions[agent] = sent.copy()
        return actions

    def __repr__(self) -> str:
        return f"<{self.name}: {words_of(self.shield)}>"

    def _unanswered(self, actions: Mapping[str, Any]) -> Iterator[str]:
        """Yield the boats without an action of the policy's own: foreign code is answered for with a stop."""
        held = getattr(self.policy, "held", None)
        for agent in self._agent_ids:
            action = actions.get(agent)
            stopped = isinstance(action, tuple) and action == STOPPED
            if agent not in actions or (stopped and isinstance(held, Mapping) and agent in held):
                yield agent

    def _say(self, faults: Mapping[str, str]) -> None:
        """Log what is wrong with an answer, each thing once a game."""
        for fault in faults.values():
            if fault not in self._said:
                self._said.add(fault)
                logger.warning("%s: %s; boats without an action hold", self.name, fault)

    def _check_played(self, moment: float, observations: Mapping[str, Any]) -> None:
        """Refuse to play if the observations change while the game that is read stands still.

        This happens to a copy of a wrapped policy: it holds a copy of its game, which nobody plays.
        """
        seen = observations.get(self._agent_ids[0]) if isinstance(observations, Mapping) else None
        shown = np.array(seen, dtype=object, copy=True)
        before, self._shown = self._shown, (moment, shown)
        if before is not None and moment == before[0] and not np.array_equal(shown, before[1]):
            raise PolicyError(
                "the game that this policy was given stands still while another is played; call reset(env, agent_ids, "
                "seed) with the one that is played (a copy of a wrapped policy has a copy of its game)"
            )

    def __getattr__(self, name: str) -> Any:
        # "policy" is not set yet while copying; and the policy's own copy methods do not know the shield
        if name == "policy" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.policy, name)


def _team_of(reader: GameReader, agent_ids: Sequence[str]) -> int:
    """Return the team of the boats, which must be the same for all."""
    if isinstance(agent_ids, str):
        raise ConfigError(f"agent_ids is the text {agent_ids!r}; give a list of boats: [{agent_ids!r}]")
    for agent in agent_ids:
        if agent not in reader.agent_ids:
            raise ConfigError(f"unknown boat {agent!r}; the game has {', '.join(reader.agent_ids)}")
    team = reader.fleet(0, False).team
    teams = {int(team[reader.agent_ids.index(agent)]) for agent in agent_ids}
    if len(teams) != 1:
        found = f"{', '.join(agent_ids)} are of two teams" if teams else "the list names no boat"
        raise ConfigError(f"{found}; give the boats of one team")
    return teams.pop()


class ShieldedCallable:
    """Any function from an observation to commands, with the fleet read from the same observation.

    Args:
        policy: ``policy(seen) -> Commands`` for all boats of the fleet.
        shield: the shield.
        read: ``read(seen) -> Fleet``.

    Raises:
        ConfigError: ``shield`` is no shield, or ``read`` is no function.
    """

    def __init__(self, policy: Callable[[Any], Commands], shield: Shield, read: Callable[[Any], Fleet]) -> None:
        if not callable(read):
            raise ConfigError(f"read is {read!r}; give a function that turns what the policy sees into a Fleet")
        self.policy = policy
        self.shield: Shield = one_game_shield(shield)
        self.read = read
        self.decisions: Decisions | None = None
        self._serving = Serving(shield)
        self._relative = False
        self._failure = ""

    def __call__(self, seen: Any) -> Commands:
        """Return filtered commands, in the frame of the policy's last usable answer.

        If the policy raises or answers something else, all boats hold. A command that is not finite makes its own boat
        hold. The decision's reason says so, and the log once for each failure. Boats that the shield does not decide
        for get speed 0 and their heading. Before the first usable answer the frame is that of `Commands.absolute_rad`.

        Raises:
            ConfigError: the shield serves another function, team or game since its last `Shield.reset`.
            FleetError: ``read`` returned no fleet.
        """
        fleet = self.read(seen)
        self._serving.check()
        if not isinstance(fleet, Fleet):
            raise FleetError(f"read answered {type(fleet).__name__}; let it return a Fleet, see Fleet.of")
        try:
            wanted = self.policy(seen)
            if not isinstance(wanted, Commands) or len(wanted) != len(fleet):
                found = f"Commands of {len(wanted)}" if isinstance(wanted, Commands) else type(wanted).__name__
                raise PolicyError(f"it answered {found}; give Commands of all {len(fleet)} boats")
            rows = np.flatnonzero(fleet.controlled & ~np.isfinite(wanted.values).all(axis=1))
            named = ", ".join(repr(fleet.names[i]) for i in rows)
            self._note(f"commands of {named} are not finite; they hold" if named else "")
            self._relative = wanted.relative
        except Exception as error:  # whatever the policy does, its boats must get commands
            ours = isinstance(error, PolicyError)
            self._note(f"{f'PolicyError: {error}' if ours else describe_error(error)}; all boats hold")
            stop = np.zeros((len(fleet), 2))
            if not self._relative:
                stop[:, 1] = np.radians(fleet.state[:, L.HEADING])
            stop[fleet.controlled] = np.nan
            wanted = Commands.relative_deg(stop) if self._relative else Commands.absolute_rad(stop)
        self.decisions = self.shield.decide(fleet, wanted)
        return self.decisions.filtered

    def __repr__(self) -> str:
        return f"<shielded {getattr(self.policy, '__name__', type(self.policy).__name__)}: {words_of(self.shield)}>"

    def _note(self, failure: str) -> None:
        """Log a failure when it begins or changes, and when it is over."""
        if failure and failure != self._failure:
            logger.error("policy failed: %s", failure)
        if self._failure and not failure:
            logger.warning("policy answers again")
        self._failure = failure


def wrap_policy(policy: Any, shield: Shield, read: Callable[[Any], Fleet] | None = None) -> Any:
    """Put a shield around a policy, see `Shield.wrap`."""
    if isinstance(policy, type):
        raise ConfigError(f"{policy.__name__} is a class; give a policy: {policy.__name__}(...)")
    if hasattr(policy, "act") and hasattr(policy, "reset"):
        if read is not None:
            raise ConfigError(
                "read= is for plain functions; a team policy's boats are read from its game: leave it out"
            )
        return ShieldedTeamPolicy(policy, shield)
    if callable(policy) and read is not None:
        return ShieldedCallable(policy, shield, read)
    if callable(policy):
        raise ConfigError(
            "a plain function needs read=, which turns what it sees into a Fleet; or build a team "
            "policy with steerclear.policies.from_callable"
        )
    if isinstance(policy, str):
        raise ConfigError(f"cannot wrap the name {policy!r}; give the policy: wrap(policies.make({policy!r}))")
    raise ConfigError(
        f"cannot wrap {type(policy).__name__}; build a team policy with steerclear.policies.make(name, path or "
        "'sb3:model.zip'), from_agents or from_callable first"
    )
