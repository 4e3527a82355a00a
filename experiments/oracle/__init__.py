"""Post-hoc avoidability analysis: was a separation violation avoidable, until when, and who let that pass?

It looks back at a recorded run with every other boat's actual track held fixed in time and searches the own boat's
commands with a full model of boat and autopilot. It shares no code with the shield and never imports it: what it says
about the shield is independent of what the shield believes.

How to call it (all arrays float64, numpy)::

    # boats: (n, 38) rows, as `Platform.pack()` gives, or a list of `Boat`
    verdict = judge(states, boats, own=0, step=123, radius_m=2.5, dt_s=0.1)          # one boat's side -> Verdict
    both = judge_breach(states, boats, (0, 3), 123, radius_m=2.5, driven=driven)      # both sides
    many = judge_breaches(states, boats, [(123, 0, 3), ...], radius_m=2.5)   # list[BreachVerdict]

- ``states`` (T+1, n, 11): every boat's full state row (columns x m, y m, heading deg, speed m/s, thrust, rudder, last
  speed error, speed integral, last heading error, heading integral, turn rate deg/s; the two errors NaN before the
  controllers' first call), index 0 the start, index k after k steps.
- ``step``: index of the first state in which the pair is within ``radius_m`` (at exactly the radius is inside), as
  the first column of ``env.record.find_breaches``.
- ``driven`` (T, n) bool or None: whether the game, not the policy or shield, drove the boat in step k -> k+1.
- ``motion`` (`Motion`): the current that carried all boats and the steps from each boat's command to its effect.
- ``verdict.outcome`` (`Outcome`), ``verdict.last_preventable_s`` (s before the breach, None if never),
  ``verdict.plan`` (the avoiding commands), ``both.responsible`` (`Responsible`).
"""

from .boat_model import N_STATE, Boat
from .judge import judge, judge_breach, judge_breaches
from .verdict import AT_ONCE, BreachVerdict, Motion, OracleError, Outcome, Plan, Responsible, Settings, Verdict

__all__ = [
    "AT_ONCE",
    "N_STATE",
    "Boat",
    "BreachVerdict",
    "Motion",
    "OracleError",
    "Outcome",
    "Plan",
    "Responsible",
    "Settings",
    "Verdict",
    "judge",
    "judge_breach",
    "judge_breaches",
]
