"""`MctfEnv`: the game as a PettingZoo ``ParallelEnv``, a thin layer over `BatchedMctf` with one game."""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from pettingzoo import ParallelEnv
from steerclear.shield.calls import checked_calls
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.jit import Array

from .actions import ActionDecoder, action_kinds, action_space
from .compat import PyquaticusAttributes
from .config import GameConfig, of_the_config
from .core import BatchedMctf, CommandFilter
from .field import field_points
from .infos import InfoWriter
from .view import GameView

logger = logging.getLogger(__name__)

Reward = Callable[[str, GameView, GameView], float]
"""``reward(agent_id, before, after) -> float``, called once per boat and step."""

RENDER_MODES = ("human", "rgb_array")
RESET_OPTIONS = ("init_dict",)


class MctfEnv(PyquaticusAttributes, ParallelEnv[str, np.ndarray, Any]):
    """Maritime Capture the Flag for policies written for PettingZoo or Pyquaticus.

    Observations are normalised float32 vectors. ``infos[agent]["global_state"]`` and ``["unnorm_obs"]`` are dicts with
    Pyquaticus' keys. A boat without an action stops. ``agents`` is empty once the game is over. Scores, positions and
    the rest are in ``core`` (a `BatchedMctf` with one game) and in `view`.

    Args:
        config: a `GameConfig` or a preset's name; None is the ``mctf2025`` preset.
        render_mode: None, "human" (a window) or "rgb_array".
        action_kind: kind of action space ("discrete", "continuous" or "afp"), one for all, one per boat, or a dict by
            agent id. Actions of every kind are accepted, whatever is declared.
        reward: None for the sparse default (weights in the config), or a function of agent id and the views before and
            after the step.
        command_filter: see `CommandFilter`: called with ``core`` and the decided commands (1, n, 2) before the boats
            move. A shield may be given here.
        seed: seed of random starts, until `reset` gives another.

    Raises:
        ConfigError: an unusable config, action kind or render mode.
    """

    metadata = {"render_modes": list(RENDER_MODES), "name": "mctf_v0", "is_parallelizable": True, "render_fps": 10}  # noqa: RUF012 (PettingZoo's own form)

    @checked_calls(hint=of_the_config)
    def __init__(
        self,
        config: GameConfig | str | None = None,
        render_mode: str | None = None,
        action_kind: str | Sequence[str] | Mapping[str, str] = "discrete",
        reward: Reward | None = None,
        command_filter: CommandFilter | None = None,
        seed: int | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ConfigError(f"unknown render_mode {render_mode!r}; choose one of {', '.join(RENDER_MODES)} or None")
        self.core = BatchedMctf(config, n_games=1, seed=seed)
        self.config = self.core.config
        self.render_mode = render_mode
        self.reward = reward
        self.command_filter = command_filter
        self._step_filters: list[CommandFilter] = []
        self.possible_agents = list(self.config.agent_ids)
        self.agents: list[str] = []
        points = field_points(self.core.field.size)
        kinds = action_kinds(self.config, action_kind)
        self.action_kinds = kinds
        self._decoder = ActionDecoder(self.config, kinds, points)
        self._info_writer = InfoWriter(self.core)
        self.agent_obs_normalizer = self._info_writer.observation
        self.global_state_normalizer = self._info_writer.global_state
        self._set_pyquaticus_attributes(points)
        self.observation_spaces: dict[str, Space[Any]] = {
            a: self.agent_obs_normalizer.normalized_space for a in self.possible_agents
        }
        self.action_spaces: dict[str, Space[Any]] = {
            a: action_space(kinds[a], self.max_speeds[i], len(points)) for i, a in enumerate(self.possible_agents)
        }
        self.state_space = self.global_state_normalizer.unnormalized_space
        self.renderer: Any = None
        """The `Renderer` behind `render`, made at the first picture."""

    def observation_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's observations: the same object at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's actions: the same object at every call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start a game.

        Args:
            seed: seed of random starts; None continues the random numbers.
            options: {"init_dict": ...} starts from a partial state (see `steerclear.env.starts.start_from`).

        Returns:
            observations and infos by agent id.

        Raises:
            GameError: an init_dict that the rules do not allow.
        """
        init = _init_dict(options)
        if seed is not None:
            self.core.seed(seed)
        if init is None:
            self.core.reset()
        else:
            self.core.reset_game(0, init)
        self.agents = self.possible_agents[:]
        if self.render_mode == "human":
            self.render()
        return self._observations(), self.infos()

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Play one step.

        Args:
            actions: agent id -> action of any kind (see `ActionDecoder`).

        Returns:
            observations, rewards, terminated, truncated and infos by agent id.

        Raises:
            GameError: the game has not been reset or is over, or an action is unusable.
        """
        if not self.agents:
            raise GameError("the game has not begun or is over; call reset() first")
        before = None if self.reward is None else self.view()
        commands = self._decoder.decode(actions, self.core.state[0])
        _, rewards, terminated, truncated = self.core.step(commands[np.newaxis], self._filter_of_step())
        ids = self.agents
        outcome = (
            self._observations(),
            self._rewards(rewards[0], before),
            dict.fromkeys(ids, bool(terminated[0])),
            dict.fromkeys(ids, bool(truncated[0])),
            self.infos(),
        )
        if terminated[0] or truncated[0]:
            self.agents = []
        if self.render_mode == "human":
            self.render()
        return outcome

    @contextmanager
    def filtered(self, command_filter: CommandFilter) -> Iterator[None]:
        """While inside, steps also pass this filter: after `command_filter`, and after filters entered later.

        A wrapper thereby filters commands in its own steps only.

        Args:
            command_filter: as ``env.command_filter``.
        """
        self._step_filters.append(command_filter)
        try:
            yield
        finally:
            self._step_filters.pop()

    def _filter_of_step(self) -> CommandFilter | None:
        """Return all filters of this step as one; None if there are none."""
        own = [] if self.command_filter is None else [self.command_filter]
        filters = [*own, *reversed(self._step_filters)]
        if len(filters) < 2:
            return filters[0] if filters else None

        def all_of_them(core: BatchedMctf, commands: Array) -> Array:
            for one in filters:
                commands = one(core, commands)
            return commands

        return all_of_them

    def decode(self, actions: Mapping[str, Any]) -> Array:
        """Return commands (n, 2), speed m/s and relative heading deg, of actions of any kind; the game is not changed.

        Raises:
            GameError: an unknown agent or an invalid action.
        """
        return self._decoder.decode(actions, self.core.state[0])

    def state(self) -> np.ndarray:
        """Return the raw global state (n_global,) float32, in the order of ``global_state_normalizer.keys``."""
        return self._info_writer.global_vector().astype(np.float32)

    def infos(self) -> dict[str, dict[str, Any]]:
        """Return infos by agent id of the game as it stands, as in `reset` and `step`."""
        return self._info_writer.infos()

    def view(self) -> GameView:
        """Return a frozen copy of the game as it stands."""
        return self.core.view(0)

    def render(self, overlay: Any = None) -> np.ndarray | None:
        """Draw the game: an RGB array (height, width, 3) uint8 in mode "rgb_array", the window in mode "human".

        Args:
            overlay: what else to draw, see `steerclear.env.render`.
        """
        if self.render_mode is None:
            logger.warning("render() does nothing without a render_mode; build the env with one of %s", RENDER_MODES)
            return None
        if self.renderer is None:
            from .render import Renderer

            self.renderer = Renderer(self.config, self.render_mode)
        picture = self.renderer.draw(self.view(), overlay)
        return picture if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if any."""
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to copy, without the window; a copy opens its own at the first picture."""
        return {**self.__dict__, "renderer": None}

    def _observations(self) -> dict[str, np.ndarray]:
        rows = self.core.observations[0].copy()
        return {agent_id: rows[i] for i, agent_id in enumerate(self.possible_agents)}

    def _rewards(self, defaults: Array, before: GameView | None) -> dict[str, float]:
        if self.reward is None or before is None:
            return dict(zip(self.possible_agents, defaults.tolist(), strict=True))
        after = self.view()
        return {agent_id: float(self.reward(agent_id, before, after)) for agent_id in self.possible_agents}


def _init_dict(options: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Return the init_dict among reset's options; log unknown options and refuse near misses."""
    if options is None:
        return None
    if not isinstance(options, Mapping):
        raise GameError(f"options is {type(options).__name__}; give a dict such as {{'init_dict': {{...}}}}")
    for name in options:
        if name in RESET_OPTIONS:
            continue
        near = difflib.get_close_matches(str(name), RESET_OPTIONS, n=1)
        if near:
            raise GameError(f"unknown reset option {name!r}; did you mean {near[0]!r}?")
        logger.warning("reset option %r is not known and has no effect; known: %s", name, ", ".join(RESET_OPTIONS))
    return options.get("init_dict")
