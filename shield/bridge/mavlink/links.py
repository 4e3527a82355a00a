"""Links of a FLEET.yaml: wires opened once each, before anything is sent to any boat."""

from __future__ import annotations

from collections.abc import Iterable

from ..clock import Clock
from ..fleet_file import FleetFile
from .endpoint import Endpoint, OnBytes
from .link import MavlinkLink
from .signing import Signing, read_key


def open_links(
    fleet: FleetFile, boats: Iterable[str], clock: Clock, *, on_bytes: OnBytes | None = None
) -> dict[str, MavlinkLink]:
    """A link for each of these boats, their wires open and silent: nothing is sent before `MavlinkLink.connect`.

    Args:
        fleet: the file.
        boats: names of boats with a link.
        clock: the loop's.
        on_bytes: gets every frame; see `endpoint.OnBytes`.

    Returns:
        Links by boat's name, in the order given.

    Raises:
        ConfigError: the signing key is unreadable, others may read it, or it is none.
        LinkError: a wire cannot be opened, or a rate or route is none; every wire opened before is given back.
    """
    signing = None if fleet.signing is None else Signing(read_key(fleet.signing.key_file), fleet.signing.link_id)
    endpoints: dict[str, Endpoint] = {}
    links: dict[str, MavlinkLink] = {}
    try:
        for name in boats:
            settings = fleet.boat(name).link
            if settings is None:
                continue
            if settings.address not in endpoints:
                endpoints[settings.address] = Endpoint(settings.address, clock, signing=signing, on_bytes=on_bytes)
                endpoints[settings.address].open()
            endpoint = endpoints[settings.address]
            links[name] = MavlinkLink(
                name, endpoint, settings.system_id, fleet.frame, clock, rate_hz=settings.rate_hz, route=settings.route
            )
    except BaseException:
        for endpoint in endpoints.values():
            endpoint.close()
        raise
    return links
