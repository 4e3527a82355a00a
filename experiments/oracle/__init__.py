"""Post-hoc avoidability analysis: was a separation violation avoidable, until when, and who let the last chance pass?

The analysis takes a recorded run and holds every other boat's actual track fixed in time. It searches the own boat's
commands with a full model of boat and autopilot. It shares no code with the shield and never imports it, so its
verdicts do not depend on the shield's model.

Usage (all arrays are float64)::

    # boats: (n, 38) rows as `Platform.pack()` returns them, or a list of `Boat`
    verdict = judge(states, boats, own=0, step=123, radius_m=2.5, dt_s=0.1)          # one boat's side -> Verdict
    both = judge_violation(states, boats, (0, 3), 123, radius_m=2.5, driven=driven)      # both sides
    many = judge_violations(states, boats, [(123, 0, 3), ...], radius_m=2.5)   # list[ViolationVerdict]

- ``states`` (T+1, n, 11): full state row of every boat; index 0 is the start, index k the state after k steps.
  Columns: x m, y m, heading deg, speed m/s, thrust, rudder, last speed error, speed integral, last heading error,
  heading integral, turn rate deg/s. The two errors are NaN before the first call of the controllers.
- ``step``: index of the first state in which the pair is within ``radius_m`` (exactly the radius counts as inside),
  as the first column of ``env.record.find_violations``.
- ``driven`` (T, n) bool or None: whether the game, not the policy or shield, controlled the boat in step k -> k+1.
- ``motion`` (`Motion`): the current that carried all boats, and each boat's delay from command to effect in steps.
- ``verdict.outcome`` (`Outcome`), ``verdict.last_preventable_s`` (s before the violation, None if never),
  ``verdict.plan`` (the avoiding commands), ``both.responsible`` (`Responsible`).
"""

from typing import Any
from warnings import warn

from .boat_model import N_STATE, Boat
from .judge import judge, judge_violation, judge_violations
from .verdict import AT_ONCE, Motion, OracleError, Outcome, Plan, Responsible, Settings, Verdict, ViolationVerdict

__all__ = [
    "AT_ONCE",
    "N_STATE",
    "Boat",
    "Motion",
    "OracleError",
    "Outcome",
    "Plan",
    "Responsible",
    "Settings",
    "Verdict",
    "ViolationVerdict",
    "judge",
    "judge_violation",
    "judge_violations",
]
_OLD = {
    "BreachVerdict": "ViolationVerdict",
    "judge_breach": "judge_violation",
    "judge_breaches": "judge_violations",
}


def __getattr__(name: str) -> Any:
    if name not in _OLD:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warn(f"{name!r} is now {_OLD[name]!r}; the old name goes with the next release", DeprecationWarning, stacklevel=2)
    return globals()[_OLD[name]]
