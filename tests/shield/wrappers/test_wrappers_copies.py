"""Copies, pickles and other processes go on with the same game, bit for bit, and leave the original alone."""

import copy
import multiprocessing
import pickle
from itertools import product

import cloudpickle
import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Commands, Fleet, Shield
from steerclear.shield.exceptions import PolicyError
from wrapped_games import GAMES, KINDS, SMALL, Batch, Env, sb3_front

COPIES = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
    "cloudpickle": lambda thing: pickle.loads(cloudpickle.dumps(thing)),
}


def begun(kind):
    game = kind()
    game.begin()
    game.play(8)
    return game


@pytest.mark.parametrize(("name", "way"), [*product(KINDS, ("deepcopy", "pickle")), ("env", "cloudpickle")])
def test_a_copy_goes_on_as_the_original_and_leaves_it_alone(name, way):
    game, twin = begun(KINDS[name]), begun(KINDS[name])
    other = COPIES[way](game)
    copied = other.play()
    assert copied == game.play() == twin.play(), "the copy's play has not touched the original"
    other.begin()
    game.begin()
    assert other.play(10) == game.play(10)


def test_the_games_that_are_copied_are_games_in_which_shields_work():
    game = begun(Env)
    assert sum(game.play(1) and game.intervened for _ in range(30)) > 0


@pytest.mark.parametrize("way", COPIES)
def test_copies_of_the_environment_for_stable_baselines_go_on_alike(way):
    pytest.importorskip("stable_baselines3")
    game = begun(lambda: Batch(sb3_front))
    other = COPIES[way](game)
    assert other.play() == game.play()


def fleet_of(gap_m):
    return Fleet.of(
        position_m=[[0, 0], [0, gap_m]], heading_rad=[0, np.pi], speed_mps=[2, 2], team=[0, 1], platforms="heron"
    )


def ahead(gap_m):
    return Commands.absolute_rad([[2.0, 0.0], [2.0, np.pi]])


@pytest.mark.parametrize("way", COPIES)
def test_a_wrapped_function_is_copied_with_its_shield(way):
    team = Shield().wrap(ahead, read=fleet_of)
    team(7.0)
    other = COPIES[way](team)
    assert other(6.0).values.tobytes() == team(6.0).values.tobytes() != ahead(6.0).values.tobytes()


@pytest.mark.parametrize("name", [name for name in policies.names() if name not in ("keyboard", *policies.entrants())])
def test_named_policies_are_the_same_when_pickled(name):
    team = pickle.loads(pickle.dumps(policies.make(name)))
    assert team.name == name
    core, other = BatchedMctf(SMALL, GAMES, seed=0), BatchedMctf(SMALL, GAMES, seed=0)
    batch = policies.make_batch(name)
    for policy, games in ((pickle.loads(pickle.dumps(batch)), core), (batch, other)):
        policy.reset(games, 1, 5)
    begun_pickle = pickle.loads(pickle.dumps((batch, other)))
    commands = [policy.act(games, 1).tobytes() for policy, games in ((batch, core), (batch, other), begun_pickle)]
    assert len(set(commands)) == 1


def test_a_game_with_a_window_is_copied_without_it():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1), render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    try:
        other = pickle.loads(pickle.dumps(env))
        assert other.renderer is None
        assert env.renderer is not None
        np.testing.assert_array_equal(other.render(), picture)
        other.close()
    finally:
        env.close()


def play_sent(pipe):
    """In another process: play on what is sent, and send the digest back."""
    pipe.send([game.play() for game in pickle.loads(pipe.recv())])


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_another_process_plays_the_same_games(method):
    games = [begun(kind) for kind in KINDS.values()]
    mine, theirs = multiprocessing.get_context(method).Pipe()
    worker = multiprocessing.get_context(method).Process(target=play_sent, args=(theirs,), daemon=True)
    worker.start()
    try:
        mine.send(pickle.dumps(games))
        assert mine.poll(60.0), "no answer"
        assert mine.recv() == [game.play() for game in games]
    finally:
        worker.join(10.0)
        worker.kill()


@pytest.mark.parametrize("way", [*COPIES, "another game"])
def test_a_wrapped_policy_that_reads_a_game_nobody_plays_says_so_instead_of_steering(way):
    game = MctfEnv(SMALL)
    observations, infos = game.reset(seed=3)
    policy = Shield.for_game(game).wrap(policies.make("medium"))
    policy.reset(game, game.agents[:3], seed=1)
    if way == "another game":
        game = MctfEnv(SMALL)
        observations, infos = game.reset(seed=4)
    else:
        policy = COPIES[way](policy)
    observations, _, _, _, infos = game.step(policy.act(observations, infos))  # of a copy it was the same until now
    with pytest.raises(PolicyError, match="stands still while another is played; call reset"):
        policy.act(observations, infos)
    policy.reset(game, game.agents[:3], seed=1)
    for _ in range(3):
        observations, _, _, _, infos = game.step(policy.act(observations, infos))


def test_a_wrapped_policy_may_be_asked_twice_in_one_step():
    game = MctfEnv(SMALL)
    observations, infos = game.reset(seed=3)
    policy = Shield.for_game(game).wrap(policies.make("medium"))
    policy.reset(game, game.agents[:3], seed=1)
    for _ in range(3):
        assert set(policy.act(observations, infos)) == set(game.agents[:3])
