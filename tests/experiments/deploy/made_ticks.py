"""A tick put together by hand: every kind of row, nothing compiled."""

import math

import numpy as np
from steerclear.experiments.deploy.rules import player_names
from steerclear.shield import Commands, Fleet, Reason
from steerclear.shield.bridge.messages import BoatReading, Contact, Sent, Tick
from steerclear.shield.decision import Decisions
from steerclear.shield.surroundings import Surroundings

WANTED = [(1.5, 54.0), (12.5, 359.0), (2.0, 180.0)]
SENT = [(1.5, 54.0), (10.25, 8.0), (0.0, 271.0)]


def made_tick(fleet, now_s=5.0, names=None, **changes):
    """Three boats of ours, of which two were changed, and three contacts; ``names`` may replace those shown."""
    names = names or player_names(fleet)
    place = [(20.0, 20.0), (30.0, 40.0), (40.0, 60.0), (120.0, 20.0), (110.0, 40.0), (33.0, 42.0)]
    heading = np.radians([54.0, 8.0, 271.0, 270.0, 270.0, 200.0])
    state = Fleet.of(
        position_m=place, heading_rad=heading, speed_mps=[1.5, 2.0, 0.3, 1.0, 1.2, 2.0], team=[0, 0, 0, 1, 1, 1],
        platforms="heron", names=names,
    )  # fmt: skip
    wanted, sent = (np.array([*rows, *[(math.nan, math.nan)] * 3]) for rows in (WANTED, SENT))
    decisions = Decisions(
        fleet=state,
        nominal=Commands.absolute_rad(_rad(wanted)),
        filtered=Commands.absolute_rad(_rad(sent)),
        intervened=np.array([False, True, True, False, False, False]),
        reason=np.array([Reason.PASSED, Reason.LEAST_CHANGE, Reason.BEST_EFFORT, *[Reason.NOT_COVERED] * 3]),
        safety_margin_m=np.array([math.inf, 0.25, -1.5, *[math.nan] * 3]),
        slack_m=np.zeros(6),
        bound=np.array([-1, 5, -2, -1, -1, -1]),
        solve_time_s=0.001,
    )
    readings, contacts, told = {}, [], {}
    for i, name in enumerate(names):
        position, speed = (float(place[i][0]), float(place[i][1])), float(state.speed_mps[i])
        if i < 3:
            ages = dict.fromkeys(("position_age_s", "heading_age_s", "velocity_age_s", "heartbeat_age_s"), 0.04)
            readings[name] = BoatReading(
                name, now_s, position, heading_rad=float(heading[i]), speed_mps=speed, course_rad=float(heading[i]),
                turn_rate_rads=0.0, turn_rate_age_s=0.04, mode="GUIDED", ready=True, why_not="", **ages,
            )  # fmt: skip
            told[name] = Sent(name, now_s, math.radians(SENT[i][1]), SENT[i][0], "SET_ATTITUDE_TARGET", True)
        else:
            contacts.append(Contact(name, position, float(heading[i]), speed, now_s - 0.12, 0.3, "hub"))
    made = {
        "number": 1, "due_s": now_s, "began_s": now_s, "sent_s": now_s, "readings": readings,
        "contacts": tuple(contacts), "fleet": state, "wanted": decisions.nominal, "surroundings": Surroundings(),
        "decisions": decisions, "shield_reset": False, "sent": told, "policy_age_s": 0.06, "actions": (), "game": {},
    }  # fmt: skip
    return Tick(**{**made, **changes})


def _rad(rows):
    return np.column_stack([rows[:, 0], np.radians(rows[:, 1])])
