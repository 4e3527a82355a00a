"""Value tables on disk and their cards: shipped with the package or solved on demand, checked on every read.

A card states what a table was solved for and how accurate it is. It is stored as JSON inside the table's file.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..exceptions import TableError
from ..platforms.platform import Platform
from ..platforms.registry import PLATFORMS, get_platform
from .grid import Grid
from .lookup import LEVELS_S, N_LEVELS, STEPS, Tables, no_tables, pack
from .settings import OtherMay, Problem, read_other_may, table_name
from .solve import Progress, write_whole

CACHE_VARIABLE = "STEERCLEAR_TABLES"
"""Environment variable with the folder of tables solved on demand."""
SHIPPED = Path(__file__).parent / "shipped"
FORMAT = 1
"""Version of the table files."""


def platform_digest(platform: Platform) -> str:
    """Return a digest of a platform's parameters; a table is valid for exactly these."""
    return hashlib.sha256(platform.pack().tobytes()).hexdigest()[:16]


@dataclass(frozen=True)
class Card:
    """Description of a value table.

    The table is valid for an own boat at maximum thrust; the other boat may have any thrust.
    """

    own: str  # platforms' names
    other: str
    own_parameters: str  # digests of their parameters
    other_parameters: str
    other_may: str  # what the other boat may do
    grid: dict[str, Any]  # nodes of the table, see `Grid`
    dt_s: float  # table step and longest play, s
    horizon_s: float
    iterations: int  # iterations done
    residual_m: float  # largest change of a value in the last step, m
    payload_sha256: str = ""  # digest of the packed values
    version: str = ""  # version of the package that solved it
    checked_radii_m: tuple[float, ...] = ()  # separation radii whose convergence and margin were checked, m
    # by radius, the share by which the sets {V < radius} change on a coarser grid
    convergence: dict[str, Any] = field(default_factory=dict)
    # areas of {V < radius}, m^2, by radius and speed pair, over relative headings
    areas_m2: dict[str, Any] = field(default_factory=dict)
    model_error: dict[str, Any] = field(default_factory=dict)  # error of the reduced model against the full one
    # results of closed-loop runs of the full model; empty if not run
    margin: dict[str, Any] = field(default_factory=dict)
    levels_s: tuple[float, ...] = ()  # shorter times T for which V(x, T) is stored as well, s
    # by T and radius, how far ahead, m, the set {V(x, T) < radius} extends head-on at top speeds
    levels: dict[str, Any] = field(default_factory=dict)
    format: int = FORMAT

    def to_json(self) -> str:
        """Return the card as text."""
        return json.dumps(asdict(self), indent=1, sort_keys=True)

    @staticmethod
    def of_json(text: str) -> Card:
        """Read a card.

        Raises:
            TableError: the text is no card of this format version.
        """
        try:
            content = json.loads(text)
            content["checked_radii_m"] = tuple(content["checked_radii_m"])
            content["levels_s"] = tuple(content.get("levels_s", ()))
            card = Card(**content)
            card.make_grid()
        except (ValueError, TypeError, KeyError) as error:
            raise TableError(f"the table's card cannot be read ({error})") from error
        if card.format != FORMAT:
            raise TableError(f"the table's format is {card.format}, this version of the package reads {FORMAT}")
        return card

    def make_grid(self) -> Grid:
        """Return the grid of the table."""
        return Grid(**self.grid)


@dataclass(frozen=True)
class ValueTable:
    """A packed table and its card."""

    card: Card  # its description
    values: NDArray[np.uint8]  # uint8 over the grid, in steps of cap / 255, rounded down; for the whole play
    # the same for each time in the card's ``levels_s``, shape ``(levels, *grid)``; at least ``values``
    levels: NDArray[np.uint8]

    def values_m(self) -> NDArray[np.float64]:
        """Return the values in m, over the grid."""
        return self.values.astype(np.float64) * (self.card.make_grid().cap_m / STEPS)


def pack_values(problem: Problem, state: Progress) -> ValueTable:
    """Pack a solved table, with values rounded down; the accuracy figures of its card are still empty."""
    grid = problem.grid
    values = pack(state.values, grid.cap_m).reshape(grid.shape)
    kept_s = LEVELS_S if problem.other_may is OtherMay.WORST_CASE else ()
    levels = [state.levels[k] if k < len(state.levels) else values.ravel() for k in range(len(kept_s))]
    shorter = np.array(levels, np.uint8).reshape(-1, *grid.shape)
    card = Card(
        own=problem.own.name,
        other=problem.other.name,
        own_parameters=platform_digest(problem.own),
        other_parameters=platform_digest(problem.other),
        other_may=problem.other_may.value,
        grid=asdict(grid),
        dt_s=problem.dt_s,
        horizon_s=problem.horizon_s,
        iterations=state.iterations,
        residual_m=round(float(state.residual_m), 6),
        version=_version(),
        levels_s=kept_s,
        payload_sha256=_digest(values, shorter),
    )
    return ValueTable(card, values, shorter)


def _version() -> str:
    try:
        return version("steerclear")
    except PackageNotFoundError:
        return "unknown"


def _digest(values: NDArray[np.uint8], levels: NDArray[np.uint8]) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes() + np.ascontiguousarray(levels).tobytes()).hexdigest()


def _more(levels: NDArray[np.uint8], values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return by how much each level exceeds the next longer one: mostly 0, so it compresses well."""
    return levels - np.concatenate([levels[1:], values[None]]) if len(levels) else levels


def _levels(more: NDArray[np.uint8], values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the levels from their differences, from the longest down."""
    return values + np.add.accumulate(more[::-1], axis=0, dtype=np.uint8)[::-1] if len(more) else more


def cache_folder() -> Path:
    """Return the folder of tables solved on demand: `CACHE_VARIABLE`, otherwise the platform's cache folder."""
    named = os.environ.get(CACHE_VARIABLE)
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "steerclear" / "tables"


def save_table(table: ValueTable, path: Path) -> None:
    """Write a table; never leave a partial file under its name.

    Raises:
        TableError: the file cannot be written.
    """
    shape = table.values.shape
    lines = table.values.reshape(*shape[:3], -1)
    steps = np.diff(lines, axis=2, prepend=np.uint8(0))
    memory = io.BytesIO()
    more = _more(table.levels, table.values)
    np.savez_compressed(memory, card=np.array(table.card.to_json()), steps=np.moveaxis(steps, 3, 0), more=more)
    write_whole(path, memory.getvalue(), "table", "choose another place with --out")


def read_table(path: Path) -> ValueTable:
    """Read a table file and check that it is complete.

    Raises:
        TableError: the file is missing, cut short, altered or of another format.
    """
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            if not {"card", "steps"} <= set(file.files):
                raise TableError(f"{path} is no value table; give one that steerclear reach solve has made")
            text, steps = str(file["card"]), file["steps"]
            more = file["more"] if "more" in file.files else np.zeros(0, np.uint8)
    except TableError:
        raise
    except FileNotFoundError as error:
        raise TableError(f"there is no table file {path}") from error
    except Exception as error:  # zip, zlib and numpy have many exceptions for invalid bytes
        raise TableError(f"table file {path} is damaged ({error})") from error
    card = Card.of_json(text)
    shape = card.make_grid().shape
    if steps.dtype != np.uint8 or steps.shape != (shape[3] * shape[4], *shape[:3]):
        raise TableError(f"table file {path} is damaged (its values do not fit its grid)")
    lines = np.add.accumulate(np.moveaxis(steps, 0, 3), axis=2, dtype=np.uint8)
    values = np.ascontiguousarray(lines).reshape(shape)
    if more.dtype != np.uint8 or more.size != len(card.levels_s) * values.size:
        raise TableError(f"table file {path} is damaged (its levels do not fit its card)")
    levels = _levels(more.reshape(-1, *shape), values)
    if _digest(values, levels) != card.payload_sha256:
        raise TableError(f"table file {path} is damaged (checksum differs)")
    return ValueTable(card, values, levels)


def remedy(own: str, other: str, other_may: OtherMay) -> str:
    """Return the command that solves a table."""
    boats = [name if name in PLATFORMS else f"{name}.yaml" for name in (own, other)]  # other boats come from files
    return f"steerclear reach solve --own {boats[0]} --other {boats[1]} --other-may {other_may.value}"


def find_table(own: str, other: str, other_may: OtherMay) -> Path | None:
    """Return the file of a table, or None. One solved on demand takes precedence over the shipped one."""
    name = f"{table_name(own, other, other_may)}.npz"
    return next((folder / name for folder in (cache_folder(), SHIPPED) if (folder / name).is_file()), None)


def load_table(
    own: str | Platform, other: str | Platform, other_may: str | OtherMay = OtherMay.WORST_CASE
) -> ValueTable:
    """Return the table of a pair, checked against the boats' parameters.

    Raises:
        TableError: it is missing, damaged or made for other parameters; the message names the command that makes it.
    """
    boats, mode = (get_platform(own), get_platform(other)), read_other_may(other_may)
    return _load(*boats, mode, str(cache_folder()))


@lru_cache(maxsize=32)
def _load(own: Platform, other: Platform, mode: OtherMay, folder: str) -> ValueTable:
    command = remedy(own.name, other.name, mode)
    path = find_table(own.name, other.name, mode)
    if path is None:
        raise TableError(
            f"no {mode.value} value table for {own.name} with {other.name}, neither shipped nor in {folder}; "
            f"make it with: {command}"
        )
    try:
        table = read_table(path)
        check_parameters(table.card, own, other, mode)
    except TableError as error:
        raise TableError(f"{error} [{path}]; make it anew with: {command}") from error
    return table


def check_parameters(card: Card, own: Platform, other: Platform, mode: OtherMay) -> None:
    """Raise a `TableError` unless the card is for these boats and this mode."""
    found, wanted = (card.own, card.other, card.other_may), (own.name, other.name, mode.value)
    if found != wanted:
        texts = ("{} with {}, {}".format(*names) for names in (found, wanted))
        raise TableError("the table is for {}, but {} was requested".format(*texts))
    for role, platform, digest in (("own", own, card.own_parameters), ("other", other, card.other_parameters)):
        if digest != platform_digest(platform):
            raise TableError(f"the table was made for other parameters of the {role} boat {platform.name!r}")


def stack_tables(tables: Sequence[ValueTable]) -> Tables:
    """Concatenate tables. A table without shorter times uses its values for the whole play at any time."""
    if not tables:
        return no_tables()
    blocks: list[NDArray[np.uint8]] = []
    level, full_m = np.zeros((len(tables), N_LEVELS), np.int64), np.zeros((len(tables), N_LEVELS))
    at = 0
    for row, full, table in zip(level, full_m, tables, strict=True):
        row[:], full[:] = at, _full_from_m(table, table.values)
        blocks.append(table.values.ravel())
        at += table.values.size
        for k in [LEVELS_S.index(time_s) for time_s in table.card.levels_s if time_s in LEVELS_S]:
            row[k], full[k] = at, _full_from_m(table, table.levels[k])
            blocks.append(table.levels[k].ravel())
            at += table.values.size
    axes = np.stack([table.card.make_grid().pack() for table in tables])
    return Tables(np.concatenate(blocks), level, axes, np.maximum.accumulate(full_m, axis=1))


def _full_from_m(table: ValueTable, values: NDArray[np.uint8]) -> float:
    """Return the range, m, at least the cap, from which all values equal the cap; infinite if there is none."""
    grid = table.card.make_grid()
    below = np.flatnonzero((values != STEPS).any(axis=(1, 2, 3, 4)))
    first = int(below[-1]) + 1 if len(below) else 0
    return max(grid.cap_m, float(grid.ranges_m()[first])) if first < grid.n_rho else np.inf


def with_figures(table: ValueTable, **figures: object) -> ValueTable:
    """Return the table with figures added to its card."""
    return replace(table, card=replace(table.card, **figures))  # type: ignore[arg-type]
