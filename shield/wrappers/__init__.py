"""Wrappers that put the shield around policies and environments."""

from .parallel import ShieldedParallelEnv
from .policy import ShieldedCallable, ShieldedTeamPolicy
from .team_batch import TeamBatch
from .vector_gym import MctfVectorEnv

__all__ = ["MctfVectorEnv", "ShieldedCallable", "ShieldedParallelEnv", "ShieldedTeamPolicy", "TeamBatch"]
