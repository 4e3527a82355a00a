"""Learned teams: networks of numpy weights, played without torch.

For each of our own, ``teams/`` holds the weights, the config that trains it again, and its curve. A team is registered
if its weights are present.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..catalogue import entrant
from .cloned import Cloned
from .network import Network, preset_in
from .network import read_weights as read_weights
from .play import LearnedBatch, LearnedTeam
from .raids import RaidsBatch, RaidsTeam

WEIGHTS, SB3 = "weights:", "sb3:"
TEAMS = Path(__file__).parent / "teams"
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
CHOOSER = TEAMS / "crowley.npz"


def team_of(network: Network, name: str = "weights", sample: bool = False) -> LearnedTeam | RaidsTeam:
    """Return a network as the team policy of its kind."""
    return (RaidsTeam if network.kind == "raids" else LearnedTeam)(network, name, sample)


def batch_of(network: Network, name: str = "weights", sample: bool = False) -> LearnedBatch | RaidsBatch:
    """Return a network as the batch policy of its kind."""
    return (RaidsBatch if network.kind == "raids" else LearnedBatch)(network, name, sample)


def load_weights(path: str | Path, sample: bool = False) -> LearnedTeam | RaidsTeam:
    """Load an exported network as a team policy."""
    return team_of(read_weights(path), Path(path).stem, sample)


def load_weights_batch(path: str | Path, sample: bool = False) -> LearnedBatch | RaidsBatch:
    """Load an exported network as a batch policy."""
    return batch_of(read_weights(path), Path(path).stem, sample)


def load_trained(path: str | Path, sample: bool = False, interval: int | None = None) -> LearnedTeam:
    """Load a model of ``steerclear train`` as a team policy, from its tensors alone; see `load_sb3_batch`."""
    from .sb3_file import read_sb3

    return LearnedTeam(read_sb3(path, interval), Path(path).stem, sample)


def load_sb3_batch(path: str | Path, sample: bool = False, interval: int | None = None) -> LearnedBatch:
    """Load a saved Stable-Baselines3 model for a batch of games.

    Only its tensors are read: none of its pickles runs.
    """
    from .sb3_file import read_sb3

    return LearnedBatch(read_sb3(path, interval), Path(path).stem, sample)


def batch_builder(name: str) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
    """Return the builder of a learned batch policy and its first arguments; None if the name is not one of these."""
    if name.startswith(SB3):
        return load_sb3_batch, (name.removeprefix(SB3),)
    path = name.removeprefix(WEIGHTS) if name.startswith(WEIGHTS) else FILES.get(name)
    return None if path is None else (load_weights_batch, (path,))


def learned_in(name: str) -> str:
    """Return the preset in which the policy of that name learned; empty if it is not learned or does not state it."""
    from ...sb3 import read_card

    if name.startswith(SB3):
        return preset_in(read_card(Path(name.removeprefix(SB3)).expanduser()))
    path = name.removeprefix(WEIGHTS) if name.startswith(WEIGHTS) else FILES.get(name)
    return "" if path is None else read_weights(path).preset


def _enter(name: str) -> None:
    def build(sample: bool = False) -> LearnedTeam | RaidsTeam:
        return team_of(read_weights(FILES[name]), name, sample)

    build.__qualname__ = name
    entrant(name, *ABOUT[name])(build)


for _name in FILES:
    _enter(_name)

if CHOOSER.exists():

    @entrant("crowley", "options chosen as a scripted demonstrator does, by cloning (Crowley-BU-LL)", "Crowley-BU-LL")
    def _crowley() -> Cloned:
        return Cloned(CHOOSER)
