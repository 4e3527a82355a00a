"""The env as a match plays it: what nobody reads in a step is not written."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.play import EntrantTeam
from steerclear.policies.scripted.team import ScriptedTeam

RECORDED = ("state", "has_flag", "is_tagged", "oob", "is_disabled", "flag_position", "captures")
"""What a record keeps of a game."""
Infos = dict[str, dict[str, Any]]


class PlayingEnv(MctfEnv):
    """An `MctfEnv` that can leave its infos out: they take a fifth of a step's time.

    Attributes:
        tells: whether infos are written; else they are empty.
    """

    tells = True

    def infos(self) -> Infos:
        """Infos by agent id; empty where nobody reads them."""
        return super().infos() if self.tells else {}


def read_infos(teams: Iterable[Any]) -> bool:
    """Whether one of these policies may read infos: all but our own scripted teams and entrants, which see the game."""
    return not all(_sees_the_game(policy) for policy in teams)


def live_view(core: BatchedMctf) -> Any:
    """What a recorder reads, as the game's own arrays: always of this moment, never copied; valid until a reset."""
    return SimpleNamespace(**{name: getattr(core.games, name)[0] for name in RECORDED})


def _sees_the_game(policy: Any) -> bool:
    return any(isinstance(policy, team) and type(policy).act is team.act for team in (EntrantTeam, ScriptedTeam))
