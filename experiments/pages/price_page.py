"""The page of what safety costs: how long opponents are feared for, against hits and play, from ablations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear.shield.config import ShieldConfig

from ..measure.tally import RADII_M, breach_column
from ..report.markdown import MADE, line, table
from ..report.tables import interval_text

STEM = "price"
_DIALS = ("adversary_s", "visitor_s", "profile")
_HEADS = (
    "feared, s",
    "changed, %",
    "hits opp.",
    "hits mates",
    "captures",
    "against",
    "net, on - off",
    "tags, on - off",
    "primary, on - off",
    "games",
    "version",
)


def is_shielded(content: Mapping[str, Any]) -> bool:
    """Whether results are of an ablation with a shield; one that was told no time has that of the default profile."""
    return content.get("command") == "ablate" and isinstance(content.get("settings", {}).get("shield"), Mapping)


def is_dial(content: Mapping[str, Any]) -> bool:
    """Whether results are of an ablation that was told how long opponents are feared for."""
    return is_shielded(content) and bool(set(_DIALS) & set(content["settings"]["shield"]))


ADVICE = (
    "What to set when: `players` (the default) against teams that play; `rammers` where nobody may be hit, where boats "
    "often lie still (which single rammers hit: see [encounters by family](measured/comparison.md), `at_rest`), and on "
    "boats, as `FLEET.yaml` does; `hold-course` where opponents are traffic and not a team. Any two other "
    "settings are compared, paired, by `steerclear compare` ([settings](settings.md))."
)
"""Beside the figures: which of the profiles is for whom."""


def price_page(found: Sequence[Mapping[str, Any]], folder: Path) -> tuple[str, str, list[Path]]:
    """Name and text of the page, and its pictures.

    Args:
        found: results of ablations, see `is_shielded`.
        folder: where the pictures go.
    """
    groups = _groups(found)
    words = (
        "How long an opponent may do its worst before it holds its course (`adversary_s`) decides what safety costs. "
        "Hits are entries into the distance kept, per game; differences are paired, shield on less off, same seeds; "
        "95 % intervals. `0` takes opponents to hold their course, `inf` to hunt for ever; the second of two is "
        "for those on our side of the field (`visitor_s`), which can tag nobody there. Each row is of the version that "
        "measured it. Boats that are slow fear for longer than that."
    )
    lines = ["# Safety and its price", "", MADE, "", words, "", ADVICE, ""]
    picture = folder / f"{STEM}.png"
    _plot(groups, picture)
    lines += [f"![hits against changed commands]({picture.name})", ""]
    for (preset, radius_m, pairing), runs in groups.items():
        lines += [f"## {line(preset)}, {radius_m:g} m: {line(pairing)}", ""]
        lines += [*table(_HEADS, [_row(fear, content, summary, radius_m) for fear, content, summary in runs]), ""]
    return f"{STEM}.md", "\n".join(lines), [picture]


_Fear = tuple[float, float]
"""How long opponents are feared for, and how long on our side of the field, s."""

_Run = tuple[_Fear, Mapping[str, Any], Mapping[str, Any]]
_Groups = dict[tuple[str, float, str], list[_Run]]


def _groups(found: Sequence[Mapping[str, Any]]) -> _Groups:
    """Runs by preset, distance and pairing, each with its time, the least first."""
    groups: _Groups = {}
    for content in found:
        shield = content["settings"]["shield"]
        dials = {name: math.inf if value == "inf" else value for name, value in shield.items() if name in _DIALS}
        config = ShieldConfig.of(**dials)
        fear_s = config.feared_s, config.visitor_feared_s
        radius_m = float(shield.get("separation_m", RADII_M[0]))
        for summary in content["pairings"]:
            key = (content["settings"]["preset"], radius_m, summary["pairing"])
            groups.setdefault(key, []).append((fear_s, content, summary))
    return {key: sorted(groups[key], key=lambda run: run[0]) for key in sorted(groups)}


def _told_fear(fear_s: _Fear) -> str:
    always, visiting = fear_s
    return f"{always:g}" if always == visiting else f"{always:g} / {visiting:g}"


def _row(fear_s: _Fear, content: Mapping[str, Any], summary: Mapping[str, Any], radius_m: float) -> list[str]:
    metrics = summary["metrics"]

    def told(name: str, state: str) -> str:
        return interval_text(metrics[name][state]) if state in metrics.get(name, {}) else "-"

    return [
        _told_fear(fear_s),
        told("changed_share", "on"),
        told(breach_column("opponent", radius_m), "on"),
        told(breach_column("teammate", radius_m), "on"),
        told("captures", "on"),
        told("captures_against", "on"),
        told("net_captures", "difference"),
        told("tags", "difference"),
        told("primary", "difference"),
        f"{summary['games_on']}",
        str(content.get("versions", {}).get("steerclear", "-")),
    ]


_MARKERS = "osD^vPX*<>"
"""One for each time that opponents are feared for, the least first."""


def _plot(groups: _Groups, path: Path) -> None:
    """Hits with opponents and net of captures against commands changed: a column a game, a line an opponent."""
    from matplotlib.figure import Figure  # without pyplot: no window system is touched
    from matplotlib.lines import Line2D

    games = list(dict.fromkeys((preset, radius_m) for preset, radius_m, _ in groups))
    pairings = list(dict.fromkeys(pairing for _, _, pairing in groups))
    fears = sorted({fear_s for runs in groups.values() for fear_s, _, _ in runs})
    marker = {fear_s: _MARKERS[k % len(_MARKERS)] for k, fear_s in enumerate(fears)}
    canvas = Figure(figsize=(2.9 * len(games) + 0.6, 5.4), layout="constrained", dpi=150)
    axes = canvas.subplots(2, len(games), squeeze=False, sharex="col", sharey="row")
    for (preset, radius_m, pairing), runs in groups.items():
        column, colour = games.index((preset, radius_m)), f"C{pairings.index(pairing)}"
        changed = [summary["metrics"]["changed_share"]["on"]["value"] for _, _, summary in runs]
        for axis, name, state in (
            (axes[0, column], breach_column("opponent", radius_m), "on"),
            (axes[1, column], "net_captures", "difference"),
        ):
            values = [summary["metrics"][name][state]["value"] for _, _, summary in runs]
            axis.plot(changed, values, "-", lw=0.8, color=colour)
            for x, y, (fear_s, _, _) in zip(changed, values, runs, strict=True):
                axis.plot(x, y, marker[fear_s], ms=4.5, color=colour, mec="white", mew=0.5)
    for (preset, radius_m), column in zip(games, axes.T, strict=True):
        column[0].set_title(f"{preset}, {radius_m:g} m", fontsize=9)
        column[1].set_xlabel("commands changed, %")
    axes[0, 0].set_ylabel("hits with opponents, per game")
    axes[1, 0].set_ylabel("net of captures, on - off")
    for axis in axes.flat:
        axis.axhline(0.0, color="#999999", lw=0.6)
        axis.margins(x=0.08)
        axis.spines[["top", "right"]].set_visible(False)
    handles = [Line2D([], [], color=f"C{k}", label=pairing) for k, pairing in enumerate(pairings)]
    handles += [
        Line2D([], [], ls="", marker=marker[fear_s], color="#555555", label=f"{_told_fear(fear_s)} s")
        for fear_s in fears
    ]
    canvas.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7, frameon=False)
    canvas.savefig(path)
