"""Playing a tournament into a folder: every game is kept when it ends, a later run goes on from there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..runner import ROWS_FILE, append_row, open_folder, read_rows
from ..warming import compile_game, compile_judge, compile_shield
from ..workers import Workers, outcomes
from .play import play_game
from .results import finalists
from .settings import GameJob, TournamentSettings, label

Notice = Callable[[int, int], None]
"""Told how many games are done and how many there are."""


class Tournament:
    """A tournament, and where its games are kept.

    Args:
        settings: what to play.
        folder: where games go and where finished ones come from.
        resume: go on with what is there.
        workers: processes here, or a cluster.
    """

    def __init__(self, settings: TournamentSettings, folder: Path, resume: bool, workers: Workers = 1) -> None:
        self.settings, self.folder, self.workers = settings, folder, workers
        self._lock = open_folder(folder, "tournament", resume)
        self.failed: list[dict[str, Any]] = []
        self._kept = {key: rows[0] for key, rows in read_rows(folder / ROWS_FILE).items()}
        self._jobs: list[GameJob] = (
            settings.qualifying_games() if settings.qualifying else settings.final(settings.teams)
        )
        self.resumed = sum(job.key in self._kept for job in self._jobs)

    @property
    def jobs(self) -> list[GameJob]:
        """The games known so far: those of the final once the finalists are."""
        return list(self._jobs)

    @property
    def expected(self) -> int:
        """Games there are to play, all in all."""
        settings = self.settings
        qualifying = len(settings.qualifying_games()) if settings.qualifying else 0
        return qualifying + len(settings.final(settings.teams[: settings.finalists]))

    def run(self, notice: Notice = lambda done, of: None) -> None:
        """Play what is missing, the qualifying first."""
        self._play(self._jobs, notice)
        if self.settings.qualifying:
            final = self.settings.final(finalists(self.rows(), self.settings))
            self.resumed += sum(job.key in self._kept for job in final)
            self._jobs += final
            self._play(final, notice)

    def rows(self) -> list[dict[str, Any]]:
        """What is on disk of this tournament, in the order of its games."""
        return [self._kept[job.key] for job in self._jobs if job.key in self._kept]

    def _play(self, jobs: Sequence[GameJob], notice: Notice) -> None:
        missing = [job for job in jobs if job.key not in self._kept]
        notice(len(self.rows()), self.expected)
        for outcome in outcomes(play_game, missing, self.workers, (compile_game, compile_shield, compile_judge)):
            job = outcome.job
            if outcome.answer is None:
                game = {"blue": label(job.spec.own), "red": label(job.spec.opponent), "repetition": job.spec.game}
                self.failed.append(
                    {
                        "phase": job.phase,
                        "state": job.state,
                        **game,
                        "error": outcome.error,
                        "fault": outcome.trace is not None,
                    }
                )
            else:
                append_row(self.folder / ROWS_FILE, job.key, [outcome.answer])
                self._kept[job.key] = outcome.answer
            notice(len(self.rows()), self.expected)
