"""``steerclear demonstrate``: a person plays by choosing options; what was chosen is kept for learners."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from steerclear.policies.entrants.demonstrator import BOAT_KEYS, OPTION_KEYS, Demonstrator
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import install_command

from ..play.match import Match
from ..play.spec import MatchSpec
from ..result_files import NEW, write_table
from ..tables import game_table
from . import options as o
from .console import command, err, out
from .files import check_ending
from .play import Opponent, Shield, Side, Speed, _until_closed

File = Annotated[Path, typer.Option("--out", metavar="FILE.parquet", help="Where demonstrations go; a new file."), NEW]
OPPONENTS = ("easy", "medium")
HOW = (
    f"{', '.join(BOAT_KEYS[:3])} choose a boat; "
    + ", ".join(f"{key} {name}" for key, name in OPTION_KEYS.items())
    + "; close the window to end"
)


@command
def demonstrate(
    opponent: Opponent = "easy",
    preset: o.Preset = "aamas2024",
    side: Side = "blue",
    shield: Shield = True,
    seed: o.Seed = 0,
    speed: Speed = 2.0,
    file: File = Path("demonstration.parquet"),
    max_time: o.MaxTime = None,
) -> None:
    """Play in a window by choosing an option for each boat; keep what was chosen, and at what sight, as Parquet.

    Exit status: 0 done, 2 bad input, 130 interrupted.
    """
    _check(opponent, file)
    err().print(HOW, soft_wrap=True)
    spec = MatchSpec(
        preset=preset,
        own="options",
        opponent=opponent,
        seed=seed,
        side=side,
        shield={} if shield else None,
        rules=o.game_settings(max_time, None, None),
        judge="none",
    )
    rows, row = demonstration(spec, Demonstrator(say=lambda words: err().print(words, highlight=False)), speed)
    out().print(game_table(row, spec.radii_m))
    out().print(f"{keep(rows, file)}", soft_wrap=True)


def demonstration(
    spec: MatchSpec, demonstrator: Demonstrator, speed: float = 1.0, mode: str | None = "human"
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Play one game; its demonstrations, each with the game's spec and result beside it, and the game's row.

    Args:
        spec: the game.
        demonstrator: the person's team.
        speed: times faster than the game that the window goes at most.
        mode: "human" opens the window; None where keys come from elsewhere.
    """
    match = Match(spec, mode, speed)
    try:
        match.seat(spec.own_team, demonstrator)
        row = match.play(None if mode is None else _until_closed).row
    finally:
        match.close()
    about = {name: row[name] for name in ("preset", "opponent", "side", "seed", "captures", "captures_against")}
    return [{**about, **one} for one in demonstrator.rows], row


def keep(rows: list[dict[str, Any]], file: Path) -> Path:
    """Write demonstrations.

    Raises:
        ConfigError: the file cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {file} ({error.strerror}); choose another --out") from error
    return write_table(file.parent, rows, file.stem)


def _check(opponent: str, file: Path) -> None:
    """Refuse before the window opens what would lose a person's play.

    Raises:
        ConfigError: another opponent, another kind of file, or pyarrow missing.
    """
    if opponent not in OPPONENTS:
        raise ConfigError(f"--opponent is {opponent!r}; demonstrations are against {' or '.join(OPPONENTS)}")
    check_ending(file, "--out", (".parquet",))
    if find_spec("pyarrow") is None:
        raise ConfigError(f"Parquet files need pyarrow; {install_command('parquet')}")
