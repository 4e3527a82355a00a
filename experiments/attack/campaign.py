"""Many searches, each kept on disk when it ends; scenes, replay and results of what they found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.console import Group

from ..encounters.guards import NONE
from ..encounters.play import play
from ..encounters.replays import records_of
from ..encounters.results import is_shield
from ..encounters.scene_file import scenes_of
from ..replay_html import write_replay
from ..result_files import write_json
from ..runner import RESULTS_FILE, ROWS_FILE, Experiment, Run
from ..tables import number_text, titled
from ..warming import compile_encounters, compile_judge
from .search import Search, run_job

MOST_REPLAYS = 10


def experiment_of(first: Search, restarts: int) -> Experiment:
    """The same search from so many starts."""
    jobs = [asdict(replace(first, restart=k)) for k in range(restarts)]
    settings = {**asdict(first), "restarts": restarts}
    return Experiment("attack", settings, jobs, run_job, "searches", (compile_encounters, compile_judge))


def write_all(run: Run) -> dict[str, Any]:
    """Write scenes, replay and results.json of what was found; return the content of results.json."""
    files: dict[str, str] = {"searches": ROWS_FILE, "results": RESULTS_FILE}
    rows = []
    for entry in run.rows:
        name = None
        if entry["scene"] is not None:
            name = f"scenes/attack-{entry['restart']:03d}.json"
            write_json(run.folder / name, entry["scene"])
        rows.append({k: v for k, v in entry.items() if k not in ("scene", "closest_scene")} | {"scene": name})
    if run.rows and not run.interrupted:
        files["replay"] = _write_replay(run.folder, run.experiment.settings["guard"], run.rows).name
    results = {
        **run.head(),
        "searches": rows,
        "failed": [{name: job[name] for name in ("restart", "error", "fault")} for job in run.failed],
        "found": sum(row["scene"] is not None for row in rows),
        "files": files,
    }
    run.write(results)
    return results


def _write_replay(folder: Path, guard: str, found: Sequence[dict[str, Any]]) -> Path:
    """The avoidable breaches, then the closest, each with the guard and without."""
    order = sorted(found, key=lambda entry: (entry["scene"] is None, entry["closest_m"]))[:MOST_REPLAYS]
    records = []
    for entry in order:
        scenes, conditions = scenes_of(entry["scene"] or entry["closest_scene"])
        words = "avoidable breach" if entry["scene"] else f"closest {entry['closest_m']:.2f} m"
        films = [(play(scenes, name, conditions), name) for name in dict.fromkeys((guard, NONE))]
        records += records_of(films, 0, f"search {entry['restart']}, {words}")
    return write_replay(records, folder / "replay.html", title="Attacks")


def searches_table(results: dict[str, Any]) -> Group:
    """Table for the terminal."""
    settings = results["settings"]
    title = (
        f"{settings['attackers']} {settings['other']} against {settings['own_boats']} {settings['own']}, "
        f"guard {settings['guard']}"
    )
    rows = [
        [
            f"{row['restart']}",
            f"{row['tried']}",
            number_text(row["closest_m"]),
            f"{row['breached']}",
            f"{len(row['judged'])}",
            row["scene"] or "-",
        ]
        for row in results["searches"]
    ]
    return titled(title, ["search", "tried", "closest, m", "breached", "judged", "avoidable"], rows)


def passed(results: dict[str, Any]) -> bool:
    """Whether no shield was made to breach avoidably."""
    return not (results["found"] and is_shield(results["settings"]["guard"]))
