"""The signing key a fleet file names: for the links, and for the feed."""

from __future__ import annotations

from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.mavlink.signing import Signing, read_key


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
