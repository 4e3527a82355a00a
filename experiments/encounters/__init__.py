"""Encounters: boats that meet, in families of thousands, with any filter in the place of the shield.

From Python::

    from steerclear.experiments.encounters import Conditions, measure
    outcome = measure("rammer_1", "shield:adversary_horizon_s=9", own="heron", other="heron", n=200, seed=0,
                      conditions=Conditions(radius_m=2.5))
    outcome.summary["breached"], outcome.columns["closest_m"].min()

``draw`` gives the scenes alone, ``play`` plays them with any guard (a safety filter) and returns every state. A guard
decides in water and in the dark as the batched shield does: ``decide(state, wanted, ours) -> sent``, ``reason``,
``safety_margin_m``.
"""

from typing import Any
from warnings import warn

from ..baselines.registry import build_guard, parse_guards
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
    "build_guard",
    "draw",
    "get_family",
    "measure",
    "parse_guards",
    "play",
]


def __getattr__(name: str) -> Any:
    if name != "Film":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warn("Film is called Trajectory", DeprecationWarning, stacklevel=2)
    return Trajectory
