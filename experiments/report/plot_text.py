"""Names in plots: matplotlib reads dollar signs as formulas, and fails on those that are none."""

from __future__ import annotations

from steerclear.shield.visible import visible

LONGEST = 60


def plot_text(content: object) -> str:
    """Text that is drawn as it is; a long one is cut, line ends stay."""
    text = visible(content, keep="\n")
    text = text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
    return text.replace("$", r"\$")
