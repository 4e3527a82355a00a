"""A network as a competition entry: a zip with ``solution.py`` and its weights, which needs numpy only."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
from steerclear.env.config import PRESETS, GameConfig
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.weights_file import arrays_of
from steerclear.policies.submissions.made_for import ABOUT_FILE, MadeFor
from steerclear.shield.exceptions import ConfigError, PolicyError

TEMPLATE = Path(__file__).parent.parent / "templates" / "learned_solution.py.txt"


def write_submission(network: Network, path: Path) -> Path:
    """Write the zip, whole or not at all.

    Raises:
        ConfigError: entries send numbers of actions; this network sends speeds and headings, or numbers of raids.
        PolicyError: it cannot be written.
    """
    if network.kind == "raids":
        raise ConfigError("raids look at the whole game, which no entry is told; play them here, as weights:FILE")
    if network.kind != "discrete":
        raise ConfigError("an entry for the competition sends action numbers; train with actions: discrete")
    content = io.BytesIO()
    np.savez_compressed(content, **arrays_of(network))
    with whole_file(path, PolicyError) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("solution.py", TEMPLATE.read_text(encoding="utf-8").replace("ABOUT", _about(network)))
        if network.preset in PRESETS:
            made = MadeFor(network.preset, GameConfig.preset(network.preset).decision_s)
            archive.writestr(ABOUT_FILE, made.to_bytes())
        archive.writestr("weights.npz", content.getvalue())
    return path


def _about(network: Network) -> str:
    where = f"It learned in preset {network.preset}. " if network.preset else ""
    return f"{where}There is no shield in it: ``steerclear entry wrap`` puts one round it."
