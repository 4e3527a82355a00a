"""The env as a match plays it and as it is recorded: what nobody reads in a step is neither written nor copied."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import Record, make_record
from steerclear.env.record_file import LAYOUT
from steerclear.policies.entrants.play import EntrantTeam
from steerclear.policies.scripted.team import ScriptedTeam
from steerclear.shield.platforms.layout import HEADING, SPEED, X, Y

FIRST_ROWS = 1024
"""Rows there is room for at first; when they are full, for twice as many."""
MARKS = ("has_flag", "is_tagged", "oob", "is_disabled", "flag_position", "captures")
ORDERS = ("wanted", "sent", "reason", "intervened", "safety_margin_m")
Rows = NDArray[Any]


class PlayingEnv(MctfEnv):
    """An `MctfEnv` that can leave its infos out (``tells``): they take a fifth of a step's time."""

    tells = True

    def infos(self) -> dict[str, dict[str, Any]]:
        """Infos by agent id; empty where nobody reads them."""
        return super().infos() if self.tells else {}


def read_infos(teams: Iterable[Any]) -> bool:
    """Whether one of these policies may read infos: all but our own scripted teams and entrants, which see the game."""
    ours = (EntrantTeam, ScriptedTeam)
    return not all(any(isinstance(p, team) and type(p).act is team.act for team in ours) for p in teams)


def live_view(core: BatchedMctf) -> Any:
    """What a recorder reads, as the game's own arrays: always of this moment, never copied; valid until a reset."""
    return SimpleNamespace(**{name: getattr(core.games, name)[0] for name in ("state", *MARKS)})


class Recorder:
    """One game as a record, step by step: as `GameRecorder` does, into arrays made beforehand, in a third of the time.

    The game is its `live_view`, from which the start is taken at once; its meta is as `GameRecorder.start` takes it.
    """

    def __init__(self, game: Any, meta: Mapping[str, Any]) -> None:
        self._game, self._meta, self._steps = game, dict(meta), 0
        sizes = {"n": len(meta["agent_ids"])}
        self._rows: dict[str, Rows] = {
            name: np.zeros((FIRST_ROWS, *(sizes.get(str(axis), axis) for axis in axes[1:])), dtype=kind)
            for name, (axes, kind) in LAYOUT.items()
            if name != "breaches"
        }
        self._note_state(0)

    def step(self, wanted: Rows, sent: Rows, reason: Rows, intervened: Rows, safety_margin_m: Rows) -> None:
        """Add a step: commands (n, 2) of speed m/s and absolute heading deg, (n,) the rest; the state is the game's."""
        step = self._steps
        if step + 2 > len(self._rows["wanted"]):
            self._rows = {name: np.concatenate([rows, np.zeros_like(rows)]) for name, rows in self._rows.items()}
        for name, row in zip(ORDERS, (wanted, sent, reason, intervened, safety_margin_m), strict=True):
            self._rows[name][step] = row
        self._note_state(step + 1)
        self._steps = step + 1

    def finish(self) -> Record:
        """The record, without breaches; TraceError where it does not fit together."""
        arrays = {name: rows[: self._steps + (LAYOUT[name][0][0] == "T+1")].copy() for name, rows in self._rows.items()}
        return make_record(self._meta, breaches=np.zeros((0, 4)), **arrays)

    def _note_state(self, row: int) -> None:
        state, rows = self._game.state, self._rows
        rows["position"][row, :, 0], rows["position"][row, :, 1] = state[:, X], state[:, Y]
        rows["heading_deg"][row], rows["speed_mps"][row] = state[:, HEADING], state[:, SPEED]
        for name in MARKS:
            rows[name][row] = getattr(self._game, name)
