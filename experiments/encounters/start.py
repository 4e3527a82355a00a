"""Whether encounters start where the shield can still answer for them: its certificate at the first decision."""

from __future__ import annotations

import numpy as np

from .guards import SHIELD, build_guard
from .play import Film


def start_certificate_m(film: Film) -> np.ndarray:
    """The default shield's certificate at the first decision, least of the own boats, whatever guard was played.

    It is asked about the true start, with the margins that the conditions call for; the same number for every guard,
    so that guards are compared on the same encounters.

    Returns:
        (B,) m; at least 0 outside the set from which the shield cannot promise to keep the radius, inf where nobody
        is near.
    """
    scenes = film.scenes
    shield = build_guard(SHIELD, scenes, film.conditions)
    ours = np.broadcast_to(scenes.own, film.state.shape[1:3]).copy()
    shield.decide(scenes.state, film.wanted[0], ours)
    return np.asarray(shield.certificate_m[:, scenes.own].min(axis=1))
