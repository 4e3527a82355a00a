"""`VehicleSession`: every socket and file of a runner, opened from a fleet file and given back together."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType

from ..compat import Self
from ..surroundings import OPEN_WATER, Surroundings
from .blackbox import TlogWriter, log_path
from .clock import Clock
from .control_loop import Parts
from .feed import FeedReceiver
from .fleet_file import FleetFile
from .fleet_settings import BoatSettings
from .links import LINK_MAKERS, key_of
from .messages import Contact, ContactSource, Link, LinkMaker, TickSink, WantedSource, contact_of

LOG = logging.getLogger(__name__)

CONNECT_S = 15.0
PREPARE_S = 60.0
"""An autopilot arms up to 42 s after it was switched on."""


class VehicleSession:
    """Links to the boats a process commands, links it only listens to, and the feed. A context manager.

    Nothing is sent to any boat before `connect`. Leaving it stops every boat it prepared, verifies that, and gives
    everything back.

    Args:
        fleet: the file.
        boat: name of this process's boat, or None for all of the team.
        clock: the loop's.
        tlog: whether raw packets are kept in the log folder.
        begun_unix_s: time, s since 1970, that this run's files are named after; None: now.

    Attributes:
        links: to the boats this process commands, by name.
        ears: links that are only listened to, by name.
        key: signing key, 32 bytes; None: nothing is signed.

    Raises:
        FleetFileError: there is nothing to command.
        ConfigError: the signing key cannot be read or others can read it.
        LinkError: a wire cannot be opened, such as a port that is taken.
        BridgeError: the feed cannot be heard, or the packet log cannot be made.
    """

    def __init__(
        self, fleet: FleetFile, boat: str | None, clock: Clock, *, tlog: bool = True, begun_unix_s: float | None = None
    ) -> None:
        self.fleet, self.clock = fleet, clock
        self.begun_unix_s = time.time() if begun_unix_s is None else begun_unix_s
        commanded = fleet.commanded(boat)
        self.key = key_of(fleet)
        self._makers: dict[str, LinkMaker] = {}
        self._tlog: TlogWriter | None = None
        self.feed: FeedReceiver | None = None
        self.left: tuple[str, ...] = ()
        """What each boat was left doing, once closed."""
        try:
            if tlog:
                self._tlog = TlogWriter(log_path(fleet.log_dir, ".tlog", self.begun_unix_s))
            self.links = {entry.name: self._link(entry) for entry in commanded}
            self.ears = {entry.name: self._link(entry) for entry in self._heard_only(commanded)}
            listen = fleet.feed_listen(boat)
            if fleet.feed is not None and listen is not None:
                self.feed = FeedReceiver(listen, fleet.frame, clock, fleet.feed.allow, fleet.names, self.key)
            for maker in self._makers.values():
                maker.open()
        except BaseException:
            self.close()
            raise

    def connect(self, timeout_s: float = CONNECT_S) -> None:
        """Hear every boat and get its streams, all at once.

        Raises:
            LinkError: a boat does not answer.
        """
        self._all({**self.links, **self.ears}, lambda link: link.connect(timeout_s))

    def prepare(self, timeout_s: float = PREPARE_S) -> None:
        """Bring every commanded boat to where it obeys, all at once.

        Raises:
            LinkRefused: an autopilot says no.
            LinkError: no answer.
        """
        self._all(self.links, lambda link: link.prepare(timeout_s))

    def sources(self) -> tuple[ContactSource, ...]:
        """Who tells of other boats: the feed, and what comes by the way of the links."""
        by_links = [source for maker in self._makers.values() for source in maker.sources()]
        return (*by_links, *(() if self.feed is None else (self.feed,)))

    def contacts(self) -> tuple[Contact, ...]:
        """Boats heard of by these sources and by links that are only listened to."""
        error = self.fleet.shield_config.position_error_m
        told = [contact_of(link.read(), error) for link in self.ears.values()]
        heard = [contact for source in self.sources() for contact in source.read()]
        return (*heard, *(contact for contact in told if contact is not None))

    def parts(
        self,
        nominal: WantedSource,
        sinks: Sequence[TickSink],
        grounds: Surroundings = OPEN_WATER,
        *,
        plays: bool = False,
    ) -> Parts:
        """What a control loop on these boats works with.

        Args:
            nominal: where nominal commands come from.
            sinks: get every tick.
            grounds: static constraints of the game.
            plays: whether the referee's state of the game counts.
        """
        return Parts(
            links=self.links,
            policy=nominal,
            ears=self.ears,
            contacts=self.sources(),
            game=self.feed if plays else None,
            grounds=grounds,
            sinks=tuple(sinks),
        )

    def close(self) -> None:
        """Stop every boat, verify it, and give everything back; may be called again."""
        links: dict[str, Link] = {**getattr(self, "links", {}), **getattr(self, "ears", {})}
        ears = getattr(self, "ears", {})
        if links and not self.left:
            with ThreadPoolExecutor(len(links)) as pool:
                texts = list(pool.map(_leave, [link for name, link in links.items() if name not in ears]))
            for link in ears.values():
                link.release()
            self.left = tuple(texts)
        for maker in self._makers.values():
            maker.close()
        if self.feed is not None:
            self.feed.close()
        if self._tlog is not None:
            self._tlog.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _heard_only(self, commanded: Iterable[BoatSettings]) -> list[BoatSettings]:
        names = {entry.name for entry in commanded}
        return [
            entry
            for entry in self.fleet.boats
            if entry.link is not None and entry.name not in names and self.fleet.contact_of(entry) == "telemetry"
        ]

    def _link(self, boat: BoatSettings) -> Link:
        kind = "" if boat.link is None else boat.link.kind
        if kind not in self._makers:
            on_bytes = None if self._tlog is None else self._tlog.on_bytes
            self._makers[kind] = LINK_MAKERS[kind](self.fleet, self.clock, on_bytes)
        return self._makers[kind].link(boat)

    @staticmethod
    def _all(links: Mapping[str, Link], work: Callable[[Link], None]) -> None:
        """Do something slow with all links at the same time; the first that fails is told, after all are done."""
        if not links:
            return
        with ThreadPoolExecutor(len(links)) as pool:
            futures = [pool.submit(work, link) for link in links.values()]
        errors = [error for error in (future.exception() for future in futures) if error is not None]
        for error in errors[1:]:
            LOG.error("%s", error)
        if errors:
            raise errors[0]


def _leave(link: Link) -> str:
    try:
        return link.close()
    except Exception as error:  # the other boats must still be stopped
        LOG.exception("%s: not left in order", link.boat)
        return f"{link.boat}: not left in order ({error}); it stops by its own time-out"
