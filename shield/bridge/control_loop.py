"""`ControlLoop`: read, judge, decide, send, record, at a fixed rate on a monotonic clock, until told to end."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import BridgeError
from ..shield import Shield
from ..surroundings import OPEN_WATER, Surroundings
from .clock import Clock
from .command_pipeline import CommandPipeline, Steered
from .failsafe import Failsafe, Seen, Verdict, at_rest, nearing
from .feed_packets import GameSource, GameState
from .fleet_file import FleetFile
from .messages import (
    Action,
    Alarming,
    Answer,
    BoatReading,
    ContactSource,
    Link,
    NominalSource,
    Snapshot,
    Tick,
    TickSink,
    contacts_heard,
)
from .model_error import ModelErrorMonitor
from .operator import Operator
from .static_obstacles import StaticObstacles
from .tracker import Tracker

LOG = logging.getLogger(__name__)

TALK_EVERY_S, LATE_EVERY_S = 5.0, 10.0
"""The same failure, and that the loop falls behind, are logged again after this long, s."""
RETAKE_S, RETOLD_S = 6.0, 10.0
"""An autopilot is asked for so long when a boat is taken back, s: a pilot who takes it again meanwhile is not fought
for longer. What came of it is shown, and it is not tried again by itself, for so long."""
BIN_S, BINS = 0.0001, 20_000  # width, s, and number of bins that durations are counted in


@dataclass(frozen=True)
class Parts:
    """What the loop works with."""

    links: Mapping[str, Link]  # of the boats this process commands, connected and prepared
    policy: NominalSource  # where nominal commands come from
    # links that are only listened to, of boats somebody else commands
    listen_only: Mapping[str, Link] = field(default_factory=dict)
    contacts: Sequence[ContactSource] = ()  # other sources of positions
    game: GameSource | None = None  # the referee's state of the game; None: none
    surroundings: Surroundings = OPEN_WATER  # static constraints of the game, see `StaticObstacles`
    sinks: Sequence[TickSink] = ()  # get every tick; the black box among them


class ControlLoop:
    """Runs boats of a file with parts of which it closes none; without a shield it makes one with the file's settings.

    Attributes:
        tracker, failsafe, model_error: what it knows of the boats.
        overruns: how well it kept its rate.
        near: boats that came near one of ours when these were handed over at the end, a line each.
    """

    def __init__(
        self, fleet: FleetFile, parts: Parts, operator: Operator, clock: Clock, shield: Shield | None = None
    ) -> None:
        self.fleet, self.parts, self.operator, self.clock = fleet, parts, operator, clock
        self.overruns = Overruns(fleet.dt_s)
        self.tracker = Tracker(fleet, parts.links)
        self.failsafe = Failsafe(fleet, self.tracker)
        self.model_error = ModelErrorMonitor(fleet, tuple(parts.links))
        self.near: tuple[str, ...] = ()
        self._obstacles = StaticObstacles(fleet, parts.surroundings)
        chosen = Shield(fleet.shield_config, self._obstacles.forms[0]) if shield is None else shield
        self._pipeline = CommandPipeline(fleet, chosen, parts.links, clock)
        self._reacquisition = Reacquisition(parts.links)
        self._has_referee = fleet.feed is not None and fleet.feed.referee is not None and parts.game is not None
        per_boat = fleet.coordination != "team"
        self._teammates = tuple(boat.name for boat in fleet.ours if per_boat and boat.name not in parts.links)
        self._number, self._broke_s, self._ending = 0, -math.inf, ""
        self._readings: dict[str, BoatReading] = {}
        self._decided: Decisions | None = None
        self._log_fault, self._broken = "", set[int]()

    def run(self, seconds: float | None = None) -> str:
        """Turn at the file's rate until the operator ends it or the time is over, then bring boats to rest.

        At the end boats are told to stop and go on behind the shield until they lie still and nobody is on the way to
        one of them: a boat that only stops may drift into another, and one that nobody steers is defended by nobody.

        Returns:
            Why it ended.
        """
        began = self.clock.now_s()
        last = math.inf if seconds is None else began + seconds
        try:
            due = self._keep_on(began, lambda due: not self.operator.ended and due < last)
            self._ending = self.operator.ended or f"ran for {self.clock.now_s() - began:.0f} s"
            latest = due + self.fleet.end.longest_s
            self._keep_on(due, lambda now: now < latest and not (at_rest(self._readings) and not self._nearing()))
            self.near = tuple(self._nearing())
            for text in self.near:
                LOG.warning("handed over although %s: take it over by hand", text)
        finally:
            self._stop_ours()
            self._reacquisition.close()
        return self._ending

    def _keep_on(self, due_s: float, goes_on: Callable[[float], bool]) -> float:
        """Turn at the rate as long as ``goes_on(due time)``; when the next turn would be due."""
        while goes_on(due_s):
            self.clock.sleep_until(due_s)
            self.turn_or_stop(due_s)
            due_s = self.overruns.next_due(due_s, self.clock.now_s())
        return due_s

    def _nearing(self) -> list[str]:
        return nearing(self.fleet, self.tracker, self._readings)

    def turn_or_stop(self, due_s: float) -> None:
        """A turn; one that breaks where none should leaves boats told to stop, and the next one is tried."""
        try:
            self.turn(due_s)
        except Exception:
            self._stop_ours()
            if self.clock.now_s() - self._broke_s >= TALK_EVERY_S:
                self._broke_s = self.clock.now_s()
                LOG.exception("a turn of the loop broke; boats told to stop")

    def _stop_ours(self) -> None:
        """Stop boats by their links; those that somebody took are left alone, unless STOP ALL was asked for twice."""
        readings = {} if self.operator.hard else self._readings
        self._pipeline.stop_all([n for n in self.parts.links if n not in readings or not readings[n].released])

    def turn(self, due_s: float) -> Tick:
        """One turn, due at that time."""
        began, parts = self.clock.now_s(), self.parts
        self._readings = readings = {name: link.read() for name, link in parts.links.items()}
        contacts = contacts_heard(parts.contacts, parts.listen_only, self.fleet.shield_config.position_error_m)
        self.tracker.update(began, readings, contacts)
        self.model_error.update(self.tracker.own_rows(), readings)
        self.tracker.margin_m = self.model_error.margin_m
        answer = parts.policy.latest()
        game, game_age = (None, math.inf) if parts.game is None else (parts.game.game(), parts.game.game_age_s())
        verdict = self._judge(began, readings, answer, game, game_age)
        self._retake(verdict, began)
        steered = self._steer(answer.commands, verdict, game, game_age)
        self._decided = steered.decisions
        self.failsafe.handed_over |= steered.beyond
        self.tracker.sent(began, steered.sent)
        self.model_error.sent(steered.sent)
        tick = Tick(
            number=self._number,
            due_s=due_s,
            began_s=began,
            sent_s=self.clock.now_s(),
            readings=readings,
            contacts=contacts,
            fleet=steered.fleet,
            nominal=steered.nominal,
            surroundings=steered.surroundings,
            decisions=steered.decisions,
            shield_reset=steered.shield_reset,
            sent=steered.sent,
            policy_age_s=answer.age_s,
            actions=(
                *self.operator.actions(began),
                *self._reacquisition.actions(began),
                *verdict.actions,
                *steered.actions,
                *self.model_error.actions(),
            ),
            game={} if game is None else game.as_dict(),
        )
        self._number += 1
        self._record(tick)
        parts.policy.offer(Snapshot(tick.number, began, self.tracker.seen_now(), tick.game, game_age))
        return tick

    def _judge(
        self, now_s: float, readings: Mapping[str, BoatReading], answer: Answer, game: GameState | None, age_s: float
    ) -> Verdict:
        """What is due by the table of fail-safes; ``age_s``: of the state of the game."""
        heard = [alarm for source in self.parts.contacts if isinstance(source, Alarming) for alarm in source.alarms()]
        return self.failsafe.judge(
            Seen(
                now_s=now_s,
                readings=readings,
                answer=answer,
                game_age_s=age_s,
                game_expected=self._has_referee,
                game_over=game is not None and game.over,
                log_fault=self._log_fault,
                overrides=self.operator.active(now_s),
                alarms=(*self.tracker.alarms(), *heard),
                outside_model_s={name: self.model_error.outside_s(name) for name in readings},
                decided=self._decided,
            )
        )

    def _steer(self, answer: Commands | None, verdict: Verdict, game: GameState | None, game_age_s: float) -> Steered:
        if self._ending:
            verdict.actions.append(Action("all", "end", "stop", f"the run ends: {self._ending}"))
        if self.operator.stopped or self._ending:
            verdict.responses.update(dict.fromkeys(self.parts.links, "stop"))
        if self.operator.hard:
            return Steered(sent=self._pipeline.stop_all(tuple(self.parts.links)))
        limit = self.fleet.limits.contact.max_age_s
        certain = [name for name in self._teammates if not self.tracker.contradicted(name)]
        teammates = {name for name in certain if self.tracker.contact_age_s(name) <= limit}
        around = self._obstacles.around(game, game_age_s)
        return self._pipeline.steer(self.tracker, answer, verdict, around, teammates)

    def _retake(self, verdict: Verdict, now_s: float) -> None:
        """Take back boats the operator asks for, and those whose fail-safe is over where the file says so."""
        why_not = "the run ends" if self._ending else "STOP ALL is in force" if self.operator.stopped else ""
        requests = list(self.operator.take_requests())
        asked = {boat for boat, _ in requests}
        self.failsafe.handed_over -= asked
        requests += [(boat, "after_failsafe") for boat in sorted(verdict.retake - asked) if not why_not]
        self._reacquisition.start(requests, self._readings, now_s, why_not)

    def _record(self, tick: Tick) -> None:
        """Give a tick to all sinks, whatever one of them does; one that can keep no more is named once."""
        faults, broken = [], set[int]()
        for k, sink in enumerate(self.parts.sinks):
            try:
                sink.take(tick)
            except Exception as error:
                broken.add(k)
                declared = isinstance(error, BridgeError)
                faults += [str(error)] if declared else []
                if k not in self._broken:
                    text = str(error) if declared else "a sink broke; it gets no boat into danger"
                    LOG.error("%s", text, exc_info=not declared)
        self._log_fault, self._broken = "; ".join(faults), broken


class Overruns:
    """Keeps a rate of a step of ``dt_s``, s, and counts turns that began late or took longer than a step.

    Attributes:
        turns: so far.
        late: turns after which at least one due time was missed.
        missed: due times missed.
        worst_s: latest end of a turn after the next was due, s.
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_s, self._logged_s = dt_s, -math.inf
        self.turns, self.late, self.missed, self.worst_s = 0, 0, 0, 0.0

    def next_due(self, due_s: float, now_s: float) -> float:
        """When the next turn is due after one due at ``due_s`` ended at ``now_s``.

        Turns keep to the grid of the start; missed ones are left out, not made up: two commands at once help nobody.
        """
        self.turns += 1
        due = due_s + self._dt_s
        if now_s <= due:
            return due
        missed = int((now_s - due) / self._dt_s) + 1
        self.late, self.missed, self.worst_s = self.late + 1, self.missed + missed, max(self.worst_s, now_s - due)
        if now_s - self._logged_s >= LATE_EVERY_S:
            self._logged_s = now_s
            LOG.warning("the loop fell behind by %.0f ms; %d turns left out", 1e3 * (now_s - due), missed)
        return due + missed * self._dt_s


class Reacquisition:
    """Takes back boats, by their links, that somebody took from us when asked to and never otherwise.

    It works beside the loop: that never waits.
    """

    def __init__(self, links: Mapping[str, Link]) -> None:
        self._links = links
        self._threads: dict[str, threading.Thread] = {}
        self._off = threading.Event()
        self._notes: dict[str, tuple[float, str]] = {}
        self._ended: dict[str, str] = {}

    def start(
        self, requests: Iterable[tuple[str, str]], readings: Mapping[str, BoatReading], now_s: float, why_not: str = ""
    ) -> None:
        """Begin what is asked for (boats, and who asked); with ``why_not`` not, and what is under way is called off."""
        if why_not:
            self._off.set()
        elif self._off.is_set():
            self._off = threading.Event()  # what was called off stays so: it has the old one
        for boat, by in requests:
            if why_not:
                self._notes[boat] = now_s, f"{boat} is not taken back: {why_not}"
            elif boat not in self._links or readings[boat].ready:
                why = "it obeys" if boat in self._links else "it is not commanded here"
                self._notes[boat] = now_s, f"{boat} need not be taken back: {why}"
            elif boat not in self._threads and not (by == "after_failsafe" and boat in self._notes):
                self._notes[boat] = now_s, f"{boat} is being taken back, asked for by {by}"
                thread = threading.Thread(target=self._take, args=(boat, self._off), name=f"take {boat}", daemon=True)
                self._threads[boat] = thread
                thread.start()
        for boat in [boat for boat, thread in self._threads.items() if not thread.is_alive()]:
            del self._threads[boat]
            self._notes[boat] = now_s, self._ended.pop(boat, f"{boat}: not taken back, see the log")

    def actions(self, now_s: float) -> tuple[Action, ...]:
        """What is under way, and what came of it lately, for the record and the display."""
        lasting = {b: note for b, note in self._notes.items() if b in self._threads or now_s - note[0] <= RETOLD_S}
        self._notes = lasting
        return tuple(Action(boat, "take_back", "none", text) for boat, (_, text) in lasting.items())

    def close(self) -> None:
        """Call off what is under way, and wait for it."""
        self._off.set()
        for thread in self._threads.values():
            thread.join(2.0 * RETAKE_S)

    def _take(self, boat: str, off: threading.Event) -> None:
        try:
            self._links[boat].prepare(RETAKE_S, off.is_set)
            text = f"{boat} is taken back and obeys"
        except BridgeError as error:
            text = f"not taken back: {error}"
        LOG.warning("%s", text)
        self._ended[boat] = text


class Timing:
    """A sink that measures the loop's jitter and the time from telemetry to command, and never grows."""

    def __init__(self) -> None:
        self._counts = {name: np.zeros(BINS, np.int64) for name in ("late", "turn", "decide")}
        self._longest_s = dict.fromkeys(self._counts, 0.0)

    def take(self, tick: Tick) -> None:
        """Count one tick."""
        durations_s = {"late": tick.began_s - tick.due_s, "turn": tick.sent_s - tick.began_s}
        if tick.decisions is not None:
            durations_s["decide"] = tick.decisions.solve_time_s
        for name, duration_s in durations_s.items():
            self._counts[name][min(BINS - 1, max(0, int(duration_s / BIN_S)))] += 1
            self._longest_s[name] = max(self._longest_s[name], duration_s)

    def close(self) -> None:
        """Nothing to finish."""

    def figures(self) -> dict[str, float]:
        """Jitter (begin after due), telemetry read to last command sent, and the decision alone, s."""
        return {
            "jitter_p50_s": self._quantile_s("late", 0.5),
            "jitter_p999_s": self._quantile_s("late", 0.999),
            "jitter_max_s": self._longest_s["late"],
            "read_to_sent_p50_s": self._quantile_s("turn", 0.5),
            "read_to_sent_p99_s": self._quantile_s("turn", 0.99),
            "read_to_sent_max_s": self._longest_s["turn"],
            "decide_p99_s": self._quantile_s("decide", 0.99),
        }

    def _quantile_s(self, name: str, share: float) -> float:
        """Upper edge of the bin that this share of durations does not exceed, s."""
        total = np.cumsum(self._counts[name])
        if total[-1] == 0:
            return 0.0
        return min(float(np.searchsorted(total, share * total[-1]) + 1) * BIN_S, self._longest_s[name])
