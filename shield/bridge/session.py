"""`VehicleSession`: every socket and file of a runner, opened from a fleet file and given back together.

The one place where a link is chosen is `LINK_MAKERS`, by the ``kind`` of a boat's link in FLEET.yaml.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

from ..surroundings import OPEN_WATER, Surroundings
from .blackbox import TlogWriter, log_path
from .clock import Clock
from .control_loop import Parts
from .feed import FeedReceiver
from .fleet_file import FleetFile
from .fleet_settings import BoatSettings
from .mavlink.connection import Endpoint, OnBytes
from .mavlink.signing import Signing, read_key
from .mavlink.vehicle import MavlinkLink
from .messages import Closing, Contact, ContactSource, Link, LinkMaker, NominalSource, TickSink, contacts_heard
from .moos.links import MoosLinks

LOG = logging.getLogger(__name__)

CONNECT_S = 15.0
HURRIED_S = 3.0  # boats are waited for no longer once somebody interrupts while they are stopped
PREPARE_S = 60.0  # an autopilot arms up to 42 s after it was switched on


class VehicleSession(Closing):
    """Links to the boats a process commands, links it only listens to, and the feed. A context manager.

    Nothing is sent to any boat before `connect`. Leaving it stops every boat it prepared, verifies that, and gives
    everything back.

    Args:
        fleet: the file.
        boat: name of this process's boat, or None for all of the team.
        clock: the loop's.
        tlog: whether raw packets are kept in the log folder.
        begun_unix_s: time that this run's files are named after, s since 1970; None: now.

    Attributes:
        links: to the boats this process commands, by name.
        listen_only: links that are only listened to, by name.
        feed: hears it; None: the file has none.
        key: signing key, 32 bytes; None: nothing is signed.
        left: what each boat was left doing, once closed.

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
        self.links: dict[str, Link] = {}
        self.listen_only: dict[str, Link] = {}
        self.feed: FeedReceiver | None = None
        self.left: tuple[str, ...] = ()
        self._makers: dict[str, LinkMaker] = {}
        self._tlog: TlogWriter | None = None
        try:
            if tlog:
                self._tlog = TlogWriter(log_path(fleet.log_dir, ".tlog", self.begun_unix_s))
            for entry in fleet.boats:
                if entry in commanded:
                    self.links[entry.name] = self._link(entry)
                elif entry.link is not None and fleet.contact_of(entry) == "telemetry":
                    self.listen_only[entry.name] = self._link(entry)
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
        _all({**self.links, **self.listen_only}, lambda link: link.connect(timeout_s))

    def prepare(self, timeout_s: float = PREPARE_S) -> None:
        """Bring every commanded boat to where it obeys, all at once.

        Raises:
            LinkRefused: an autopilot says no.
            LinkError: no answer.
        """
        _all(self.links, lambda link: link.prepare(timeout_s))

    def sources(self) -> tuple[ContactSource, ...]:
        """Who tells of other boats: the feed, and what comes by the way of the links."""
        by_links = [source for maker in self._makers.values() for source in maker.sources()]
        return (*by_links, *(() if self.feed is None else (self.feed,)))

    def contacts(self) -> tuple[Contact, ...]:
        """Boats heard of by these sources and by links that are only listened to."""
        return contacts_heard(self.sources(), self.listen_only, self.fleet.shield_config.position_error_m)

    def parts(
        self,
        nominal: NominalSource,
        sinks: Sequence[TickSink],
        surroundings: Surroundings = OPEN_WATER,
        *,
        plays: bool = False,
    ) -> Parts:
        """What a control loop on these boats works with; ``plays``: whether the referee's state of the game counts."""
        game = self.feed if plays else None
        return Parts(self.links, nominal, self.listen_only, self.sources(), game, surroundings, tuple(sinks))

    def close(self) -> None:
        """Stop every boat, verify it, and give everything back; may be called again."""
        if not self.left:
            pool = ThreadPoolExecutor(max(1, len(self.links)))
            leaving = {name: pool.submit(_leave, link) for name, link in self.links.items()}
            try:
                wait(leaving.values())
            except KeyboardInterrupt:
                wait(leaving.values(), HURRIED_S)
                raise
            finally:
                pool.shutdown(wait=False)
                self.left = tuple(
                    future.result() if future.done() else _as_seen(self.links[name]) for name, future in leaving.items()
                )
            for link in self.listen_only.values():
                link.release()
        for maker in self._makers.values():
            maker.close()
        for opened in (self.feed, self._tlog):
            if opened is not None:
                opened.close()

    def _link(self, boat: BoatSettings) -> Link:
        kind = "" if boat.link is None else boat.link.kind
        if kind not in self._makers:
            on_bytes = None if self._tlog is None else self._tlog.on_bytes
            self._makers[kind] = LINK_MAKERS[kind](self.fleet, self.clock, on_bytes)
        return self._makers[kind].link(boat)


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


def _as_seen(link: Link) -> str:
    """What is known of a boat that nobody waits for any longer."""
    try:
        seen = link.read()
    except Exception as error:
        return f"{link.boat}: told to stop by its link, not verified ({error}); look at it"
    speed = "speed unknown" if math.isnan(seen.speed_mps) else f"{seen.speed_mps:.1f} m/s"
    return f"{link.boat}: told to stop by its link, not verified: last seen in {seen.mode or 'no mode'}, {speed}"


class MavlinkLinks(LinkMaker):
    """A `LinkMaker`: one `Endpoint` an address, shared by the boats behind it; ``on_bytes`` gets every whole frame.

    Raises:
        ConfigError: the signing key cannot be read, or others can read it.
    """

    def __init__(self, fleet: FleetFile, clock: Clock, on_bytes: OnBytes | None) -> None:
        self._fleet, self._clock, self._on_bytes = fleet, clock, on_bytes
        self._signing = signing_of(fleet)
        self._endpoints: dict[str, Endpoint] = {}

    def link(self, boat: BoatSettings) -> MavlinkLink:
        """See `LinkMaker`."""
        settings = boat.link
        if settings is None:
            raise ValueError(f"boat {boat.name} has no link")
        endpoint = self._endpoints.get(settings.address)
        if endpoint is None:
            endpoint = Endpoint(settings.address, self._clock, signing=self._signing, on_bytes=self._on_bytes)
            self._endpoints[settings.address] = endpoint
        frame, rate_hz, route = self._fleet.frame, settings.rate_hz, settings.route
        return MavlinkLink(boat.name, endpoint, settings.system_id, frame, self._clock, rate_hz=rate_hz, route=route)

    def open(self) -> None:
        """See `LinkMaker`."""
        for endpoint in self._endpoints.values():
            endpoint.open()

    def close(self) -> None:
        """See `LinkMaker`."""
        for endpoint in self._endpoints.values():
            endpoint.close()


LINK_MAKERS: Mapping[str, Callable[[FleetFile, Clock, OnBytes | None], LinkMaker]] = {
    "mavlink": MavlinkLinks,
    "moos": MoosLinks,
}


def signing_of(fleet: FleetFile) -> Signing | None:
    """Key and link number of a file; None: it has no signing.

    Raises:
        ConfigError: the key cannot be read, or others can read it.
    """
    return None if fleet.signing is None else Signing(read_key(fleet.signing.key_file), fleet.signing.link_id)


def key_of(fleet: FleetFile) -> bytes | None:
    """The key alone.

    Raises:
        ConfigError: as `signing_of`.
    """
    signing = signing_of(fleet)
    return None if signing is None else signing.key
