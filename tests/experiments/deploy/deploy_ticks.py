"""Ticks of a simulated game, as the loop on boats would make them."""

import math

import numpy as np
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy.rules import game_config, player_names, state_of
from steerclear.shield import Commands, Shield, ShieldConfig
from steerclear.shield.bridge.messages import BoatReading, Contact, Sent, Tick
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import Surroundings


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
        self.decisions = None
        self.number = 0

    def _filter(self, core, commands):
        state = core.state[0].copy()
        fleet = Fleet(state, core.team, self.config.platforms, core.team == 0, self.names)
        self.decisions = self.shield.decide(fleet, Commands.relative_deg(commands[0]), self.surroundings)
        return self.decisions.filtered.values[np.newaxis]

    @property
    def surroundings(self):
        return Surroundings(field=self.fleet.geofence.box)

    def tick(self, now_s=None, actions=(), **changes):
        """Play a step; the tick of it."""
        actions_of = {}
        for team in self.teams:
            actions_of |= team.act(self.observations, self.infos)
        self.observations, *_, self.infos = self.env.step(actions_of)
        now_s = 0.1 * self.number if now_s is None else now_s
        state = self.decisions.fleet.state
        readings, contacts, sent = {}, [], {}
        for i, name in enumerate(self.names):
            heading = math.radians(state[i, L.HEADING]) % (2.0 * math.pi)
            position = (float(state[i, L.X]), float(state[i, L.Y]))
            if self.decisions.fleet.controlled[i]:
                ages = dict.fromkeys(("position_age_s", "heading_age_s", "velocity_age_s", "heartbeat_age_s"), 0.04)
                readings[name] = BoatReading(
                    name, now_s, position, heading_rad=heading, speed_mps=float(state[i, L.SPEED]), course_rad=heading,
                    turn_rate_rads=0.0, turn_rate_age_s=0.04, mode="GUIDED", ready=True, why_not="", **ages,
                )  # fmt: skip
                decision = self.decisions[i]
                sent[name] = Sent(
                    name, now_s, decision.filtered_heading_rad, decision.filtered_speed_mps, "SET_ATTITUDE_TARGET", True
                )
            else:
                contacts.append(Contact(name, position, heading, float(state[i, L.SPEED]), now_s - 0.12, 0.3, "hub"))
        made = {
            "number": self.number, "due_s": now_s, "began_s": now_s + 0.0003, "sent_s": now_s + 0.004,
            "readings": readings, "contacts": tuple(contacts), "fleet": self.decisions.fleet,
            "wanted": self.decisions.nominal, "surroundings": self.surroundings, "decisions": self.decisions,
            "shield_reset": False, "sent": sent, "policy_age_s": 0.06, "actions": tuple(actions),
            "game": state_of(self.env.core, self.names).as_dict(),
        }  # fmt: skip
        self.number += 1
        return Tick(**{**made, **changes})
