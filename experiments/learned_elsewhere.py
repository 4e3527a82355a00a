"""What is said of a learned policy that plays another game than the one it learned in."""

from __future__ import annotations

import math

from steerclear.env.config import GameConfig
from steerclear.env.presets import PRESETS
from steerclear.policies.entrants.learned import learned_in


def words_of_elsewhere(policy: str, game: GameConfig) -> str:
    """What to say of a policy that learned by the rules of another preset; nothing where it did not, or none is known.

    Args:
        policy: its name, as `steerclear.policies.make` takes it.
        game: the game it is to play.

    Raises:
        PolicyError: its file cannot be read.
    """
    preset = learned_in(policy)
    if preset in ("", game.preset_name):
        return ""
    return (
        f"{policy} learned in preset {preset} and plays {game.preset_name} here{_steps(preset, game)}: it may "
        f"play badly; play it by preset {preset}, or let it learn on by these rules (start: in docs/train.md)"
    )


def _steps(preset: str, game: GameConfig) -> str:
    """What a decision that is held for so many steps comes to here, where steps are not as long."""
    if preset not in PRESETS:
        return ""
    learned_s = GameConfig.preset(preset).decision_s
    if math.isclose(learned_s, game.decision_s):
        return ""
    here_s, times = game.decision_s, game.decision_s / learned_s
    return f", where a step is {here_s:g} s, not {learned_s:g} s, and its decisions last {times:g} times as long"
