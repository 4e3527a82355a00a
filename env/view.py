"""`GameView`: a frozen copy of one game's arrays."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L

from .arrays import Games, Rules
from .config import GameConfig


@dataclass(frozen=True)
class GameView:
    """One game at one moment; every array is a copy. Names and units as in `BatchedMctf`, without the batch axis.

    Boats are in the order of ``config.agent_ids``, n of them, blue first; of two entries the first is blue's.

    Attributes:
        config: rules.
        state: (n, 11) of each boat: east and north m, heading deg, speed m/s, and what its autopilot remembers.
        params: (n, n_params) parameters of each boat.
        team: (n,) 0 blue, 1 red.
        previous_position: (n, 2) before the last move, m.
        is_tagged: (n,) tagged.
        is_disabled: (n,) stopped by a power play.
        has_flag: (n,) carries the other team's flag.
        oob: (n,) out of bounds.
        on_side: (n,) in its own half.
        driven: (n,) the game decided the last command, not the policy.
        tagging_cooldown_s: (n,) since the last tag, s, up to the cool-down.
        made_tag: (n,) boat tagged in this step, -1 for none.
        collisions: (n,) so far, looked for once a decision.
        contacts: (n,) the same, looked for after every step.
        flag_home: (2, 2) m.
        flag_position: (2, 2) m; with its carrier while taken.
        flag_taken: (2,) that team's flag is carried by an opponent.
        captures: (2,) by each team.
        grabs: (2,) likewise.
        tags: (2,) likewise.
        events: (2, 4) captures, grabs, tags and boats newly out of bounds in this decision.
        power_start: (2,) decision at which a power play begins, -1 for none.
        power_boats: (2, 2) boats that it disables.
        power_begun: (2,) how often it has begun.
        time_s: since the start, s.
        terminated: a team has made the most captures that count.
        truncated: the time is over.
    """

    config: GameConfig
    state: Array
    params: Array
    team: IntArray
    previous_position: Array
    is_tagged: BoolArray
    is_disabled: BoolArray
    has_flag: BoolArray
    oob: BoolArray
    on_side: BoolArray
    driven: BoolArray
    tagging_cooldown_s: Array
    made_tag: IntArray
    collisions: IntArray
    contacts: IntArray
    flag_home: Array
    flag_position: Array
    flag_taken: BoolArray
    captures: IntArray
    grabs: IntArray
    tags: IntArray
    events: IntArray
    power_start: IntArray
    power_boats: IntArray
    power_begun: IntArray
    time_s: float
    terminated: bool
    truncated: bool

    @property
    def position(self) -> Array:
        """Positions (n, 2), m."""
        return self.state[:, [L.X, L.Y]]

    @property
    def heading_deg(self) -> Array:
        """Headings (n,), deg clockwise from north."""
        return self.state[:, L.HEADING]

    @property
    def speed_mps(self) -> Array:
        """Speeds (n,), m/s."""
        return self.state[:, L.SPEED]


_FIXED = {"config", "params", "team", "flag_home", "time_s", "terminated", "truncated"}
_COPIED = tuple(entry.name for entry in fields(GameView) if entry.name not in _FIXED)


def view_game(config: GameConfig, rules: Rules, games: Games, b: int) -> GameView:
    """Return a view of game ``b``."""
    return GameView(
        config=config,
        params=rules.params,
        team=rules.team,
        flag_home=rules.flag_home,
        time_s=float(games.time_s[b]),
        terminated=bool(games.terminated[b]),
        truncated=bool(games.truncated[b]),
        **{name: np.copy(getattr(games, name)[b]) for name in _COPIED},
    )


def restore_game(rules: Rules, games: Games, b: int, view: GameView) -> None:
    """Set game ``b`` to the state in a view. What a view lacks (random numbers, touching pairs) is not changed."""
    for name in _COPIED:
        target, given = getattr(games, name)[b], np.asarray(getattr(view, name))
        if given.shape != target.shape:
            raise GameError(f"{name} of the view has shape {given.shape}; give {target.shape}, of the same game")
    for name in _COPIED:
        getattr(games, name)[b] = getattr(view, name)
    games.time_s[b] = view.time_s
    games.terminated[b], games.truncated[b] = view.terminated, view.truncated
