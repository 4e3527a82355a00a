"""Learn with action masks: MaskablePPO chooses among the actions that the shield would let pass; the shield stays."""

from sb3_contrib import MaskablePPO
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.wrappers import MctfVecEnv, TeamBatch, games_shield

core = BatchedMctf(GameConfig.preset("aamas2024", default_start=False), n_games=4, seed=1)
opponent = policies.make_batch("medium")
envs = MctfVecEnv(TeamBatch(core, opponent, shield=games_shield(core, team="blue"), interval=10))
model = MaskablePPO("MlpPolicy", envs, n_steps=4, batch_size=48, n_epochs=1, seed=1)
model.learn(total_timesteps=48)  # a thousand times as many to learn something
masks = envs.action_masks()
actions, _ = model.predict(envs.reset(), action_masks=masks)
print(f"{masks.shape[0]} learners, {masks.shape[1]} actions each, {masks.mean():.0%} of them pass")
