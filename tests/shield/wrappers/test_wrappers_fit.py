"""A shield fits the game it is put on: another step is refused, distances nobody chose are the game's."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.wrappers import ShieldedParallelEnv, TeamBatch, game_facts, games_shield

BLUE = ["agent_0", "agent_1", "agent_2"]
ISLAND = {"circle": [(2.0, (40.0, 10.0))]}


@pytest.fixture
def told(caplog):
    game_facts._warn_once.cache_clear()
    caplog.set_level(logging.WARNING, logger=game_facts.__name__)
    return caplog


def game(preset="aamas2024", **settings):
    return MctfEnv(GameConfig.preset(preset, **settings))


def wrap_env(env, shield):
    return ShieldedParallelEnv(env, shield).shield


def wrap_policy(env, shield):
    team = shield.wrap(policies.make("medium"))
    team.reset(env, BLUE, 0)
    return team.shield


WRAPS = pytest.mark.parametrize("wrap", [wrap_env, wrap_policy])


@WRAPS
@pytest.mark.parametrize(("dt_s", "of_shield"), [(0.5, {}), (0.5, {"dt_s": 0.1}), (0.1, {"dt_s": 0.2})])
def test_a_shield_for_another_step_is_refused(wrap, dt_s, of_shield):
    shield = Shield(**of_shield)
    words = f"steps of {shield.config.dt_s:g} s .* by {dt_s:g} s for each command; build it by Shield.for_game"
    with pytest.raises(ConfigError, match=words):
        wrap(game(dt_s=dt_s), shield)
    assert wrap(game(dt_s=dt_s), Shield(dt_s=dt_s)).config.dt_s == dt_s


@WRAPS
def test_a_distance_nobody_chose_is_the_games_where_that_is_larger(wrap, told):
    given = Shield()
    shield = wrap(game("mctf2025"), given)
    assert (shield.config.separation_m, given.config.separation_m) == (4.0, 2.5)
    assert shield.config == replace(given.config, separation_m=4.0)
    assert [record.getMessage() for record in told.records] == [
        "no separation_m was given: the shield keeps 4 m, the distance at which this game counts collisions"
    ]
    wrap(game("mctf2025"), Shield())
    assert len(told.records) == 1, "once is enough"
    assert wrap(game("aamas2024"), given) is given


@WRAPS
def test_a_smaller_distance_that_was_chosen_stays_and_is_told(wrap, told):
    shield = wrap(game("mctf2025"), Shield(separation_m=2.5))
    assert shield.config.separation_m == 2.5
    assert "keeps 2.5 m (separation_m), but this game counts collisions at 4 m" in told.text
    assert "give separation_m=4" in told.text
    told.clear()
    wrap(game("mctf2025"), Shield(separation_m=6.0))
    assert told.text == ""


def test_the_distance_is_that_of_the_teams_boats(told):
    env = game("mctf2025", agent_radius_m=(1.0, 1.0, 1.0, 2.0, 2.0, 2.0))
    assert ShieldedParallelEnv(env, Shield(), "blue").shield.config.separation_m == 3.0
    assert ShieldedParallelEnv(env, Shield(), "red").shield.config.separation_m == 4.0
    alone = game("aamas2024", team_size=1, agent_radius_m=(0.5, 0.5))
    assert ShieldedParallelEnv(alone, Shield()).shield.config.separation_m == 2.5, "never less than the default"
    assert told.text.count("no separation_m was given") == 2


def test_boats_keep_off_obstacles_by_their_radius(told):
    env = game("mctf2025", obstacles=ISLAND)
    assert ShieldedParallelEnv(env, Shield()).shield.config.obstacle_clearance_m == 2.0
    assert ShieldedParallelEnv(env, Shield(obstacle_clearance_m=1.0)).shield.config.obstacle_clearance_m == 1.0
    assert "keeps 1 m (obstacle_clearance_m), but this game has boats hit its obstacles at 2 m" in told.text
    assert ShieldedParallelEnv(game("mctf2025"), Shield()).shield.config.obstacle_clearance_m == 1.0, (
        "no obstacle, no hull"
    )


@pytest.mark.parametrize(
    "build", [BatchedMctf, MctfEnv, lambda config: ShieldedParallelEnv(MctfEnv(config), Shield(dt_s=0.2))]
)
def test_a_shield_for_a_game_has_its_step_and_distances(build, told):
    config = GameConfig.preset("mctf2025", dt_s=0.2, obstacles=ISLAND)
    shield = Shield.for_game(build(config), current_mps=0.1)
    found = shield.config
    assert (found.dt_s, found.separation_m, found.obstacle_clearance_m, found.current_mps) == (0.2, 4.0, 2.0, 0.1)
    told.clear()
    game_facts._warn_once.cache_clear()
    assert wrap_env(MctfEnv(config), shield) is shield
    assert told.text == ""
    assert Shield.for_game(build(config), separation_m=5.0).config.separation_m == 5.0


def test_shields_of_batches_take_the_games_distances_and_tell_of_smaller_ones(told):
    core = BatchedMctf("mctf2025", n_games=2)
    assert games_shield(core).config.separation_m == 4.0
    assert games_shield(core, ShieldConfig()).config.separation_m == 4.0
    assert games_shield(core, ShieldConfig(separation_m=2.5)).config.separation_m == 2.5
    assert told.text.count("keeps 2.5 m (separation_m), but this game counts collisions at 4 m") == 1
    told.clear()
    game_facts._warn_once.cache_clear()
    own = BatchedShield(ShieldConfig(), 2, ("surveyor",) * 6, (0, 0, 0, 1, 1, 1))
    TeamBatch(core, shield=own).core.step(np.zeros((2, 6, 2)), own.filter_for(0))
    assert "keeps 2.5 m (separation_m), but this game counts collisions at 4 m" in told.text


def test_what_was_chosen_is_known_of_copies_and_does_not_make_settings_differ():
    import copy
    import pickle
    from dataclasses import replace

    unsaid, said = ShieldConfig(dt_s=0.2), ShieldConfig(dt_s=0.2, separation_m=2.5)
    assert unsaid == said
    assert hash(unsaid) == hash(said)
    assert (unsaid.separation_m, str(unsaid.separation_m)) == (2.5, "2.5")
    copies = (copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing)), lambda thing: replace(thing, dt_s=0.1))
    for same in copies:
        assert (same(unsaid).is_chosen("separation_m"), same(said).is_chosen("separation_m")) == (False, True)


def test_a_shield_is_put_to_a_game_that_was_changed_by_the_next_reset():
    env = game("aamas2024")
    wrapped = ShieldedParallelEnv(env, Shield())
    env.core = BatchedMctf(GameConfig.preset("aamas2024", dt_s=0.5))
    with pytest.raises(ConfigError, match=r"steps of 0\.1 s"):
        wrapped.reset(seed=0)


def test_a_game_without_keep_out_has_no_circle_to_keep_off():
    env = game("aamas2024", flag_keepout_m=0.0)
    wrapped = ShieldedParallelEnv(env, Shield())
    home = env.core.flag_home[0]
    start = {"agent_position": {"agent_0": [home[0], home[1] - 6.0]}, "agent_heading": {"agent_0": 0.0}}
    wrapped.reset(seed=0, options={"init_dict": {**start, "agent_speed": {"agent_0": 2.0}}})
    for _ in range(60):
        wrapped.step({"agent_0": (2.0, 0.0)})
        assert wrapped.decisions[0].reason == Reason.PASSED
    assert env.core.state[0, 0, 1] > home[1]


def longer(core):
    core.config = replace(core.config, dt_s=0.5)


def wider(core):
    core.agent_radius_m[:] = 2.0


@pytest.mark.parametrize(("change", "words"), [(longer, "dt_s of the game was 0.1"), (wider, "radius_m of the game")])
def test_a_game_set_to_something_else_in_its_middle_is_refused(change, words):
    env = ShieldedParallelEnv(game(), Shield())
    seen = env.reset(seed=1)
    team = Shield().wrap(policies.make("medium"))
    team.reset(env.unwrapped, BLUE, 0)
    env.step(team.act(*seen))
    change(env.unwrapped.core)
    for go_on in (lambda: env.step({}), lambda: team.act(*seen)):
        with pytest.raises(ConfigError, match=words + r".* now; reset\(\) it"):
            go_on()


@pytest.mark.parametrize("team", [None, True, 2, -1, 1.0, "Blue", [0], b"blue"])
def test_what_is_no_team_is_refused(team):
    with pytest.raises(ConfigError, match=r"unknown team .*; choose 'blue' or 'red'"):
        ShieldedParallelEnv(game(), Shield(), team)
