"""A table's card: what it was solved for and how good it is. Kept as JSON inside the table's file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any

from ..exceptions import TableError
from ..platforms.platform import Platform
from .grid import Grid

FORMAT = 1
"""Version of the table files."""


def platform_digest(platform: Platform) -> str:
    """Digest of a platform's parameters; a table is valid for exactly these."""
    return hashlib.sha256(platform.pack().tobytes()).hexdigest()[:16]


@dataclass(frozen=True)
class Card:
    """What a value table is.

    The table is valid for an own boat whose thrust is at its maximum; its other boat may have any thrust.

    Attributes:
        own, other: platforms' names.
        own_parameters, other_parameters: digests of their parameters.
        other_may: what the other boat is granted.
        grid: nodes of the table, as of `Grid`.
        dt_s, horizon_s: table step and longest play, s.
        iterations: steps done until the end.
        residual_m: largest change of a value in the last step, m.
        checked_radii_m: separation radii for which convergence and margin were checked, m.
        convergence: share by which the sets {V < radius} change on a coarser grid, by radius.
        areas_m2: areas of {V < radius}, m^2, by radius and speed pair, over relative headings.
        model_error: error of the reduced model against the full one.
        margin: outcome of closed-loop runs of the full model; empty when not run.
        version: version of the package that solved it.
        levels_s: shorter times T for which V(x, T) is kept as well, s.
        levels: how far ahead, m, the set {V(x, T) < radius} reaches head-on at top speeds, by T and radius.
        payload_sha256: digest of the packed values.
    """

    own: str
    other: str
    own_parameters: str
    other_parameters: str
    other_may: str
    grid: dict[str, Any]
    dt_s: float
    horizon_s: float
    iterations: int
    residual_m: float
    payload_sha256: str = ""
    version: str = ""
    checked_radii_m: tuple[float, ...] = ()
    convergence: dict[str, Any] = field(default_factory=dict)
    areas_m2: dict[str, Any] = field(default_factory=dict)
    model_error: dict[str, Any] = field(default_factory=dict)
    margin: dict[str, Any] = field(default_factory=dict)
    levels_s: tuple[float, ...] = ()
    levels: dict[str, Any] = field(default_factory=dict)
    format: int = FORMAT

    def to_json(self) -> str:
        """The card as text."""
        return json.dumps(asdict(self), indent=1, sort_keys=True)

    @staticmethod
    def of_json(text: str) -> Card:
        """Read a card.

        Raises:
            TableError: the text is no card of this version of the format.
        """
        try:
            content = json.loads(text)
            content["checked_radii_m"] = tuple(content["checked_radii_m"])
            content["levels_s"] = tuple(content.get("levels_s", ()))
            card = Card(**content)
            card.make_grid()
        except (ValueError, TypeError, KeyError) as error:
            raise TableError(f"the table's card cannot be read ({error})") from error
        if card.format != FORMAT:
            raise TableError(f"the table's format is {card.format}, this version of the package reads {FORMAT}")
        return card

    def make_grid(self) -> Grid:
        """The grid of the table."""
        return Grid(**self.grid)
