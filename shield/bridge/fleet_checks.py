"""What the keys of a FLEET.yaml must agree on with each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

from ..config import ShieldConfig
from ..exceptions import ConfigError, FleetFileError, LinkError
from ..platforms import Gains, Platform, get_platform
from ..renamed import current_settings
from ..surroundings import Surroundings
from .fleet_settings import FleetSettings, MoosLinkSettings
from .mavlink.transport import host_and_port, parse_address

if TYPE_CHECKING:
    from .fleet_file import FleetFile

MOOS = "moos://"
LEAST_MOOS_HZ = 5.0
UNITS = {"_per_s": "1/s", "_mps": "m/s", "_rad": "rad", "_m": "m", "_s": "s"}
"""Units of settings by the ends of their names."""


def check_fleet(fleet: FleetFile) -> None:
    """Check what single keys cannot.

    Raises:
        FleetFileError: two things of the file contradict each other; one line that names both.
    """
    checks = (_agents, _platforms, _current, _room, _links, _contacts, _listeners, _limits)
    for fault in chain.from_iterable(check(fleet) for check in checks):
        raise FleetFileError(fault)


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
    """Settings of the shield with this file's step, coordination, hard line and ages.

    Margins from teammates shrink no faster than those from others where the file does not say otherwise: hulls on
    water, links and clocks do what is known of them only roughly. Opponents are taken for rammers, likewise.

    Raises:
        FleetFileError: a setting is unknown or contradicts the file's own key.
    """
    settings = current_settings(fleet.shield, warned=True)
    dt_s, fence = 1.0 / fleet.rate_hz, fleet.geofence
    for key, value, source, is_said in (
        ("dt_s", dt_s, "rate_hz says", True),
        ("coordination", fleet.coordination, "coordination says", True),
        ("beyond_m", fence.beyond_m, "geofence.beyond_m", "beyond_m" in fence.model_fields_set),
        ("beyond_then", fence.then, "geofence.then", "then" in fence.model_fields_set),
    ):
        given = settings.setdefault(key, value)
        same = given == value or (isinstance(given, float) and isinstance(value, float) and math.isclose(given, value))
        if is_said and not same:
            raise FleetFileError(f"shield.{key} is {given!r} and {source} {value!r}; leave shield.{key} out")
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
        raise FleetFileError(f"shield: {error}{_unit_words(str(error))}") from None
    if config.max_track_age_s < oldest:
        raise FleetFileError(
            f"shield.max_track_age_s is {config.max_track_age_s} s and boats are kept for {oldest} s "
            "(limits.*.lost_after_s); leave shield.max_track_age_s out"
        )
    return config


def _unit_words(said: str) -> str:
    """The unit of a setting that is no number, as its name ends."""
    name = said.partition(" ")[0]
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    return f" in {unit}, without the unit" if unit and said.endswith("give a number") else ""


def address_of(text: str, key: str) -> tuple[str, int]:
    """Host and port of HOST:PORT.

    Raises:
        FleetFileError: it is not of that form.
    """
    place = host_and_port(text)
    if place is None or place[1] == 0:
        raise FleetFileError(f'{key} is {text!r}; give "HOST:PORT", such as "127.0.0.1:14700"')
    return place


def _agents(fleet: FleetFile) -> Iterator[str]:
    agents = list(fleet.agent_ids)
    for values, what in ((list(fleet.names), "are named"), (agents, "play")):
        yield from (f"two boats {what} {v!r}; give each its own" for v in values if values.count(v) > 1)
    if agents != [f"agent_{i}" for i in range(len(agents))] or len(agents) % 2:
        yield (
            f"agents are {', '.join(agents)}; give an even number of boats agent_0, agent_1, ... in that "
            "order, blue first, and boats outside the game no agent; a boat of ours without a game has a team instead"
        )
    for boat in fleet.boats:
        if boat.agent is not None and boat.team is not None:
            yield f"boat {boat.name!r} has an agent, which says its team; leave its team out"
        if boat.is_steered and boat.agent is None and boat.team is None:
            yield (
                f"boat {boat.name!r} has a link and neither agent nor team: nobody here steers it; give it a team, "
                "or commanded: false where it is only heard"
            )


def _platforms(fleet: FleetFile) -> Iterator[str]:
    for name in {boat.platform for boat in fleet.boats} | set(fleet.platforms):
        platform_of(fleet, name)
    yield from ()


def _current(fleet: FleetFile) -> Iterator[str]:
    """Each boat that is steered makes way against the current that the shield is told of."""
    current_mps = fleet.shield_config.current_mps
    for boat in filter(lambda boat: boat.is_steered, fleet.boats):
        platform = fleet.platform_of[boat.name]
        if current_mps >= platform.max_speed_mps:
            yield (
                f"shield.current_mps is {current_mps:g} m/s and boat {boat.name!r} ({platform.name}) makes "
                f"{platform.max_speed_mps:g} m/s at most: it cannot hold its place; give a smaller one, or stay ashore"
            )


def _room(fleet: FleetFile) -> Iterator[str]:
    """The geofence has room for the boats that are kept inside, a separation apart, as the shield keeps its edge."""
    fence, config = fleet.geofence, fleet.shield_config
    if not (fence.xmin_m < fence.xmax_m and fence.ymin_m < fence.ymax_m):
        yield f"geofence {fence.box} is empty; give xmin_m < xmax_m and ymin_m < ymax_m"
    try:
        xmin, ymin, xmax, ymax = Surroundings(field=fence.box).pack(config).field.tolist()
    except ConfigError as error:
        yield f"geofence: {error}"
        return
    sides, apart = (xmax - xmin, ymax - ymin), config.separation_m
    if min(sides) < apart:
        water = f"{min(sides):g} m of water, narrower than the separation of {apart:g} m"
        yield f"geofence {fence.box} leaves {water}; widen geofence"
    kept = sum(boat.is_steered for boat in fleet.boats)
    if math.prod(int(min(side / apart, kept)) + 1 for side in sides) < kept:
        yield f"geofence {fence.box} has no room for {kept} boats {apart:g} m apart; widen geofence"


def _links(fleet: FleetFile) -> Iterator[str]:
    seen: dict[tuple[str, int], str] = {}
    for boat in fleet.boats:
        link, name = boat.link, f"boat {boat.name!r}"
        if link is None:
            continue
        shared = f"system_id, {link.system_id}, on {link.address}"
        if isinstance(link, MoosLinkSettings):
            yield from _moos_link(fleet, name, link)
            address_of(link.address.removeprefix(MOOS), f"{name}: link address {MOOS}...")
            shared = f"MOOSDB, {link.address}"
        else:
            try:
                if parse_address(link.address).number == 0:
                    yield f"{name}: link address {link.address!r} ends in 0; give its port, or its baud rate"
            except LinkError as error:
                yield f"{name}: {error}; for a boat that runs MOOS {MOOS}HOST:PORT"
        other = seen.setdefault((link.address, link.system_id), boat.name)
        if other != boat.name:
            yield f"boats {other!r} and {boat.name!r} have one {shared}; give each its own"


def _moos_link(fleet: FleetFile, name: str, link: MoosLinkSettings) -> Iterator[str]:
    """Fast enough for its PIDs; and somebody knows what stops it once its gate died: its PID, or else the file."""
    if fleet.rate_hz < LEAST_MOOS_HZ:
        yield (
            f"rate_hz is {fleet.rate_hz:g} and {name} runs MOOS, whose PIDs want commands at {LEAST_MOOS_HZ:g} Hz: "
            f"give {LEAST_MOOS_HZ:g} or more"
        )
    answers = (link.thrust_timeout_s is not None) + link.nothing_stops_it
    if link.gate == "pid" and answers != 1:
        yield (
            f"{name}: with gate: pid no PID stops it when the gate dies; give its link thrust_timeout_s (s "
            "after which its actuators take thrust off by themselves) or nothing_stops_it: true, or take gate: helm"
        )
    if link.gate == "helm" and answers:
        yield f"{name}: thrust_timeout_s and nothing_stops_it are for gate: pid; leave them out"


def _contacts(fleet: FleetFile) -> Iterator[str]:
    for boat in fleet.boats:
        kind, name = fleet.contact_of(boat), f"boat {boat.name!r}"
        if kind == "feed" and fleet.feed is None:
            yield f"{name} is known from the feed, and the file has none; add feed: listen"
        if kind == "moos" and not any(other.by_moos for other in fleet.boats):
            yield f"{name} is known from NODE_REPORTs, and no boat of ours has a moos:// link"
        if kind == "telemetry" and boat.link is None:
            yield f"nobody says where {name} is; give it a link, or contact: feed and a feed section"
        if not boat.is_steered and boat.feed_listen is not None:
            yield f"{name} is not commanded; leave its feed_listen out"


def _listeners(fleet: FleetFile) -> Iterator[str]:
    """No two sockets of ours on one port."""
    taken: dict[int, str] = {}
    for boat in fleet.boats:
        if boat.link is not None and boat.link.address.startswith("udpin:"):
            taken[address_of(boat.link.address.partition(":")[2], "link")[1]] = f"the link of {boat.name!r}"
    if fleet.feed is None:
        return
    listeners = {"feed.listen": fleet.feed.listen, "feed.referee": fleet.feed.referee}
    listeners |= {f"feed_listen of {boat.name!r}": boat.feed_listen for boat in fleet.boats}
    for key, text in listeners.items():
        if text is not None:
            port = address_of(text, key)[1]
            if port in taken:
                yield f"{key} and {taken[port]} use one port, {port}; give each its own"
            taken[port] = key
    for text in fleet.feed.publish:
        address_of(text, "feed.publish")


def _limits(fleet: FleetFile) -> Iterator[str]:
    for name, sooner, later in (
        ("navigation", "max_age_s", "lost_after_s"),
        ("contact", "max_age_s", "lost_after_s"),
        ("model", "after_s", "give_up_after_s"),
        ("policy", "max_age_s", "give_up_after_s"),
    ):
        limit = getattr(fleet.limits, name)
        first, second = getattr(limit, sooner), getattr(limit, later)
        if second < first:
            yield f"limits.{name}.{later} is {second} s, before {sooner}, {first} s; give it at least that"
