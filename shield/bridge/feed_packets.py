"""Packets of the position and game feed: one JSON object per UDP datagram, every check on it, and its seal.

A packet of kind "positions" says where boats are (`Fix`), one of kind "game" how the game stands (`GameState`).
A sealed packet is the object, a line break, ``hmac-sha256:`` and the HMAC-SHA256 of the object's bytes in 64
hexadecimal digits. Its key is made from the signing key for this purpose alone:
``HMAC-SHA256(signing key, "steerclear feed 1")``.
"""

from __future__ import annotations

import hmac
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, NoReturn

from pydantic import Field, TypeAdapter, ValidationError

from ..exceptions import ConfigError, FeedError
from .game_state import MOST_BOATS, GameState, check_name, fault_of, game_state, short

KEY_BYTES = 32
PURPOSE = b"steerclear feed 1"
_MARK, _DIGITS = b"\nhmac-sha256:", 64
SEAL_BYTES = len(_MARK) + _DIGITS

MAX_BYTES = 32768
"""Largest datagram taken."""

_FAR_OUT = frozenset({655.35, 6553.5, 65535.0})
"""16 bits of ones, in the units boats and receivers use: not available."""
NOT_AVAILABLE: Mapping[str, frozenset[float]] = {
    "heading_deg": _FAR_OUT | {-360.0, 360.0, 511.0, 3600.0, 36000.0},
    "speed_mps": _FAR_OUT | {102.3, 1023.0},
    "latitude_deg": frozenset({91.0}),
    "longitude_deg": frozenset({181.0}),
    "age_s": _FAR_OUT,
    "error_m": _FAR_OUT,
}
"""What AIS, GPS receivers and autopilots say for a value they do not know, of each field."""


@dataclass(frozen=True)
class Fix:
    """Where a sender says a boat is.

    Attributes:
        boat: its name.
        latitude_deg, longitude_deg: WGS 84, deg.
        heading_deg: true course, deg clockwise from north; more than -360, less than 360.
        speed_mps: along the heading, m/s.
        age_s: how old the fix was when it was sent, s.
        error_m: bound of the position's error, m.
    """

    boat: str
    latitude_deg: Annotated[float, Field(strict=True, ge=-89.0, le=89.0)]
    longitude_deg: Annotated[float, Field(strict=True, ge=-180.0, le=180.0)]
    heading_deg: Annotated[float, Field(strict=True, ge=-360.0, le=360.0)]
    speed_mps: Annotated[float, Field(strict=True, ge=-50.0, le=50.0)]
    age_s: Annotated[float, Field(strict=True, ge=0.0, le=3600.0)]
    error_m: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)]


_READER = TypeAdapter(Fix)


@dataclass(frozen=True)
class Packet:
    """One datagram.

    Attributes:
        sender: who sent it.
        run: number the sender drew when it started; 0 when it gives none.
        seq: counts the sender's packets.
        fixes: positions of a packet of kind "positions".
        game: of a packet of kind "game".
        refused: why single fixes of the packet were left out, a line each.
        stamp: when it was sent, in 10 us since 1 January 2015, of packets that are sealed; None: it has none.
    """

    sender: str
    run: int
    seq: int
    fixes: tuple[Fix, ...] = ()
    game: GameState | None = None
    refused: tuple[str, ...] = ()
    stamp: int | None = None

    def encode(self) -> bytes:
        """The datagram.

        Raises:
            FeedError: it holds a value that is not finite, or is too long.
        """
        content: dict[str, Any] = {"steerclear": 1, "sender": self.sender, "run": self.run, "seq": self.seq}
        content |= {} if self.stamp is None else {"stamp": self.stamp}
        if self.game is not None:
            content |= {"kind": "game", **self.game.as_dict()}
        else:  # a heading that came out as a full turn is north, and 360 is what "not available" looks like
            plain = [{**vars(fix), "heading_deg": fix.heading_deg % 360.0 % 360.0} for fix in self.fixes]
            content |= {"kind": "positions", "contacts": plain}
        try:
            data = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
        except ValueError as error:
            raise FeedError(f"the packet holds a value that cannot be sent ({error}); give finite numbers") from None
        most = MAX_BYTES - SEAL_BYTES
        if len(data) > most:
            raise FeedError(f"the packet has {len(data)} bytes; send fewer boats at once, {most} bytes at most")
        return data


class Seal:
    """Closes packets and tells genuine ones, so that nobody without the key can speak on the feed.

    Args:
        key: the 32-byte signing key, as `mavlink.signing.read_key` gives it.

    Raises:
        ConfigError: the key has another length.
    """

    def __init__(self, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ConfigError(f"the signing key has {len(key)} bytes; give {KEY_BYTES}")
        self._key = hmac.digest(key, PURPOSE, "sha256")

    def close(self, body: bytes) -> bytes:
        """The body with its code."""
        return body + _MARK + self._code(body)

    def fault(self, data: bytes) -> str:
        """Why a datagram must not be believed: "unsigned", "bad_signature", or empty when it is genuine."""
        if not is_sealed(data):
            return "unsigned"
        return "" if hmac.compare_digest(self._code(data[:-SEAL_BYTES]), data[-_DIGITS:]) else "bad_signature"

    def _code(self, body: bytes) -> bytes:
        return hmac.digest(self._key, body, "sha256").hex().encode()


def is_sealed(data: bytes) -> bool:
    """Whether a datagram ends as sealed ones do."""
    return len(data) >= SEAL_BYTES and data[-SEAL_BYTES:-_DIGITS] == _MARK


def parse_packet(data: bytes) -> Packet:
    """The packet in a datagram. A fix that cannot be used is left out and named; anything else wrong refuses it all.

    Raises:
        FeedError: it is too long, no JSON, of another version or kind, or a value is missing, not finite or absurd.
    """
    if len(data) > MAX_BYTES:
        raise FeedError(f"packet of {len(data)} bytes; {MAX_BYTES} at most")
    try:
        content = json.loads(data, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise FeedError(f"packet is not JSON ({short(error)})") from None
    if not isinstance(content, dict) or content.get("steerclear") != 1 or isinstance(content["steerclear"], bool):
        raise FeedError('packet is not of this feed; begin it with {"steerclear": 1, ...')
    sender, run, seq = check_name(content.get("sender"), "sender"), _count(content, "run", 0), _count(content, "seq")
    stamp = _count(content, "stamp") if "stamp" in content else None
    if content.get("kind") == "game":
        game = game_state(content)
        return Packet(sender, run, seq, game=replace(game, note=game.note[:200]), stamp=stamp)
    if content.get("kind") != "positions":
        raise FeedError(f"packet of kind {short(content.get('kind'))}; kinds are positions and game")
    contacts = content.get("contacts")
    if not isinstance(contacts, list) or len(contacts) > MOST_BOATS:
        raise FeedError(f"contacts is {short(contacts)}; give a list, {MOST_BOATS} boats at most")
    fixes: dict[str, Fix] = {}
    refused = []
    for entry in contacts:
        try:
            fix = _fix(entry)
        except FeedError as error:
            refused.append(str(error))
            continue
        if fix.boat in fixes:
            refused.append(f"boat {fix.boat} is given twice")
        else:
            fixes[fix.boat] = fix
    return Packet(sender, run, seq, fixes=tuple(fixes.values()), refused=tuple(refused), stamp=stamp)


def _fix(entry: Any) -> Fix:
    boat = check_name(entry.get("boat") if isinstance(entry, dict) else entry, "boat")
    if not isinstance(entry, dict):
        raise FeedError(f"contact {boat} is a text; give an object with its boat, place, heading and speed")
    for key, values in NOT_AVAILABLE.items():
        if type(entry.get(key)) in (int, float) and entry[key] in values:
            text = f'{key} is {entry[key]}, which means "not available"; leave the boat out until it is known'
            raise FeedError(f"boat {boat}: {text}")
    try:
        return _READER.validate_python(entry)
    except ValidationError as error:
        raise FeedError(f"boat {boat}: {fault_of(error)}") from None


def _count(content: Mapping[str, Any], key: str, otherwise: Any = None) -> int:
    value = content.get(key, otherwise)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise FeedError(f"{key} is {short(value)}; give a whole number >= 0")
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise FeedError(f"{name} is no number of JSON")
