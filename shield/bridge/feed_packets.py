"""Packets of the position and game feed: one JSON object per UDP datagram, what is in them, and every check on it.

A packet of kind "positions" says where boats are (`Fix`), one of kind "courses" what team-mates were told to do
(`Course`), one of kind "game" how the game stands (`GameState`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from ..exceptions import FeedError
from .feed_values import count_of, mapping_of, name_of, number_of, pair_of, refuse_constant, short, truth_of

_Entry = TypeVar("_Entry", "Fix", "Course")

MAX_BYTES = 32768
"""Largest datagram taken."""
MAX_BOATS = 64
MAX_SPEED_MPS = 50.0
MAX_AGE_S = 3600.0
MAX_ERROR_M = 1000.0
LARGEST = 1e9


@dataclass(frozen=True)
class Fix:
    """Where a sender says a boat is.

    Attributes:
        boat: its name.
        latitude_deg, longitude_deg: WGS 84, deg.
        heading_deg: true course, deg clockwise from north.
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
class Course:
    """What a boat was told to do, by the process that commands it: its command after the shield.

    Attributes:
        boat: its name.
        heading_deg: true course, deg clockwise from north.
        speed_mps: m/s.
        age_s: how long ago, when it was sent, s.
    """

    boat: str
    heading_deg: float
    speed_mps: float
    age_s: float


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
        courses: of a packet of kind "courses".
        game: of a packet of kind "game".
        refused: why single fixes or courses of the packet were left out, a line each.
    """

    sender: str
    run: int
    seq: int
    fixes: tuple[Fix, ...] = ()
    courses: tuple[Course, ...] = ()
    game: GameState | None = None
    refused: tuple[str, ...] = ()

    def encode(self) -> bytes:
        """The datagram.

        Raises:
            FeedError: it holds a value that is not finite, or is too long.
        """
        head = {"steerclear": 1, "sender": self.sender, "run": self.run, "seq": self.seq}
        if self.game is not None:
            body: dict[str, Any] = {"kind": "game", **self.game.as_dict()}
        elif self.courses:
            body = {"kind": "courses", "courses": [dict(vars(course)) for course in self.courses]}
        else:
            body = {"kind": "positions", "contacts": [dict(vars(fix)) for fix in self.fixes]}
        try:
            data = json.dumps(head | body, allow_nan=False, separators=(",", ":")).encode()
        except ValueError as error:
            raise FeedError(f"the packet holds a value that cannot be sent ({error}); give finite numbers") from None
        if len(data) > MAX_BYTES:
            raise FeedError(f"the packet has {len(data)} bytes; send fewer boats at once, {MAX_BYTES} bytes at most")
        return data


def parse_packet(data: bytes) -> Packet:
    """The packet in a datagram. A fix or course that cannot be used is left out and named; any other fault refuses all.

    Raises:
        FeedError: it is too long, no JSON, of another version or kind, or a value is missing, not finite or absurd.
    """
    if len(data) > MAX_BYTES:
        raise FeedError(f"packet of {len(data)} bytes; {MAX_BYTES} at most")
    try:
        content = json.loads(data, parse_constant=refuse_constant)
    except (ValueError, RecursionError) as error:
        raise FeedError(f"packet is not JSON ({short(error)})") from None
    if not isinstance(content, dict) or content.get("steerclear") != 1 or isinstance(content["steerclear"], bool):
        raise FeedError('packet is not of this feed; begin it with {"steerclear": 1, ...')
    sender, kind = name_of(content, "sender"), content.get("kind")
    run, seq = count_of(content, "run", 0), count_of(content, "seq")
    if kind == "positions":
        fixes, refused = _entries(content, "contacts", _fix)
        return Packet(sender, run, seq, fixes=fixes, refused=refused)
    if kind == "courses":
        courses, refused = _entries(content, "courses", _course)
        return Packet(sender, run, seq, courses=courses, refused=refused)
    if kind == "game":
        return Packet(sender, run, seq, game=game_state(content))
    raise FeedError(f"packet of kind {short(kind)}; kinds are positions, courses and game")


def game_state(content: Mapping[str, Any]) -> GameState:
    """The state of a game from plain values under the packet's keys, the inverse of `GameState.as_dict`.

    Raises:
        FeedError: a value is missing or makes no sense.
    """
    boats = content.get("boats")
    if not isinstance(boats, Mapping) or len(boats) > MAX_BOATS:
        raise FeedError(f"boats is {short(boats)}; give a dict by name, {MAX_BOATS} boats at most")
    flags = content.get("flags")
    if not isinstance(flags, (list, tuple)) or len(flags) != 2:
        raise FeedError(f"flags is {short(flags)}; give blue's and red's")
    note = content.get("note", "")
    if not isinstance(note, str):
        raise FeedError(f"note is {short(note)}; give a text")
    return GameState(
        time_s=number_of(content, "time_s", 0.0, LARGEST),
        boats={name_of({"boat": name}, "boat"): _boat_status(entry) for name, entry in boats.items()},
        flags=(_flag_status(flags[0]), _flag_status(flags[1])),
        captures=pair_of(content, "captures"),
        grabs=pair_of(content, "grabs"),
        tags=pair_of(content, "tags"),
        over=truth_of(content, "over"),
        note=note[:200],
    )


def _boat_status(entry: Any) -> BoatStatus:
    fields = mapping_of(entry, "a boat")
    truths = {key: truth_of(fields, key) for key in ("tagged", "has_flag", "oob", "on_side", "driven")}
    return BoatStatus(cooldown_s=number_of(fields, "cooldown_s", 0.0, LARGEST), **truths)


def _flag_status(entry: Any) -> FlagStatus:
    fields = mapping_of(entry, "a flag")
    x_m, y_m = (number_of(fields, key, -LARGEST, LARGEST) for key in ("x_m", "y_m"))
    return FlagStatus(x_m, y_m, truth_of(fields, "taken"))


def _entries(
    content: Mapping[str, Any], key: str, read: Callable[[Mapping[str, Any]], _Entry]
) -> tuple[tuple[_Entry, ...], tuple[str, ...]]:
    """What a packet says of single boats, each once, and why others were left out."""
    given = content.get(key)
    if not isinstance(given, list) or len(given) > MAX_BOATS:
        raise FeedError(f"{key} is {short(given)}; give a list, {MAX_BOATS} boats at most")
    found: dict[str, _Entry] = {}
    refused = []
    for row in given:
        try:
            entry = read(mapping_of(row, f"one of {key}"))
        except FeedError as error:
            refused.append(str(error))
            continue
        if entry.boat in found:
            refused.append(f"boat {entry.boat} is given twice")
        else:
            found[entry.boat] = entry
    return tuple(found.values()), tuple(refused)


def _course(entry: Mapping[str, Any]) -> Course:
    boat = name_of(entry, "boat")
    try:
        return Course(
            boat=boat,
            heading_deg=number_of(entry, "heading_deg", -720.0, 720.0),
            speed_mps=number_of(entry, "speed_mps", -MAX_SPEED_MPS, MAX_SPEED_MPS),
            age_s=number_of(entry, "age_s", 0.0, MAX_AGE_S),
        )
    except FeedError as error:
        raise FeedError(f"boat {boat}: {error}") from None


def _fix(entry: Mapping[str, Any]) -> Fix:
    boat = name_of(entry, "boat")
    try:
        return Fix(
            boat=boat,
            latitude_deg=number_of(entry, "latitude_deg", -89.0, 89.0),
            longitude_deg=number_of(entry, "longitude_deg", -180.0, 180.0),
            heading_deg=number_of(entry, "heading_deg", -720.0, 720.0),
            speed_mps=number_of(entry, "speed_mps", -MAX_SPEED_MPS, MAX_SPEED_MPS),
            age_s=number_of(entry, "age_s", 0.0, MAX_AGE_S),
            error_m=number_of(entry, "error_m", 0.0, MAX_ERROR_M),
        )
    except FeedError as error:
        raise FeedError(f"boat {boat}: {error}") from None
