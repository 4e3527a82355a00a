"""Trying policies before anything long begins, and saying what loading them means."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.policies.entrants.learned.sb3_file import check_whole
from steerclear.policies.registry import SB3_PREFIX
from steerclear.policies.sb3 import check_origin, code_warning, read_card

from ..entries.team import is_entry, make_team
from ..play.learned_elsewhere import words_of_elsewhere, words_of_shield
from .console import err


def try_policies(names: Sequence[str], trust: bool, game: GameConfig) -> None:
    """Load each policy once, those from files in a process of their own; say which learned in another game.

    Raises:
        PolicyError: one cannot be loaded, or is a model of others and not trusted.
    """
    say_what_runs(names, trust)
    for name in dict.fromkeys(names):
        team = make_team(name, trust=trust)
        if hasattr(team, "close"):
            team.close()
    say_of_elsewhere(names, game)


def say_of_elsewhere(names: Sequence[str], game: GameConfig) -> None:
    """Say, once a command, of each policy that learned by the rules of another preset than the game's.

    So of a shield in an entry that keeps less than this game counts.

    Raises:
        PolicyError: the file of one cannot be read, or the shield in it is for another game.
    """
    for name in dict.fromkeys(names):
        for words in filter(None, (words_of_elsewhere(name, game), words_of_shield(name, game))):
            err().print(words, markup=False, soft_wrap=True)


def say_what_runs(names: Sequence[str], trust: bool) -> None:
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
            err().print(code_warning(path), markup=False, soft_wrap=True)
