"""Compiling before many processes start: each part once, at the same time, into the cache on disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from steerclear.shield import Shield, ShieldConfig

from .. import oracle
from ..play.match import play_match
from ..play.spec import MatchSpec
from .pool import run_all

SECONDS = 1.0
WARMED = 3
"""Parts that games may need: the game, the shield, the judge."""


@dataclass(frozen=True)
class WarmUp:
    """One part to compile: a shield with these settings, what a short game needs, or the oracle."""

    shield: dict[str, Any] | None = None
    game: MatchSpec | None = None
    judge: bool = False


def warm_up(specs: Sequence[MatchSpec], processes: int, notice: Callable[[int], None] = lambda done: None) -> None:
    """Compile what the games need: the game and its policies in one process, the shield in another.

    What goes wrong here is left to the games themselves to report.

    Args:
        specs: the games.
        processes: how many at once.
        notice: told how many of `WARMED` parts are ready.
    """
    unshielded = {spec.opponent: replace(spec, shield=None, opponent_shield=None) for spec in specs}
    parts = [WarmUp(game=_short(spec)) for spec in list(unshielded.values())[:1]]
    shields = [spec.shield for spec in specs if spec.shield is not None]
    parts += [WarmUp(shield=dict(settings)) for settings in shields[:1]]
    if any(spec.judged for spec in specs):
        parts.append(WarmUp(judge=True))
    notice(WARMED - len(parts))
    for done, _ in enumerate(run_all(compile_part, parts, processes), WARMED - len(parts) + 1):
        notice(done)


def parts_of_all() -> list[tuple[str, Callable[[], object]]]:
    """Everything that commands compile, each part with its name; what one part compiles the next finds."""
    from ..encounters import measure

    game = _short(MatchSpec(preset="aamas2024", own="medium", opponent="easy", shield={}))
    return [
        ("the shield", lambda: Shield().warm_up()),
        ("the shield, each boat by itself", lambda: Shield(ShieldConfig(coordination="per_boat")).warm_up()),
        ("the game", lambda: play_match(game)),
        ("the judge", compile_oracle),
        ("encounters", lambda: measure("rammer_1", n=1)),
        ("the reachability filter", lambda: measure("rammer_1", "reach", n=1, judge=False)),
    ]


def compile_share(number: int, of: int) -> None:
    """Compile everything beside ``of - 1`` other processes that do so: each begins elsewhere and waits for the others.

    Args:
        number: which of them this one is, from 0.
        of: how many there are.
    """
    parts = parts_of_all()
    first = number * len(parts) // of
    for _, compile_it in parts[first:] + parts[:first]:
        compile_it()


def compile_part(part: WarmUp) -> None:
    """Compile one part."""
    if part.shield is not None:
        Shield(ShieldConfig.of(**part.shield)).warm_up()
    if part.game is not None:
        play_match(part.game)
    if part.judge:
        compile_oracle()


def compile_oracle() -> None:
    """Let the oracle judge a boat that runs into a stopped one."""
    boat = oracle.Boat("single_integrator", 2.0, max_turn_dps=90.0)
    states = np.zeros((40, 2, oracle.N_STATE))
    states[:, 0, 1], states[:, 0, 3], states[:, 1, 1] = 0.2 * np.arange(40), 2.0, 5.0
    oracle.judge(states, [boat, boat], own=0, step=13, radius_m=2.5)


def _short(spec: MatchSpec) -> MatchSpec:
    return replace(spec, rules={**spec.rules, "max_time_s": SECONDS})
