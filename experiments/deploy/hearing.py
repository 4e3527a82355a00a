"""Where boats are, for who only watches: from the feed, and from boats' own links that are listened to."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from types import TracebackType

from steerclear.shield.bridge.clock import Clock
from steerclear.shield.bridge.feed import FeedReceiver
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.fleet_settings import LinkSettings
from steerclear.shield.bridge.links import key_of, signing_of
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from steerclear.shield.bridge.messages import Contact, contact_of
from steerclear.shield.compat import Self
from steerclear.shield.exceptions import FleetFileError

CONNECT_S = 15.0


class Hearing:
    """Hears boats; commands none. A context manager.

    Args:
        fleet: the file.
        clock: of all times.
        listen: HOST:PORT to hear the feed at; None: the file's feed.referee.
        links: whether boats that have a link are heard there too.

    Raises:
        FleetFileError: neither the file nor ``listen`` says where to hear positions.
        BridgeError: an address cannot be heard at, or a boat does not answer.
        ConfigError: the signing key cannot be read, or others can read it.
    """

    def __init__(self, fleet: FleetFile, clock: Clock, listen: str | None = None, links: bool = False) -> None:
        address = listen or (None if fleet.feed is None else fleet.feed.referee)
        if address is None and not links:
            raise FleetFileError(
                'nobody says where boats are; add feed.referee: "HOST:PORT", or give --listen or --links'
            )
        self.feed: FeedReceiver | None = None
        self._error_m = fleet.shield_config.position_error_m
        self._clock, self._max_age_s = clock, fleet.limits.contact.max_age_s
        self._links: list[tuple[MavlinkLink, Endpoint, int]] = []
        self._open = contextlib.ExitStack()
        try:
            if address is not None:
                allow = ("127.0.0.1",) if fleet.feed is None else fleet.feed.allow
                feed = FeedReceiver(address, fleet.frame, clock, allow, fleet.names, key_of(fleet))
                self.feed = self._open.enter_context(feed)
            if links:
                self._connect(fleet, clock)
        except BaseException:
            self.close()
            raise

    def contacts(self) -> Sequence[Contact]:
        """The latest contact of each boat heard of: of its own link, else of who was heard first and still speaks."""
        told = [contact_of(link.read(), self._error_m) for link, _, _ in self._links]
        heard = () if self.feed is None else self.feed.read()
        oldest_s = self._clock.now_s() - self._max_age_s
        found: dict[str, Contact] = {}
        for contact in (*(entry for entry in told if entry is not None), *heard):
            known = found.get(contact.boat)
            if known is None or known.fixed_s < min(oldest_s, contact.fixed_s):
                found[contact.boat] = contact
        return tuple(found.values())

    def close(self) -> None:
        """Give everything back, telling no boat anything; may be called again."""
        for _, endpoint, system_id in self._links:
            endpoint.detach(system_id)
        self._links = []
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _connect(self, fleet: FleetFile, clock: Clock) -> None:
        signing = signing_of(fleet)
        endpoints: dict[str, Endpoint] = {}
        for boat in fleet.boats:
            if boat.link is not None:
                endpoint = endpoints.get(boat.link.address)
                if endpoint is None:
                    endpoint = endpoints[boat.link.address] = Endpoint(boat.link.address, clock, signing=signing)
                    endpoint.open()
                    self._open.callback(endpoint.close)
                self._add(boat.name, boat.link, endpoint, fleet, clock)
        for link, _, _ in self._links:
            link.connect(CONNECT_S)

    def _add(self, name: str, settings: LinkSettings, endpoint: Endpoint, fleet: FleetFile, clock: Clock) -> None:
        link = MavlinkLink(name, endpoint, settings.system_id, fleet.frame, clock, rate_hz=settings.rate_hz)
        self._links.append((link, endpoint, settings.system_id))
