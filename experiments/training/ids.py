"""An id for Gymnasium, ``make_vec("steerclear.experiments.training.ids:steerclear/Mctf-v0", num_envs=192)``."""

from __future__ import annotations

from typing import Any

from gymnasium.envs.registration import register, registry

ID = "steerclear/Mctf-v0"


if ID not in registry:
    register(
        id=ID,
        entry_point="steerclear.experiments.training.ids:make_one",
        vector_entry_point="steerclear.experiments.training.ids:make_learners",
    )


def make_one(**settings: Any) -> Any:
    """Refuse it: a game has more than one learner.

    Raises:
        ConfigError: always.
    """
    from steerclear.shield.exceptions import ConfigError

    raise ConfigError(f'{ID} has many learners; call gymnasium.make_vec("{make_one.__module__}:{ID}", num_envs=...)')


def make_learners(
    num_envs: int = 3,
    preset: str = "aamas2024",
    opponent: str = "medium",
    team: str = "blue",
    shield: bool = False,
    actions: str = "discrete",
    interval: int = 1,
    seed: int = 0,
    autoreset_mode: Any = "SameStep",
    **rules: Any,
) -> Any:
    """A `MctfVectorEnv`.

    Args:
        num_envs: learners, a whole number of teams.
        preset: rules of the game.
        opponent: name of a batch policy.
        team: the learners' side.
        shield: a shield stands in the games.
        actions: "discrete", "continuous" or "normalised".
        interval: game steps for which a decision is held.
        seed: of games and opponent.
        autoreset_mode: "SameStep", "NextStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        **rules: settings of the game that replace the preset's.

    Raises:
        ConfigError: boats that make no whole teams, a shield that is neither True nor False, or another unusable
            setting.
    """
    from steerclear import policies
    from steerclear.env.config import GameConfig
    from steerclear.env.core import BatchedMctf
    from steerclear.shield.exceptions import ConfigError
    from steerclear.shield.wrappers import MctfVectorEnv, TeamBatch, games_shield

    config = GameConfig.preset(preset, **{"default_start": False, **rules})
    if num_envs < 1 or num_envs % config.team_size:
        raise ConfigError(f"num_envs is {num_envs}; give a multiple of {config.team_size}, one for each boat of a team")
    if not isinstance(shield, bool):  # a name or settings would be true, and not what they say
        raise ConfigError(
            f"shield is {shield!r}; give True or False, or build one with settings from parts: games_shield(core, "
            "ShieldConfig(...)) in a TeamBatch"
        )
    core = BatchedMctf(config, n_games=num_envs // config.team_size, seed=seed)
    guard = games_shield(core, team=team) if shield else None
    batch = TeamBatch(core, policies.make_batch(opponent), team, guard, actions, seed, interval)
    return MctfVectorEnv(batch, autoreset_mode)
