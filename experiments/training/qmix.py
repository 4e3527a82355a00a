"""QMIX (Rashid et al. 2018): values of each boat's actions, mixed monotonically into one value of the team.

Q_tot(s, u) = f_s(Q_1(o_1, u_1), ..., Q_n(o_n, u_n)) with df_s / dQ_i >= 0, so each boat's best action is the team's.
The weights of f are made from the state by networks of their own, their absolute values taken.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn


class Transitions(NamedTuple):
    """N moments of a team of n boats.

    Attributes:
        seen: (N, n, obs) what each boat saw, next_seen the same a decision later.
        state: (N, s) what the mixer sees, next_state likewise.
        actions: (N, n) whole numbers.
        rewards: (N,) of the team.
        ended: (N,) 1.0 where no reward can follow.
    """

    seen: torch.Tensor
    state: torch.Tensor
    actions: torch.Tensor
    rewards: torch.Tensor
    next_seen: torch.Tensor
    next_state: torch.Tensor
    ended: torch.Tensor


class MonotoneMixer(nn.Module):
    """The f_s above: one hidden layer of ELU with weights >= 0.

    Args:
        boats: n.
        state: numbers in a state.
        hidden: width.
    """

    def __init__(self, boats: int, state: int, hidden: int = 32) -> None:
        super().__init__()
        self.boats, self.hidden = boats, hidden
        self.first = nn.Linear(state, boats * hidden)
        self.first_bias = nn.Linear(state, hidden)
        self.second = nn.Linear(state, hidden)
        self.value = nn.Sequential(nn.Linear(state, hidden), nn.ReLU(), nn.Linear(hidden, 1))

    def forward(self, values: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        """Q_tot (N,) of values (N, n) at states (N, s)."""
        weights = self.first(state).abs().view(-1, self.boats, self.hidden)
        hidden = nn.functional.elu(torch.bmm(values[:, None], weights)[:, 0] + self.first_bias(state))
        mixed: torch.Tensor = (hidden * self.second(state).abs()).sum(1) + self.value(state)[:, 0]
        return mixed


class AdditiveMixer(nn.Module):
    """The sum of the values (Sunehag et al. 2018): what QMIX is to beat."""

    def forward(self, values: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        """Q_tot (N,)."""
        return values.sum(1)


class Qmix:
    """Learner of values and mixer, with target networks and double Q-learning.

    Args:
        agent: network from what a boat sees to its actions' values.
        mixer: `MonotoneMixer` or `AdditiveMixer`.
        copies: builds another agent and mixer of the same shapes, for the targets.
        rate: of Adam.
        discount: per decision.
        target_every: updates between copies to the targets.
    """

    def __init__(
        self,
        agent: nn.Module,
        mixer: nn.Module,
        copies: tuple[nn.Module, nn.Module],
        rate: float = 5e-4,
        discount: float = 0.99,
        target_every: int = 100,
    ) -> None:
        self.agent, self.mixer = agent, mixer
        self.agent_target, self.mixer_target = copies
        self.discount, self.target_every, self.updates = discount, target_every, 0
        self._parameters = [*agent.parameters(), *mixer.parameters()]
        self.optimiser = torch.optim.Adam(self._parameters, lr=rate)
        self._copy()

    def _copy(self) -> None:
        self.agent_target.load_state_dict(self.agent.state_dict())
        self.mixer_target.load_state_dict(self.mixer.state_dict())

    def loss(self, batch: Transitions) -> torch.Tensor:
        """Mean squared error of r + discount * Q_tot'(s', argmax Q) over transitions."""
        chosen = self.agent(batch.seen).gather(2, batch.actions[..., None])[..., 0]
        with torch.no_grad():
            best = self.agent(batch.next_seen).argmax(2, keepdim=True)
            after = self.agent_target(batch.next_seen).gather(2, best)[..., 0]
            future = self.mixer_target(after, batch.next_state)
            target = batch.rewards + self.discount * (1.0 - batch.ended) * future
        return nn.functional.mse_loss(self.mixer(chosen, batch.state), target)

    def update(self, batch: Transitions) -> float:
        """One step of Adam; the loss before it."""
        loss = self.loss(batch)
        self.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self._parameters, 10.0)
        self.optimiser.step()
        self.updates += 1
        if self.updates % self.target_every == 0:
            self._copy()
        return float(loss.detach())
