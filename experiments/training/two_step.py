"""The two-step game of the QMIX paper: 8 needs a mixture that is not a sum; sums settle for 7.

First boat 0's action alone decides: 0 leads to a state where every pair of actions pays 7, 1 to one that pays
[[0, 1], [1, 8]]. A sum of values cannot hold the second table, underestimates it and takes the sure 7.
"""

from __future__ import annotations

import torch
from torch import nn

from .qmix import AdditiveMixer, MonotoneMixer, Qmix, Transitions

PAYS = torch.tensor([[[7.0, 7.0], [7.0, 7.0]], [[0.0, 1.0], [1.0, 8.0]]])
STATES = 4
"""Start, the two second steps, and the end."""


def all_moments() -> Transitions:
    """Every state with every pair of actions, once: what uniform exploration sees."""
    rows = []
    for state in (0, 1, 2):
        for one in (0, 1):
            for two in (0, 1):
                after = 1 + one if state == 0 else 3
                pay = 0.0 if state == 0 else float(PAYS[state - 1, one, two])
                rows.append((state, one, two, pay, after, float(state != 0)))
    numbers = torch.tensor(rows)
    state, after = (torch.eye(STATES)[numbers[:, k].long()] for k in (0, 4))
    seen = [torch.stack([one, one], dim=1) for one in (state, after)]
    return Transitions(seen[0], state, numbers[:, 1:3].long(), numbers[:, 3], seen[1], after, numbers[:, 5])


def learned_return(monotone: bool, updates: int = 1500, seed: int = 0) -> float:
    """What the greedy team earns after learning from all moments alike."""
    torch.manual_seed(seed)
    agents = [_Pair(), _Pair()]
    mixers = [MonotoneMixer(2, STATES, 8) if monotone else AdditiveMixer() for _ in range(2)]
    learner = Qmix(agents[0], mixers[0], (agents[1], mixers[1]), rate=5e-3, discount=0.99, target_every=50)
    moments = all_moments()
    for _ in range(updates):
        learner.update(moments)
    return _greedy(agents[0])


class _Pair(nn.Module):
    """A network for each of the two players, which play unlike parts."""

    def __init__(self) -> None:
        super().__init__()
        self.parts = nn.ModuleList(nn.Sequential(nn.Linear(STATES, 32), nn.ReLU(), nn.Linear(32, 2)) for _ in range(2))

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        return torch.stack([part(seen[:, k]) for k, part in enumerate(self.parts)], dim=1)


def _greedy(agent: nn.Module) -> float:
    """What a team gets that takes the best actions."""
    with torch.no_grad():
        first = agent(torch.eye(STATES)[[0, 0]][None])[0].argmax(1)
        after = 1 + int(first[0])
        second = agent(torch.eye(STATES)[[after, after]][None])[0].argmax(1)
    return float(PAYS[after - 1, int(second[0]), int(second[1])])
