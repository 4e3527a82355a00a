"""Playing encounters of one family with one guard: chunks of games, the worst variant of each, verdicts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError

from .arrival import never_arrived
from .families import draw
from .guards import NONE, GuardMaker
from .inactive import inactive_columns
from .play import Film, play
from .scenes import DT_S, Conditions, Scenes
from .start import start_certificate_m
from .summary import summarise
from .tally import Columns, tally
from .verdicts import NO_VERDICT, VERDICT_COLUMNS, judge_worst

CHUNK_MIB = 96.0
"""Memory of a chunk's films, MiB."""
MOST_PER_CHUNK = 100
"""Encounters of a chunk: what an interrupted run may lose."""
BARE_SAME = ("goal_s", "reversals_per_min")
"""Columns kept of the same variant without a guard, with ``unshielded_`` before the name."""
BARE_WORST = ("closest_m", "breaches_teammate", "breaches_opponent")
"""Columns kept of the variant that is worst without a guard."""


@dataclass(frozen=True)
class Outcome:
    """What came of n encounters.

    Attributes:
        columns: arrays (n,) by name: see `tally.tally`, `verdicts.judge_game` and `measure_chunk`.
        summary: figures over all of them, see `summary.summarise`.
    """

    columns: Columns
    summary: dict[str, Any]


def measure(
    family: str,
    guard: str | GuardMaker = "shield",
    own: str = "heron",
    other: str = "heron",
    n: int = 200,
    seed: int = 0,
    conditions: Conditions | None = None,
    judge: bool = True,
    first: int = 0,
) -> Outcome:
    """Play encounters in this process.

    Args:
        family: name of the family.
        guard: a name (see `guards`) or what makes a guard from (config, games, platforms, team, surroundings).
        own: platform of the own boats.
        other: platform of the others.
        n: how many encounters.
        seed: of the scenes.
        conditions: radius, delay, noise, current.
        judge: ask the oracle about breaches (seconds each); without, they count as not judged.
        first: number of the first encounter.

    Raises:
        SteerclearError: bad input.
    """
    asked = conditions or Conditions()
    parts = [measure_chunk(scenes, guard, asked, judge) for scenes in chunks(family, own, other, asked, seed, first, n)]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Outcome(columns, summarise(columns))


def chunks(
    family: str, own: str, other: str, conditions: Conditions, seed: int, first: int, n: int
) -> Iterator[Scenes]:
    """Scenes of ``n`` encounters in batches that fit into memory.

    Raises:
        ConfigError: nothing to play.
    """
    if n < 1:
        raise ConfigError(f"the number of encounters is {n}; ask for at least 1")
    size = chunk_size(draw(family, own, other, conditions, seed, first, 1))
    for start in range(first, first + n, size):
        yield draw(family, own, other, conditions, seed, start, min(size, first + n - start))


def chunk_size(sample: Scenes) -> int:
    """Encounters per chunk: their films, with a guard and without, take about `CHUNK_MIB`."""
    per_game = 2 * 8 * sample.steps * len(sample.team) * (sample.state.shape[2] + 5)
    return max(1, min(MOST_PER_CHUNK, int(CHUNK_MIB * 2**20 / (per_game * sample.games))))


def measure_chunk(scenes: Scenes, guard: str | GuardMaker, conditions: Conditions, judge: bool = True) -> Columns:
    """Play a batch of scenes with a guard and without, and count.

    Returns:
        Columns (n,) over the encounters, the worst variant of each: ``number``, ``game`` (of the batch), ``variant``,
        ``start_certificate_m`` (see `start`), those of `tally.tally`, ``never_arrived`` (see `arrival`),
        ``unshielded_*`` of `BARE_SAME` and `BARE_WORST`, those of `inactive.inactive_columns`, ``decision_us`` and
        ``decision_p999_us`` (of the chunk, per game and step), and the verdicts.
    """
    play(replace(scenes.take([0]), length_s=DT_S), guard, conditions)  # compiles, so that what is timed is deciding
    film = play(scenes, guard, conditions)
    bare_film = film if guard == NONE else play(scenes, NONE, conditions)
    counted = tally(film) | {"never_arrived": never_arrived(film, bare_film)}
    bare = tally(bare_film)
    worst, verdicts = _verdicts(film, counted, judge)
    columns = {"number": scenes.number[worst].astype(np.float64), "game": worst.astype(np.float64)}
    columns["variant"] = np.array([game - np.argmax(scenes.number == scenes.number[game]) for game in worst], float)
    columns["start_certificate_m"] = start_certificate_m(film)[worst]
    columns |= {name: values[worst] for name, values in counted.items()}
    columns |= {f"unshielded_{name}": bare[name][worst] for name in BARE_SAME}
    worst_bare = worst_games(scenes, bare["closest_m"])
    columns |= {f"unshielded_{name}": bare[name][worst_bare] for name in BARE_WORST}
    columns |= inactive_columns(bare_film, guard, conditions, worst_bare)
    columns["decision_us"] = np.full(len(worst), float(np.median(film.decision_us)))
    columns["decision_p999_us"] = np.full(len(worst), float(np.quantile(film.decision_us, 0.999)))
    return columns | verdicts


def worst_games(scenes: Scenes, closest_m: np.ndarray) -> np.ndarray:
    """Games, one per encounter, in which its boats came closest."""
    order = np.lexsort((closest_m, scenes.number))
    firsts = np.flatnonzero(np.diff(scenes.number[order], prepend=-1))
    return np.asarray(order[firsts])


def _verdicts(film: Film, counted: Columns, judge: bool) -> tuple[np.ndarray, Columns]:
    """The game of each encounter that counts, and the columns of its verdict."""
    worst = worst_games(film.scenes, counted["closest_m"])
    if judge:
        worst, found = judge_worst(film, counted, worst)
    else:
        hits = (counted["breaches_teammate"] + counted["breaches_opponent"])[worst]
        found = [NO_VERDICT | {"not_judged": float(count)} for count in hits]
    return worst, {name: np.array([verdict[name] for verdict in found]) for name in VERDICT_COLUMNS}
