"""Wrap an environment: all boats of a team are shielded, those that the game drives, too.

A real Pyquaticus environment goes in the place of ``game``, unchanged.
"""

from steerclear.env import mctf_v0
from steerclear.shield import Shield
from steerclear.shield.wrappers import ShieldedParallelEnv

game = mctf_v0.parallel_env("aamas2024")
env = ShieldedParallelEnv(game, Shield.for_game(game), team="blue")
observations, infos = env.reset(seed=4)
for _ in range(50):
    observations, rewards, terminated, truncated, infos = env.step({agent: 4 for agent in env.agents})
decision = infos["agent_0"]["shield"]
changed = "changed" if decision.intervened else "as requested"
print(decision.reason.name, f"margin {decision.safety_margin_m:.2f} m", changed)
