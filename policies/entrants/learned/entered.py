"""Our learned teams by name: each has its weights, the config that trains it again and its curve in ``teams/``.

A team is entered where its weights are there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..catalogue import entrant
from ..demonstrator import row_of
from ..sight import Sight
from .chooser import OPTION_NAMES, read_chooser
from .kinds import team_of
from .play import LearnedTeam
from .raids import RaidsTeam
from .teacher import OptionPlayer
from .weights_file import read_weights

TEAMS = Path(__file__).parent / "teams"
CHOOSER = "crowley"
ABOUT = {
    "jin": ("capture-seeking PPO, a stand-in: the team's code was never shared", "Jin-Indep"),
    "leprell": ("decentralised PPO on captures and grabs alone (Leprell-USMA)", "Leprell-USMA"),
    "richley": ("QMIX, and PPO once the flag is held (Richley-NIWC-ATL)", "Richley-NIWC-ATL"),
    "swell": ("PPO by the rules of aamas2024 against medium alone, begun with jin", ""),
    "surge": ("PPO in the game of 2025 against medium alone, begun with jin", ""),
    "riptide": ("undertow's raids, their numbers given by a network: for play with a shield", ""),
    "ours": ("PPO in the game of 2025, begun with surge: the team to start from, with the shield", ""),
}
FILES = {name: TEAMS / f"{name}.npz" for name in ABOUT if (TEAMS / f"{name}.npz").exists()}
"""Weights of the teams that are networks."""


def _enter(name: str) -> None:
    description, team = ABOUT[name]

    @entrant(name, description, team)
    def build(sample: bool = False) -> LearnedTeam | RaidsTeam:
        return team_of(read_weights(FILES[name]), name, sample)

    build.__qualname__ = name


for _name in FILES:
    _enter(_name)


class Cloned(OptionPlayer):
    """Chooses options as a scripted demonstrator does, by behaviour cloning."""

    name = CHOOSER

    def __init__(self) -> None:
        super().__init__()
        self._chooser: Any = read_chooser(TEAMS / f"{CHOOSER}.npz")

    def wish(self, sight: Sight, number: int) -> str:
        """What the demonstrator would most likely choose."""
        row = row_of(sight, number, self._choices[number], False)
        seen = [[float(row[name]) for name in self._chooser.names]]
        return OPTION_NAMES[int(self._chooser.choices(seen)[0])]


if (TEAMS / f"{CHOOSER}.npz").exists():
    entrant(CHOOSER, "options chosen as a scripted demonstrator does, by cloning (Crowley-BU-LL)", "Crowley-BU-LL")(
        Cloned
    )
