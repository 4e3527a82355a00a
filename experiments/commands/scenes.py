"""Playing scene files: what ``encounters --scene`` and ``attack --replay`` do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from steerclear.shield.exceptions import ConfigError

from ..baselines.registry import NONE, is_shield
from ..encounters.outcomes import measure_chunk
from ..encounters.replay import record_of
from ..encounters.scene import read_scene
from ..encounters.simulate import play
from ..replay_html import write_replay
from ..result_files import check_new
from ..tables import number_text, titled
from .console import out


def play_scene_files(paths: Sequence[Path], guards: Sequence[str], folder: Path | None, judge: bool = True) -> bool:
    """Play every scene of the files with every guard; print a table, write a replay when there is a folder.

    Returns:
        Whether no shield had an avoidable breach.

    Raises:
        SteerclearError: a file that is no scene, a guard that cannot be made, or a folder with another replay.
    """
    replay = None if folder is None else folder / "replay.html"
    check_new(replay, "--out")
    rows, records, passed = [], [], True
    for path in paths:
        scenes, conditions = read_scene(path)
        for guard in guards:
            columns = measure_chunk(scenes, guard, conditions, judge)
            hits = int((columns["breaches_teammate"] + columns["breaches_opponent"]).sum())
            avoidable = int(columns["avoidable"].sum())
            rows.append([path.name, guard, number_text(float(columns["closest_m"].min())), f"{hits}", f"{avoidable}"])
            passed = passed and not (avoidable and is_shield(guard))
            if folder is not None:
                played, worst = play(scenes, guard, conditions), int(columns["game"][columns["closest_m"].argmin()])
                records.append(record_of(played, worst, f"{path.stem}, {guard}", guard != NONE))
    out().print(titled("Scenes", ["file", "guard", "closest, m", "breaches", "avoidable"], rows))
    if replay is not None:
        _make(replay.parent)
        out().print(f"{write_replay(records, replay, title='Scenes')}", soft_wrap=True)
    return passed


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write to {folder} ({error.strerror}); choose another --out") from error
