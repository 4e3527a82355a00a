"""A person plays: one boat by arrow keys, or all of a team by options."""

import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.registry import KEYBOARD
from steerclear.shield.exceptions import PolicyError

BLUE = ["agent_0", "agent_1", "agent_2"]


def keyboard(game, pressed, own=BLUE, **options):
    env, observations, infos = game
    team = policies.make(KEYBOARD, keys=lambda: set(pressed), **options)
    team.reset(env, own, 0)
    return team.act(observations, infos)


@pytest.mark.parametrize(
    ("pressed", "action"),
    [
        ([], (0.0, 0.0)),
        (["up"], (2.0, 0.0)),
        (["w", "left"], (2.0, -45.0)),
        (["up", "d"], (2.0, 45.0)),
        (["up", "left", "right"], (2.0, 0.0)),
        (["up", "left shift"], (1.0, 0.0)),
        (["a"], (1.0, -90.0)),
        (["right"], (1.0, 90.0)),
        (["down", "up"], (1.0, 180.0)),
        (["x"], (0.0, 0.0)),
    ],
)
def test_keys_steer_the_humans_boat(game, pressed, action):
    assert keyboard(game, pressed)["agent_0"] == action


def test_the_other_boats_are_played_by_another_policy(game):
    env, observations, infos = game
    medium = policies.make("medium")
    medium.reset(env, BLUE, 0)
    wanted = medium.act(observations, infos)
    actions = keyboard(game, ["up"], agent="agent_1")
    assert actions == {"agent_0": wanted["agent_0"], "agent_1": (2.0, 0.0), "agent_2": wanted["agent_2"]}
    assert keyboard(game, [], agent=2, others="hold") == dict.fromkeys(actions, (0.0, 0.0))
    assert keyboard(game, ["up"], own=["agent_4"]) == {"agent_4": (2.0, 0.0)}


class Windowed(MctfEnv):
    """A game with a made-up window."""

    renderer = None


def test_keys_come_from_the_games_window_once_there_is_one():
    env = Windowed("aamas2024")
    observations, infos = env.reset(seed=1)
    env.render_mode = "human"
    team = policies.make(KEYBOARD, others="hold")
    team.reset(env, ["agent_0", "agent_1"], 0)
    assert team.act(observations, infos)["agent_0"] == (0.0, 0.0)
    env.renderer = type("Renderer", (), {"keys": lambda self: {"up"}})()
    assert team.act(observations, infos) == {"agent_0": (2.0, 0.0), "agent_1": (0.0, 0.0)}


def test_the_keyboard_needs_a_window_and_a_boat_of_its_team(game):
    env, *_ = game
    with pytest.raises(PolicyError, match="render_mode='human'"):
        policies.make(KEYBOARD).reset(env, ["agent_0"], 0)
    for agent in ("agent_3", 3, -1):
        with pytest.raises(PolicyError, match="agent is"):
            policies.make(KEYBOARD, agent=agent, keys=set).reset(env, ["agent_0", "agent_1"], 0)
    with pytest.raises(PolicyError, match="call reset"):
        policies.make(KEYBOARD).act({}, {})
