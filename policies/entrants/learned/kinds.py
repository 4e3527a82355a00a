"""Which object plays which kind of network."""

from __future__ import annotations

from .network import Network
from .play import LearnedBatch, LearnedTeam
from .raids import RaidsBatch, RaidsTeam


def team_of(network: Network, name: str = "weights", sample: bool = False) -> LearnedTeam | RaidsTeam:
    """A network as the team policy of its kind."""
    return (RaidsTeam if network.kind == "raids" else LearnedTeam)(network, name, sample)


def batch_of(network: Network, name: str = "weights", sample: bool = False) -> LearnedBatch | RaidsBatch:
    """The same for a batch of games."""
    return (RaidsBatch if network.kind == "raids" else LearnedBatch)(network, name, sample)
