"""Which object trains which algorithm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .settings import TrainingSettings
from .unused import check_used


def training_of(settings: TrainingSettings, folder: Path, resume: bool) -> Any:
    """An object with ``run(notice)`` and ``decisions``.

    Raises:
        ConfigError: a setting or checkpoint is unusable, or a setting is given that the algorithm has no use for.
    """
    check_used(settings)
    if settings.algorithm == "qmix":
        from .qmix_training import QmixTraining

        return QmixTraining(settings, folder, resume)
    if settings.algorithm == "qmix+ppo":
        from .two_part import TwoPartTraining

        return TwoPartTraining(settings, folder, resume)
    if settings.algorithm == "cloning":
        from .cloning import CloningTraining

        return CloningTraining(settings, folder, resume)
    if settings.algorithm == "raids":
        from .raids_training import RaidsTraining

        return RaidsTraining(settings, folder, resume)
    from .training import Training

    return Training(settings, folder, resume)
