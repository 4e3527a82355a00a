"""Packets of the position and game feed: one JSON object per UDP datagram, what is in them, and every check on it.

A packet of kind "positions" says where boats are (`Fix`), one of kind "game" how the game stands (`GameState`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from ..exceptions import FeedError
from .feed_seal import SEAL_BYTES

MAX_BYTES = 32768
"""Largest datagram taken."""
MAX_BOATS = 64
MAX_NAME = 64
MAX_SPEED_MPS = 50.0
MAX_AGE_S = 3600.0
MAX_ERROR_M = 1000.0
LARGEST = 1e9

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
    latitude_deg: float
    longitude_deg: float
    heading_deg: float
    speed_mps: float
    age_s: float
    error_m: float


@dataclass(frozen=True)
class BoatStatus:
    """What the game says of one boat; names as in `steerclear.env`."""

    tagged: bool
    has_flag: bool
    oob: bool
    on_side: bool
    cooldown_s: float
    driven: bool


@dataclass(frozen=True)
class FlagStatus:
    """One team's flag: where it is, m in the field, and whether an opponent carries it."""

    x_m: float
    y_m: float
    taken: bool


@dataclass(frozen=True)
class GameState:
    """How the game stands, as its referee sees it; pairs are blue, red.

    Attributes:
        time_s: since the game began, s.
        boats: status of each boat by its name.
        flags: the two flags.
        captures, grabs, tags: counts of each team.
        over: whether the game has ended.
        note: what the referee has to say, such as whom it waits for.
    """

    time_s: float
    boats: Mapping[str, BoatStatus]
    flags: tuple[FlagStatus, FlagStatus]
    captures: tuple[int, int] = (0, 0)
    grabs: tuple[int, int] = (0, 0)
    tags: tuple[int, int] = (0, 0)
    over: bool = False
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain values under the packet's own keys."""
        return {
            "time_s": self.time_s,
            "boats": {name: dict(vars(status)) for name, status in self.boats.items()},
            "flags": [dict(vars(flag)) for flag in self.flags],
            "captures": list(self.captures),
            "grabs": list(self.grabs),
            "tags": list(self.tags),
            "over": self.over,
            "note": self.note,
        }


@dataclass(frozen=True)
class Packet:
    """One datagram.

    Attributes:
        sender: who sent it.
        run: number the sender drew when it started; 0 when it gives none.
        seq: counts the sender's packets.
        fixes: positions of a packet of kind "positions".
        game: of a packet of kind "game".
        stamp: when it was sent, in 10 us since 1 January 2015, of packets that are sealed; None: it has none.
        refused: why single fixes of the packet were left out, a line each.
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
        head = {"steerclear": 1, "sender": self.sender, "run": self.run, "seq": self.seq}
        head |= {} if self.stamp is None else {"stamp": self.stamp}
        if self.game is not None:
            body: dict[str, Any] = {"kind": "game", **self.game.as_dict()}
        else:
            body = {"kind": "positions", "contacts": [_plain(fix) for fix in self.fixes]}
        try:
            data = json.dumps(head | body, allow_nan=False, separators=(",", ":")).encode()
        except ValueError as error:
            raise FeedError(f"the packet holds a value that cannot be sent ({error}); give finite numbers") from None
        most = MAX_BYTES - SEAL_BYTES
        if len(data) > most:
            raise FeedError(f"the packet has {len(data)} bytes; send fewer boats at once, {most} bytes at most")
        return data


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
        raise FeedError(f"packet is not JSON ({_short(error)})") from None
    if not isinstance(content, dict) or content.get("steerclear") != 1 or isinstance(content["steerclear"], bool):
        raise FeedError('packet is not of this feed; begin it with {"steerclear": 1, ...')
    sender, kind = _name(content, "sender"), content.get("kind")
    run, seq = _count(content, "run", 0), _count(content, "seq")
    stamp = _count(content, "stamp") if "stamp" in content else None
    if kind == "positions":
        fixes, refused = _fixes(content)
        return Packet(sender, run, seq, fixes=fixes, refused=refused, stamp=stamp)
    if kind == "game":
        return Packet(sender, run, seq, game=game_state(content), stamp=stamp)
    raise FeedError(f"packet of kind {_short(kind)}; kinds are positions and game")


def game_state(content: Mapping[str, Any]) -> GameState:
    """The state of a game from plain values under the packet's keys, the inverse of `GameState.as_dict`.

    Raises:
        FeedError: a value is missing or makes no sense.
    """
    boats = content.get("boats")
    if not isinstance(boats, Mapping) or len(boats) > MAX_BOATS:
        raise FeedError(f"boats is {_short(boats)}; give a dict by name, {MAX_BOATS} boats at most")
    flags = content.get("flags")
    if not isinstance(flags, (list, tuple)) or len(flags) != 2:
        raise FeedError(f"flags is {_short(flags)}; give blue's and red's")
    note = content.get("note", "")
    if not isinstance(note, str):
        raise FeedError(f"note is {_short(note)}; give a text")
    return GameState(
        time_s=_number(content, "time_s", 0.0, LARGEST),
        boats={_name({"boat": name}, "boat"): _boat_status(entry) for name, entry in boats.items()},
        flags=(_flag_status(flags[0]), _flag_status(flags[1])),
        captures=_pair(content, "captures"),
        grabs=_pair(content, "grabs"),
        tags=_pair(content, "tags"),
        over=_truth(content, "over"),
        note=note[:200],
    )


def _boat_status(entry: Any) -> BoatStatus:
    fields = _mapping(entry, "a boat")
    truths = {key: _truth(fields, key) for key in ("tagged", "has_flag", "oob", "on_side", "driven")}
    return BoatStatus(cooldown_s=_number(fields, "cooldown_s", 0.0, LARGEST), **truths)


def _flag_status(entry: Any) -> FlagStatus:
    fields = _mapping(entry, "a flag")
    x_m, y_m = (_number(fields, key, -LARGEST, LARGEST) for key in ("x_m", "y_m"))
    return FlagStatus(x_m, y_m, _truth(fields, "taken"))


def _fixes(content: Mapping[str, Any]) -> tuple[tuple[Fix, ...], tuple[str, ...]]:
    contacts = content.get("contacts")
    if not isinstance(contacts, list) or len(contacts) > MAX_BOATS:
        raise FeedError(f"contacts is {_short(contacts)}; give a list, {MAX_BOATS} boats at most")
    fixes: dict[str, Fix] = {}
    refused = []
    for entry in contacts:
        try:
            fix = _fix(_mapping(entry, "a contact"))
        except FeedError as error:
            refused.append(str(error))
            continue
        if fix.boat in fixes:
            refused.append(f"boat {fix.boat} is given twice")
        else:
            fixes[fix.boat] = fix
    return tuple(fixes.values()), tuple(refused)


def _fix(entry: Mapping[str, Any]) -> Fix:
    boat = _name(entry, "boat")
    try:
        return Fix(
            boat=boat,
            latitude_deg=_number(entry, "latitude_deg", -89.0, 89.0),
            longitude_deg=_number(entry, "longitude_deg", -180.0, 180.0),
            heading_deg=_number(entry, "heading_deg", -360.0, 360.0),
            speed_mps=_number(entry, "speed_mps", -MAX_SPEED_MPS, MAX_SPEED_MPS),
            age_s=_number(entry, "age_s", 0.0, MAX_AGE_S),
            error_m=_number(entry, "error_m", 0.0, MAX_ERROR_M),
        )
    except FeedError as error:
        raise FeedError(f"boat {boat}: {error}") from None


def _plain(fix: Fix) -> dict[str, Any]:
    """As it is sent: a heading that came out as a full turn is north, and 360 is what "not available" looks like."""
    return {**vars(fix), "heading_deg": fix.heading_deg % 360.0 % 360.0}


def _mapping(entry: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(entry, Mapping):
        raise FeedError(f"{what} is {_short(entry)}; give an object")
    return entry


def _number(entry: Mapping[str, Any], key: str, low: float, high: float) -> float:
    value = entry.get(key)
    usable = isinstance(value, (int, float)) and not isinstance(value, bool)
    if usable and value in NOT_AVAILABLE.get(key, ()):
        raise FeedError(f'{key} is {_short(value)}, which means "not available"; leave the boat out until it is known')
    if not usable or not low <= value <= high:  # type: ignore[operator] # a number when usable
        raise FeedError(f"{key} is {_short(value)}; give a number from {low:g} to {high:g}")
    return float(value)  # type: ignore[arg-type] # checked above


def _count(entry: Mapping[str, Any], key: str, default: int | None = None) -> int:
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise FeedError(f"{key} is {_short(value)}; give a whole number >= 0")
    return value


def _pair(entry: Mapping[str, Any], key: str) -> tuple[int, int]:
    value = entry.get(key)
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise FeedError(f"{key} is {_short(value)}; give blue's and red's count")
    return _count({key: value[0]}, key), _count({key: value[1]}, key)


def _truth(entry: Mapping[str, Any], key: str) -> bool:
    value = entry.get(key)
    if not isinstance(value, bool):
        raise FeedError(f"{key} is {_short(value)}; give true or false")
    return value


def _name(entry: Mapping[str, Any], key: str) -> str:
    value = entry.get(key)
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME or not value.isprintable():
        raise FeedError(f"{key} is {_short(value)}; give a name of 1 to {MAX_NAME} characters")
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise FeedError(f"{name} is no number of JSON")


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else repr(value) if not isinstance(value, BaseException) else str(value)
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 60 else text[:59] + "…"
