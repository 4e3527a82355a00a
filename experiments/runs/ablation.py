"""The ablation: every pairing without and with the shield, from the same seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from steerclear import policies

from ..measure.score import DEFAULT_PENALTY
from ..measure.statistics import count_interval, paired_ratio
from ..measure.summary import Row, by_game, summarise
from ..measure.tally import RADII_M, breach_column
from ..play.conditions import CALM, Conditions
from ..play.spec import ANSWER_S, SIDES, MatchSpec


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

    @property
    def separation_m(self) -> float:
        """Radius the shield keeps, m: the one at which its bars are judged."""
        return float(self.shield.get("separation_m", RADII_M[0]))

    @property
    def radii_m(self) -> tuple[float, ...]:
        """Radii at which breaches are counted, m: the usual two and the shield's own."""
        return tuple(sorted({*RADII_M, self.separation_m}))

    def specs(self) -> list[MatchSpec]:
        """List all games, those with the same number next to each other, so that an early end leaves pairs."""
        digests = {name: policies.fingerprint(name) for name in (self.own, *self.opponents)}
        return [
            self._spec(opponent, game, shielded, (digests[self.own], digests[opponent]))
            for game in range(self.games)
            for opponent in self.opponents
            for shielded in self.states
        ]

    def _spec(self, opponent: str, game: int, shielded: bool, files: tuple[str, str]) -> MatchSpec:
        return MatchSpec(
            preset=self.preset,
            own=self.own,
            opponent=opponent,
            game=game,
            seed=self.seed + game,
            side=self.sides[game % len(self.sides)],
            shield=dict(self.shield) if shielded else None,
            shield_autopilot=self.shield_autopilot,
            rules=dict(self.rules),
            fixed_start=self.fixed_start,
            penalty=self.penalty,
            radii_m=self.radii_m,
            judge=self.judge,
            conditions=self.conditions,
            files=files,
            trust=self.trust,
            answer_s=self.answer_s,
        )


def by_pairing(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Group rows by pairing, in the order the pairings come."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["pairing"], []).append(row)
    return groups


def summaries(rows: Sequence[Row], settings: AblationSettings) -> list[dict[str, Any]]:
    """Summarise every pairing."""
    return [summarise(group, settings.radii_m, settings.seed) for group in by_pairing(rows).values()]


def ablation_bars(rows: Sequence[Row], separation_m: float) -> list[dict[str, Any]]:
    """Judge the games of all pairings together, pairs only.

    Returns:
        Per bar `name`, `value`, `low`, `high`, `sense`, `limit`, `met` (None where there is nothing to judge).
    """
    pairs = _pairs(rows)
    if not pairs:
        return []
    teammate, opponent = (breach_column(kind, separation_m) for kind in ("teammate", "opponent"))
    hits = sum(int(on[teammate]) for _, on in pairs)
    zero = {"value": float(hits), "low": None, "high": None, "sense": "<=", "limit": 0.0, "met": hits == 0}
    return [
        {"name": f"hits with team-mates at {separation_m:g} m, shielded, all games", **zero},
        {"name": f"hits with opponents at {separation_m:g} m, on / off", **_ratio(pairs, opponent, "<=", 0.1)},
        {"name": "captures, on / off", **_ratio(pairs, "captures", ">=", 0.9)},
        *_deadlock_bar(pairs),
        *_avoidable_bar(rows, separation_m),
    ]


def _deadlock_bar(pairs: Sequence[tuple[Row, Row]]) -> list[dict[str, Any]]:
    """No bar where rows are of a version that did not count them."""
    if not all("deadlocks" in on for _, on in pairs):
        return []
    rate = count_interval(sum(int(on["deadlocks"]) for _, on in pairs), len(pairs))
    limits = {"value": rate.value, "low": rate.low, "high": rate.high}
    return [{"name": "deadlocks, shielded, per game", **limits, "sense": "<=", "limit": 0.0, "met": rate.value == 0.0}]


def _avoidable_bar(rows: Sequence[Row], separation_m: float) -> list[dict[str, Any]]:
    """Judge the shielded games that the oracle judged; no bar without any."""
    judged = [row for row in rows if row["shielded"] and row.get("breaches") is not None]
    if not judged:
        return []
    found = sum(breach["verdict"] == "avoidable" for row in judged for breach in row["breaches"])
    rate = count_interval(found, len(judged))
    name = f"avoidable hits at {separation_m:g} m, shielded, per game"
    limits = {"value": rate.value, "low": rate.low, "high": rate.high}
    return [{"name": name, **limits, "sense": "<=", "limit": 0.0, "met": found == 0}]


def most_instructive(rows: Sequence[Row], separation_m: float) -> tuple[Row, Row] | None:
    """Choose the pair of games, off and on, with the most breaches when unshielded; None without a pair."""
    columns = [breach_column(kind, separation_m) for kind in ("teammate", "opponent")]
    return max(_pairs(rows), key=lambda pair: sum(int(pair[0][name]) for name in columns), default=None)


def spec_of(row: Row, specs: Sequence[MatchSpec]) -> MatchSpec:
    """Find the spec a row was played from."""
    return next(
        spec
        for spec in specs
        if (spec.pairing, spec.game, spec.shield is not None) == (row["pairing"], row["game"], row["shielded"])
    )


def quick(settings: AblationSettings, max_time_s: float, games: int) -> AblationSettings:
    """Return the small version of an ablation: fewer and shorter games."""
    return replace(settings, games=games, rules={**settings.rules, "max_time_s": max_time_s})


def _pairs(rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    pairs = []
    for group in by_pairing(rows).values():
        off, on = by_game(group, False), by_game(group, True)
        pairs += [(off[game], on[game]) for game in sorted(set(off) & set(on))]
    return pairs


def _ratio(pairs: Sequence[tuple[Row, Row]], column: str, sense: str, limit: float) -> dict[str, Any]:
    off, on = (np.array([pair[side][column] for pair in pairs], dtype=np.float64) for side in (0, 1))
    ratio = paired_ratio(off, on)
    met = None if off.sum() == 0 else bool(ratio.value <= limit if sense == "<=" else ratio.value >= limit)
    return {"value": ratio.value, "low": ratio.low, "high": ratio.high, "sense": sense, "limit": limit, "met": met}
