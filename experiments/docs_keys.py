"""Every key of the JSON and tables that the commands write, with its meaning and unit: ``templates/json_keys.txt``.

The page of keys is made of it; tests walk real results and fail on a key that is not there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from jinja2 import Environment

from .deploy.keys import DEPLOY, REFEREE, REPLAY
from .encounters.attack import KEYS as ATTACK
from .encounters.figures import KEYS as ENCOUNTERS
from .metrics import game_metrics_of
from .page import template


def _read() -> dict[str, dict[str, str]]:
    metrics = game_metrics_of()
    text = Environment(trim_blocks=True, lstrip_blocks=True).from_string(template("json_keys.txt"))
    meanings = {metric.key: metric.meaning for metric in metrics}
    columns = {
        re.sub(r"_\d+\.\d+m$", "_*", metric.column): metric.meaning
        for metric in metrics
        if metric.kind not in ("percent", "least")
    }
    keys: dict[str, dict[str, str]] = {}
    for section in text.render(
        meanings=meanings, columns=columns, encounters=ENCOUNTERS, attack=ATTACK, deploy=DEPLOY, referee=REFEREE,
        replay=REPLAY,
    ).split("\n## ")[1:]:  # fmt: skip
        commands, *lines = section.strip().splitlines()
        entries = dict(line.split(": ", 1) for line in lines if line)
        shown, _, part = commands.rpartition(" of ")
        keys |= {(f"{shown} of {name}" if shown else name): entries for name in part.split(", ")}
    return keys


KEYS = _read()
"""Meaning of each key by command; ``rows of COMMAND``: of the columns of its rows."""


def undocumented(content: Mapping[str, Any], documented: Mapping[str, str]) -> list[str]:
    """Return the key paths of ``content`` that ``documented`` does not describe."""
    patterns = [re.compile(_pattern(name)) for name in documented]
    return sorted({path for path in paths_of(content) if not any(p.fullmatch(path) for p in patterns)})


def paths_of(content: Any, path: str = "") -> Iterator[str]:
    """Yield the path of every value: ``a.b[].c``."""
    if isinstance(content, Mapping) and content:
        for name, value in content.items():
            yield from paths_of(value, f"{path}.{name}" if path else str(name))
    elif isinstance(content, list | tuple) and content:
        for value in content:
            yield from paths_of(value, f"{path}[]")
    elif not isinstance(content, Mapping | list | tuple):
        yield path


def _pattern(name: str) -> str:
    # settings may nest; elsewhere a star is one name (which may hold a dot, as in breaches_opponent_2.5m)
    if name.endswith("settings.*"):
        return re.escape(name[:-1]) + ".+"
    return re.escape(name).replace(r"\*", r"[^\[\]]+?")
