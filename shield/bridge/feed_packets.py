"""Packets of the position and game feed, one JSON object per UDP datagram: checks, authentication, who sends.

A packet of kind "positions" says where boats are (`Fix`), one of kind "game" how the game stands (`GameState`).
A sealed packet is the object, a line break, ``hmac-sha256:`` and the HMAC-SHA256 of the object's bytes in 64
hexadecimal digits. Its key is made from the signing key for this purpose alone:
``HMAC-SHA256(signing key, "steerclear feed 1")``.
"""

from __future__ import annotations

import hmac
import json
import logging
import math
import random
import socket
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal, NoReturn, Protocol

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from ..exceptions import ConfigError, FeedError
from .frame import FieldFrame
from .mavlink.signing import SigningClock
from .mavlink.transport import host_and_port
from .messages import Closing, Tick

LOG = logging.getLogger(__name__)
PUBLISH_EVERY = 2  # every second tick's positions are published
KEY_BYTES = 32
PURPOSE = b"steerclear feed 1"
_MARK, _DIGITS = b"\nhmac-sha256:", 64
SEAL_BYTES = len(_MARK) + _DIGITS
MAX_BYTES = 32768  # largest datagram taken
MOST_BOATS = 64
_FAR_OUT = frozenset({655.35, 6553.5, 65535.0})  # 16 bits of ones, in the units boats and receivers use: not available
NOT_AVAILABLE: Mapping[str, frozenset[float]] = {
    "heading_deg": _FAR_OUT | {-360.0, 360.0, 511.0, 3600.0, 36000.0},
    "speed_mps": _FAR_OUT | {102.3, 1023.0},
    "latitude_deg": frozenset({91.0}),
    "longitude_deg": frozenset({181.0}),
    "age_s": _FAR_OUT,
    "error_m": _FAR_OUT,
}
"""What AIS, GPS receivers and autopilots say for a value they do not know, of each field."""


def _printable(name: str) -> str:
    if not name.isprintable():
        raise ValueError("it holds a character that cannot be seen")
    return name


def _real(low: float, high: float) -> Any:
    return Field(strict=True, ge=low, le=high)


Name = Annotated[str, Field(strict=True, min_length=1, max_length=64), AfterValidator(_printable)]
Text = Annotated[str, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
Count = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
Duration = Annotated[float, _real(0.0, 1e9)]
Metres = Annotated[float, _real(-1e9, 1e9)]


@dataclass(frozen=True)
class BoatStatus:
    """What the game says of one boat; names as in `steerclear.env`."""

    tagged: Flag
    has_flag: Flag
    oob: Flag
    on_side: Flag
    cooldown_s: Duration
    driven: Flag


@dataclass(frozen=True)
class FlagStatus:
    """One team's flag: where it is, m in the field, and whether an opponent carries it."""

    x_m: Metres
    y_m: Metres
    taken: Flag


@dataclass(frozen=True)
class GameState:
    """How the game stands; pairs are blue, red."""

    time_s: Duration  # since the game began, s
    boats: Annotated[Mapping[Name, BoatStatus], Field(max_length=MOST_BOATS)]  # status of each boat by its name
    flags: tuple[FlagStatus, FlagStatus]  # the two flags
    captures: tuple[Count, Count] = (0, 0)  # counts of each team
    grabs: tuple[Count, Count] = (0, 0)
    tags: tuple[Count, Count] = (0, 0)
    over: Flag = False  # whether the game has ended
    note: Text = ""  # what the referee has to say, such as whom it waits for

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as the feed and the black box have them."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}


class GameSource(Protocol):
    """Gives the latest state of the game; never waits."""

    def game(self) -> GameState | None:
        """None: none yet."""

    def game_age_s(self) -> float:
        """Its age, s; inf: none yet."""


@dataclass(frozen=True)
class Fix:
    """Where a sender says a boat is."""

    boat: Name
    latitude_deg: Annotated[float, _real(-89.0, 89.0)]  # WGS 84, deg
    longitude_deg: Annotated[float, _real(-180.0, 180.0)]
    # true course, deg clockwise from north; more than -360, less than 360
    heading_deg: Annotated[float, _real(-360.0, 360.0)]
    speed_mps: Annotated[float, _real(-50.0, 50.0)]  # along the heading, m/s
    age_s: Annotated[float, _real(0.0, 3600.0)]  # how old the fix was when it was sent, s
    error_m: Annotated[float, _real(0.0, 1000.0)]  # bound of the position's error, m


@dataclass(frozen=True)
class Packet:
    """One datagram."""

    sender: str  # who sent it
    run: int  # number the sender drew when it started; 0 when it gives none
    seq: int  # counts the sender's packets
    fixes: tuple[Fix, ...] = ()  # positions of a packet of kind "positions"
    game: GameState | None = None  # of a packet of kind "game"
    refused: tuple[str, ...] = ()  # why single fixes of the packet were left out, a line each
    # when it was sent, in 10 us since 1 January 2015, of packets that are sealed; None: it has none
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


@dataclass(frozen=True)
class _Head:
    """What every packet begins with."""

    steerclear: Annotated[float, _real(1, 1)]
    kind: Literal["positions", "game"]
    sender: Name
    seq: Count
    run: Count = 0
    stamp: Count = -1
    contacts: Annotated[list[Any], Field(max_length=MOST_BOATS)] | None = None


_HEAD, _FIX, _GAME = TypeAdapter(_Head), TypeAdapter(Fix), TypeAdapter(GameState)


def parse_packet(data: bytes) -> Packet:
    """The packet in a datagram. A fix that cannot be used is left out and named; anything else wrong refuses it all.

    Raises:
        FeedError: it is too long, no JSON, of another version or kind, or a value is missing, not finite or absurd.
    """
    if len(data) > MAX_BYTES:
        raise FeedError(f"packet of {len(data)} bytes; {MAX_BYTES} at most")
    try:
        content = json.loads(data, parse_constant=_refuse_constant)
        head = _HEAD.validate_python(content)
    except ValidationError as error:
        raise FeedError(f"packet's {_fault(error)}") from None
    except (ValueError, RecursionError) as error:
        raise FeedError(f"packet is not JSON ({short(error)})") from None
    stamp = None if head.stamp < 0 else head.stamp
    if head.kind == "game":
        game = game_state(content)
        return Packet(head.sender, head.run, head.seq, game=replace(game, note=game.note[:200]), stamp=stamp)
    if head.contacts is None:
        raise FeedError("packet's contacts are missing; give a list of boats")
    fixes: dict[str, Fix] = {}
    refused = []
    for entry in head.contacts:
        try:
            fix = _fix(entry)
        except FeedError as error:
            refused.append(str(error))
            continue
        if fix.boat in fixes:
            refused.append(f"boat {fix.boat} is given twice")
        fixes.setdefault(fix.boat, fix)
    return Packet(head.sender, head.run, head.seq, tuple(fixes.values()), refused=tuple(refused), stamp=stamp)


def game_state(content: Mapping[str, Any]) -> GameState:
    """The state of a game from plain values, the inverse of `GameState.as_dict`.

    Raises:
        FeedError: a value is missing or makes no sense.
    """
    if missing := [key for key in ("captures", "grabs", "tags", "over") if key not in content]:
        raise FeedError(f"the game has no {missing[0]}; give it")
    try:
        return _GAME.validate_python(dict(content))
    except ValidationError as error:
        raise FeedError(f"the game's {_fault(error)}") from None


def _fix(entry: Any) -> Fix:
    if not isinstance(entry, dict):
        raise FeedError(f"contact {short(entry)} is no object; give one with its boat, place, heading and speed")
    boat = f"boat {short(entry.get('boat'))}"
    for key, values in NOT_AVAILABLE.items():
        if type(entry.get(key)) in (int, float) and entry[key] in values:
            raise FeedError(
                f'{boat}: {key} is {entry[key]}, which means "not available"; leave the boat out until it is known'
            )
    try:
        return _FIX.validate_python(entry)
    except ValidationError as error:
        raise FeedError(f"{boat}: {_fault(error)}") from None


def _fault(error: ValidationError) -> str:
    """The first thing wrong: where it is, the value found, and what it should be."""
    fault = error.errors(include_url=False)[0]
    place = short(".".join(map(str, fault["loc"])) or "content")
    if fault["type"] in ("missing", "missing_argument"):
        return f"{place} is missing; give it"
    return f"{place} is {short(fault['input'])}: {fault['msg'].replace('Input', 'it', 1)}"


def short(value: Any) -> str:
    """A value in a line for a person, 60 characters at most."""
    text = value if isinstance(value, str) else str(value) if isinstance(value, BaseException) else repr(value)
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


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


class FeedSender(Closing):
    """Sends packets of the feed under one name; never waits. A context manager.

    Args:
        sender: its name.
        to: HOST:PORT of each listener; looked up once, since a name server could be waited for.
        key: the 32-byte signing key, so that packets are sealed; None: they are not.

    Raises:
        ConfigError: an address is not of that form, or its host unknown, or the key has another length.
    """

    def __init__(self, sender: str, to: Iterable[str], key: bytes | None = None) -> None:
        self.sender = sender
        self.run = random.SystemRandom().randrange(1, 2**31)
        self._seal, self._clock, self._seq = None if key is None else Seal(key), SigningClock(), 0
        self._to: list[tuple[socket.AddressFamily, Any]] = []
        for host, port in map(socket_address, to):
            try:
                self._to.append(place_of(host, port))
            except OSError as error:
                raise ConfigError(f"nobody knows the host {host!r} ({error.strerror}); give its address") from None
        families = {family for family, _ in self._to}
        self._sockets = {family: socket.socket(family, socket.SOCK_DGRAM) for family in families}
        for opened in self._sockets.values():
            opened.setblocking(False)

    def send_positions(self, fixes: Sequence[Fix]) -> None:
        """Send where boats are, or raise `FeedError`: a value is not finite, or they are too many for one packet."""
        self._send(fixes=tuple(fixes))

    def send_game(self, game: GameState) -> None:
        """Send how the game stands, or raise `FeedError`: a value is not finite, or the packet is too long."""
        self._send(game=game)

    def close(self) -> None:
        """Give the sockets back; may be called again."""
        for entry in self._sockets.values():
            entry.close()

    def _send(self, fixes: tuple[Fix, ...] = (), game: GameState | None = None) -> None:
        stamp = None if self._seal is None else self._clock.take()
        data = Packet(self.sender, self.run, self._seq, fixes, game, stamp=stamp).encode()
        data = data if self._seal is None else self._seal.close(data)
        self._seq += 1
        for family, place in self._to:
            try:
                self._sockets[family].sendto(data, place)
            except OSError as error:  # nobody listens there now, or the network is away: the next packet tries again
                LOG.debug("feed to %s: %s", place, error)


class PositionPublisher:
    """A sink that tells others (runners, the referee) where our boats are, to within ``error_m``."""

    def __init__(self, sender: FeedSender, frame: FieldFrame, error_m: float) -> None:
        self._sender, self._frame, self._error_m = sender, frame, error_m
        self._logged = False

    def take(self, tick: Tick) -> None:
        """Send the fixes of a tick."""
        fixes = []
        for reading in tick.readings.values():
            if math.isfinite(reading.age_s):
                place = self._frame.to_geodetic_deg(*reading.position_m)
                heading_deg = math.degrees(self._frame.heading_to_true_rad(reading.heading_rad))
                fixes.append(Fix(reading.boat, *place, heading_deg, reading.speed_mps, reading.age_s, self._error_m))
        if not fixes or tick.number % PUBLISH_EVERY:
            return
        try:
            self._sender.send_positions(fixes)
        except FeedError as error:  # an impossible reading must not stop the others for good
            if not self._logged:
                LOG.warning("positions not published: %s", error)
            self._logged = True

    def close(self) -> None:
        """Give the socket back."""
        self._sender.close()


def socket_address(text: str) -> tuple[str, int]:
    """Host and port of HOST:PORT; an IPv6 host may stand in brackets.

    Raises:
        ConfigError: it is not of that form.
    """
    place = host_and_port(text)
    if place is None:
        raise ConfigError(f'{text!r} is no address; give "HOST:PORT", such as "127.0.0.1:14700"')
    return place


def place_of(host: str, port: int) -> tuple[socket.AddressFamily, Any]:
    """IPv6 or IPv4 (names, such as localhost, count as IPv4), and the place as sockets of that family take it.

    Raises:
        OSError: nobody knows the host.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return family, socket.getaddrinfo(host, port, family, socket.SOCK_DGRAM)[0][4]
