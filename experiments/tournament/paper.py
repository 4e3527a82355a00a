"""What the paper of the first International Maritime Capture the Flag Competition (2024) reports of its final."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperRow:
    """A team of the paper.

    Attributes:
        team: its name there.
        entrant: ours by that name; empty for a learned team that nobody has entered yet.
        rank: in Table 3, with the penalty.
        score: likewise.
        collisions: likewise.
        rank_free: in Table 4, without it.
        captures: likewise.
    """

    team: str
    entrant: str
    rank: int
    score: float
    collisions: int
    rank_free: int
    captures: int


PAPER = (
    PaperRow("Lucas-QMU", "lucas", 1, -1.0, 4, 6, 0),
    PaperRow("Ohto-Indep", "ohto", 2, -3.0, 12, 6, 0),
    PaperRow("Alamer-EJUST", "alamer", 2, -3.0, 12, 6, 0),
    PaperRow("Meo-Indep", "meo", 3, -4.25, 17, 6, 0),
    PaperRow("Chao-NIWC-PAC", "chao", 4, -6.75, 11, 4, 4),
    PaperRow("Richley-NIWC-ATL", "richley", 5, -10.0, 109, 3, 15),
    PaperRow("Jin-Indep", "jin", 6, -10.25, 226, 1, 31),
    PaperRow("Crowley-BU-LL", "crowley", 7, -15.5, 183, 2, 19),
    PaperRow("Leprell-USMA", "leprell", 8, -49.5, 153, 5, 0),
)
"""The learned ones (richley, jin, crowley, leprell) count here as soon as somebody enters them under these names."""

SCRIPTED = ("lucas", "ohto", "alamer", "meo", "chao")


def paper_row(name: str) -> PaperRow | None:
    """The paper's row of one of our teams, None where it has none."""
    return next((row for row in PAPER if row.entrant == name), None)
