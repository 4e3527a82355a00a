"""An entry's games three ways and their page: bare, as the zip that is handed in, with the shield round the game."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.policies.submissions.made_for import made_for
from steerclear.policies.submissions.stage import Stage

from ..ablation import AblationSettings
from ..metrics import breach_column
from ..page import render, write_page
from ..play.spec import MatchSpec
from ..statistics import Interval, paired_difference
from ..tables import number_text
from ..workers import Row
from .package import game_spec
from .wrap import own_files, shielded_files, write_zip

PAGE, ZIP = "entry.html", "shielded.zip"


@dataclass(frozen=True)
class EntryGames(AblationSettings):
    """Games of an entry.

    Attributes:
        zip_file: the entry as it is handed in, which plays the same games without our shield: it decides once a
            decision of the game, and leaves boats that the game drives to it. Empty: there is none.
    """

    zip_file: str = ""

    def specs(self) -> list[MatchSpec]:
        """List all games: those of the entry without and with the shield, then those of the zip."""
        own = {entry.name: getattr(self, entry.name) for entry in fields(AblationSettings)}
        handed_in = AblationSettings(**{**own, "own": self.zip_file, "states": (False,)})
        return super().specs() + (handed_in.specs() if self.zip_file else [])

    def how_many(self) -> str:
        """How many games that are, in words."""
        ways = "bare, as the zip that is handed in, with the shield round the game"
        ways = ways if self.zip_file else "without the shield, with it"
        each, number = f"{self.games} game{'s' if self.games != 1 else ''}", len(self.opponents)
        against = f"each of {number} opponents" if number != 1 else self.opponents[0]
        return f"{each} against {against}, {ways}: {len(self.specs())} games in all"


def shielded_zip(
    entry: str, folder: Path, preset: str, shield: dict[str, Any], again: bool = False
) -> tuple[str, list[str]]:
    """Write what would be handed in into a folder of results, the same bytes every time; ``again``: over what is there.

    Returns:
        Its path, empty where there is none, and why there is none, in sentences.

    Raises:
        PolicyError: there is no entry.
        ConfigError: it cannot be written.
    """
    made, stage = made_for(entry), Stage(entry)
    try:
        if made is not None and made.shielded:
            return "", [f"{entry} is shielded already: off means its own shield alone"]
        if not GameConfig.preset(preset).shows_disabled:
            return "", [f"no zip is played: rules {preset} normalise the global state, which a zip reads in metres"]
        path = folder / ZIP
        if again or not path.exists():  # else the folder is another run's, and refused
            write_zip(path, shielded_files(game_spec(preset, shield), preset, own_files(stage.folder))[1])
        return str(path), []
    finally:
        stage.close()


def by_opponent(rows: Sequence[Row], settings: EntryGames) -> dict[str, tuple[list[Row], ...]]:
    """Games against each opponent that were played in every way: bare, (as the zip,) with the shield round the game."""
    ways = [(settings.own, False), *([(settings.zip_file, False)] if settings.zip_file else []), (settings.own, True)]
    found = {}
    for name in dict.fromkeys(row["opponent"] for row in rows):
        played = [
            {row["game"]: row for row in rows if row["opponent"] == name and (row["own"], bool(row["shielded"])) == way}
            for way in ways
        ]
        common = sorted(set.intersection(*map(set, played)))
        found[name] = tuple([each[game] for game in common] for each in played)
    return found


def net(row: Row) -> float:
    """Captures made less those of the other team."""
    return float(row["captures"] - row["captures_against"])


def net_change(off: Sequence[Row], on: Sequence[Row], seed: int = 0) -> Interval:
    """Mean change of the net of captures by the shield, with its 95 % interval over pairs of games."""
    return paired_difference([net(row) for row in off], [net(row) for row in on], seed)


def write_entry_page(
    rows: Sequence[Row],
    settings: EntryGames,
    folder: Path,
    links: Sequence[tuple[str, str]],
    warnings: Sequence[str],
) -> Path:
    """Write the page.

    Args:
        rows: the games.
        settings: what was played.
        folder: where to.
        links: label and file name of each game to look at, and of what else there is.
        warnings: sentences that a reader has to know first.

    Returns:
        The path written.

    Raises:
        ConfigError: the file cannot be written.
    """
    groups = by_opponent(rows, settings)
    page = render(
        "entry.html",
        title=f"{Path(settings.own).name} and the shield",
        subtitle=f"{settings.preset}, the shield keeps {settings.separation_m:g} m: {settings.how_many()}, from the "
        "same seeds.",
        warnings=warnings,
        ways=["bare", *(["the zip"] if settings.zip_file else []), "shield round the game"],
        tiles=_tiles(groups, settings),
        rows=[_opponent(name, group, settings) for name, group in groups.items()],
        radius=f"{settings.separation_m:g} m",
        links=links,
    )
    return write_page(folder / PAGE, page)


def _sums(rows: Sequence[Row], settings: EntryGames) -> dict[str, float]:
    """Totals of some games."""
    names = {
        "captures": "captures",
        "against": "captures_against",
        "counted": "collisions",
        "mates": breach_column("teammate", settings.separation_m),
        "opponents": breach_column("opponent", settings.separation_m),
    }
    return {short: float(sum(row[column] for row in rows)) for short, column in names.items()}


def _tiles(groups: Mapping[str, tuple[list[Row], ...]], settings: EntryGames) -> list[tuple[str, list[str], str]]:
    """Label, a figure for each way, and a note."""
    ways = [[row for group in each for row in group] for each in zip(*groups.values(), strict=True)]
    sums = [_sums(rows, settings) for rows in ways]
    games = max(1, len(ways[0]))
    looked = "a game, every step looked at"
    shown = (
        ("hits with opponents", "opponents", looked),
        ("hits with team-mates", "mates", looked),
        ("counted by the game", "counted", "a game, once a decision"),
        ("captures", "captures", "a game"),
    )
    tiles = [(label, [number_text(one[name] / games) for one in sums], note) for label, name, note in shown]
    nets = [number_text(float(np.mean([net(row) for row in rows])) if rows else 0.0) for rows in ways]
    return [*tiles, ("net of captures", nets, "made less given up, a game")]


def _opponent(name: str, group: tuple[list[Row], ...], settings: EntryGames) -> list[str]:
    """Row of the table: one opponent, totals of all games that were played in every way."""
    sums = [_sums(rows, settings) for rows in group]
    cells = [Path(name).name, str(len(group[0]))]
    for column in ("captures", "against", "mates", "opponents", "counted"):
        cells.append(" → ".join(f"{one[column]:g}" for one in sums))
    changes = [net_change(group[0], rows, settings.seed) for rows in group[1:] if rows]
    cells.insert(4, " → ".join(map(_change_text, changes)) or "-")
    return cells


def _change_text(change: Interval) -> str:
    limits = "" if change.low != change.low else f" [{number_text(change.low)}, {number_text(change.high)}]"
    return f"{number_text(change.value)}{limits}"


def games_to_look_at(rows: Sequence[Row], settings: EntryGames, most: int) -> list[tuple[str, Row, Row]]:
    """Pairs of games off and on with why they are worth a look: most hits off, hits on, most captures lost.

    Each pair once, at most so many.
    """
    pairs = [pair for bare, *_, on in by_opponent(rows, settings).values() for pair in zip(bare, on, strict=True)]
    columns = [breach_column(kind, settings.separation_m) for kind in ("teammate", "opponent")]

    def hits(row: Mapping[str, Any]) -> int:
        return sum(int(row[column]) for column in columns)

    rated = [
        ("most hits without the shield", lambda pair: hits(pair[0])),
        ("hits with the shield", lambda pair: hits(pair[1])),
        ("captures lost with the shield", lambda pair: net(pair[0]) - net(pair[1])),
    ]
    chosen: list[tuple[str, Row, Row]] = []
    for words, worth in rated:
        best = max(pairs, key=worth, default=None)
        if best is None or worth(best) <= 0 or any(best[1] is row for _, _, row in chosen):
            continue
        chosen.append((words, *best))
    return chosen[:most]
