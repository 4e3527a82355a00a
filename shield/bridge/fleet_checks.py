"""What the keys of a FLEET.yaml must agree on with each other."""

from __future__ import annotations

import ipaddress
import math
import re
from collections.abc import Mapping
from typing import Any

from ..config import ShieldConfig
from ..exceptions import ConfigError, FleetFileError
from ..platforms import Gains, Platform, get_platform
from ..renamed import current_settings
from ..surroundings import Surroundings
from .fleet_settings import BoatSettings, FleetSettings, MoosLinkSettings

LINK_KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial")
MOOS = "moos://"
LEAST_MOOS_HZ = 5.0

_HOST = r"[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63}){0,15}\.?|\[[0-9A-Fa-f:.]{2,45}(%[A-Za-z0-9]{1,16})?\]"
_ADDRESS = re.compile(rf"(?P<host>{_HOST}):(?P<port>[0-9]{{1,5}})")
_NUMERIC = re.compile(r"(^|\.)(0[xX][0-9A-Fa-f]*|[0-9]+)\.?$|[\[\]]")
_DEVICE = re.compile(r"[^:]+(:[0-9]{1,7})?")


def check_fleet(fleet: FleetSettings) -> None:
    """Check what single keys cannot.

    Raises:
        FleetFileError: two things of the file contradict each other; one line that names both.
    """
    _check_unique([boat.name for boat in fleet.boats], "are named")
    _check_agents(fleet)
    for name in {boat.platform for boat in fleet.boats} | set(fleet.platforms):
        platform_of(fleet, name)
    _check_room(fleet, shield_config(fleet))
    _check_links(fleet)
    _check_contacts(fleet)
    _check_listeners(fleet)
    _check_limits(fleet)


def platform_of(fleet: FleetSettings, name: str) -> Platform:
    """The platform of that name: the file's own, or one the package knows.

    Raises:
        FleetFileError: there is none, or its settings make no sense.
    """
    if name not in fleet.platforms:
        try:
            return get_platform(name)
        except ConfigError as error:
            raise FleetFileError(f"{error}; or describe it under platforms") from None
    settings: dict[str, Any] = dict(fleet.platforms[name])
    try:
        for controller in ("speed_pid", "heading_pid"):
            if isinstance(settings.get(controller), Mapping):
                settings[controller] = Gains(**settings[controller])
        return Platform(**{"kind": "usv", **settings, "name": name})
    except (ConfigError, TypeError) as error:
        raise FleetFileError(f"platforms.{name}: {error}") from None


def shield_config(fleet: FleetSettings) -> ShieldConfig:
    """Settings of the shield with this file's step, coordination and ages.

    Margins from teammates shrink no faster than those from others where the file does not say otherwise: hulls on
    water, links and clocks do what is known of them only roughly. Opponents are taken for rammers, likewise.

    Raises:
        FleetFileError: a setting is unknown or contradicts the file's own key.
    """
    settings = current_settings(fleet.shield, warned=True)
    dt_s = 1.0 / fleet.rate_hz
    for key, value, source in (("dt_s", dt_s, "rate_hz"), ("coordination", fleet.coordination, "coordination")):
        given = settings.setdefault(key, value)
        same = given == value or (isinstance(given, float) and isinstance(value, float) and math.isclose(given, value))
        if not same:
            raise FleetFileError(f"shield.{key} is {given!r} and {source} says {value!r}; leave shield.{key} out")
    _hard_line(fleet, settings)
    oldest = max(fleet.limits.contact.lost_after_s, fleet.limits.navigation.lost_after_s)
    settings.setdefault("max_track_age_s", oldest + dt_s)
    if settings.get("adversary_horizon_s") is None:  # a real hull is at stake, and nobody knows who is out there
        settings.setdefault("profile", "ramming")
    settings.setdefault("teammate_margin_cap_m", settings.get("margin_cap_m", ShieldConfig.margin_cap_m))
    if settings.get("barriers"):
        raise FleetFileError("shield.barriers: what they are given is not in the black box; leave them out on boats")
    try:
        config = ShieldConfig.of(**settings)
    except (ConfigError, TypeError) as error:
        raise FleetFileError(f"shield: {error}") from None
    if config.max_track_age_s < oldest:
        raise FleetFileError(
            f"shield.max_track_age_s is {config.max_track_age_s} s and boats are kept for {oldest} s "
            "(limits.*.lost_after_s); leave shield.max_track_age_s out"
        )
    return config


def _hard_line(fleet: FleetSettings, settings: dict[str, Any]) -> None:
    """The hard line as the geofence has it, where the shield's own settings do not say otherwise."""
    for key, name in (("beyond_m", "beyond_m"), ("beyond_then", "then")):
        said = getattr(fleet.geofence, name)
        if name in fleet.geofence.model_fields_set and settings.get(key, said) != said:
            raise FleetFileError(
                f"shield.{key} is {settings[key]!r} and geofence.{name} {said!r}; leave shield.{key} out"
            )
        settings.setdefault(key, said)


def address_of(text: str, key: str) -> tuple[str, int]:
    """Host and port of HOST:PORT.

    Raises:
        FleetFileError: it is not of that form.
    """
    found = _ADDRESS.fullmatch(text)
    if found is None or not 0 < int(found["port"]) < 65536 or not _is_host(found["host"]):
        raise FleetFileError(f'{key} is {text!r}; give "HOST:PORT", such as "127.0.0.1:14700"')
    return found["host"], int(found["port"])


def _is_host(host: str) -> bool:
    """Whether a host means one thing: what ends in a number is a plain address, not one in octal (010.0.0.1) or cut."""
    if not _NUMERIC.search(host):
        return True
    try:
        ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return False
    return True


def _check_agents(fleet: FleetSettings) -> None:
    agents = [boat.agent for boat in fleet.boats if boat.agent is not None]
    _check_unique(agents, "play")
    expected = [f"agent_{i}" for i in range(len(agents))]
    if agents != expected or len(agents) % 2:
        raise FleetFileError(
            f"agents are {', '.join(agents)}; give an even number of boats agent_0, agent_1, ... in that "
            "order, blue first, and boats outside the game no agent; a boat of ours without a game has a team instead"
        )
    for boat in fleet.boats:
        if boat.agent is not None and boat.team is not None:
            raise FleetFileError(f"boat {boat.name!r} has an agent, which says its team; leave its team out")


def _check_unique(values: list[str], what: str) -> None:
    for value in values:
        if values.count(value) > 1:
            raise FleetFileError(f"two boats {what} {value!r}; give each its own")


def _check_room(fleet: FleetSettings, config: ShieldConfig) -> None:
    """The geofence has room for the boats that are kept inside, a separation apart, as the shield keeps its edge."""
    fence = fleet.geofence
    if not (fence.xmin_m < fence.xmax_m and fence.ymin_m < fence.ymax_m):
        raise FleetFileError(f"geofence {fence.box} is empty; give xmin_m < xmax_m and ymin_m < ymax_m")
    try:
        xmin, ymin, xmax, ymax = Surroundings(field=fence.box).pack(config).field.tolist()
    except ConfigError as error:
        raise FleetFileError(f"geofence: {error}") from None
    sides, apart = (xmax - xmin, ymax - ymin), config.separation_m
    if min(sides) < apart:
        raise FleetFileError(
            f"geofence {fence.box} leaves {min(sides):g} m of water, narrower than the separation of {apart:g} m; "
            "widen geofence"
        )
    kept = sum(boat.link is not None and boat.commanded for boat in fleet.boats)
    if math.prod(int(min(side / apart, kept)) + 1 for side in sides) < kept:
        raise FleetFileError(f"geofence {fence.box} has no room for {kept} boats {apart:g} m apart; widen geofence")


def _check_links(fleet: FleetSettings) -> None:
    seen: dict[tuple[str, int], str] = {}
    for boat in fleet.boats:
        if boat.link is None:
            continue
        if isinstance(boat.link, MoosLinkSettings):
            if fleet.rate_hz < LEAST_MOOS_HZ:
                raise FleetFileError(
                    f"rate_hz is {fleet.rate_hz:g} and boat {boat.name!r} runs MOOS, whose PIDs want commands at "
                    f"{LEAST_MOOS_HZ:g} Hz: give {LEAST_MOOS_HZ:g} or more"
                )
            _check_stop(boat.name, boat.link)
            address_of(boat.link.address.removeprefix(MOOS), f"boat {boat.name!r}: link address {MOOS}...")
            other = seen.setdefault((boat.link.address, 0), boat.name)
            if other != boat.name:
                raise FleetFileError(
                    f"boats {other!r} and {boat.name!r} have one MOOSDB, {boat.link.address}; each boat has its own"
                )
            continue
        kind = boat.link.address.split(":")[0]
        if kind not in LINK_KINDS or ":" not in boat.link.address:
            raise FleetFileError(
                f"boat {boat.name!r}: link address {boat.link.address!r}; give one of "
                f"{', '.join(f'{k}:...' for k in LINK_KINDS)}, such as udpin:127.0.0.1:14550, or {MOOS}HOST:PORT"
            )
        rest = boat.link.address.partition(":")[2]
        if kind != "serial":
            address_of(rest, f"boat {boat.name!r}: link address")
        elif not _DEVICE.fullmatch(rest):
            raise FleetFileError(
                f"boat {boat.name!r}: link address {boat.link.address!r}; give serial:DEVICE:BAUD, such as "
                "serial:/dev/ttyUSB0:57600"
            )
        other = seen.setdefault((boat.link.address, boat.link.system_id), boat.name)
        if other != boat.name:
            raise FleetFileError(
                f"boats {other!r} and {boat.name!r} have one system_id, {boat.link.system_id}, on {boat.link.address}; "
                "give each its own"
            )


def _check_stop(name: str, link: MoosLinkSettings) -> None:
    """Somebody knows what stops a boat whose gate died: behind "helm" its PID does, behind "pid" the file must say."""
    answers = (link.thrust_timeout_s is not None) + link.nothing_stops_it
    if link.gate == "pid" and answers != 1:
        raise FleetFileError(
            f"boat {name!r}: with gate: pid no PID stops it when the gate dies; give its link thrust_timeout_s (s "
            "after which its actuators take thrust off by themselves) or nothing_stops_it: true, or take gate: helm"
        )
    if link.gate == "helm" and answers:
        raise FleetFileError(f"boat {name!r}: thrust_timeout_s and nothing_stops_it are for gate: pid; leave them out")


def contact_kind(fleet: FleetSettings, boat: BoatSettings) -> str:
    """How a process that does not command this boat knows it: "feed", "telemetry" or "moos"."""
    if boat.contact is not None:
        return boat.contact
    if boat.link is None and any(other.link is not None and other.link.kind == "moos" for other in fleet.boats):
        return "moos"
    return "feed" if fleet.feed is not None else "telemetry"


def _check_contacts(fleet: FleetSettings) -> None:
    for boat in fleet.boats:
        kind = contact_kind(fleet, boat)
        commanded = boat.link is not None and boat.commanded
        if kind == "feed" and fleet.feed is None:
            raise FleetFileError(f"boat {boat.name!r} is known from the feed, and the file has none; add feed: listen")
        if kind == "moos" and not any(other.link is not None and other.link.kind == "moos" for other in fleet.boats):
            raise FleetFileError(
                f"boat {boat.name!r} is known from NODE_REPORTs, and no boat of ours has a moos:// link"
            )
        if kind == "telemetry" and boat.link is None:
            raise FleetFileError(
                f"nobody says where boat {boat.name!r} is; give it a link, or contact: feed and a feed section"
            )
        if not commanded and boat.feed_listen is not None:
            raise FleetFileError(f"boat {boat.name!r} is not commanded; leave its feed_listen out")


def _check_listeners(fleet: FleetSettings) -> None:
    """No two sockets of ours on one port."""
    taken: dict[int, str] = {}
    for boat in fleet.boats:
        if boat.link is not None and boat.link.address.startswith("udpin:"):
            taken[address_of(boat.link.address.partition(":")[2], "link")[1]] = f"the link of {boat.name!r}"
    for key, text in _feed_listeners(fleet):
        port = address_of(text, key)[1]
        if port in taken:
            raise FleetFileError(f"{key} and {taken[port]} use one port, {port}; give each its own")
        taken[port] = key
    for text in () if fleet.feed is None else fleet.feed.publish:
        address_of(text, "feed.publish")


def _feed_listeners(fleet: FleetSettings) -> list[tuple[str, str]]:
    if fleet.feed is None:
        return []
    listeners = [("feed.listen", fleet.feed.listen)]
    if fleet.feed.referee is not None:
        listeners.append(("feed.referee", fleet.feed.referee))
    return listeners + [(f"feed_listen of {b.name!r}", b.feed_listen) for b in fleet.boats if b.feed_listen]


def _check_limits(fleet: FleetSettings) -> None:
    limits = fleet.limits
    later: tuple[tuple[str, float, float], ...] = (
        ("navigation.lost_after_s", limits.navigation.max_age_s, limits.navigation.lost_after_s),
        ("contact.lost_after_s", limits.contact.max_age_s, limits.contact.lost_after_s),
        ("model.give_up_after_s", limits.model.after_s, limits.model.give_up_after_s),
        ("policy.give_up_after_s", limits.policy.max_age_s, limits.policy.give_up_after_s),
    )
    for name, first, second in later:
        if second < first:
            sooner = "after_s" if name.startswith("model") else "max_age_s"
            raise FleetFileError(f"limits.{name} is {second} s, before {sooner}, {first} s; give it at least that")
