"""An entry's games three ways and their page: alone, as the zip that is handed in, with the shield round the game."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steerclear.env.config import GameConfig
from steerclear.policies.submissions.made_for import made_for
from steerclear.policies.submissions.stage import Stage

from ..ablation import AblationSettings
from ..metrics import breach_column, check, game_goals
from ..page import render, write_page
from ..play.spec import MatchSpec
from ..statistics import paired_difference
from ..tables import interval_text, number_text
from ..workers import Row
from .package import game_spec
from .wrap import own_files, shielded_files, write_zip

if TYPE_CHECKING:
    import pandas as pd

PAGE, ZIP = "entry.html", "shielded.zip"
BARE, IN_ZIP, AROUND = "entry alone", "shield in the zip", "shield round the game"
"""What a figure is of: no shield, that of the zip that is handed in, or one that decides ten times a second."""
LOOKED = "a game, every step looked at"
TILES = (
    ("opponents", "hits with opponents", LOOKED),
    ("teammates", "hits with teammates", LOOKED),
    ("collisions", "counted by the game", "a game, once a decision"),
    ("captures", "captures", "a game"),
    ("net", "net of captures", "made less given up, a game"),
)
SUMS = ("captures", "captures_against", "teammates", "opponents", "collisions")
"""Columns of totals in the table."""


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

    def goals(self, table: pd.DataFrame) -> list[dict[str, Any]]:
        """Judge the zip, which is handed in, and then the shield round the game, each against the bare entry."""
        import pandas as pd

        bare = table[(table["own"] == self.own) & ~table["shielded"]]
        of_zip = table[table["own"] == self.zip_file].assign(shielded=True)
        of_zip = of_zip.assign(pairing=self.own + " vs " + of_zip["opponent"])
        around = table[(table["own"] == self.own) & table["shielded"]]
        return [
            {**goal, "name": f"{words}: {goal['name']}"}
            for words, games in ((IN_ZIP, of_zip), (AROUND, around))
            if len(bare) and len(games)
            for goal in check(game_goals(self.separation_m), pd.concat([bare, games]))
        ]

    def heads(self, pairing: str) -> dict[str, str]:
        """Which shield the figures of a pairing are of."""
        if self.zip_file and pairing.startswith(f"{self.zip_file} vs "):
            return {"off": IN_ZIP}
        return {"off": BARE, "on": AROUND, "difference": "difference, paired"}

    def how_many(self) -> str:
        """How many games that are, in words."""
        ways = ", ".join([BARE, *([IN_ZIP] if self.zip_file else []), AROUND])
        each, number = f"{self.games} game{'s' if self.games != 1 else ''}", len(self.opponents)
        against = f"each of {number} opponents" if number != 1 else self.opponents[0]
        return f"{each} against {against}; {ways}: {len(self.specs())} games in all"


def shielded_zip(
    entry: str, folder: Path, preset: str, shield: dict[str, Any], again: bool = False
) -> tuple[str, list[str]]:
    """Write what would be handed in into a folder of results, the same bytes every time; ``again``: over what is there.

    Returns:
        Its path, empty where there is none, and why there is none, in sentences.
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


def by_opponent(rows: Sequence[Row], settings: EntryGames) -> dict[str, list[pd.DataFrame]]:
    """Games against each opponent that were played in every way: alone, (as the zip,) with the shield round the game.

    Returns:
        Tables by game, with the columns ``net`` (captures made less given up), ``teammates`` and ``opponents`` (hits).
    """
    import pandas as pd

    columns = {f"{kind}s": breach_column(kind, settings.separation_m) for kind in ("teammate", "opponent")}
    table = pd.DataFrame(rows).rename(columns={column: name for name, column in columns.items()})
    table["net"] = table["captures"] - table["captures_against"]
    ways = [(settings.own, False), *([(settings.zip_file, False)] if settings.zip_file else []), (settings.own, True)]
    found = {}
    for name, played in table.groupby("opponent", sort=False):
        each = [
            played[(played["own"] == own) & (played["shielded"].astype(bool) == shielded)].set_index("game")
            for own, shielded in ways
        ]
        common = sorted(set.intersection(*(set(one.index) for one in each)))
        found[str(name)] = [one.loc[common] for one in each]
    return found


def write_entry_page(
    rows: Sequence[Row],
    settings: EntryGames,
    folder: Path,
    links: Sequence[tuple[str, str]],
    warnings: Sequence[str],
) -> Path:
    """Write the page of the games, with links (label, file name) to what there is to look at, and warnings first."""
    groups = by_opponent(rows, settings)
    page = render(
        "entry.html",
        title=f"{Path(settings.own).name} and the shield",
        subtitle=f"{settings.preset}, the shield keeps {settings.separation_m:g} m: {settings.how_many()}, from the "
        "same seeds.",
        warnings=warnings,
        ways=[BARE, *([IN_ZIP] if settings.zip_file else []), AROUND],
        tiles=_tiles(groups),
        rows=[_opponent(name, ways, settings.seed) for name, ways in groups.items()],
        radius=f"{settings.separation_m:g} m",
        links=links,
    )
    return write_page(folder / PAGE, page)


def _tiles(groups: Mapping[str, Sequence[pd.DataFrame]]) -> list[tuple[str, list[str], str]]:
    """Label, a figure a game for each way, and a note."""
    import pandas as pd

    ways = [pd.concat(each) for each in zip(*groups.values(), strict=True)]
    return [
        (label, [number_text(float(games[column].mean()) if len(games) else 0.0) for games in ways], note)
        for column, label, note in TILES
    ]


def _opponent(name: str, ways: Sequence[pd.DataFrame], seed: int) -> list[str]:
    """Row of the table: one opponent, totals of all games that were played in every way."""
    changes = [paired_difference(ways[0]["net"], games["net"], seed) for games in ways[1:] if len(games)]
    sums = [" → ".join(f"{games[column].sum():g}" for games in ways) for column in SUMS]
    change = " → ".join(interval_text(asdict(one)) for one in changes) or "-"
    return [Path(name).name, str(len(ways[0])), *sums[:2], change, *sums[2:]]


def games_to_look_at(rows: Sequence[Row], settings: EntryGames, most: int) -> list[tuple[str, Row, Row]]:
    """Pairs of games off and on with why they are worth a look: most hits off, hits on, most captures lost.

    Each pair once, at most so many.
    """
    import pandas as pd

    groups = [(ways[0], ways[-1]) for ways in by_opponent(rows, settings).values()]
    off, on = (pd.concat(games).reset_index() for games in zip(*groups, strict=True)) if groups else (None, None)
    if off is None or on is None:
        return []
    played = {(row["opponent"], row["game"], bool(row["shielded"])): row for row in rows if row["own"] == settings.own}
    chosen: dict[tuple[str, int], str] = {}
    for words, worth in (
        ("most hits without the shield", off["teammates"] + off["opponents"]),
        ("hits with the shield", on["teammates"] + on["opponents"]),
        ("captures lost with the shield", off["net"] - on["net"]),
    ):
        if len(worth) and worth.max() > 0:
            best = worth.idxmax()
            chosen.setdefault((off.at[best, "opponent"], off.at[best, "game"]), words)
    pairs = [(words, played[(*game, False)], played[(*game, True)]) for game, words in chosen.items()]
    return pairs[:most]
