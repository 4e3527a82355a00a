"""An entry's games three ways and their report: alone, as the zip handed in, with the shield round the game."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from steerclear.env.config import GameConfig
from steerclear.policies.submissions.made_for import made_for
from steerclear.policies.submissions.stage import Stage

from ..ablation import DIFFERENCES, AblationSettings
from ..metrics import check, game_goals, violation_column
from ..play.spec import MatchSpec
from ..report import Report, Section, way_tiles
from ..runner import Experiment
from ..statistics import paired_difference
from ..tables import AROUND, BARE, IN_ZIP, Table, interval_text
from ..words import count_text
from ..workers import Row
from .wrap import game_spec, own_files, shielded_files, write_zip

if TYPE_CHECKING:
    import pandas as pd

PAGE, ZIP = "entry.html", "shielded.zip"
SUMS = ("captures", "captures_against", "teammates", "opponents", "collisions")
HEADS = [
    *("opponent", "games", "captures", "given up", "change of the net, a game"),
    *("hits with teammates", "hits with opponents", "counted by the game"),
]
HIT = (
    "A hit is one entry of two boats into {radius:g} m, looked for after every step of motion; the game itself looks "
    "once a decision, and counts two teammates that meet twice. In brackets the 95 % interval of the paired change: "
    "where it holds 0, the games do not say that the shield costs captures."
)
OF_ZIP = (
    "The zip is what steerclear entry wrap writes: it decides once a decision of the game, and boats that the game "
    "drives (tagged, out of bounds, disabled) are out of its reach. The shield round the game decides before every "
    "step, and steers tagged boats and those out of bounds, too. "
)


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

    def experiment(self, command: str) -> Experiment:
        """What `runner.execute` runs; it tells first how many games that are."""
        return replace(super().experiment(command), about=self.how_many())

    def goals(self, table: pd.DataFrame) -> list[dict[str, Any]]:
        """Judge the zip, which is handed in, and then the shield round the game, each against the bare entry."""
        import pandas as pd

        if table.empty:  # interrupted before the first game ended
            return []
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
        return {"off": super().heads(pairing).get("off", BARE), "on": AROUND, **DIFFERENCES}

    def how_many(self) -> str:
        """How many games that are, in words."""
        ways, number = ", ".join(self.ways()), len(self.opponents)
        against = f"each of {number} opponents" if number != 1 else self.opponents[0]
        total = count_text(len(self.specs()), "game")
        return f"{count_text(self.games, 'game')} against {against}; {ways}: {total} in all"

    def ways(self) -> list[str]:
        """Names of the ways each game is played, in order."""
        return [self.heads("")["off"], *([IN_ZIP] if self.zip_file else []), AROUND]


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

    columns = {f"{kind}s": violation_column(kind, settings.separation_m) for kind in ("teammate", "opponent")}
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


def entry_report(rows: Sequence[Row], settings: EntryGames) -> Report:
    """The report of the games: sums of all games against each opponent, and of all together."""
    import pandas as pd

    groups = by_opponent(rows, settings)
    body = [_line(Path(name).name, games, settings.seed) for name, games in groups.items()]
    together = [pd.concat(games) for games in zip(*groups.values(), strict=True)]
    if len(body) > 1:
        body.append(_line("all together", together, settings.seed))
    means = [{column: float(games[column].mean()) for column in SUMS} for games in together if len(games)]
    words = (OF_ZIP if settings.zip_file else "") + HIT.format(radius=settings.separation_m)
    return Report(
        f"{Path(settings.own).name} and the shield",
        f"{settings.preset}, the shield keeps {settings.separation_m:g} m: {settings.how_many()}, from the same seeds.",
        tiles=way_tiles(dict(zip(settings.ways(), means, strict=False)), settings.separation_m),
        sections=[
            Section(f"Sums of all games, {' → '.join(settings.ways())}", [Table("", HEADS, body)], words, wide=True)
        ],
    )


def _line(name: str, ways: Sequence[pd.DataFrame], seed: int) -> list[str]:
    """Row of the table: totals of games that were played in every way."""
    changes = [paired_difference(ways[0]["net"], games["net"], seed) for games in ways[1:] if len(games)]
    sums = ["\u00a0→\u00a0".join(f"{games[column].sum():g}" for games in ways) for column in SUMS]
    change = " → ".join(interval_text(asdict(one)) for one in changes) or "-"
    return [name, str(len(ways[0])), *sums[:2], change, *sums[2:]]


def games_to_look_at(rows: Sequence[Row], settings: EntryGames) -> list[tuple[str, Row, Row]]:
    """Pairs of games off and on, each once, and why to look at them: most hits off, hits on, captures lost."""
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
    return [(words, played[(*game, False)], played[(*game, True)]) for game, words in chosen.items()]
