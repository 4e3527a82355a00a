"""`BatchedMctf`: B games at once, compiled. Every front end uses these rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from steerclear.shield.arrays import NoNumbersError, numbers
from steerclear.shield.calls import checked_calls
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.shared import share
from steerclear.shield.workspace import LARGEST_COMMAND

from .advance import CHUNK, advance_games, begin_decision, end_decision, follow_games, move_games
from .arrays import make_games, make_rules
from .config import GameConfig, as_config, of_the_config
from .drive_home import decide_commands
from .field import field_geometry
from .observation_layout import bounds_of, observation_keys
from .observe import observe_games
from .power_play import toggle_power_plays
from .randomness import seed_states
from .rules import reward_games
from .starts import default_places, reset_games, start_from, start_where_seen
from .validation import check_count
from .view import GameView, restore_game, view_game

CommandFilter = Callable[["BatchedMctf", Array], Array]
"""Filter between decision and motion, such as the shield: ``filter(core, commands (B, n, 2)) -> commands``.

It is called before every step of motion: several times per decision if a command is held for several steps.
"""


class BatchedMctf:
    """B games of Maritime Capture the Flag, stepped together in compiled code.

    Boats are ordered agent_0..: blue (team 0) first, then red (team 1). The arrays of `Games`, such as ``state (B, n,
    N_STATE)``, ``is_tagged (B, n)`` or ``time_s (B,)``, are live attributes: `step` and `reset` change them in place.
    Further arrays are ``params (n, N_PARAM)``, ``team``, ``max_speed_mps`` and ``agent_radius_m`` (n,) and ``flag_home
    (2, 2)`` m.

    A finished game goes on when stepped; reset it with `reset(mask)`.

    Args:
        config: a `GameConfig` or a preset's name.
        n_games: number of games B.
        seed: seed of all games; game b draws the same numbers whatever B is.

    Raises:
        ConfigError: the config is unusable.
    """

    @checked_calls(hint=of_the_config)
    def __init__(self, config: GameConfig | str | None = None, n_games: int = 1, seed: int | None = None) -> None:
        self.config = as_config(config)
        self.n_games = check_count("n_games", n_games, low=1)
        self.n_boats = self.config.n_boats
        self.field = field_geometry(self.config)
        self.rules = make_rules(self.config, self.field)
        self.games = make_games(self.config, self.n_games)
        vars(self).update(self.games._asdict())
        self.params: Array = self.rules.params
        self.team: IntArray = self.rules.team
        self.max_speed_mps: Array = self.rules.max_speed
        self.agent_radius_m: Array = self.rules.agent_radius
        self.flag_home: Array = self.rules.flag_home
        self.observation_keys = observation_keys(self.config)
        self.n_obs = len(self.observation_keys)
        low, high = bounds_of(self.observation_keys, self.config, self.field, float(self.max_speed_mps.max()))
        self.observation_low, self.observation_high = low, high
        self._middle = 0.5 * (low + high)
        self._scale = 2.0 / np.where(high > low, high - low, np.inf)
        self._raw = np.zeros((min(self.n_games, CHUNK), self.n_boats, self.n_obs))
        self._places = default_places(self.config, self.field)
        self._commands = np.zeros((self.n_games, self.n_boats, 2))
        self.observations = np.zeros((self.n_games, self.n_boats, self.n_obs), dtype=np.float32)
        self.rewards = np.zeros((self.n_games, self.n_boats))
        self.seed(seed)
        self.reset()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Return an array of `Games`."""

    def reset(self, mask: BoolArray | None = None, seed: int | None = None) -> np.ndarray:
        """Start games anew.

        Args:
            mask: (B,) bool, which games; None for all.
            seed: new seed for those games, game b as in a reset of all; None continues each game's random numbers.

        Returns:
            Observations (B, n, n_obs) float32, normalised, of all games.

        Raises:
            GameError: the mask has the wrong shape, or boats do not fit into the field.
        """
        chosen = np.ones(self.n_games, dtype=np.bool_) if mask is None else np.asarray(mask)
        if chosen.shape != (self.n_games,) or chosen.dtype != np.bool_:
            raise GameError(f"mask is {chosen.dtype} of shape {chosen.shape}; give bool of shape ({self.n_games},)")
        if seed is not None:
            self.seed(seed, chosen)
        reset_games(self.rules, self.games, chosen, self._places, self.config)
        return self.observe()

    def seed(self, seed: int | None, mask: BoolArray | None = None) -> None:
        """Seed the random numbers of all games, or of those in ``mask`` (B,); None takes entropy from the machine."""
        if seed is not None:
            check_count("seed", seed, low=0)
        chosen = slice(None) if mask is None else mask
        self.games.rng[chosen] = seed_states(seed, self.n_games)[chosen]

    def reset_game(self, game: int, init: Mapping[str, Any]) -> np.ndarray:
        """Start one game from a partial state, see `steerclear.env.starts.start_from`; the others go on.

        Returns:
            Observations (B, n, n_obs) float32, normalised, of all games.

        Raises:
            GameError: no such game, or a state that the rules do not allow.
        """
        self._check_game(game)
        start_from(self.config, self.rules, self.games, game, self._places, init)
        return self.observe()

    def commands(self, actions: Array) -> Array:
        """Return the commands that the boats will obey, after the game's own decisions; set ``driven``.

        Args:
            actions: (B, n, 2) nominal commands of the policies: speed m/s, relative heading deg.

        Returns:
            New array (B, n, 2), same units.

        Raises:
            GameError: wrong shape, or an action is not finite or beyond `LARGEST_COMMAND`.
        """
        decided = np.empty_like(self._commands)
        decide_commands(self.rules, self.games, self._checked("action", actions), decided)
        return decided

    def advance(self, commands: Array) -> None:
        """Move all boats under ``commands`` (B, n, 2) for a decision and apply the rules, collisions and clocks.

        In a decision of several steps the game decides anew before each step for game-controlled boats. The others
        continue under the same speed and relative heading.

        Raises:
            GameError: wrong shape, or a command is not finite or beyond `LARGEST_COMMAND`.
        """
        given = self._checked("command", commands)
        begin_decision(self.rules, self.games)
        self._commands[:] = given
        advance_games(self.rules, self.games, given, self._commands)

    def start_seen(self, seen: Array) -> None:
        """Start all games with boats where they are seen. Something else moves them; they may be real.

        Args:
            seen: (B, n, 4) x m, y m, heading deg, speed m/s; a boat whose x is NaN has no position and is out of
                bounds.

        Raises:
            GameError: wrong shape, or a value that is not finite of a boat whose x is a number.
        """
        start_where_seen(self.rules, self.games, self._checked_sight(seen))

    def follow(self, seen: Array, dt_s: float) -> None:
        """Apply the rules to boats that something else has moved.

        It does the same as `advance`, in the same order, but moves nothing.

        Args:
            seen: (B, n, 4) where the boats are now, as in `start_seen`.
            dt_s: time since the last call, s, by which cool-downs and the game's clock advance.

        Raises:
            GameError: see `start_seen`, or ``dt_s`` is not a time.
        """
        given = self._checked_sight(seen)
        if not 0.0 <= dt_s < np.inf:
            raise GameError(f"dt_s is {dt_s}; give a finite time >= 0, in s")
        follow_games(share(self.rules._replace(decision_s=float(dt_s))), self.games, given)

    def restore(self, view: GameView, game: int = 0) -> None:
        """Restore a game from a view of it, or of another game of the same size: the inverse of `view`.

        Raises:
            GameError: there is no such game, or the view has other boats.
        """
        self._check_game(game)
        restore_game(self.rules, self.games, game, view)

    def step(
        self, actions: Array, command_filter: CommandFilter | None = None
    ) -> tuple[np.ndarray, Array, BoolArray, BoolArray]:
        """Play one decision of all games, in one step of motion or several.

        Args:
            actions: (B, n, 2) speed m/s, relative heading deg.
            command_filter: called with this object and the decided commands before every step of motion; the boats obey
                what it returns.

        Returns:
            observations (B, n, n_obs) float32 in [-1, 1], rewards (B, n), terminated (B,), truncated (B,). The next
            step reuses these arrays: copy what you keep.

        Raises:
            GameError: see `commands` and `advance`.
        """
        wanted = self._checked("action", actions)
        with self._power_plays():
            commands = self.commands(wanted)
            if command_filter is not None:
                commands = self._checked("command", command_filter(self, commands))
        begin_decision(self.rules, self.games)
        if command_filter is None:
            self._commands[:] = commands
            advance_games(self.rules, self.games, wanted, self._commands)
        else:
            move_games(self.rules, self.games, commands)
            for _ in range(1, self.config.decision_steps):
                commands = self._checked("command", command_filter(self, self.commands(wanted)))
                move_games(self.rules, self.games, commands)
            end_decision(self.rules, self.games)
        reward_games(self.rules, self.games, self.rewards)
        return self.observe(), self.rewards, self.terminated, self.truncated

    @contextmanager
    def _power_plays(self) -> Iterator[None]:
        """Begin and end power plays; undo that on an exception inside, since the decision has then not begun."""
        before = self.is_disabled.copy(), self.games.power_begun.copy()
        toggle_power_plays(self.rules, self.games)
        try:
            yield
        except BaseException:
            self.is_disabled[:], self.games.power_begun[:] = before
            raise

    def observe(self) -> np.ndarray:
        """Return observations (B, n, n_obs) float32, normalised; the array is reused."""
        observe_games(self.rules, self.games, self._middle, self._scale, self._raw, self.observations)
        return self.observations

    def view(self, game: int = 0) -> GameView:
        """Return a frozen copy of one game."""
        return view_game(self.config, self.rules, self.games, game)

    def _checked(self, what: str, values: Any) -> Array:
        """Return actions or commands (B, n, 2) as an array; refuse non-finite ones and those that overflow motion."""
        shape = self._commands.shape
        try:
            array = numbers(values)
        except NoNumbersError as error:
            raise GameError(f"{what}s are no numbers ({error}); give {shape}: speed m/s, heading deg") from None
        if array.shape != shape:
            raise GameError(f"{what}s have shape {array.shape}; give {shape}: speed m/s, heading deg")
        if not np.abs(array).max(initial=0.0) <= LARGEST_COMMAND:
            game, boat, column = np.argwhere(~(np.abs(array) <= LARGEST_COMMAND))[0]
            wrong = f"beyond {LARGEST_COMMAND:g}" if np.isfinite(array[game, boat, column]) else "not finite"
            raise GameError(f"{what} of agent_{boat} in game {game} is {wrong}; give finite speed m/s and heading deg")
        return array

    def _checked_sight(self, seen: Any) -> Array:
        array = np.array(seen, dtype=np.float64, order="C")
        wanted = (self.n_games, self.n_boats, 4)
        if array.shape != wanted:
            raise GameError(f"seen has shape {array.shape}; give {wanted}: x m, y m, heading deg, speed m/s")
        nowhere = np.isnan(array[..., 0])
        if not np.isfinite(array[~nowhere]).all():
            raise GameError("seen holds a value that is not finite; give NaN as the x of a boat that is nowhere")
        array[nowhere] = (np.nan, np.nan, 0.0, 0.0)
        return array

    def _check_game(self, game: int) -> None:
        if not 0 <= game < self.n_games:
            raise GameError(f"there is no game {game}; games are 0..{self.n_games - 1}")
