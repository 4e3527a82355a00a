"""The sections of a FLEET.yaml: their keys, units and bounds, and what is said where a file breaks them."""

from __future__ import annotations

import json
import math
import re
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
)
from pydantic.fields import FieldInfo

from .fleet_yaml import short

Response = Literal["hold_course", "slow", "hold_station", "stop"]

Name = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9_.-]{1,32}$", description="give 1 to 32 letters, digits, '_', '-' or '.'"),
]
Seconds = Annotated[float, Field(gt=0.0, le=3600.0, description="give seconds > 0")]
Metres = Annotated[float, Field(ge=-1e6, le=1e6, description="give metres in the field's frame")]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0, description="give degrees")]
Length = Annotated[float, Field(gt=0.0, le=1e5, description="give metres > 0")]


def _rooted(path: Path, info: ValidationInfo) -> Path:
    return path if info.context is None else info.context / path


Place = Annotated[Path, AfterValidator(_rooted)]
"""A path that starts from the file's folder, which is the validation's context; None leaves it."""


class Section(BaseModel):
    """Part of the file: unknown keys are errors, nothing is taken for something else, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Origin(Section):
    """Where the field's corner (0, 0) is."""

    latitude_deg: float = Field(ge=-89.0, le=89.0, description="give the corner's latitude, deg")
    longitude_deg: float = Field(ge=-180.0, le=180.0, description="give the corner's longitude, deg")


class FieldSettings(Section):
    """The field of play; y axis along ``y_axis_deg``, deg clockwise from true north; size along x and y, m."""

    origin: Origin = Field(description="give latitude_deg and longitude_deg of the field's corner")
    y_axis_deg: float = Field(0.0, ge=-360.0, le=360.0, description="give the true course of the field's y axis, deg")
    size_m: tuple[Length, Length] = Field(description="give [length along x, length along y] in m")


class Geofence(Section):
    """The operating area of our boats, m in the field's frame, and the hard line around it.

    Boats are kept inside the area and leave it only to keep clear of others. ``beyond_m``: how far outside it the hard
    line lies. ``then``: what becomes of a boat beyond that line: "stop" (stopped by its link and handed over to its
    pilot) or "flee" (it goes on to keep clear of others).
    """

    xmin_m: Metres
    ymin_m: Metres
    xmax_m: Metres
    ymax_m: Metres
    beyond_m: float = Field(10.0, ge=0.0, le=1000.0, description="give metres outside the geofence, 0 to 1000")
    then: Literal["stop", "flee"] = Field("stop", description="stop or flee: what a boat beyond the hard line does")

    @property
    def box(self) -> tuple[float, float, float, float]:
        """(xmin, ymin, xmax, ymax), m."""
        return self.xmin_m, self.ymin_m, self.xmax_m, self.ymax_m

    def outside_m(self, x_m: float, y_m: float) -> float:
        """How far outside a point is, m; negative: how far inside; NaN stays NaN."""
        dx, dy = max(self.xmin_m - x_m, x_m - self.xmax_m), max(self.ymin_m - y_m, y_m - self.ymax_m)
        return math.hypot(dx, dy) if min(dx, dy) > 0.0 else max(dx, dy)

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point is inside; NaN is not."""
        return self.outside_m(x_m, y_m) <= 0.0


class Obstacle(Section):
    """Shore, pier, shallow or keep-out area that no command may lead a boat across; one of its four forms.

    ``polygon_m``: corners [x, y] in the field's frame. ``polygon_deg``: corners [latitude, longitude]. ``circle_m``:
    [x, y, radius]. ``geojson``: path of a GeoJSON file, whose polygons and lines are all taken.
    """

    name: Name | None = None
    polygon_m: tuple[tuple[Metres, Metres], ...] | None = Field(
        None, min_length=3, description="give corners [x, y] in m, at least three"
    )
    polygon_deg: tuple[tuple[Degrees, Degrees], ...] | None = Field(
        None, min_length=3, description="give corners [latitude, longitude] in deg, at least three"
    )
    circle_m: tuple[Metres, Metres, Length] | None = Field(None, description="give [x, y, radius] in m")
    geojson: Place | None = Field(None, description="give the path of a GeoJSON file")
    _area: int = PrivateAttr(0)
    _label: str = PrivateAttr("")

    @property
    def area(self) -> int:
        """Number of the area that it bounds, together with others of the same number; negative: a wall bounds none."""
        return self._area

    @property
    def label(self) -> str:
        """Its name, or its place in the file."""
        return self._label

    def of_area(self, area: int, label: str) -> Obstacle:
        """The same obstacle with that number and label."""
        copy = self.model_copy()
        copy._area, copy._label = area, label
        return copy


class LinkSettings(Section):
    """How a boat is reached.

    ``address``: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or serial:DEVICE:BAUD. ``rate_hz``:
    rate of the telemetry asked for. ``route``: name of the command message, "auto" chooses by what the boat can.
    """

    kind: Literal["mavlink", "moos"] = Field(description="the kind of link: mavlink or moos")
    address: str = Field(min_length=4, max_length=200, description='give e.g. "udpin:127.0.0.1:14550"')
    system_id: int = Field(ge=1, le=254, description="give the autopilot's MAVLink system id, 1 to 254: 255 is ours")
    rate_hz: float = Field(20.0, gt=0.0, le=40.0, description="give the telemetry rate, Hz, at most 40")
    route: str = Field("auto", min_length=1, description='give "auto" or the name of a route')


class MoosLinkSettings(LinkSettings):
    """How a boat that runs MOOS-IvP is reached; ``link: moos://HOST:PORT`` alone takes the defaults.

    ``gate``: where the shield sits: "helm" between helm and PID, "pid" between PID and actuators. ``prefix``: what the
    helm puts before its DESIRED_*. ``corner_m``: the field's corner on the mission's local grid, x east, y north.
    ``mission``: the boat's .moos file, which checks before a start read. ``thrust_timeout_s``: after how long without
    posts the actuators behind gate "pid" take thrust off by themselves. ``nothing_stops_it``: true acknowledges that
    they do not.
    """

    kind: Literal["moos"] = Field(description="the kind of link: moos")
    address: str = Field(pattern=r"^moos://", max_length=200, description='give "moos://HOST:PORT"')
    system_id: int = Field(1, ge=1, le=1, description="leave system_id out: MOOS has none")
    gate: Literal["helm", "pid"] = Field("helm", description="give helm or pid")
    prefix: str = Field("RAW_", pattern=r"^[A-Z0-9_]{1,16}$", description="give the helm_prefix, such as RAW_")
    corner_m: tuple[Metres, Metres] = Field((0.0, 0.0), description="give [x, y] of the field's corner in m")
    mission: Place | None = Field(None, description="give the path of the boat's .moos file")
    thrust_timeout_s: float | None = Field(None, gt=0.0, le=10.0, description="give seconds, at most 10")
    nothing_stops_it: bool = Field(False, description="give true, or leave it out")


class BoatSettings(Section):
    """One boat.

    ``agent``: its place in the game, agent_0 ...; none for a boat outside the game, such as a safety boat. ``team``:
    side of a boat outside the game, else nobody's. ``contact``: how this boat is known to a process that does not
    command it: "feed" (UDP positions), "telemetry" (its own link) or "moos" (NODE_REPORTs in our boats' MOOSDBs);
    None: "moos" for a boat without a link where ours have MOOS, else "feed" when the file has a feed, else "telemetry".
    ``commanded``: false for a boat with a link that somebody else steers. ``feed_listen``: HOST:PORT at which this
    boat's own process hears the feed (coordination per_boat).
    """

    name: Name
    agent: str | None = Field(None, pattern=r"^agent_[0-9]{1,4}$", description="give agent_0, agent_1, ...")
    team: Literal["blue", "red"] | None = Field(None, description="give blue or red")
    platform: str = Field(min_length=1, description="give a platform's name, such as heron, or its file")
    link: LinkSettings | None = None
    contact: Literal["feed", "telemetry", "moos"] | None = Field(None, description="give feed, telemetry or moos")
    commanded: bool = True
    feed_listen: str | None = Field(None, description='give "HOST:PORT"')

    @field_validator("link", mode="before")
    @classmethod
    def _moos_link(cls, value: Any, info: ValidationInfo) -> Any:
        """A link to a MOOSDB, which may be its address alone."""
        if isinstance(value, str) and value.startswith("moos:"):
            value = {"kind": "moos", "address": value}
        if isinstance(value, dict) and value.get("kind") == "moos":
            try:
                return MoosLinkSettings.model_validate_json(json.dumps(value), context=info.context)
            except ValidationError as error:  # its own keys and remedies, not those of the other kind
                raise ValueError(explain(error, MoosLinkSettings)) from None
        return value

    @property
    def is_steered(self) -> bool:
        """Whether some process of this file commands it."""
        return self.link is not None and self.commanded

    @property
    def by_moos(self) -> bool:
        """Whether it has a link to a MOOSDB."""
        return self.link is not None and self.link.kind == "moos"


class Signing(Section):
    """MAVLink 2 signing: 32-byte secret key in a file only its owner can read."""

    key_file: Place = Field(description="give the path of the key file")
    link_id: int = Field(1, ge=0, le=255, description="give this link's number, 0 to 255")


class Feed(Section):
    """UDP JSON positions and game state.

    ``listen``: HOST:PORT of the runner. ``allow``: hosts packets are taken from. ``referee``: HOST:PORT at which the
    referee hears positions. ``publish``: HOST:PORT list the runner sends its own boats' positions to.
    """

    listen: str = Field(description='give "HOST:PORT", such as "127.0.0.1:14700"')
    allow: tuple[str, ...] = Field(("127.0.0.1",), description="give a list of host addresses", min_length=1)
    referee: str | None = Field(None, description='give "HOST:PORT"')
    publish: tuple[str, ...] = Field((), description='give a list of "HOST:PORT"')


class NavigationLimit(Section):
    """Own position, heading and speed: older than ``max_age_s``, the response; older than ``lost_after_s``, unknown.

    In between it is steered on by its model, behind the shield, with a growing error. A boat whose own state is unknown
    is told to stop by its link; the others keep clear of where it may be.
    """

    max_age_s: Seconds = 0.5
    then: Response = "stop"
    lost_after_s: Seconds = 5.0


class ContactLimit(Section):
    """Other boats: older than ``max_age_s``, the response of all own boats; older than ``lost_after_s``, another."""

    max_age_s: Seconds = 1.0
    then: Response = "slow"
    lost_after_s: Seconds = 5.0
    lost_then: Response = "stop"


class PolicyLimit(Section):
    """The policy's answer: older than ``max_age_s`` or unusable, the response; after ``give_up_after_s``, another."""

    max_age_s: Seconds = 0.5
    then: Response = "hold_course"
    give_up_after_s: Seconds = 3.0
    give_up_then: Response = "hold_station"


class AgeLimit(Section):
    """Something older than ``max_age_s``, and the response."""

    max_age_s: Seconds
    then: Response


class FenceLimit(Section):
    """A boat outside the geofence; "return" steers it back in at half speed."""

    then: Literal["return", "hold_course", "slow", "hold_station", "stop"] = "return"


class LogLimit(Section):
    """The black box cannot be written any more (disk full)."""

    then: Literal["go_on", "hold_course", "slow", "hold_station", "stop"] = "hold_station"


class ModelLimit(Section):
    """What a boat's model may miss, see `model_error`.

    ``widest_m``: bound on the margin that measured errors give a boat. A boat more than ``outside_m`` from where it was
    predicted 2 s ago, for ``after_s``: the response; for ``give_up_after_s``: handed over, by another.
    """

    widest_m: float = Field(default=1.0, ge=0.0, le=10.0, description="give metres, 0 to 10")
    outside_m: Length = 1.5
    after_s: Seconds = 3.0
    then: Response = "slow"
    give_up_after_s: Seconds = 15.0
    give_up_then: Response = "stop"


class Limits(Section):
    """How old things may be, s, and what happens beyond.

    ``after_failsafe``: whether a boat that its autopilot's own fail-safe took waits for the operator once that is over,
    or is taken back at once.
    """

    navigation: NavigationLimit = NavigationLimit()
    contact: ContactLimit = ContactLimit()
    policy: PolicyLimit = PolicyLimit()
    link: AgeLimit = AgeLimit(max_age_s=1.0, then="stop")
    game: AgeLimit = AgeLimit(max_age_s=2.0, then="hold_station")
    geofence: FenceLimit = FenceLimit()
    log: LogLimit = LogLimit()
    model: ModelLimit = ModelLimit()
    after_failsafe: Literal["wait", "retake"] = Field(default="wait", description="give wait or retake")


class End(Section):
    """The end of a run: boats are told to stop, behind the shield, before their links stop them and put them in HOLD.

    They are handed over once they lie still and no other boat would come within the separation radius of one of them
    within ``clear_s``, and after ``longest_s`` in any case.
    """

    clear_s: Seconds = 10.0
    longest_s: Seconds = 40.0


class FleetSettings(Section):
    """The whole file, section by section; `fleet_file.FleetFile` adds what follows from it."""

    version: int = Field(ge=1, le=1, description="give the version of the format: 1")
    rate_hz: float = Field(10.0, ge=1.0, le=50.0, description="give the loop's rate, Hz, 1 to 50")
    field: FieldSettings = Field(description="give origin and size_m of the field")
    geofence: Geofence = Field(description="give xmin_m, ymin_m, xmax_m, ymax_m: the operating area")
    obstacles: tuple[Obstacle, ...] = Field((), max_length=64, description="give a list of shores and keep-out areas")
    team: Literal["blue", "red"] = Field(description="the side our boats play: blue or red")
    coordination: Literal["team", "per_boat"] = Field(
        "team", description="team (one process for all boats) or per_boat (a process per boat)"
    )
    preset: str = Field("aamas2024", min_length=1, description="give the name of the game's rules")
    rules: dict[str, Any] = Field({}, description="give settings of the game that differ from the preset's")
    shield: dict[str, Any] = Field({}, description="give settings of the shield, by name")
    platforms: dict[Name, dict[str, Any]] = Field({}, description="give platforms of your own, by name")
    boats: tuple[BoatSettings, ...] = Field(min_length=1, max_length=64, description="give the list of boats")
    signing: Signing | None = None
    feed: Feed | None = None
    limits: Limits = Limits()
    end: End = End()
    log_dir: Path = Field(Path("logs"), description="give the folder of the logs")


_TOLD = {
    r"^\w+ should have at least (\d+) items? after validation, not (\d+)$": r"it has \2 entries, fewer than \1",
    r"^\w+ should have at most (\d+) items? after validation, not (more|\d+).*$": r"it has more than \1 entries",
    "should be an object$": "should be a mapping (key: value), no list or text",
    "should be a valid array$": "should be a list ([..., ...])",
    "should be a valid number$": "should be a number alone, without a unit or quotes",
}
"""What the checks of values say, and words for it that a person who writes YAML knows."""


def explain(error: ValidationError, root: type[BaseModel]) -> str:
    """The first fault with where it is and the remedy, and how many more there are, in one line."""
    faults = error.errors(include_url=False)
    faults.sort(key=lambda fault: fault["type"] != "extra_forbidden")  # a misspelt key explains the missing one
    fault, place = faults[0], tuple(faults[0]["loc"])
    owner, entry = _find(root, place)
    name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).removeprefix(".")
    name, remedy = short(name, 120), None if entry is None else entry.description
    if fault["type"] == "extra_forbidden":
        known = list(owner.model_fields)
        near = get_close_matches(str(place[-1]), known, 1, 0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"
        text = f"unknown key {name!r}; {hint}"
    elif fault["type"] == "missing":
        text = f"{name} is missing; {remedy or 'give it'}"
    else:
        said = "" if remedy and fault["type"] == "string_pattern_mismatch" else f": {_said(fault['msg'])}"
        comma = isinstance(fault["input"], str) and re.fullmatch(r"[-+]?\d+,\d+", fault["input"])
        said = ": a decimal point is wanted, no comma" if comma else said
        text = f"{name} is {short(repr(fault['input']))}{said}; {remedy or 'correct it'}"
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _said(message: str) -> str:
    for told, words in _TOLD.items():
        message = re.sub(told, words, message)
    return re.sub("^(Input|String|List|Tuple|Dictionary|Value)(?= should)", "it", message)


def _find(root: type[BaseModel], place: tuple[int | str, ...]) -> tuple[type[BaseModel], FieldInfo | None]:
    """The model that owns a place, and the field there as far as it is known."""
    owner, entry = root, None
    for part in place:
        if isinstance(part, str):
            if part not in owner.model_fields:
                break
            entry = owner.model_fields[part]
            owner = _model_in(entry.annotation) or owner
    return owner, entry


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model inside ``X``, ``X | None``, ``tuple[X, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _model_in(part)) is not None), None)
