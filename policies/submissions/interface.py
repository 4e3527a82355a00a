"""The call a submission must answer, looked at when it is loaded: one that cannot be called would hold all game."""

from __future__ import annotations

import inspect
from typing import Any

from steerclear.shield.exceptions import PolicyError

from ..signatures import call_fault

METHOD_NAME = "compute_action"
ARGUMENTS = ("agent_id", "full_obs_normalized", "full_obs", "global_state")
ARGUMENTS_OF_2024 = 3
"""(agent_id as a number, observation_normalized, observation), both of that boat alone."""


def check_interface(instance: Any, source: object) -> None:
    """Check that a ``solution`` can be asked for actions.

    Raises:
        PolicyError: its method is missing, takes other arguments or answers later.
    """
    method = getattr(instance, METHOD_NAME, None)
    if not callable(method):
        raise PolicyError(f"solution() of {source} has no method {METHOD_NAME!r}; define one")
    fault = call_fault(method, ARGUMENTS)
    if fault is None:
        return
    remedy = f"define {METHOD_NAME}(self, {', '.join(ARGUMENTS)})"
    if _takes(method, ARGUMENTS_OF_2024):
        remedy = (
            f"it looks like the interface of 2024, whose observations this game does not make: port it, and {remedy}"
        )
    raise PolicyError(f"{METHOD_NAME} of {source} {fault}; {remedy}, the last three being dicts keyed by agent id")


def _takes(method: Any, count: int) -> bool:
    try:
        inspect.signature(method).bind(*range(count))
    except Exception:
        return False
    return True
