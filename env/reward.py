"""The default reward: sparse, from the events of the step."""

from __future__ import annotations

from steerclear.shield.jit import Array, lean_kernel

from .arrays import Games, Rules


@lean_kernel
def reward_games(rules: Rules, games: Games, out: Array) -> None:
    """Rewards of the last step into ``out`` (B, n): weighted own events minus the opponents', minus own collisions."""
    for b in range(out.shape[0]):
        blue = 0.0
        for kind in range(4):
            blue += rules.reward[kind] * (games.events[b, 0, kind] - games.events[b, 1, kind])
        for i in range(rules.n_boats):
            team_reward = blue if rules.team[i] == 0 else -blue
            out[b, i] = team_reward + rules.reward[4] * games.new_collisions[b, i]
