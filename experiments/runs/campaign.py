"""Playing many games into an output folder: each result is kept as it comes, a later run goes on from there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..play.match import play_row
from ..play.spec import MatchSpec
from .pool import Engine, Outcome, run_all
from .store import ResultStore

Row = dict[str, Any]
Notice = Callable[[int], None]


@dataclass
class Played:
    """What a run of many games gave.

    Attributes:
        rows: one per game played, in the order of the specs.
        failed: games that could not be played: `pairing`, `game`, `shielded`, `error`, `fault`.
        resumed: how many of the rows an earlier run had left.
    """

    rows: list[Row] = field(default_factory=list)
    failed: list[dict[str, Any]] = field(default_factory=list)
    resumed: int = 0


class Campaign:
    """Games to play, and where their results are kept.

    Args:
        specs: the games.
        store: where results go and where finished ones come from.
        processes: how many games at once, or the engine that plays them.
        play: from a spec to its row; importable by name.
    """

    def __init__(
        self,
        specs: Sequence[MatchSpec],
        store: ResultStore,
        processes: int | Engine = 1,
        play: Callable[[MatchSpec], Row] = play_row,
    ) -> None:
        self.specs = list(specs)
        self.store = store
        self.processes = processes
        self.play = play
        self._failed: list[dict[str, Any]] = []
        self._before = self._finished()

    @property
    def words_of_before(self) -> str:
        """What an earlier run left of these games, and how much that is not of them."""
        others = len(self.store.load()) - len(self._before)
        words = f"{len(self._before)} of {len(self.specs)} games are in {self.store.lines} and are taken from there"
        text = "of other settings, or of a policy's files before they changed, and count for nothing here"
        return words + (f"; {others} there are {text}" if others else "")

    def _finished(self) -> dict[str, Row]:
        wanted = {spec.key for spec in self.specs}
        return {key: row for key, row in self.store.load().items() if key in wanted}

    def run(self, notice: Notice = lambda done: None) -> Played:
        """Play what is missing.

        Args:
            notice: called with the number of finished games, first for those an earlier run had left.

        Returns:
            What was played, before and now. When interrupted, `so_far` gives what is there.
        """
        done = len(self._before)
        notice(done)
        missing = [spec for spec in self.specs if spec.key not in self._before]
        for outcome in run_all(self.play, missing, self.processes):
            self._keep(outcome)
            done += 1
            notice(done)
        return self.so_far()

    def so_far(self) -> Played:
        """Return what is on disk of this campaign."""
        finished = self._finished()
        rows = [finished[spec.key] for spec in self.specs if spec.key in finished]
        return Played(rows, list(self._failed), len(self._before))

    def _keep(self, outcome: Outcome[MatchSpec, Row]) -> None:
        spec = outcome.job
        if outcome.answer is None:
            named = {"pairing": spec.pairing, "game": spec.game, "shielded": spec.shield is not None}
            self._failed.append({**named, **outcome.why})
        else:
            self.store.append(spec.key, outcome.answer)
