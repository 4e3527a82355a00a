"""Policies tried before anything long begins, and what is said of those of another game than the one they play."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.presets import PRESETS
from steerclear.policies.entrants.learned import learned_in
from steerclear.policies.entrants.learned.sb3_file import check_whole
from steerclear.policies.registry import KEYBOARD, SB3_PREFIX
from steerclear.policies.sb3 import check_origin, code_warning, read_card
from steerclear.policies.submissions.made_for import MadeFor, check_game, made_for, words_of_less
from steerclear.shield.exceptions import ConfigError

from .entries.team import is_entry, make_team

Say = Callable[[str], None]


def try_policies(names: Sequence[str], trust: bool, game: GameConfig, say: Say) -> None:
    """Load each policy once, those from files in a process of their own; say which learned in another game.

    Raises:
        PolicyError: one cannot be loaded, or is a model of others and not trusted.
    """
    say_what_runs(names, trust, say)
    for name in dict.fromkeys(names):
        team = make_team(name, trust=trust)
        if hasattr(team, "close"):
            team.close()
    say_of_elsewhere(names, game, say)


def check_no_keyboard(names: Sequence[str]) -> None:
    """Refuse the keyboard where many games are played.

    Raises:
        ConfigError: it is among the policies.
    """
    if KEYBOARD in names:
        raise ConfigError(f"{KEYBOARD!r} needs a window; play single games with: steerclear play --own {KEYBOARD}")


def say_of_elsewhere(names: Sequence[str], game: GameConfig, say: Say) -> None:
    """Say, once a command, of each policy that learned by the rules of another preset than the game's.

    So of a shield in an entry that keeps less than this game counts.

    Raises:
        PolicyError: the file of one cannot be read, or the shield in it is for another game.
    """
    for name in dict.fromkeys(names):
        for words in filter(None, (words_of_elsewhere(name, game), words_of_shield(name, game))):
            say(words)


def say_what_runs(names: Sequence[str], trust: bool, say: Say) -> None:
    """Say of each model, before any is loaded, that loading runs its code.

    Raises:
        PolicyError: there is no such model, it is one network of two, or one of others and not trusted.
    """
    for name in dict.fromkeys(names):
        if is_entry(name) and name.startswith(SB3_PREFIX):
            policies.check(name)
            path = Path(name.removeprefix(SB3_PREFIX)).expanduser()
            check_origin(path, trust or None)
            check_whole(path, read_card(path))
            say(code_warning(path))


def words_of_elsewhere(policy: str, game: GameConfig) -> str:
    """What to say of a policy that learned by the rules of another preset; nothing where it did not, or none is known.

    Raises:
        PolicyError: its file cannot be read.
    """
    made = made_of(policy)
    preset = learned_in(policy) if made is None or made.shielded else made.preset
    if preset in ("", game.preset_name):
        return ""
    return (
        f"{policy} learned in preset {preset} and plays {game.preset_name} here{_steps(preset, game)}: it may "
        f"play badly; play it by preset {preset}, or let it learn on by these rules (start: in docs/train.md)"
    )


def words_of_shield(policy: str, game: GameConfig) -> str:
    """What to say of an entry with a shield that keeps less than the distance at which a game counts; else nothing.

    Raises:
        PolicyError: the shield in it is for decisions of another length, or for other boats.
    """
    made = made_of(policy)
    if made is None:
        return ""
    check_game(made, game, policy)
    return words_of_less(made, game, policy)


def made_of(policy: str) -> MadeFor | None:
    """What an entry says of itself, see `made_for`; None for named policies and models."""
    return made_for(policy) if is_entry(policy) and not policy.startswith(SB3_PREFIX) else None


def _steps(preset: str, game: GameConfig) -> str:
    """What a decision that is held for so many steps comes to here, where steps are not as long."""
    if preset not in PRESETS:
        return ""
    learned_s = GameConfig.preset(preset).decision_s
    if math.isclose(learned_s, game.decision_s):
        return ""
    here_s, times = game.decision_s, game.decision_s / learned_s
    return f", where a step is {here_s:g} s, not {learned_s:g} s, and its decisions last {times:g} times as long"
