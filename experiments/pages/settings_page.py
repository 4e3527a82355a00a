"""The page of settings: every one of `ShieldConfig` with unit, default, what it does, and what it costs."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from typing import NamedTuple

from steerclear.shield.config import PROFILES, RANGES, ShieldConfig

from ..report.markdown import MADE

_METHOD, _STUDY = "[method](shield.md)", "[studies](studies/method.md)"


class Cost(NamedTuple):
    """What a setting costs, and where that was measured or is argued."""

    unit: str
    cost: str
    evidence: str


COSTS = {
    "separation_m": Cost(
        "m",
        "more distance, more commands changed; a game's own distance is taken",
        "[4 m](measured/several/comparison.md)",
    ),
    "buffer_m": Cost("m", "part of the separation", _METHOD),
    "dt_s": Cost("s", "fixed by the loop or the game", _METHOD),
    "move_s": Cost("s", "fixed by the game", "[rules of 2026](mctf2026.md)"),
    "certificate": Cost("name", "`auto` measured best for each boat", _METHOD),
    "coordination": Cost(
        "name", "`per_boat` is for boats that cannot talk: more is changed, less is promised", _METHOD
    ),
    "solver": Cost("name", "time of a decision", "[bench](bench.md)"),
    "adversary_s": Cost("s", "the dial between safety and play", "[price](price.md)"),
    "visitor_s": Cost("s", "less: tags are kept, and visitors that ram get nearer", "[studies](studies/method.md)"),
    "profile": Cost("name", "names an `adversary_s` and a `visitor_s`", "[price](price.md)"),
    "response_per_s": Cost("1/s", "lower: earlier and gentler; inf: as late as possible", _STUDY),
    "table_response_per_s": Cost("1/s", "as above", _STUDY),
    "fixed_response_per_s": Cost(
        "1/s", "without it boats weave along edges and lose up to two thirds of their speed", _STUDY
    ),
    "give_way_after_s": Cost("s", "inf: stand-offs are not untangled, and some boats never arrive", _STUDY),
    "table_margin_m": Cost("m", "less: a table promises more than it can keep", "[tables](tables.md)"),
    "margin_cap_m": Cost("m", "more: boats far apart bind, and time", _STUDY),
    "mate_cap_m": Cost("m", "2 m instead of 0.2 m: 6.4 instead of 4.5 % of the commands changed", _STUDY),
    "tail_s": Cost("s", "time of a decision", _METHOD),
    "horizon_s": Cost("s", "shorter: backups end before they are proved clear", _METHOD),
    "search_limit": Cost("clearances", "lower: large crowds are decided sooner, and less well", _STUDY),
    "dwell_s": Cost("s", "0: under a rammer such boats are told port and starboard in turn, 4 times a second", _STUDY),
    "speed_weight": Cost("", "higher: turns rather than slows down", _METHOD),
    "position_error_m": Cost("m", "widens the separation twice", "[conditions](conditions.md)"),
    "current_mps": Cost(
        "m/s", "widens what is kept from static constraints, the more the later", "[conditions](conditions.md)"
    ),
    "track_error_mps": Cost("m/s", "widens the separation with the age of a track", "[boats](boats.md)"),
    "max_track_age_s": Cost("s", "shorter: decisions are refused sooner", "[boats](boats.md)"),
    "delay_s": Cost(
        "s", "boats are decided for where they will be: the longer, the sooner", "[conditions](conditions.md)"
    ),
    "edge_m": Cost("m", "None: the field's edge is not kept", _METHOD),
    "beyond_m": Cost("m", "with `beyond_then=stop`: the nearer, the more boats are stopped and hit", _METHOD),
    "beyond_then": Cost("name", "stop: boats that are chased out are stopped, and may be hit there", _METHOD),
    "hull_m": Cost("m", "distance from walls", _METHOD),
    "barriers": Cost("names", "time of a decision: a call for every sample of a path", "[extend](extend.md)"),
}
"""Keyed by the setting; a test holds them to the settings there are."""
HEAD = f"""# Settings

{MADE}

What can be set: `Shield(name=value)`, `--shield-set name=value` of the commands that play games, `shield:` in a
`FLEET.yaml`. A name that is misspelt, a value of another type (True and False are no numbers) or out of range is
refused when the shield is built.

What a setting changes is told by games from the same seeds, each setting into a folder of its own:

```sh
steerclear evaluate medium --shield --games 100 --out a
steerclear evaluate medium --shield --games 100 --out b --shield-set response_per_s=2
steerclear compare a b
```

`compare` pairs the games and gives B less A with 95 % intervals, for any two that differ in the shield, the policy, or
delay, noise and current; it says what differs, and refuses games of other rules.

"""


def settings_page() -> str:
    """The page's text."""
    rows = [
        f"| `{entry.name}` | {cost.unit} | {_default(entry.default)} | {words} | {cost.cost} | {cost.evidence} |"
        for entry in fields(ShieldConfig)
        for cost, words in [(COSTS[entry.name], meanings()[entry.name])]
    ]
    table = [
        "| setting | unit | default | what it is | what it costs | evidence |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    profiles = ", ".join(f"`{name}` {away:g} and {home:g} s" for name, (away, home) in PROFILES.items())
    ends = f"`adversary_s` and `visitor_s` of the profiles: {profiles}."
    return HEAD + "\n".join(table + rows) + f"\n\n{ends}\n\n{_ranges()}\n"


def _ranges() -> str:
    """What is refused as too small or too large."""
    told = ", ".join(
        f"`{name}` {low:g} to {high:g} {COSTS[name].unit}".rstrip() for name, (low, high) in RANGES.items()
    )
    return f"Ranges: {told}. All other numbers are at least 0."


def meanings() -> dict[str, str]:
    """What each setting is, in the words of `ShieldConfig`."""
    told = inspect.cleandoc(ShieldConfig.__doc__ or "")
    section = told.partition("Attributes:\n")[2].partition("\n\n")[0]
    entries = re.findall(r"^    (\w+): (.*?)(?=^    \w+: |\Z)", section + "\n", re.MULTILINE | re.DOTALL)
    return {name: " ".join(words.split()).replace("|", "\\|") for name, words in entries}


def _default(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else f"`{value}`"
