"""QMIX for play, then PPO for what to do once the flag is held: Richley-NIWC-ATL's team, one command."""

from __future__ import annotations

from pathlib import Path

from .checkpoints import newest, read_checkpoint
from .config import Net, PpoConfig, PpoOptions, QmixConfig, TwoPartConfig
from .ppo import PpoTraining
from .qmix import QmixTraining
from .training import FINAL, Notice

PLAY = "play"


class TwoPartTraining:
    """QMIX in the folder ``play``, then PPO in the folder itself; resumed, a first part that is done is kept.

    Args:
        config: the first stage is QMIX's, all are PPO's.
        folder: where everything goes.
        resume: go on with PPO from its last checkpoint.

    Raises:
        ConfigError: a setting or checkpoint is unusable.
    """

    def __init__(self, config: TwoPartConfig, folder: Path, resume: bool = False) -> None:
        self.config, self.folder, self.resume = config, folder, resume
        self.weights = folder / PLAY / FINAL
        self.decisions, self.total = 0, config.decisions
        self._of_play = max(1, int(config.options.play_share * config.decisions))
        self._play = None
        if not (resume and self.weights.exists()):
            self._play = QmixTraining(self._config_of_play(), folder / PLAY)
        elif found := newest(folder):
            self.decisions = self._of_play + int(read_checkpoint(found)[0]["decisions"])

    def _config_of_play(self) -> QmixConfig:
        own = ("algorithm", "device", "stages", "decisions", "net")
        shared = {name: getattr(self.config, name) for name in QmixConfig.model_fields if name not in own}
        net = Net(**{name: getattr(self.config.net, name) for name in Net.model_fields})
        stages = self.config.stages[:1]
        return QmixConfig(algorithm="qmix", stages=stages, decisions=self._of_play, net=net, **shared)

    def _config_of_second(self) -> PpoConfig:
        own = ("algorithm", "options", "decisions")
        shared = {name: getattr(self.config, name) for name in PpoConfig.model_fields if name not in own}
        left = max(1, self.total - self._of_play)
        return PpoConfig(decisions=left, options=PpoOptions(first=str(self.weights)), **shared)

    def run(self, notice: Notice = lambda done, words: None) -> None:
        """Train both parts to the end."""
        if self._play is not None:
            self._play.folder.mkdir(parents=True, exist_ok=True)
            self._play.run(lambda done, words: notice(done, f"play, {words}"))
        second = PpoTraining(self._config_of_second(), self.folder, self.resume)
        second.run(lambda done, words: notice(self._of_play + done, f"with the flag, {words}"))
        self.decisions = self.total
