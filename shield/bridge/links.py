"""The one place where a link is chosen: `LINK_MAKERS`, by the ``kind`` of a boat's link in FLEET.yaml."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from .clock import Clock
from .fleet_file import FleetFile
from .fleet_settings import BoatSettings
from .mavlink.connection import Endpoint, OnBytes
from .mavlink.signing import Signing, read_key
from .mavlink.vehicle import MavlinkLink
from .messages import LinkMaker
from .moos.links import MoosLinks


class MavlinkLinks(LinkMaker):
    """A `LinkMaker`: one `Endpoint` an address, shared by the boats behind it.

    Args:
        fleet: the file.
        clock: the loop's.
        on_bytes: gets every whole frame; None: nobody.

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
