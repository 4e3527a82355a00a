"""Every key of the JSON and tables that the commands write, with its meaning and unit.

The documentation is generated from these; a test walks real results and fails on a key that is not here.
``*`` stands for a name that depends on the run; ``[]`` for every entry of a list.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from .deploy.keys import DEPLOY as _DEPLOY
from .deploy.keys import REFEREE as _REFEREE
from .deploy.keys import REPLAY as _REPLAY
from .encounters.attack import KEYS as _ATTACK
from .encounters.figures import KEYS as _ENCOUNTERS
from .metrics import GAME_COLUMNS, GOAL_KEYS, breach_column, columns_of, game_metrics_of, meanings_of
from .tournament_keys import TOURNAMENT as _TOURNAMENT

BREACH = {
    "step": "first step inside the radius",
    "time_s": "the same as game time, s",
    "boats[]": "the two boats",
    "kind": "teammate or opponent",
    "radius_m": "separation radius, m",
    "closest_m": "closest distance until they were apart again, m",
    "verdict": "avoidable, unavoidable, started_inside or not_judged; of teammates, whether either could",
    "last_preventable_s": "last moment at which own commands could still prevent it, s before; null when never",
    "other_last_preventable_s": "the same of the opponent's boat; null for teammates",
    "exhausted": "whether the search that found no later way kept every state it reached at its resolution",
    "responsible": "who let the later last moment pass: own, opponent, both, game (it drove the boat), neither, start",
    "responsible_boats[]": "those boats",
    "driven": "whether the game drove every own boat in it when it began, so that no command could prevent it",
}

MEANINGS = meanings_of(game_metrics_of())
GAME_ROW = {
    **columns_of(game_metrics_of(), GAME_COLUMNS),
    **{f"breaches_{kind}_*": MEANINGS[breach_column(kind, 2.5)] for kind in ("teammate", "opponent", "driven")},
    "breaches": "every breach at the shield's radius with its verdict (see breaches[] of ablate); null when not judged",
    **{f"breaches[].{name}": words for name, words in BREACH.items()},
}

_LIMITS = {"value": "figure", "low": "lower 95 % limit", "high": "upper 95 % limit"}
_FIGURE = {**_LIMITS, "n": "number of games or pairs"}
_VERDICTS = {
    "breaches": "breaches of teammates or with opponents at the shield's radius, judged games",
    "avoidable": "of those avoidable",
    "unavoidable": "of those unavoidable",
    "started_inside": "of those between boats that started inside",
    "not_judged": "of those beyond what is judged in a game",
    "avoidable_per_game": "null when no game was judged",
}
_DECIDED = {"all": "all decisions", "passes": "no command changed", "intervenes": "a command changed"}
_PROVENANCE = {
    "command": "which command wrote this",
    "settings.*": "settings as given on the command line",
    "versions.*": "versions of Python and packages",
    "machine.*": "processor, cores, memory, system",
    "wall_s": "how long it took, s",
}

RESULTS = {
    **_PROVENANCE,
    "complete": "false when interrupted or a game could not be played",
    "quick": "whether this is the small version",
    "seeds[]": "seed of each game number",
    "games_played": "games in the results",
    "games_resumed": "of those, how many an earlier run had played",
    "failed[].pairing": "pairing of a game that could not be played",
    "failed[].game": "its number",
    "failed[].shielded": "whether with a shield",
    "failed[].state": "off, on or covered",
    "failed[].error": "why",
    "failed[].fault": "whether that is a fault of steerclear, not of what was given",
    "policy_files.*": "digests of the files of policies that are no named ones",
    "warnings[]": "what a reader has to know first: policies that failed while they played",
    "held[]": "policies that gave nothing usable throughout a game: the exit status is 2",
    "pairings[].pairing": "own policy vs opponent policy",
    "pairings[].games_off": "games without shield",
    "pairings[].games_on": "games with shield; of ablate, boats that the game drives left to the game",
    "pairings[].games_covered": "games with a shield that also covers boats that the game drives; absent without any",
    "pairings[].policy_failures": "failures of the own policy in all games",
    "pairings[].verdicts.*.games": "games, shield off, on or covered",
    "pairings[].verdicts.*.games_judged": "of those, games whose breaches were judged",
    **{f"pairings[].verdicts.*.*.{k}": v for k, v in _VERDICTS.items()},
    **{f"pairings[].verdicts.*.*.avoidable_per_game.{k}": f"{v}, judged games" for k, v in _LIMITS.items()},
    "pairings[].verdicts.*.*.responsible.*": "breaches for which that side is responsible",
    "pairings[].reasons.*": "boat-steps per reason, all games with shield on",
    "pairings[].metrics.*.label": "words of the tables",
    **{f"pairings[].metrics.{key}": words for key, words in MEANINGS.items()},
    **{f"pairings[].metrics.*.off.{k}": f"{v}, shield off, per game" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.on.{k}": f"{v}, shield on, per game" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.difference.{k}": f"{v}, mean of on - off, paired" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.covered.{k}": f"{v}, shield on and covering, per game" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.difference_covered.{k}": f"{v}, covered - off, paired" for k, v in _FIGURE.items()},
    **GOAL_KEYS,
    "breaches[].pairing": "pairing of the game",
    "breaches[].game": "its number",
    "breaches[].shielded": "whether its own team had a shield",
    "breaches[].state": "off, on or covered",
    **{f"breaches[].{name}": words for name, words in BREACH.items()},
    "replay.pairing": "pairing of the game in replay.html: the one with the most breaches without shield",
    "replay.game": "its number",
    "replay.breaches_off": "its breaches without shield",
    "replay.breaches_on": "its breaches with shield",
    "replay.same_as_played": "whether playing it again gave the same counts",
    "files.*": "what was written, relative to the folder",
}

COMPARE = {
    **_PROVENANCE,
    **{
        f"{which}.{name}": words
        for which in ("first", "second")
        for name, words in {
            "folder": "of the results",
            "own": "policy whose results are counted",
            "shielded": "whether the games compared are those with its shield",
            "games": "of them, in that folder",
        }.items()
    },
    "differs.*[]": "settings that differ, the first's value and the second's; null: not given",
    "pairings[].opponent": "policy of the other team",
    "pairings[].pairs": "games of both from the same seed and side",
    "pairings[].metrics.*.label": "words of the tables",
    **{f"pairings[].metrics.*.first.{k}": f"{v}, the first, per game" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.second.{k}": f"{v}, the second, per game" for k, v in _FIGURE.items()},
    **{f"pairings[].metrics.*.difference.{k}": f"{v}, second - first, paired" for k, v in _FIGURE.items()},
}

ENTRY_WRAP = {
    **_PROVENANCE,
    "entry": "what was put behind the shield",
    "zip": "the file written",
    "bytes": "its size",
    "package": "name of the private package in it, which tells one content from another",
    "preset": "rules of the game it is for",
    "shield.*": "every setting of the shield in it",
}

ENTRY_CHECK = {
    **_PROVENANCE,
    "entry": "what was checked",
    "load_s": "time until it was loaded in a process of its own, s",
    "made_for": "what an entry that steerclear wrote says of itself; null for others",
    "made_for.preset": "rules of the game it is for",
    "made_for.shield": "null: there is no shield in it",
    "made_for.shield.*": "every setting of the shield in it",
    "imports.needed[]": "packages its files import beyond Python's own and themselves",
    "imports.missing[]": "those of them that are not installed here",
    "imports.unread[]": "files that are no Python this interpreter reads",
    "calls": "actions asked for",
    "mean_ms": "mean time of one, ms",
    "max_ms": "longest, ms",
    "late": "actions that took longer than a decision of the game",
    "decision_ms": "time of a decision of the game, ms",
    "decisions": "decisions of the team, all boats together",
    "mean_decision_ms": "mean time of one, ms",
    "max_decision_ms": "longest, ms",
    "late_decisions": "those that took longer than the game gives",
    "held": "actions that could not be used: the boat stopped",
    "steps": "in which it was asked for actions",
    "game_steps": "steps of a whole game",
    "failed_steps.*": "by boat: steps without a usable action",
    "failures[].kind": "what kind of failure",
    "failures[].count": "how often",
    "failures[].boats.*": "how often, by boat",
    "failures[].message": "of the first of them",
    "game.captures": "of the game against boats that hold: flags captured",
    "game.grabs": "flags grabbed",
    "game.tags": "tags made",
    "game.collisions": "as the game counts them",
    "game.duration_s": "its length, s",
    "game.first_failure": "the first thing that went wrong; null for nothing",
}

PLAY = {
    **_PROVENANCE,
    **{f"game.{k}": v for k, v in GAME_ROW.items()},
    "files[]": "what was written",
}

PARITY = {
    **_PROVENANCE,
    "passed": "whether every trace is within the limits",
    "limits.*": "largest deviation allowed; events must be exact",
    "traces[].path": "the file",
    "traces[].steps": "steps replayed",
    "traces[].passed": "whether it is within the limits",
    "traces[].*_*": "largest deviations, unit in the name",
    "traces[].observation_normalised": "largest deviation of normalised observations",
    "traces[].mismatches": "number of events that came out differently",
    "traces[].first_mismatches[].*": "the first of them: step, event, who, expected, got",
}

_TIMES = {
    "p50_us": "median over calls, each with the median of its repeats, us",
    "p99_us": "99th percentile of them, us",
    "p99_9_us": "99.9th percentile of them, us",
}


def _decided(part: str, about: str) -> dict[str, str]:
    times = {f"{part}.{k}.{n}": f"{w}: {v}" for k, w in _DECIDED.items() for n, v in _TIMES.items()}
    shares = {f"{part}.share_intervening": "share of them in which the shield changes a command"}
    return {f"{part}.decisions": about, **shares, **times}


BENCH = {
    **_PROVENANCE,
    **_decided("decide", "states of real games, 3 boats and 3 opponents"),
    **_decided("decide_by_table", "the same of boats that look opponents up in value tables"),
    "stages[].preset": "rules of the games",
    "stages[].kind": "passes: on the backups held; searches: after a search for others; changes: some command does not",
    "stages[].decisions": "how many decisions were such",
    "stages[].share": "of all decisions",
    "stages[].time_share": "of the time of all decisions",
    "stages[].all_us": "mean time of one, us; it is the sum of the next three",
    "stages[].check_us": "of the nominal check, search included, us",
    "stages[].rest_us": "of backups, programs and exact checks after it, and of what is remembered, us",
    "stages[].python_us": "round compiled code, us",
    "lookups[].what": "what is asked of the value table",
    "lookups[].lookups": "look-ups at places drawn over the whole table",
    "lookups[].us": "mean time of one, compiled, us; median of the repeats",
    "solvers[].solver": "name in qpsolvers, or the compiled projection, the default",
    **{f"solvers[].{name}": words for name, words in _TIMES.items()},
    "solvers[].ratio": "median against that of daqp",
    "solvers[].solved": "share of programs with an answer that passes the shield's check",
    "solvers[].differs": "largest difference from the answers of daqp, scaled inputs",
    "batch[].policy": "batch policy of both teams; its own time is left out",
    "batch[].shielded": "whether the blue team is shielded",
    "batch[].games": "games at once",
    "batch[].median": "game-steps per second, one core, median of the repeats",
    "batch[].low": "slowest repeat",
    "batch[].high": "fastest repeat",
    "memory.games": "games whose memory was measured",
    "memory.games_mib": "held by the games, observations and rewards included, MiB",
    "memory.shield_mib": "held by one team's shield for them, MiB",
    "scaling[].boats": "boats in the scene",
    "scaling[].ours": "of those, boats decided for",
    "scaling[].scenes": "random scenes",
    **{f"scaling[].{name}": words for name, words in _TIMES.items()},
    "scaling[].us_per_own_boat": "median / ours, us",
    **GOAL_KEYS,
}

ENCOUNTERS = {**_PROVENANCE, **_ENCOUNTERS, **GOAL_KEYS}

ATTACK = {**_PROVENANCE, **_ATTACK}

SETS = {
    **_PROVENANCE,
    "looked_up": "whether the shield reads this value table itself, so that what it misses is not judged",
    "pairs[].own_mps": "own speed, m/s",
    "pairs[].other_mps": "the opponent's speed, m/s",
    "pairs[].heading_deg": "heading of the opponent relative to the own one, deg; 180 is head-on",
    "pairs[].shield_m2": "positions of the opponent at which the shield's certificate is negative, m^2",
    "pairs[].reach_m2": "positions at which the value table is below the radius, m^2, over the same cells",
    "pairs[].missed_m2": "positions that the table calls lost and the shield calls safe, m^2",
    **GOAL_KEYS,
}

PLAYED_SETS = {
    **_PROVENANCE,
    "sets[].own_mps": "own speed, m/s",
    "sets[].other_mps": "the opponent's speed, m/s",
    "sets[].heading_deg": "heading of the opponent relative to the own one, deg; 180 is head-on",
    "sets[].reach_m2": "positions of the opponent whose value is below the radius, m^2",
    "sets[].lost_m2": "positions of a value up to 1 m above it from which some opponent reached the shielded boat, m^2",
    "sets[].player_m2": "those from which some opponent reached a boat that the table itself steers, m^2",
    "sets[].played": "how many of those were played",
    "sets[].tried": "positions of higher values that were played",
    "sets[].tried_lost": "those of them from which an opponent reached the boat",
    "sets[].ratio": "reach_m2 and lost_m2 together, times reach_m2",
    "sets[].player_ratio": "reach_m2 and player_m2 together, times reach_m2",
    **GOAL_KEYS,
}

_SIM_BOATS = {
    "simulated_s": "simulated time, s",
    "let_go_s": "time not lived because the machine was too slow, s",
    "cpu_s": "processor time of the simulation, s",
    "played": "whether the game began: every boat with a link was commanded",
    "boats.*.address": "its link's address; null: no link",
    "boats.*.driven_by": "policy that drives it; empty: its link or nobody",
    "boats.*.taken": "packets it obeyed or answered",
    "boats.*.refused": "packets damaged, unsigned or wrongly signed",
    "boats.*.ignored": "packets it passes over silently, such as commands outside GUIDED",
    "boats.*.lost_down": "packets the radio lost on the way to the commander",
    "boats.*.lost_up": "packets the radio lost on the way to the boat",
    "closest[].first": "one boat",
    "closest[].second": "the other",
    "closest[].distance_m": "closest approach of their centres, m",
    "closest[].time_s": "when, simulated s",
    "captures[]": "flags captured by blue and red, when recorded",
    "tags[]": "tags made by blue and red, when recorded",
    "breaches[].unsteered_s[]": "for how long nobody had steered each of the two boats, s; 0: somebody did",
    "breaches[].faults[]": "faults of simulated boats that acted on one of the two then or in the 5 s before",
    "breaches[].after_run": "whether the boats of the breach had been left in HOLD and nobody steered any from then on",
    "clean": "whether the run had neither a breach of teammates nor an avoidable one; false when not recorded",
    "files[]": "what was written",
}
"""Beside these: ``breaches`` of the team the file names, as other commands give them, when recorded."""

SIM_BOATS = {**_PROVENANCE, **_SIM_BOATS, **{f"breaches[].{name}": words for name, words in BREACH.items()}}

RENDER = {**_PROVENANCE, "files[]": "what was written"}

DEPLOY = {**_PROVENANCE, **_DEPLOY}

REFEREE = {**_PROVENANCE, **_REFEREE}

REPLAY = {**_PROVENANCE, **_REPLAY, **{f"sides.*.breaches[].{name}": words for name, words in BREACH.items()}}

KEYS = {
    "ablate": RESULTS,
    "evaluate": RESULTS,
    "compare": COMPARE,
    "tournament": _TOURNAMENT,
    "entry check": ENTRY_CHECK,
    "entry report": RESULTS,
    "entry wrap": ENTRY_WRAP,
    "play": PLAY,
    "parity": PARITY,
    "bench": BENCH,
    "encounters": ENCOUNTERS,
    "attack": ATTACK,
    "reach compare": SETS,
    "reach play": PLAYED_SETS,
    "render": RENDER,
    "deploy": DEPLOY,
    "preflight": DEPLOY,
    "replay": REPLAY,
    "sim-boats": SIM_BOATS,
    "referee": REFEREE,
}


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
