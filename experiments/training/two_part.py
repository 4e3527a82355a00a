"""QMIX for play, then PPO for what to do once the flag is held: Richley-NIWC-ATL's team, one command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from .checkpoints import checkpoints_in, read_checkpoint
from .checks import check_options
from .qmix_training import RANGES, QmixTraining
from .settings import TrainingSettings
from .taking_over import FIRST
from .training import Training

PLAY = "play"
SHARE = "play_share"
"""Option: share of the decisions that QMIX gets; the rest is PPO's."""


class TwoPartTraining:
    """QMIX in the folder ``play``, then PPO in the folder itself; resumed, a first part that is done is kept.

    Args:
        settings: ``options`` as of QMIX, and ``play_share``; the first stage is QMIX's, all are PPO's.
        folder: where everything goes.
        resume: go on with PPO from its last checkpoint.

    Raises:
        ConfigError: an option or checkpoint is unusable.
    """

    def __init__(self, settings: TrainingSettings, folder: Path, resume: bool = False) -> None:
        check_options(settings.algorithm, settings.options, {SHARE: (float, 0.0, 1.0), **RANGES})
        options = dict(settings.options)
        share = float(options.pop(SHARE, 0.5))
        first = max(1, int(share * settings.decisions))
        self.settings, self.folder, self.resume = settings, folder, resume
        self.weights = folder / PLAY / "final.npz"
        self.decisions = 0
        self._play = None
        if not (resume and self.weights.exists()):
            self._play = QmixTraining(replace(settings, decisions=first, options=options), folder / PLAY)
        elif found := checkpoints_in(folder):
            self.decisions = first + int(read_checkpoint(found[-1])[0]["decisions"])
        self._first = first

    def run(self, notice: Any = lambda done, words: None) -> None:
        """Train both parts to the end."""
        if self._play is not None:
            self._play.folder.mkdir(parents=True, exist_ok=True)
            self._play.run(lambda done, words: notice(done, f"play, {words}"))
        ppo = replace(
            self.settings,
            algorithm="ppo",
            decisions=max(1, self.settings.decisions - self._first),
            options={FIRST: str(self.weights)},
        )
        second = Training(ppo, self.folder, self.resume)
        second.run(lambda done, words: notice(self._first + done, f"with the flag, {words}"))
        self.decisions = self.settings.decisions
