"""`CommandPipeline`: the only path of commands to boats. Nothing changes a command after the shield.

Where the shield demands a stop (`Reason.STOPPED`), the link stops the boat itself and sends no command.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..commands import Commands
from ..decision import Decisions, Reason
from ..exceptions import BridgeError, FleetError
from ..fleet import Fleet
from ..platforms import layout as L
from ..shield import Shield
from ..surroundings import Surroundings
from ..tracks import whole_steps
from .clock import Clock
from .failsafe import Responder, Verdict
from .fleet_file import FleetFile
from .frame import TWO_PI
from .messages import Action, Link, Sent
from .tracker import Tracker

LOG = logging.getLogger(__name__)

TALK_EVERY_S = 5.0  # interval between logs of the same failure of the decision, s


@dataclass(frozen=True)
class Steered:
    """Inputs and outputs of one decision, see `messages.Tick`; ``beyond``: boats beyond the hard line."""

    fleet: Fleet | None = None
    nominal: Commands | None = None
    surroundings: Surroundings | None = None
    decisions: Decisions | None = None
    shield_reset: bool = False
    sent: Mapping[str, Sent] = field(default_factory=dict)
    actions: tuple[Action, ...] = ()
    beyond: frozenset[str] = frozenset()


class CommandPipeline:
    """Path from nominal commands through the shield to the links of the boats that this process commands."""

    def __init__(self, fleet: FleetFile, shield: Shield, links: Mapping[str, Link], clock: Clock) -> None:
        self._file, self._shield, self._links, self._clock = fleet, shield, links, clock
        self._responders = {name: Responder(fleet.platform_of[name], fleet.geofence) for name in links}
        config = fleet.shield_config
        self._line_m = config.beyond_m if config.beyond_m is not None and config.beyond_then == "stop" else math.inf
        self._delay_s = whole_steps(config.delay_s, config.dt_s) * config.dt_s
        self._fresh = True
        self._failure = ("", -math.inf)

    def steer(
        self,
        tracker: Tracker,
        answer: Commands | None,
        verdict: Verdict,
        surroundings: Surroundings,
        teammates: Collection[str] = (),
    ) -> Steered:
        """Decide and send for all boats of this process.

        Args:
            tracker: tracks of all boats.
            answer: the policy's absolute commands for all boats of the file; used for boats without a response due.
            verdict: responses due, boats in unknown state, boats that do not obey.
            surroundings: current static constraints.
            teammates: teammates that other processes command, with their own shields.
        """
        commanded = [name for name in self._links if name not in verdict.unknown and name not in verdict.idle]
        so_far = Steered()
        try:
            fleet = tracker.assemble({*commanded, *teammates}, verdict.dropped)
            so_far = Steered(fleet)
            if fleet is None or not commanded:
                return self._finish(so_far, verdict)
            nominal = self._nominal(fleet, commanded, answer, verdict)
            so_far = Steered(fleet, nominal, surroundings)
            reset, self._fresh = self._fresh, False
            if reset:  # at the start and after a failure, which may leave inconsistent memory
                self._shield.reset()
            decisions = self._shield.decide(fleet, nominal, surroundings)
        except Exception as error:  # after any failure, no boat may continue with an old command
            return self._finish(self._failed(so_far, commanded, error), verdict)
        actions: list[Action] = []
        sent = {name: self._send(name, decisions, actions) for name in commanded}
        beyond = frozenset(action.subject for action in actions if action.condition == "hard_line")
        steered = Steered(fleet, nominal, surroundings, decisions, reset, sent, tuple(actions), beyond)
        return self._finish(steered, verdict)

    def stop_all(self, names: Collection[str]) -> dict[str, Sent]:
        """Stop boats by their links' most reliable way, bypassing the shield."""
        return {name: self._links[name].stop() for name in names}

    def _nominal(self, fleet: Fleet, commanded: Collection[str], answer: Commands | None, verdict: Verdict) -> Commands:
        values = np.full((len(fleet), 2), np.nan)
        for i, name in enumerate(fleet.names):
            if name in commanded:
                response = verdict.responses.get(name, "go_on")
                if response == "go_on" and answer is not None:
                    self._responders[name].clear()
                    values[i] = answer.values[self._file.names.index(name)]
                else:
                    response = "stop" if response == "go_on" else response
                    values[i] = self._responders[name].nominal(response, fleet.state[i])
            elif fleet.controlled[i]:  # a teammate with its own shield: assumed to hold its course
                values[i] = max(0.0, fleet.state[i, L.SPEED]), math.radians(fleet.state[i, L.HEADING]) % TWO_PI
        return Commands.absolute_rad(values)

    def _send(self, name: str, decisions: Decisions, actions: list[Action]) -> Sent:
        fleet = decisions.fleet
        i = fleet.names.index(name)
        if decisions.reason[i] == Reason.STOPPED:
            outside_m = self._outside_m(fleet, i)
            what, text = "obstacle", f"{name} can only stop before an obstacle: stopped by its link"
            if outside_m > self._line_m:
                what = "hard_line"
                text = f"{name} is {outside_m:.1f} m outside, beyond the hard line: stopped by its link, handed over"
            actions.append(Action(name, what, "stop", text))
            return self._links[name].stop()
        speed, heading = decisions.filtered.absolute(i, fleet.heading_rad[i])
        try:
            return self._links[name].send(heading, speed)
        except BridgeError as error:
            LOG.error("%s: command (%s rad, %s m/s) not sent: %s; told to stop", name, heading, speed, error)
            actions.append(Action(name, "send", "stop", f"the command was not sent ({error}); the link's own stop"))
            return self._links[name].stop()

    def _outside_m(self, fleet: Fleet, i: int) -> float:
        """Return how far outside the area a boat is, m: the larger of the present and when a command takes effect."""
        (x, y), heading, way = fleet.position_m[i], fleet.heading_rad[i], fleet.state[i, L.SPEED] * self._delay_s
        left, low, right, high = self._file.geofence.box
        places = ((x, y), (x + way * math.sin(heading), y + way * math.cos(heading)))
        return float(max(max(left - x, low - y, x - right, y - high) for x, y in places))

    def _failed(self, so_far: Steered, commanded: Collection[str], error: Exception) -> Steered:
        self._fresh = True
        text = f"no decision ({type(error).__name__}: {error}); boats told to stop"
        now = self._clock.now_s()
        if text != self._failure[0] or now - self._failure[1] >= TALK_EVERY_S:
            self._failure = text, now
            LOG.error(text, exc_info=not isinstance(error, FleetError))
        action = Action("shield", "decision", "stop", text)
        return replace(so_far, sent=self.stop_all(commanded), actions=(action,))

    def _finish(self, steered: Steered, verdict: Verdict) -> Steered:
        """Stop boats without a command; send nothing to those that do not obey."""
        sent = dict(steered.sent)
        for name in self._links:
            if name not in sent and name in verdict.idle:
                sent[name] = Sent(name, self._clock.now_s(), math.nan, math.nan, "none: does not obey", False)
            elif name not in sent:
                sent[name] = self._links[name].stop()
        return replace(steered, sent=sent)
