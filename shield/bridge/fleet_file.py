"""`FleetFile`: a FLEET.yaml, read and checked as a whole before anything is opened or sent."""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..config import ShieldConfig
from ..exceptions import FleetFileError
from ..platforms import Platform
from ..platforms.files import is_path, load_platform
from ..surroundings import Surroundings
from .fleet_checks import check_fleet, platform_of, shield_config
from .fleet_settings import BoatSettings, FleetSettings, explain
from .fleet_yaml import MOST_BYTES, read_settings
from .frame import FieldFrame
from .static_obstacles import corners_m, read_obstacles

VERSION = 1  # of the format
OUTSIDE_TEAM = 2  # team number of boats outside the game that are nobody's


class FleetFile(FleetSettings):
    """A FLEET.yaml and what follows from it. Build it with `load_fleet` or `parse_fleet`.

    Boats are in the file's order everywhere: fleets, commands, records.
    """

    @cached_property
    def frame(self) -> FieldFrame:
        """The field's frame."""
        origin = self.field.origin
        return FieldFrame(origin.latitude_deg, origin.longitude_deg, self.field.y_axis_deg)

    @cached_property
    def shield_config(self) -> ShieldConfig:
        """Settings of the shield: the file's, with step and coordination from the file's own keys."""
        return shield_config(self)

    def with_shield(self, **settings: Any) -> FleetFile:
        """This file with some settings of the shield replaced, such as a measured delay.

        Raises:
            FleetFileError: a setting is unknown or out of range.
        """
        changed = self.model_copy(update={"shield": {**self.shield, **settings}})
        vars(changed)["shield_config"] = shield_config(changed)  # the copy comes with what was worked out for this one
        return changed

    @cached_property
    def surroundings(self) -> Surroundings:
        """The operating area and the obstacles, as the shield is given them."""
        lines = (corners_m(obstacle, self.frame) for obstacle in self.obstacles)
        circles = (obstacle.circle_m for obstacle in self.obstacles)
        return Surroundings(
            field=self.geofence.box,
            polygons=tuple(line for line in lines if line),
            circles=tuple(circle for circle in circles if circle is not None),
        )

    @property
    def dt_s(self) -> float:
        """Step of the loop, s."""
        return self.shield_config.dt_s

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all boats."""
        return tuple(boat.name for boat in self.boats)

    @cached_property
    def agent_ids(self) -> tuple[str, ...]:
        """Agents of the game, agent_0 first."""
        return tuple(boat.agent for boat in self.boats if boat.agent is not None)

    @cached_property
    def platform_of(self) -> Mapping[str, Platform]:
        """Platform of each boat, by boat's name."""
        return {boat.name: platform_of(self, boat.platform) for boat in self.boats}

    @cached_property
    def kind_of(self) -> Mapping[str, str | Platform]:
        """Platform of each boat as fleets have it: its name, or the platform itself when the file describes it."""
        described = {b.name: b.platform in self.platforms or is_path(b.platform) for b in self.boats}
        return {b.name: self.platform_of[b.name] if described[b.name] else b.platform for b in self.boats}

    def measured_of(self, name: str) -> Mapping[str, float]:
        """What a fit measured of a boat, from its platform's file; empty: nothing."""
        kind = self.boat(name).platform
        return load_platform(kind).measured if is_path(kind) and kind not in self.platforms else {}

    @cached_property
    def team_of(self) -> Mapping[str, int]:
        """0 blue, 1 red, 2 nobody's, by boat's name: the first half of the agents is blue."""
        sides = {None: OUTSIDE_TEAM, "blue": 0, "red": 1}
        half = len(self.agent_ids) // 2
        return {
            boat.name: sides[boat.team] if boat.agent is None else int(self.agent_ids.index(boat.agent) >= half)
            for boat in self.boats
        }

    @property
    def team_number(self) -> int:
        """0 when our boats play blue, 1 when red."""
        return int(self.team == "red")

    def boat(self, name: str) -> BoatSettings:
        """The boat of that name.

        Raises:
            FleetFileError: no boat has it.
        """
        for boat in self.boats:
            if boat.name == name:
                return boat
        raise FleetFileError(f"no boat is named {name!r}; the file has {', '.join(self.names)}")

    @property
    def ours(self) -> tuple[BoatSettings, ...]:
        """Boats of our team with a link, to be commanded by some process of ours."""
        return tuple(boat for boat in self.boats if boat.is_steered and self.team_of[boat.name] == self.team_number)

    def commanded(self, only: str | None = None) -> tuple[BoatSettings, ...]:
        """Boats a process commands: those of our team with a link, or the one named.

        Raises:
            FleetFileError: ``only`` names a boat we may not command, or per_boat coordination without a name.
        """
        ours = self.ours
        if only is None:
            if self.coordination == "per_boat":
                raise FleetFileError("coordination is per_boat: a process per boat; name this process's with --boat")
            return ours
        boat = self.boat(only)
        if boat not in ours:
            names = ", ".join(boat.name for boat in ours)
            raise FleetFileError(f"boat {only!r} is not ours to command; choose one of {names}")
        return (boat,)

    def contact_of(self, boat: BoatSettings) -> str:
        """How a process that does not command this boat knows it: "feed", "telemetry" or "moos"."""
        if boat.contact is not None:
            return boat.contact
        if boat.link is None and any(other.by_moos for other in self.boats):
            return "moos"
        return "feed" if self.feed is not None else "telemetry"

    def feed_listen(self, boat: str | None = None) -> str | None:
        """HOST:PORT at which a runner hears the feed: the team's, or the one of a boat's own process."""
        own = None if boat is None else self.boat(boat).feed_listen
        return own or (None if self.feed is None else self.feed.listen)

    def feed_listeners(self) -> tuple[str, ...]:
        """Every HOST:PORT at which a runner of this file may hear the feed: who publishes sends to all of them."""
        if self.feed is None:
            return ()
        if self.coordination == "team":
            return (self.feed.listen,)
        return tuple(dict.fromkeys(b.feed_listen or self.feed.listen for b in self.ours))

    def position_listeners(self) -> tuple[str, ...]:
        """Every HOST:PORT positions go to: the runners' and the referee's."""
        referee = () if self.feed is None or self.feed.referee is None else (self.feed.referee,)
        others = {self.contact_of(boat) for boat in self.boats if boat.link is None}
        return (*(() if others == {"moos"} else self.feed_listeners()), *referee)


def parse_fleet(text: str, where: str = "FLEET.yaml", folder: Path | None = None) -> FleetFile:
    """A fleet file from its text.

    Args:
        text: YAML.
        where: its name, for messages.
        folder: what relative paths in it start from; None leaves them.

    Raises:
        FleetFileError: it is no YAML, has an unknown or missing key, a value out of range, or boats that contradict
            each other; one line.
    """
    try:
        content = read_settings(text)
    except FleetFileError as error:
        raise FleetFileError(f"{where} is not YAML of a fleet file: {error}") from None
    if not isinstance(content, dict):
        what = "a list in place of settings" if isinstance(content, list) else "no settings"
        raise FleetFileError(f"{where} holds {what}; give version, field, geofence, team and boats")
    if "max_speed_mps" in content:
        raise FleetFileError(f"{where} is a platform file, of one boat; give a FLEET.yaml whose boats name it")
    version = content.get("version")
    if isinstance(version, int) and version > VERSION:
        raise FleetFileError(f"{where}: version {version} is newer than this steerclear reads ({VERSION}); update it")
    try:  # by JSON's rules lists are lists, and texts paths
        fleet = FleetFile.model_validate_json(json.dumps(content), context=folder)
        if folder is not None:
            boats = tuple(boat if boat.platform in fleet.platforms else _rooted(boat, folder) for boat in fleet.boats)
            fleet = fleet.model_copy(update={"boats": boats, "log_dir": folder / fleet.log_dir})
        fleet = fleet.model_copy(update={"obstacles": read_obstacles(fleet)})
        check_fleet(fleet)
    except ValidationError as error:
        raise FleetFileError(f"{where}: {explain(error, FleetFile)}") from None
    except FleetFileError as error:
        raise FleetFileError(f"{where}: {error}") from None
    return fleet


def load_fleet(path: str | Path) -> FleetFile:
    """Read and check a FLEET.yaml; relative paths in it start from its folder.

    Raises:
        FleetFileError: as `parse_fleet`, or the file cannot be read.
    """
    return load_with_text(path)[0]


def load_with_text(path: str | Path) -> tuple[FleetFile, str]:
    """`load_fleet`, and the text it was read from, word for word.

    Raises:
        FleetFileError: as `load_fleet`.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise OSError(errno.EINVAL, "it is no plain file")
            text = file.read(MOST_BYTES + 1).decode("utf-8")  # no more of it than a fleet file may hold
        folder = Path(path).resolve().parent
    except UnicodeDecodeError:
        raise FleetFileError(
            f"cannot read {path} (it is no UTF-8; UTF-16?); save it as UTF-8, or give a FLEET.yaml"
        ) from None
    except (OSError, ValueError) as error:  # a path may hold what no path can
        why = getattr(error, "strerror", None) or error
        raise FleetFileError(f"cannot read {path} ({why}); give the path of a FLEET.yaml") from None
    return parse_fleet(text, str(path), folder), text


def _rooted(boat: BoatSettings, folder: Path) -> BoatSettings:
    """The boat, with the path of its platform's file from that folder."""
    return boat.model_copy(update={"platform": str(folder / boat.platform)}) if is_path(boat.platform) else boat
