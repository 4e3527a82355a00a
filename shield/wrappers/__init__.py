"""Wrappers that put the shield around policies and environments."""

from .parallel import ShieldedParallelEnv
from .policy import ShieldedCallable, ShieldedTeamPolicy

__all__ = ["ShieldedCallable", "ShieldedParallelEnv", "ShieldedTeamPolicy"]
