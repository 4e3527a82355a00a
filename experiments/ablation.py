"""Games of one policy against others, without and with the shield, from the same seeds: ablate, evaluate, entries.

With the shield there may be two states: ``on`` leaves the boats that the game drives (tagged, out of bounds) to it, as
a real game and a zip do; ``covered`` decides for them too. Goals and replay are of ``off`` and ``on``.

The ablation is the experiment that the others are written after: settings, jobs, ``run``, metrics, goals, report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from steerclear import policies
from steerclear.shield.exceptions import ConfigError

from .game_metrics import DEFAULT_PENALTY
from .metrics import RADII_M, check, game_goals, game_metrics_of, pairs_of, violation_column
from .play.conditions import CALM, Conditions
from .play.match import play_again, play_job
from .play.spec import ANSWER_S, SIDES, MatchSpec
from .policy_checks import made_of
from .replay_html import write_replay
from .report import write_report
from .result_files import table_name
from .runner import RESULTS_FILE, Experiment, Run
from .statistics import DIFFERENCE, summarise
from .tables import COVERED_HEAD, ITS_OWN, LEFT_HEAD
from .verdicts import COVERED, OFF, ON, all_violations, state_of, summarise_verdicts
from .warming import compile_game, compile_judge, compile_shield
from .words import count_text
from .workers import Row, Workers

if TYPE_CHECKING:
    import pandas as pd

COVERED_DIFFERENCE = f"{DIFFERENCE}_{COVERED}"
"""What the difference of covered and off is called in results; that of on and off is `DIFFERENCE`."""
DIFFERENCES = dict.fromkeys((DIFFERENCE, COVERED_DIFFERENCE), "difference, paired")
"""Heads of both where the first of two is no "off"."""
RETIRED = ("qp_relaxed", "escape")
"""Reasons that only rows of earlier versions name."""
TIMED = ("wall_s", "decision_p50_us", "decision_p99_us", "decision_max_us")
"""Columns that differ when a game is played again."""


@dataclass(frozen=True)
class AblationSettings:
    """Settings of an ablation; they are the command line and what results.json keeps.

    Attributes:
        preset: rules of the game.
        own: policy of the team that is shielded.
        opponents: policies it meets, one pairing each.
        games: games per pairing and shield state.
        seed: game g is played from seed + g, in every pairing, off and on.
        sides: colours the own team takes in turn, game by game.
        shield: settings of the shield.
        states: shield states to play, False for off and True for on.
        shield_autopilot: see `MatchSpec`; as the rest.
        covered: also play each game with a shield that covers boats that the game drives, as a state of its own; the
            state on then leaves them to the game.

    Raises:
        ConfigError: ``covered`` with ``shield_autopilot``: both states would be the same.
    """

    preset: str = "aamas2024"
    own: str = "medium"
    opponents: tuple[str, ...] = ("easy", "medium", "hidden")
    games: int = 20
    seed: int = 0
    sides: tuple[str, ...] = SIDES
    shield: Mapping[str, Any] = field(default_factory=dict)
    states: tuple[bool, ...] = (False, True)
    shield_autopilot: bool = True
    rules: Mapping[str, Any] = field(default_factory=dict)
    fixed_start: bool = False
    penalty: float = DEFAULT_PENALTY
    judge: str = "shielded"
    conditions: Conditions = CALM
    trust: bool = False
    answer_s: float = ANSWER_S
    covered: bool = False

    def __post_init__(self) -> None:
        if self.covered and self.shield_autopilot:
            raise ConfigError("covered is a state beside on: give shield_autopilot=False with it, or leave it out")

    @property
    def separation_m(self) -> float:
        """Radius the shield keeps, m, at which its goals are judged."""
        return float(self.shield.get("separation_m", RADII_M[0]))

    @property
    def radii_m(self) -> tuple[float, ...]:
        """Radii at which separation violations are counted, m: the usual two and the shield's own."""
        return tuple(sorted({*RADII_M, self.separation_m}))

    def specs(self) -> list[MatchSpec]:
        """List all games, those with the same number next to each other, so that an early end leaves pairs."""
        digests = {name: policies.fingerprint(name) for name in (self.own, *self.opponents)}
        same = {name: getattr(self, name) for name in ("preset", "own", "fixed_start", "penalty")}
        same |= {name: getattr(self, name) for name in ("judge", "conditions", "trust", "answer_s", "radii_m")}
        ways = [(shielded, self.shield_autopilot) for shielded in self.states]
        ways += [(True, True)] if self.covered else []
        return [
            MatchSpec(
                **same,
                opponent=opponent,
                game=game,
                seed=self.seed + game,
                side=self.sides[game % len(self.sides)],
                shield=dict(self.shield) if shielded else None,
                shield_autopilot=autopilot,
                rules=dict(self.rules),
                files=(digests[self.own], digests[opponent]),
            )
            for game in range(self.games)
            for opponent in self.opponents
            for shielded, autopilot in ways
        ]

    def off_and_on(self, table: pd.DataFrame) -> pd.DataFrame:
        """The rows of the two states that goals and replay are of."""
        return table[~(table["shielded"] & table["covered"])] if self.covered and len(table) else table

    def goals(self, table: pd.DataFrame) -> list[dict[str, Any]]:
        """Judge these games."""
        return [] if pairs_of(table).empty else check(game_goals(self.separation_m), table)

    def heads(self, pairing: str) -> dict[str, str]:
        """By state (off, on, difference) what a pairing's tables call it, where not as `tables.COLUMNS` does."""
        made = made_of(self.own)
        off = {OFF: ITS_OWN, **DIFFERENCES} if made is not None and made.shielded else {}
        return off | ({ON: COVERED_HEAD if self.shield_autopilot else LEFT_HEAD} if any(self.states) else {})

    def experiment(self, command: str) -> Experiment:
        """What `runner.execute` runs."""
        compiles = [compile_game, *([compile_shield] if any(self.states) else [])]
        compiles += [compile_judge] if self.judge != "none" else []
        jobs = [spec.as_job() for spec in self.specs()]
        return Experiment(command, asdict(self), jobs, play_job, "games", compiles)


AnySettings = TypeVar("AnySettings", bound=AblationSettings)


def quick(settings: AnySettings, max_time_s: float, games: int) -> AnySettings:
    """Return the small version of an ablation: fewer and shorter games."""
    return replace(settings, games=games, rules={**settings.rules, "max_time_s": max_time_s})


def results_of(run: Run, settings: AblationSettings, is_quick: bool = False) -> dict[str, Any]:
    """Put together the content of results.json, which `docs.KEYS` describes, of what was played."""
    import pandas as pd

    rows = with_states(run.rows, settings.covered)
    goals = settings.goals(settings.off_and_on(run.table))
    pairings = pairings_of(pd.DataFrame(rows), settings.radii_m, settings.seed)
    named = ("pairing", "game", "shielded", "state", "error", "fault")
    failed = []
    for job in run.failed:
        spec = MatchSpec.of_job(job)
        about = {"pairing": spec.pairing, "shielded": spec.shield is not None, "covered": spec.covered}
        failed += with_states([{**job, **about}], settings.covered)
    pairs = {(row[side], row.get(f"{side}_files")) for row in rows for side in ("own", "opponent")}
    return {
        **run.head(),
        "quick": is_quick,
        "policy_files": {name: digest for name, digest in sorted(pairs, key=str) if digest},
        "seeds": [settings.seed + game for game in range(settings.games)],
        "games_played": len(rows),
        "games_resumed": run.resumed,
        "failed": [{name: job[name] for name in named} for job in failed],
        "warnings": failure_warnings(rows),
        "held": held_games(rows),
        "pairings": [one | ({"heads": heads} if (heads := settings.heads(one["pairing"])) else {}) for one in pairings],
        "goals": goals,
        "violations": all_violations(rows),
    }


def with_states(rows: Sequence[Row], covered: bool) -> list[dict[str, Any]]:
    """Add to each row the ``state`` of the shield that it counts for: off, on, or covered where that is one."""
    return [{**row, "state": COVERED if covered and row["covered"] else state_of(row)} for row in rows]


def pairings_of(table: pd.DataFrame, radii_m: Sequence[float], seed: int = 0) -> list[dict[str, Any]]:
    """Summarise every pairing of a table of games; without a column ``state`` they are off or on.

    Returns:
        Of each, JSON-ready: ``pairing``, ``games_off``, ``games_on``, ``metrics`` (per key ``label``, ``off``, ``on``,
        ``difference``, each with value, low, high, n; absent where there is none), ``verdicts``, ``reasons`` (on),
        ``policy_failures``; where games were played covered also ``games_covered``, and per metric ``covered`` and
        ``difference_covered``.
    """
    import pandas as pd

    if table.empty:
        return []
    metrics = game_metrics_of(radii_m)
    if "state" not in table:
        table = table.assign(state=[state_of(row) for row in table.to_dict("records")])
    table = table.drop_duplicates(["pairing", "game", "state"], keep="last")
    figures = summarise(table, metrics, ["pairing"], ("state", OFF, ON), ["game"], seed)
    if (table["state"] == COVERED).any():
        more = summarise(table, metrics, ["pairing"], ("state", OFF, COVERED), ["game"], seed)
        more = more[more["state"] != OFF].replace({"state": {DIFFERENCE: COVERED_DIFFERENCE}})
        figures = pd.concat([figures, more])
    found = []
    for pairing, games in table.groupby("pairing", sort=False):
        count = {state: int((games["state"] == state).sum()) for state in (OFF, ON, COVERED)}
        lines = figures[figures["pairing"] == pairing]
        told: dict[str, dict[str, Any]] = {metric.key: {"label": metric.label} for metric in metrics}
        for line in lines.to_dict("records"):
            told[line["metric"]][line["state"]] = {name: line[name] for name in ("value", "low", "high", "n")}
        on = games[games["state"] == ON]
        reasons = {name.removeprefix("reason_"): int(on[name].sum()) for name in on if name.startswith("reason_")}
        found.append(
            {
                "pairing": pairing,
                "games_off": count[OFF],
                "games_on": count[ON],
                **({"games_covered": count[COVERED]} if count[COVERED] else {}),
                "metrics": told,
                "verdicts": summarise_verdicts(games.to_dict("records")),
                "reasons": {name: n for name, n in reasons.items() if n or name.lower() not in RETIRED},
                "policy_failures": int(games["policy_failures"].sum()),
            }
        )
    return found


def write_results(run: Run, results: dict[str, Any], records: Sequence[Any] = ()) -> None:
    """Write report, replay (of ``records``, unshielded first) and results.json; note the names under ``files``."""
    files = {"results": RESULTS_FILE, "games": table_name()}
    results["files"] = files
    links = []
    if records:
        files["replay"] = write_replay(records, run.folder / "replay.html").name
        played = results["replay"]
        label = f"{played['pairing']}, game {played['game']}: without the shield and with it"
        links = [{"label": label, "path": files["replay"]}]
    rows = with_states(run.rows, results["settings"]["covered"])
    flat = [{name: value for name, value in row.items() if name != "violations"} for row in rows]
    files["report"] = write_report({**results, "games": flat, "replays": links}, run.folder / "report.html").name
    run.write(results)


def replay_of(
    table: pd.DataFrame, specs: Sequence[MatchSpec], separation_m: float, workers: Workers
) -> tuple[dict[str, Any], list[Any]] | None:
    """Play `most_instructive` again; the ``replay`` entry of results.json and the records, None without a pair."""
    pair = most_instructive(table, separation_m)
    if pair is None:
        return None
    chosen = [spec_of(row, specs) for row in pair]
    played = play_again(chosen, workers)
    if len(played) < len(chosen):
        return None
    again = [played[spec.key] for spec in chosen]
    columns = [violation_column(kind, separation_m) for kind in ("teammate", "opponent")]
    entry = {
        "pairing": pair[0]["pairing"],
        "game": pair[0]["game"],
        "violations_off": sum(int(pair[0][column]) for column in columns),
        "violations_on": sum(int(pair[1][column]) for column in columns),
        "same_as_played": all(same_game(row, result.row) for row, result in zip(pair, again, strict=True)),
    }
    return entry, [result.record for result in again]


def most_instructive(table: pd.DataFrame, separation_m: float) -> tuple[Row, Row] | None:
    """The pair of games, off and on, with the most hits when unshielded, in blue where there are any; or None."""
    pairs = pairs_of(table)
    if pairs.empty:
        return None
    blue = pairs["side_on"] == "blue"  # the replay opens on a game whose shielded team is blue
    pairs = pairs[blue] if blue.any() else pairs
    hits = sum(pairs[violation_column(kind, separation_m) + "_off"] for kind in ("teammate", "opponent"))
    chosen = pairs.iloc[int(hits.to_numpy().argmax())]
    rows = table.to_dict("records")
    off, on = (
        next(r for r in rows if (r["pairing"], r["game"], r["shielded"]) == (chosen["pairing"], chosen["game"], state))
        for state in (False, True)
    )
    return off, on


def spec_of(row: Row, specs: Sequence[MatchSpec]) -> MatchSpec:
    """Find the spec a row was played from; of a shielded row that of the state on, which `specs` lists first."""
    wanted = (row["pairing"], row["game"], row["shielded"])
    return next(spec for spec in specs if (spec.pairing, spec.game, spec.shield is not None) == wanted)


def same_game(first: Row, second: Row) -> bool:
    """Tell whether two rows are the same game; times of computing may differ."""
    both = ((first.get(name), value) for name, value in second.items() if name not in (*TIMED, "violations"))
    return all(bool(one == two or (two is None and (one is None or one != one))) for one, two in both)


_SEATS = (("own policy", "", "own: "), ("opponents' policy", "opponent_", "opponent: "))
"""Words, how the columns begin, and how the texts of its failures do."""


def failure_warnings(rows: Sequence[Row]) -> list[str]:
    """Sentences about failures of policies: one for each side that failed."""
    found = []
    for words, column, begin in _SEATS:
        failed = [row for row in rows if row[f"{column}policy_failures"]]
        if failed:
            count, text = sum(int(row[f"{column}policy_failures"]) for row in failed), _first_text(failed, begin)
            found.append(
                f"The {words} failed {count_text(count, 'time')}, in {len(failed)} of {count_text(len(rows), 'game')}; "
                "boats without an action stopped for those steps, so the figures are not those of a working policy."
                + (f" First failure: {text}" if text else "")
            )
    return found


def held_games(rows: Sequence[Row]) -> list[str]:
    """Sentences about policies that did not play: in no step of a game had a boat of theirs a usable answer."""
    found = []
    for words, column, begin in _SEATS:
        held = [row for row in rows if row["steps"] > 0 and row[f"{column}policy_usable_steps"] == 0]
        if held:
            text = _first_text(held, begin)
            found.append(
                f"the {words} gave no usable answer throughout {len(held)} of {count_text(len(rows), 'game')}; its "
                f"boats lay still, so these are figures of no policy{f' ({text})' if text else ''}; mend it or leave "
                "it out"
            )
    return found


def _first_text(rows: Sequence[Row], begin: str) -> str:
    texts = (str(row["first_failure"] or "") for row in rows)
    return next((text.removeprefix(begin) for text in texts if text.startswith(begin)), "")
