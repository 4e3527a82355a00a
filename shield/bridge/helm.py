"""`Helm`: the one place where wanted commands pass the shield and leave for boats. Nothing changes them after that."""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import BridgeError, FleetError
from ..fleet import Fleet
from ..jit import Array
from ..platforms import layout as L
from ..shield import Shield
from ..surroundings import Surroundings
from .assemble import assemble
from .clock import Clock
from .fleet_file import FleetFile
from .frame import TWO_PI
from .freshness import Verdict
from .link import Link, Sent
from .parts import GameState
from .responses import Responder
from .roster import Roster
from .tick import Action
from .water import Water

LOG = logging.getLogger(__name__)

TALK_EVERY_S = 5.0
"""The same failure of the decision is logged again after this long, s."""


@dataclass(frozen=True)
class Steered:
    """What went in and out of one decision; see `tick.Tick`."""

    fleet: Fleet | None = None
    wanted: Commands | None = None
    surroundings: Surroundings | None = None
    decisions: Decisions | None = None
    shield_reset: bool = False
    sent: Mapping[str, Sent] = field(default_factory=dict)
    actions: tuple[Action, ...] = ()


class Helm:
    """Takes what boats should do to the shield and its answer to the boats.

    Args:
        fleet: the file.
        shield: the one shield.
        links: of the boats this process commands, by name.
        clock: of all times.
        water: what does not move around the boats; None: the file's geofence.
    """

    def __init__(
        self,
        fleet: FleetFile,
        shield: Shield,
        links: Mapping[str, Link],
        clock: Clock,
        water: Water | None = None,
    ) -> None:
        self._file = fleet
        self._shield = shield
        self._links = links
        self._clock = clock
        self._water = Water(fleet) if water is None else water
        self._responders = {name: Responder(fleet.platform_of[name], fleet.geofence) for name in links}
        self._fresh = True
        self._failure = ("", -math.inf)

    def steer(
        self,
        roster: Roster,
        answer: Commands | None,
        verdict: Verdict,
        mates: Collection[str] = (),
        game: GameState | None = None,
        game_age_s: float = math.inf,
    ) -> Steered:
        """Decide and send for all boats of this process.

        Args:
            roster: what is known of all boats.
            answer: the policy's absolute commands, all boats of the file; used for boats without a response due.
            verdict: responses due, boats whose state is unknown, boats that do not obey.
            mates: team-mates another process commands behind a shield of their own.
            game: the referee's state of the game; None: none.
            game_age_s: its age, s.
        """
        commanded = [name for name in self._links if name not in verdict.unknown and name not in verdict.idle]
        so_far = Steered()
        try:
            fleet = assemble(roster, {*commanded, *mates}, verdict.dropped)
            so_far = Steered(fleet)
            if fleet is None or not commanded:
                return self._finish(so_far, verdict)
            wanted = self._wanted(fleet, commanded, answer, verdict)
            so_far = Steered(fleet, wanted, self._water.around(fleet, game, game_age_s))
            reset = self._reset_if_due()
            decisions = self._shield.decide(fleet, wanted, so_far.surroundings)
        except Exception as error:  # whatever broke, no boat may go on with an old command
            return self._finish(self._failed(so_far, commanded, error), verdict)
        actions: list[Action] = []
        sent = {name: self._send(name, decisions, fleet, actions) for name in commanded}
        steered = replace(so_far, decisions=decisions, shield_reset=reset, sent=sent, actions=tuple(actions))
        return self._finish(steered, verdict)

    def stop_all(self, names: Collection[str]) -> dict[str, Sent]:
        """Tell boats to stop by their links' surest way, past the shield."""
        return {name: self._links[name].stop() for name in names}

    def _reset_if_due(self) -> bool:
        """Forget all backups at the start and after a failure: half-made memory is not to be trusted."""
        reset = self._fresh
        if reset:
            self._shield.reset()
        self._fresh = False
        return reset

    def _wanted(self, fleet: Fleet, commanded: Collection[str], answer: Commands | None, verdict: Verdict) -> Commands:
        values = np.full((len(fleet), 2), np.nan)
        for i, name in enumerate(fleet.names):
            if name in commanded:
                values[i] = self._wanted_row(name, fleet.state[i], answer, verdict)
            elif fleet.controlled[i]:  # a team-mate with its own shield: taken to hold its course
                values[i] = max(0.0, fleet.state[i, L.SPEED]), math.radians(fleet.state[i, L.HEADING]) % TWO_PI
        return Commands.absolute_rad(values)

    def _wanted_row(
        self, name: str, row: Array, answer: Commands | None, verdict: Verdict
    ) -> tuple[float, float] | Array:
        response = verdict.responses.get(name, "go_on")
        if response == "go_on" and answer is not None:
            self._responders[name].clear()
            return answer.values[self._file.names.index(name)]
        return self._responders[name].wanted("stop" if response == "go_on" else response, row)

    def _send(self, name: str, decisions: Decisions, fleet: Fleet, actions: list[Action]) -> Sent:
        i = fleet.names.index(name)
        speed, heading = decisions.sent.absolute(i, fleet.heading_rad[i])
        try:
            return self._links[name].send(heading, speed)
        except BridgeError as error:
            LOG.error("%s: command (%s rad, %s m/s) not sent: %s; told to stop", name, heading, speed, error)
            actions.append(Action(name, "send", "stop", f"the command was not sent ({error}); the link's own stop"))
            return self._links[name].stop()

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
        """Stop boats whose state is unknown; leave alone those that somebody else steers."""
        sent = dict(steered.sent)
        for name in self._links:
            if name in sent:
                continue
            if name in verdict.idle:
                sent[name] = Sent(name, self._clock.now_s(), math.nan, math.nan, "none: does not obey", False)
            else:
                sent[name] = self._links[name].stop()
        return replace(steered, sent=sent)
