"""What is said of a policy that plays another game than the one it learned in, or than the shield in it is for."""

from __future__ import annotations

import math

from steerclear.env.config import GameConfig
from steerclear.env.presets import PRESETS
from steerclear.policies.entrants.learned import learned_in
from steerclear.policies.registry import SB3_PREFIX
from steerclear.policies.submissions.made_for import MadeFor, check_game, made_for, words_of_less

from ..entries.team import is_entry


def words_of_elsewhere(policy: str, game: GameConfig) -> str:
    """What to say of a policy that learned by the rules of another preset; nothing where it did not, or none is known.

    Args:
        policy: its name, as `steerclear.policies.make` takes it.
        game: the game it is to play.

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
