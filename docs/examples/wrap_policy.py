"""Wrap a policy: the commands of a team pass the shield on their way to the game."""

from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield

env = MctfEnv("aamas2024")
blue, red = env.possible_agents[:3], env.possible_agents[3:]
ours = Shield.for_game(env).wrap(policies.make("medium"))  # or "entries/our_team.zip", or an object of your own
theirs = policies.make("rammer")

observations, infos = env.reset(seed=2)
ours.reset(env, blue, seed=0)
theirs.reset(env, red, seed=1)
changed = 0
for _ in range(100):
    actions = ours.act(observations, infos) | theirs.act(observations, infos)
    changed += ours.decisions.count_intervened
    observations, _, _, _, infos = env.step(actions)
print(f"commands changed: {changed} of {100 * len(blue)}")
print(f"hits of ours: {env.view().collisions[:3].sum()}")
