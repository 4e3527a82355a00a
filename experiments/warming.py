"""Compiling before many processes start: each part once, at the same time, into the cache on disk."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec

import numpy as np
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.wrappers import ShieldedParallelEnv, TeamBatch, games_shield

from . import oracle
from .play.match import play_match
from .play.spec import MatchSpec

SHORT_GAME = MatchSpec(preset="aamas2024", own="medium", opponent="easy", shield={}, rules={"max_time_s": 1.0})


def compile_shield() -> None:
    """Compile the shield of the default settings."""
    Shield().warm_up()


def compile_game() -> None:
    """Compile what a game needs, played by us and stepped by others."""
    play_match(SHORT_GAME)
    env = MctfEnv("aamas2024")
    env.reset(seed=0)
    env.step(dict.fromkeys(env.agents, 4))


def compile_masks() -> None:
    """Compile the masks of actions that learners ask for."""
    env = ShieldedParallelEnv(MctfEnv("aamas2024"), Shield(), masks=True)
    env.reset(seed=0)


def compile_batch() -> None:
    """Compile a batch of games against a scripted team, as learners play them."""
    core = BatchedMctf("aamas2024", n_games=1)
    batch = TeamBatch(core, policies.make_batch("medium"), shield=games_shield(core, team="blue"))
    batch.reset()
    batch.step(np.zeros(batch.learners, dtype=np.int64))


def compile_judge() -> None:
    """Let the post-hoc analysis judge a boat that runs into a stopped one."""
    boat = oracle.Boat("single_integrator", 2.0, max_turn_dps=90.0)
    states = np.zeros((40, 2, oracle.N_STATE))
    states[:, 0, 1], states[:, 0, 3], states[:, 1, 1] = 0.2 * np.arange(40), 2.0, 5.0
    oracle.judge(states, [boat, boat], own=0, step=13, radius_m=2.5)


def compile_encounters(safety_filter: str = "shield", judge: bool = True) -> None:
    """Compile what encounters with a filter need."""
    from .encounters import measure

    measure("rammer_1", safety_filter, n=1, judge=judge)


def compile_boats() -> None:
    """Compile what a run with simulated boats needs: runner, policy, referee and boats; nothing without its extra."""
    if not all(map(find_spec, BOATS_NEED)):
        return
    from .deploy.player import Orders, Player, cast_of
    from .deploy.quiet import warm_up
    from .deploy.referee import Umpire, game_config, player_names
    from .sim_boats import SimBoat, SimFleet
    from .sim_boats.demo import demo_fleet
    from .sim_boats.hull import STEP_S

    fleet = demo_fleet()
    warm_up(fleet)
    Player(Orders(cast_of(fleet), "medium")).warm_up()
    config, names = game_config(fleet), player_names(fleet)
    Umpire(config, names)
    boats = [
        SimBoat(name, fleet.platform_of[name], fleet.team_of[name], address=None, policy="medium") for name in names
    ]
    water = SimFleet(boats, preset=config.replace(dt_s=STEP_S))
    try:
        water.play()
        water.advance(SHORT_S)
    finally:
        water.close()


def compile_fit() -> None:
    """Compile what fitting a boat's model needs; nothing without its extra."""
    if not all(map(find_spec, BOATS_NEED)):
        return
    from .fit.fitting import AHEAD, EVERY
    from .fit.models import MODELS, errors_of
    from .fit.runs import Run

    run = Run.of("none", 0.0, np.zeros((2 * AHEAD, 4)), np.zeros((2 * AHEAD, 2)))
    for model in MODELS.values():
        errors_of(model.platform(model.starts()[0], "any", 2.0).pack(), run, 0.1, EVERY, AHEAD)


SHORT_S = 0.4  # boats are simulated for so long, s
BOATS_NEED = ("pymavlink", "pymap3d", "mcap", "pydantic")  # modules of the extra "boats"
PARTS: dict[str, Callable[[], object]] = {
    "the shield": compile_shield,
    "the shield, each boat by itself": lambda: Shield(ShieldConfig(coordination="per_boat")).warm_up(),
    "the game": compile_game,
    "masks of actions": compile_masks,
    "batches of games": compile_batch,
    "the judge": compile_judge,
    "boats": compile_boats,
    "fits of boats": compile_fit,
    "encounters": compile_encounters,
    "the reachability filter": partial(compile_encounters, "reach", judge=False),
}
"""Everything that commands compile; what one part compiles the next finds."""


def compile_share(number: int, of: int) -> None:
    """Compile everything, the ``number``-th (from 0) ``of`` processes that do: each begins elsewhere."""
    parts = list(PARTS.values())
    first = number * len(parts) // of
    for compile_it in parts[first:] + parts[:first]:
        compile_it()
