"""Train in a batch: every boat of the blue teams is a learner, with the shield inside the environment."""

import numpy as np
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.shield.wrappers import MctfVectorEnv, TeamBatch, games_shield

core = BatchedMctf("mctf2025", n_games=8)
shield = games_shield(core, team="blue")  # None: the same without a shield
learners = MctfVectorEnv(TeamBatch(core, policies.make_batch("medium"), "blue", shield=shield))
observations, infos = learners.reset(seed=1)
random, total = np.random.default_rng(0), np.zeros(learners.num_envs)
for _ in range(20):
    actions = random.integers(0, learners.single_action_space.n, learners.num_envs)  # your learner's
    observations, rewards, terminated, truncated, infos = learners.step(actions)
    total += rewards
print(f"{learners.num_envs} learners, observations {observations.shape}, mean return {total.mean():.2f}")
