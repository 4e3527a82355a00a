"""``steerclear fit``: a platform file from logs of a boat."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms.files import to_text

from ..fit.fitting import best_of, fit_runs, platform_file, results_of
from ..fit.models import MODELS
from ..fit.plot import draw
from ..fit.reading import read_logs
from ..fit.words import about_the_boat, promise
from ..result_files import NEW, check_new, make_folder_of, write_json
from . import options as o
from .console import command, err, out
from .files import check_each_once, check_ending

Logs = Annotated[
    list[Path],
    typer.Argument(metavar="LOG...", help="Logs of one boat: .csv of steps, .tlog, ArduPilot .bin, .mcap, .alog."),
]
Out = Annotated[Path, typer.Option("--out", metavar="FILE", help="Platform file to write (.yaml); a new one."), NEW]
Name = Annotated[str | None, typer.Option(metavar="NAME", help="Of the boat.", show_default="the file's name")]
Kind = Annotated[str, typer.Option(metavar="KIND", help="rate, usv, or auto: the one that predicts best.")]
Boat = Annotated[str | None, typer.Option(metavar="NAME", help="The boat, of a black-box log with several.")]
SystemId = Annotated[int | None, typer.Option(metavar="N", help="The boat, of a .tlog with several.")]
Plot = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Picture of the fit, a new file.", show_default="beside --out, .png"),
    NEW,
]


@command
def fit(
    logs: Logs,
    file: Out = Path("boat.yaml"),
    name: Name = None,
    kind: Kind = "auto",
    boat: Boat = None,
    system_id: SystemId = None,
    plot: Plot = None,
    json_file: o.JsonFile = None,
) -> None:
    """Fit a boat to its logs: model, delay and a margin that covers 99 % of what it misses on held-out runs.

    Exit status: 0 done, 2 bad input or too little to fit, 130 interrupted.
    """
    check_each_once(logs, "LOG...")  # else a run would be held out from a fit to itself
    check_ending(file, "--out", (".yaml", ".yml"))
    picture = plot or file.with_suffix(".png")
    check_ending(picture, "--plot", (".png", ".pdf", ".svg"))
    check_new(picture, "--plot")
    if kind != "auto" and kind not in MODELS:
        raise ConfigError(f"--kind is {kind!r}; give auto or one of {', '.join(MODELS)}")
    left_out: list[str] = []
    runs = read_logs(logs, boat, system_id, left_out.append)
    for words in left_out:
        err().print(f"left out: {words}", style="yellow", markup=False, soft_wrap=True)
    kinds = tuple(MODELS) if kind == "auto" else (kind,)
    found = fit_runs(runs, kinds, lambda words: err().print(f"fitting {len(runs)} runs as {words} ...", style="dim"))
    chosen = best_of(found)
    described = platform_file(found[chosen], name or file.stem)
    results = results_of(found, chosen, described) | {"left_out": left_out}
    head = f"Fitted by steerclear fit to {len(runs)} runs of {', '.join(sorted({log.name for log in logs}))[:200]}."
    _write(file, to_text(described, head))
    make_folder_of(picture)
    draw(found[chosen], described.platform.name, picture)
    if json_file is not None:
        write_json(json_file, results)
    _show(results, chosen)
    for line in (*about_the_boat(described.platform), *promise(described)):
        out().print(line, soft_wrap=True)
    out().print(f"{file}\n{picture}", soft_wrap=True, markup=False)


def _write(file: Path, text: str) -> None:
    try:
        make_folder_of(file)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {file} cannot be written ({error.strerror}); choose another place") from None


def _show(results: dict[str, Any], chosen: str) -> None:
    table = Table(title="held-out errors of the place, m (median / 99 of 100)", title_justify="left")
    table.add_column("model")
    for at in ("1 s", "3 s", "6 s"):
        table.add_column(f"{at} ahead", justify="right")
    for kind, errors in results["errors_m"].items():
        mark = " (taken)" if kind == chosen else ""
        table.add_row(kind + mark, *(f"{one['median']:.2f} / {one['p99']:.2f}" for one in errors.values()))
    out().print(table)
    alone = sorted({run["name"] for run in results["runs"] if not run["held_out"]})
    if alone:
        out().print(f"The only ones of their kind, and so not held out: {', '.join(alone)}.", soft_wrap=True)
    medians = results["median_3_s_by_manoeuvre_m"]
    out().print("Median 3 s ahead: " + ", ".join(f"{kind} {value:.2f} m" for kind, value in medians.items()) + ".")
