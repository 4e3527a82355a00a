"""Policies from the user's own objects: Pyquaticus-style agents, or any callable."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

from .foreign import Answer, ForeignCode, GuardedTeam

AgentFactory = Callable[[str, Any], Any]
"""``factory(agent_id, env) -> agent`` with ``compute_action(obs, info)``."""
Function = Callable[[np.ndarray], Any]


def call_fault(function: Callable[..., Any], arguments: Sequence[str]) -> str | None:
    """Return why a function cannot be called with these arguments and answer at once; None if it can.

    This check before the game replaces failures in every step of it.

    Args:
        function: as it will be called, bound.
        arguments: their names, for the text.
    """
    if inspect.iscoroutinefunction(function) or inspect.isgeneratorfunction(function):
        return "is a coroutine or generator, which answers nothing when it is called; return the action"
    if inspect.isasyncgenfunction(function):
        return "is an asynchronous generator; return the action"
    try:
        signature = inspect.signature(function)
    except Exception:  # built-in functions have no signature; foreign ones may raise anything
        return None
    try:
        signature.bind(*arguments)
    except TypeError:
        named = [f"{one.name}=" if one.kind == one.KEYWORD_ONLY else one.name for one in signature.parameters.values()]
        return f"takes ({', '.join(named)}), and is called with ({', '.join(arguments)})"
    return None


class AgentsCode(ForeignCode):
    """Agents with ``compute_action(obs, info)``, which receive all observations and infos by agent id as in Pyquaticus.

    Args:
        agents: agents by id, or a factory that is called with (agent_id, env) when a game begins.
    """

    def __init__(self, agents: Mapping[str, Any] | AgentFactory) -> None:
        if not callable(agents) and not isinstance(agents, Mapping):
            raise PolicyError("agents must be a dict agent_id -> agent, or a function of (agent_id, env)")
        if isinstance(agents, type) and not any(hasattr(agents, name) for name in ("compute_action", "__getattr__")):
            name = agents.__name__
            raise PolicyError(
                f"class {name} has no compute_action(obs, info); define it, or give a function that builds what has "
                f"one: lambda agent_id, env: {name}(agent_id, env)"
            )
        if isinstance(agents, Mapping):
            _check_agents(agents)
        self._source = agents
        self._agents: dict[str, Any] = {}

    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Look up or build the agents of this game."""
        if isinstance(self._source, Mapping):
            _check_all(self._source, agent_ids, "no agent for", "agents are")
            self._agents = {agent_id: self._source[agent_id] for agent_id in agent_ids}
        else:
            self._agents = {agent_id: self._source(agent_id, env) for agent_id in agent_ids}
            _check_agents(self._agents)

    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Return the answers of each boat's agent."""
        return lambda agent_id: self._agents[agent_id].compute_action(observations, infos)


def _check_agents(agents: Mapping[str, Any]) -> None:
    for agent_id, agent in agents.items():
        if not callable(getattr(agent, "compute_action", None)):
            raise PolicyError(f"agent {agent_id} ({type(agent).__name__}) has no compute_action(obs, info)")
        fault = call_fault(agent.compute_action, ("obs", "info"))
        if fault is not None:
            raise PolicyError(f"compute_action of agent {agent_id} ({type(agent).__name__}) {fault}")


class CallableCode(ForeignCode):
    """Functions of one boat's normalised observation: one for all boats, or one per agent id."""

    def __init__(self, functions: Function | Mapping[str, Function]) -> None:
        parts = list(functions.values()) if isinstance(functions, Mapping) else [functions]
        if not parts or not all(callable(part) for part in parts):
            raise PolicyError("give a function f(obs) -> action, or a dict agent_id -> such functions")
        for part in parts:
            fault = call_fault(part, ("obs",))
            if fault is not None:
                raise PolicyError(f"{getattr(part, '__name__', 'the function')} {fault}; give f(obs) -> action")
        self._functions = functions

    def begin(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Check that every boat has a function."""
        if isinstance(self._functions, Mapping):
            _check_all(self._functions, agent_ids, "no function for", "there are")

    def prepare(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> Answer:
        """Return the answers of each boat's function."""
        functions = self._functions
        if isinstance(functions, Mapping):
            return lambda agent_id: functions[agent_id](observations[agent_id])
        return lambda agent_id: functions(observations[agent_id])


def _check_all(given: Mapping[str, Any], agent_ids: Sequence[str], lacks: str, are: str) -> None:
    missing = [agent_id for agent_id in agent_ids if agent_id not in given]
    if missing:
        raise PolicyError(f"{lacks} {', '.join(missing)}; {are} {', '.join(given) or 'none'}")


def from_agents(agents: Mapping[str, Any] | AgentFactory, name: str = "agents") -> GuardedTeam:
    """Build a team of Pyquaticus-style agents: objects with ``compute_action(obs, info)``.

    Args:
        agents: {agent_id: agent}, or ``factory(agent_id, env)``, often the agents' class itself, called at each reset.
            A dict serves only the env that its agents were built with.
        name: name for records and reports.

    Raises:
        PolicyError: neither a dict nor callable, or an agent or the class has no ``compute_action``.
    """
    return GuardedTeam(name, AgentsCode(agents))


def from_callable(function: Function | Mapping[str, Function], name: str = "callable") -> GuardedTeam:
    """Build a team that calls ``function(observation)`` for each boat.

    Args:
        function: receives a boat's normalised observation (n_obs,) float32 and returns its action; or a dict of such
            functions by agent.
        name: name for records and reports.

    Raises:
        PolicyError: not callable.
    """
    return GuardedTeam(name, CallableCode(function))
