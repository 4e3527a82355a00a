"""Policies tried before anything long begins, and what is said of those of another game than the one they play."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from steerclear import policies
from steerclear.env.config import PRESETS, GameConfig
from steerclear.policies.entrants.learned import learned_in
from steerclear.policies.entrants.learned.sb3_file import check_whole
from steerclear.policies.registry import KEYBOARD, SB3_PREFIX
from steerclear.policies.sb3 import check_origin, code_warning, read_card
from steerclear.policies.submissions.made_for import MadeFor, check_game, made_for, words_of_less
from steerclear.shield.exceptions import ConfigError

from .entries.team import is_entry, make_team
from .play.conditions import CALM, Conditions, check_current
from .play.spec import check_shield
from .play.spec import words_of_less as words_of_less_kept

Say = Callable[[str], None]


def check_run(
    names: Sequence[str],
    game: GameConfig,
    shield: Mapping[str, Any] | None,
    say: Say,
    conditions: Conditions = CALM,
    trust: bool = False,
    many: bool = True,
) -> None:
    """Find every bad name or number before the first game is played, and say what is to be known of them.

    Each policy is loaded once, those from files in a process of their own; ``many``: nobody sits at the keyboard.

    Raises:
        SteerclearError: a policy cannot be loaded, or is of others and not trusted; a setting is unusable.
    """
    check_current(conditions, game)
    if shield is not None:
        say_of_distance(check_shield(shield, game).separation_m, game, say)
    if many and KEYBOARD in names:
        raise ConfigError(f"{KEYBOARD!r} needs a window; play single games with: steerclear play --own {KEYBOARD}")
    say_what_runs(names, trust, say)
    for name in dict.fromkeys(names):
        team = make_team(name, trust=trust)
        if hasattr(team, "close"):
            team.close()
    say_of_elsewhere(names, game, say)


def say_of_distance(kept_m: float, game: GameConfig, say: Say) -> None:
    """Say, once a command, that its shield keeps less than the distance at which the game counts collisions."""
    if words := words_of_less_kept(kept_m, game):
        say(words)


def say_of_elsewhere(names: Sequence[str], game: GameConfig, say: Say) -> None:
    """Say of each policy that learned by other rules, and of a shield in an entry that keeps less than the game counts.

    Raises:
        PolicyError: the file of one cannot be read, or the shield in it is for another game.
    """
    for name in dict.fromkeys(names):
        for words in filter(None, (words_of_elsewhere(name, game), _words_of_shield(name, game))):
            say(words)


def say_what_runs(names: Sequence[str], trust: bool, say: Say) -> None:
    """Say of each model, before any is loaded, that loading runs its code; PolicyError where it may not, or cannot."""
    for name in dict.fromkeys(names):
        if is_entry(name) and name.startswith(SB3_PREFIX):
            policies.check(name)
            path = Path(name.removeprefix(SB3_PREFIX)).expanduser()
            check_origin(path, trust or None)
            check_whole(path, read_card(path))
            say(code_warning(path))


def words_of_elsewhere(policy: str, game: GameConfig) -> str:
    """What to say of a policy that learned by the rules of another preset; else nothing."""
    made = made_of(policy)
    preset = learned_in(policy) if made is None or made.shielded else made.preset
    if preset in ("", game.preset_name):
        return ""
    steps, learned_s = "", GameConfig.preset(preset).decision_s if preset in PRESETS else game.decision_s
    if not math.isclose(learned_s, game.decision_s):  # then its decisions last longer, or not as long
        here_s, times = game.decision_s, game.decision_s / learned_s
        steps = f", where a step is {here_s:g} s, not {learned_s:g} s, and its decisions last {times:g} times as long"
    return (
        f"{policy} learned in preset {preset} and plays {game.preset_name} here{steps}: it may "
        f"play badly; play it by preset {preset}, or let it learn on by these rules (start: in docs/train.md)"
    )


def _words_of_shield(policy: str, game: GameConfig) -> str:
    made = made_of(policy)
    if made is None:
        return ""
    check_game(made, game, policy)
    return words_of_less(made, game, policy)


def made_of(policy: str) -> MadeFor | None:
    """What an entry says of itself, see `made_for`; None for named policies and models."""
    return made_for(policy) if is_entry(policy) and not policy.startswith(SB3_PREFIX) else None
