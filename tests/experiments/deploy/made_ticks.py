"""Ticks of a simulated game, as the loop on boats would make them, and one put together by hand."""

import contextlib
import math
import threading
import time

import numpy as np
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy.referee import game_config, player_names, state_of
from steerclear.shield import Commands, Reason, Shield, ShieldConfig
from steerclear.shield.bridge.messages import BoatReading, Contact, Sent, Tick
from steerclear.shield.decision import Decisions
from steerclear.shield.fleet import Fleet
from steerclear.shield.surroundings import Surroundings


def tick_of(decisions, now_s, **changes):
    """The tick in which those decisions were sent: readings of boats that were decided for, contacts of the others."""
    fleet, readings, contacts, sent = decisions.fleet, {}, [], {}
    rows = zip(
        fleet.names, fleet.position_m.tolist(), fleet.heading_rad.tolist(), fleet.speed_mps.tolist(), strict=True
    )
    ages = dict.fromkeys(("position_age_s", "heading_age_s", "velocity_age_s", "heartbeat_age_s"), 0.04)
    for i, (name, place, heading, speed) in enumerate(rows):
        if fleet.controlled[i]:
            readings[name] = BoatReading(
                name, now_s, tuple(place), heading_rad=heading, speed_mps=speed, course_rad=heading,
                turn_rate_rads=0.0, turn_rate_age_s=0.04, mode="GUIDED", ready=True, why_not="", **ages,
            )  # fmt: skip
            told_mps, told_rad = decisions.filtered.absolute(i, heading)
            sent[name] = Sent(name, now_s, told_rad, told_mps, "SET_ATTITUDE_TARGET", True)
        else:
            contacts.append(Contact(name, tuple(place), heading, speed, now_s - 0.12, 0.3, "hub"))
    made = {
        "number": 1, "due_s": now_s, "began_s": now_s, "sent_s": now_s, "readings": readings,
        "contacts": tuple(contacts), "fleet": fleet, "wanted": decisions.nominal, "surroundings": Surroundings(),
        "decisions": decisions, "shield_reset": False, "sent": sent, "policy_age_s": 0.06, "actions": (), "game": {},
    }  # fmt: skip
    return Tick(**{**made, **changes})


class Stream:
    """Plays a shielded game between two scripted teams, a tick per step."""

    def __init__(self, fleet, policy="medium", opponent="rammer", separation_m=2.5):
        self.fleet = fleet
        self.config = game_config(fleet)
        self.env = MctfEnv(self.config, command_filter=self._filter)
        self.observations, self.infos = self.env.reset(seed=1)
        ids, half = self.env.possible_agents, self.config.team_size
        self.teams = [policies.make(policy), policies.make(opponent)]
        for k, team in enumerate(self.teams):
            team.reset(self.env, ids[k * half : (k + 1) * half], 1)
        self.shield = Shield(ShieldConfig(separation_m=separation_m))
        self.names = player_names(fleet)
        self.surroundings = Surroundings(field=fleet.geofence.box)
        self.number = 0

    def _filter(self, core, commands):
        fleet = Fleet(core.state[0].copy(), core.team, self.config.platforms, core.team == 0, self.names)
        self.decisions = self.shield.decide(fleet, Commands.relative_deg(commands[0]), self.surroundings)
        return self.decisions.filtered.values[np.newaxis]

    def tick(self, now_s=None, **changes):
        """Play a step; the tick of it."""
        actions_of = {}
        for team in self.teams:
            actions_of |= team.act(self.observations, self.infos)
        self.observations, *_, self.infos = self.env.step(actions_of)
        now_s = 0.1 * self.number if now_s is None else now_s
        times = {"began_s": now_s + 0.0003, "sent_s": now_s + 0.004, "number": self.number}
        self.number += 1
        game = state_of(self.env.core, self.names).as_dict()
        return tick_of(self.decisions, now_s, **{**times, "surroundings": self.surroundings, "game": game, **changes})


WANTED = [(1.5, 54.0), (12.5, 359.0), (2.0, 180.0)]
SENT = [(1.5, 54.0), (10.25, 8.0), (0.0, 271.0)]


def made_tick(fleet, now_s=5.0, names=None, **changes):
    """Three boats of ours, of which two were changed, and three contacts; ``names`` may replace those shown."""
    state = Fleet.of(
        position_m=[(20.0, 20.0), (30.0, 40.0), (40.0, 60.0), (120.0, 20.0), (110.0, 40.0), (33.0, 42.0)],
        heading_rad=np.radians([54.0, 8.0, 271.0, 270.0, 270.0, 200.0]), speed_mps=[1.5, 2.0, 0.3, 1.0, 1.2, 2.0],
        team=[0, 0, 0, 1, 1, 1], platforms="heron", names=names or player_names(fleet),
    )  # fmt: skip
    rows = [np.array([*rows, *[(math.nan, math.nan)] * 3]) * (1.0, math.pi / 180.0) for rows in (WANTED, SENT)]
    wanted, sent = (Commands.absolute_rad(values) for values in rows)
    decisions = Decisions(
        fleet=state,
        nominal=wanted,
        filtered=sent,
        intervened=np.array([False, True, True, False, False, False]),
        reason=np.array([Reason.PASSED, Reason.LEAST_CHANGE, Reason.BEST_EFFORT, *[Reason.NOT_COVERED] * 3]),
        safety_margin_m=np.array([math.inf, 0.25, -1.5, *[math.nan] * 3]),
        slack_m=np.zeros(6),
        bound=np.array([-1, 5, -2, -1, -1, -1]),
        solve_time_s=0.001,
    )
    return tick_of(decisions, now_s, **changes)


def wait_for(condition, patience_s=30.0):
    """Wait until something holds; fail when it does not in time."""
    end_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.005)


@contextlib.contextmanager
def repeating(act, every_s=0.02):
    """Do something again and again in a thread of its own, until it is left."""
    done = threading.Event()

    def run():
        while not done.wait(every_s):
            act()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
