"""Encounters: boats that meet, in families of thousands, with any safety filter in the place of the shield.

From Python::

    from steerclear.experiments.encounters import Conditions, measure
    outcome = measure("rammer_1", "shield:adversary_horizon_s=9", own="heron", other="heron", n=200, seed=0,
                      conditions=Conditions(radius_m=2.5))
    outcome.summary["violated"], outcome.columns["closest_m"].min()

``draw`` gives the scenes alone, ``play`` plays them with any safety filter and returns every state. A filter decides
in water and in the dark as the batched shield does: ``decide(state, nominal, ours) -> filtered``, ``reason``,
``safety_margin_m``.
"""

from steerclear.shield.renamed import old_names

from ..baselines.registry import build_filter, parse_filters
from .figures import Outcome, measure
from .scenarios import FAMILIES, draw, get_family
from .scene import DT_S, Conditions, Scenes
from .simulate import Trajectory, play

__all__ = [
    "DT_S",
    "FAMILIES",
    "Conditions",
    "Outcome",
    "Scenes",
    "Trajectory",
    "build_filter",
    "draw",
    "get_family",
    "measure",
    "parse_filters",
    "play",
]
_OLD = {"Film": "Trajectory", "build_guard": "build_filter", "parse_guards": "parse_filters"}
__getattr__ = old_names(globals(), _OLD)
