"""Encounters: boats that meet, in families of thousands, with any filter in the place of the shield.

From Python::

    from steerclear.experiments.encounters import Conditions, measure
    outcome = measure("rammer_1", "shield:adversary_s=9", own="heron", other="heron", n=200, seed=0,
                      conditions=Conditions(radius_m=2.5))
    outcome.summary["breached"], outcome.columns["closest_m"].min()

``draw`` gives the scenes alone, ``play`` plays them with any guard and returns every state. A guard decides in water
and in the dark as the batched shield does: ``decide(state, wanted, ours) -> sent``, ``reason``, ``certificate_m``.
"""

from .families import FAMILIES, draw, get_family
from .guards import build_guard, parse_guards
from .measure import Outcome, measure
from .play import Film, play
from .scenes import DT_S, Conditions, Scenes

__all__ = [
    "DT_S",
    "FAMILIES",
    "Conditions",
    "Film",
    "Outcome",
    "Scenes",
    "build_guard",
    "draw",
    "get_family",
    "measure",
    "parse_guards",
    "play",
]
