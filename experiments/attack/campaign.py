"""Many searches, each kept on disk when it ends; scenes, replay and results of what they found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.console import Group

from ..encounters.guards import NONE
from ..encounters.play import play
from ..encounters.replays import records_of
from ..encounters.results import is_shield
from ..encounters.scene_file import scenes_of
from ..report.replay_html import write_replay
from ..report.tables import number_text, titled
from ..runs.pool import Engine, run_all
from ..runs.provenance import machine, versions
from ..runs.store import LINES_FILE, ResultStore, write_json
from .search import Search, run_search

MOST_REPLAYS = 10


def searches_of(first: Search, restarts: int) -> list[Search]:
    """The same search from so many starts."""
    return [replace(first, restart=k) for k in range(restarts)]


def run_searches(
    searches: Sequence[Search], store: ResultStore, processes: int | Engine, notice: Callable[[int], None]
) -> list[dict[str, Any]]:
    """Run what is not in the store yet; return what failed."""
    before, failed = store.load(), []
    missing = [search for search in searches if search.key not in before]
    done = len(searches) - len(missing)
    notice(done)
    for outcome in run_all(run_search, missing, processes):
        if outcome.answer is None:
            failed.append({"restart": outcome.job.restart, **outcome.why})
        else:
            store.append(outcome.job.key, outcome.answer)
        done += 1
        notice(done)
    return failed


def write_all(
    folder: Path, searches: Sequence[Search], store: ResultStore, failed: Sequence[Any], wall_s: float
) -> dict[str, Any]:
    """Write scenes, replay and results.json of what is in the store; return the content of results.json."""
    kept = store.load()
    found = [kept[search.key] for search in searches if search.key in kept]
    files: dict[str, str] = {"searches": LINES_FILE, "results": "results.json"}
    rows = []
    for entry in found:
        name = None
        if entry["scene"] is not None:
            name = f"scenes/attack-{entry['restart']:03d}.json"
            write_json(folder / name, entry["scene"])
        rows.append({k: v for k, v in entry.items() if k not in ("scene", "closest_scene")} | {"scene": name})
    if found:
        files["replay"] = _write_replay(folder, searches[0].guard, found).name
    results = {
        "command": "attack",
        "settings": {**asdict(searches[0]), "restarts": len(searches)},
        "versions": versions(),
        "machine": machine(),
        "wall_s": wall_s,
        "searches": rows,
        "failed": list(failed),
        "found": sum(row["scene"] is not None for row in rows),
        "files": files,
    }
    write_json(folder / "results.json", results)
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
