"""The fixed-rate loop: read, judge, decide, send, record; on a monotonic clock, until told to end."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping

from ..commands import Commands
from ..shield import Shield
from .assemble import seen_now
from .clock import Clock
from .contact import Contact, alarms_of, heard_from
from .fleet_file import FleetFile
from .foresight import Foresight
from .freshness import RIVAL_S, Seen, Verdict, judge
from .handover import at_rest, nearing
from .helm import Helm, Steered
from .latency import Delays
from .link import BoatReading, Link
from .operator import Operator
from .overruns import Overruns
from .parts import GameState, Parts, contact_of
from .policy_watch import PolicyWatch
from .recording import Recorder
from .retaking import Retaking
from .roster import Roster
from .tick import Action, Tick
from .wanted import Snapshot, WantedSource
from .water import Water

__all__ = ["Loop", "Parts", "contact_of"]

LOG = logging.getLogger(__name__)

TALK_EVERY_S = 5.0
"""The same failure is logged again after this long, s."""

RIVALS = ("second_commander", "disobeys")
"""Keys of `BoatReading.faults` that tell of somebody else's commands: heard, or seen by what the boat does."""


class Loop:
    """Runs boats.

    Args:
        fleet: the file.
        parts: links, policy, sources and sinks; the loop closes none of them.
        operator: STOP ALL, overrides, the end.
        clock: of all times; the links and the feed have the same.
        shield: the shield; None: one with the file's settings.
    """

    def __init__(
        self, fleet: FleetFile, parts: Parts, operator: Operator, clock: Clock, shield: Shield | None = None
    ) -> None:
        self.fleet = fleet
        self.parts = parts
        self.operator = operator
        self.clock = clock
        self.overruns = Overruns(fleet.dt_s)
        self.roster = Roster(fleet, parts.links)
        chosen = Shield(fleet.shield_config, fleet.surroundings) if shield is None else shield
        self.delays = Delays({name: fleet.platform_of[name] for name in parts.links}, fleet.shield_config)
        self.foresight = Foresight(fleet, tuple(parts.links))
        self._helm = Helm(fleet, chosen, parts.links, clock, Water(fleet, parts.grounds))
        self._watch = PolicyWatch(fleet, tuple(parts.links))
        self._has_referee = fleet.feed is not None and fleet.feed.referee is not None
        self._mates = _mates(fleet, parts.links)
        self._number = 0
        self._recorder = Recorder(parts.sinks)
        self._retaking = Retaking(parts.links)
        self._rivals_s: dict[str, float] = {}
        self._broke_s = -math.inf
        self.near: tuple[str, ...] = ()
        """Boats that came near one of ours when these were handed over at the end."""
        self._ending = ""
        self._readings: dict[str, BoatReading] = {}

    def run(self, seconds: float | None = None) -> str:
        """Turn at the file's rate until the operator ends it or the time is over, then bring boats to rest.

        At the end boats are told to stop and go on behind the shield until they lie still and nobody is on the way to
        one of them: a boat that only stops may drift into another, and one that nobody steers is defended by nobody.

        Args:
            seconds: how long, s on the loop's clock; None: until ended.

        Returns:
            Why it ended.
        """
        began = self.clock.now_s()
        last = math.inf if seconds is None else began + seconds
        try:
            due = self._keep_on(began, lambda due: not self.operator.ended and due < last)
            self._ending = self.operator.ended or f"ran for {self.clock.now_s() - began:.0f} s"
            latest = due + self.fleet.end.longest_s
            self._keep_on(due, lambda now: now < latest and not self._is_clear())
            self._tell_near()
        finally:
            self._stop_ours()
            self._retaking.close()
        return self._ending

    def _keep_on(self, due_s: float, goes_on: Callable[[float], bool]) -> float:
        """Turn at the rate as long as ``goes_on(due time)``; when the next turn would be due."""
        while goes_on(due_s):
            self.clock.sleep_until(due_s)
            self._turn_or_stop(due_s)
            due_s = self.overruns.next_due(due_s, self.clock.now_s())
        return due_s

    def _is_clear(self) -> bool:
        """Whether boats can be handed over: they lie still, and nobody is on the way to one of them."""
        return at_rest(self._readings) and not nearing(self.fleet, self.roster, self._readings)

    def _tell_near(self) -> None:
        self.near = tuple(nearing(self.fleet, self.roster, self._readings))
        for text in self.near:
            LOG.warning("handed over although %s: take it over by hand", text)

    def _turn_or_stop(self, due_s: float) -> None:
        """A turn that breaks where none should leaves boats told to stop, and the next one is tried."""
        try:
            self.turn(due_s)
        except Exception:
            self._stop_ours()
            if self.clock.now_s() - self._broke_s >= TALK_EVERY_S:
                self._broke_s = self.clock.now_s()
                LOG.exception("a turn of the loop broke; boats told to stop")

    def _no_taking(self) -> str:
        """Why no boat is taken back now; empty: it may be."""
        return "the run ends" if self._ending else "STOP ALL is in force" if self.operator.stopped else ""

    def _stop_ours(self) -> None:
        """Stop boats by their links; those that somebody took are left alone, unless STOP ALL was asked for twice."""
        readings = {} if self.operator.hard else self._readings
        self._helm.stop_all([name for name in self.parts.links if name not in readings or not readings[name].released])

    def turn(self, due_s: float) -> Tick:
        """One turn.

        Args:
            due_s: when it was due.
        """
        began = self.clock.now_s()
        self._readings = readings = {name: link.read() for name, link in self.parts.links.items()}
        self._retaking.look(self.operator.take_requests(), readings, began, self._no_taking())
        contacts = self._contacts()
        self.roster.update(began, readings, contacts)
        self.foresight.update(self.roster.own_rows(), readings)
        self.roster.margin_m = self.foresight.margin_m
        answer, policy_age, fault = _latest(self.parts.policy)
        self._watch.update(began, answer, policy_age, fault)
        game, game_age = self._game()
        verdict = judge(self.fleet, self.roster, self._seen(began, readings, game, game_age))
        steered = self._steer(answer, verdict, game, game_age)
        self.roster.sent(began, steered.sent)
        self.delays.update(readings, steered.sent)
        self.foresight.sent(steered.sent)
        tick = Tick(
            number=self._number,
            due_s=due_s,
            began_s=began,
            sent_s=self.clock.now_s(),
            readings=readings,
            contacts=contacts,
            fleet=steered.fleet,
            wanted=steered.wanted,
            surroundings=steered.surroundings,
            decisions=steered.decisions,
            shield_reset=steered.shield_reset,
            sent=steered.sent,
            policy_age_s=policy_age,
            actions=(
                *self.operator.actions(began),
                *self._retaking.actions(began),
                *verdict.actions,
                *steered.actions,
                *self.delays.actions(),
                *self.foresight.actions(),
            ),
            game={} if game is None else game.as_dict(),
        )
        self._number += 1
        self._recorder.take(tick)
        self.parts.policy.offer(Snapshot(tick.number, began, seen_now(self.roster), tick.game, game_age))
        return tick

    def _steer(self, answer: Commands | None, verdict: Verdict, game: GameState | None, game_age_s: float) -> Steered:
        if self._ending:
            verdict.actions.append(Action("all", "end", "stop", f"the run ends: {self._ending}"))
        if self.operator.stopped or self._ending:
            verdict.responses.update(dict.fromkeys(self.parts.links, "stop"))
        if self.operator.hard:
            return Steered(sent=self._helm.stop_all(tuple(self.parts.links)))
        limit = self.fleet.limits.contact.max_age_s
        sure = [name for name in self._mates if not self.roster.contradicted(name)]
        mates = {name for name in sure if self.roster.contact_age_s(name) <= limit}
        return self._helm.steer(self.roster, answer, verdict, mates, game, game_age_s)

    def _seen(
        self, now_s: float, readings: Mapping[str, BoatReading], game: GameState | None, game_age_s: float
    ) -> Seen:
        for name, reading in readings.items():
            if any(reading.faults.get(kind) for kind in RIVALS):
                self._rivals_s[name] = now_s
        return Seen(
            readings=readings,
            usable=self._watch.usable,
            policy_age_s=self._watch.ages(now_s),
            rivals={name for name, time_s in self._rivals_s.items() if now_s - time_s <= RIVAL_S},
            policy_fault=self._watch.fault,
            game_age_s=game_age_s,
            game_expected=self.parts.game is not None and self._has_referee,
            game_over=game is not None and game.over,
            log_fault=self._recorder.fault,
            overrides=self.operator.active(now_s),
            outside_s={name: self.foresight.outside_s(name) for name in readings},
            alarms=(*self.roster.alarms(), *(alarm for each in self.parts.contacts for alarm in alarms_of(each))),
        )

    def _contacts(self) -> tuple[Contact, ...]:
        heard = [contact for source in self.parts.contacts for contact in heard_from(source)]
        error = self.fleet.shield_config.position_error_m
        told = [contact_of(link.read(), error) for link in self.parts.ears.values()]
        return (*heard, *(contact for contact in told if contact is not None))

    def _game(self) -> tuple[GameState | None, float]:
        source = self.parts.game
        return (None, math.inf) if source is None else (source.game(), source.game_age_s())


def _latest(policy: WantedSource) -> tuple[Commands | None, float, str]:
    answer = policy.latest()
    return answer if isinstance(answer, tuple) else (answer.commands, answer.age_s, answer.fault)


def _mates(fleet: FleetFile, links: Mapping[str, Link]) -> tuple[str, ...]:
    """Team-mates that another process of ours commands, behind a shield of its own."""
    if fleet.coordination == "team":
        return ()
    return tuple(boat.name for boat in fleet.ours if boat.name not in links)
