import logging
import time

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.policies.registry import KEYBOARD
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error


def run(team, game, steps=1, own=("agent_0", "agent_1", "agent_2")):
    """Actions of each step."""
    env, observations, infos = game
    team.reset(env, list(own), 0)
    actions = []
    for _ in range(steps):
        actions.append(team.act(observations, infos))
        observations, *_, infos = env.step(actions[-1])
    return actions


def test_a_function_gets_each_boats_observation_and_its_actions_pass_unchanged(game):
    seen = []

    def answer(observation):
        seen.append(observation)
        return np.array([1.0, 5.0])

    actions = run(policies.from_callable(answer), game)[0]
    assert list(actions) == ["agent_0", "agent_1", "agent_2"]
    for observation, agent_id in zip(seen, actions, strict=True):
        np.testing.assert_array_equal(observation, game[1][agent_id])
        assert actions[agent_id].dtype == np.float64


def test_functions_by_agent(game):
    team = policies.from_callable({f"agent_{k}": (lambda obs, k=k: k) for k in range(3)})
    assert run(team, game)[0] == {"agent_0": 0, "agent_1": 1, "agent_2": 2}
    with pytest.raises(PolicyError, match="no function for agent_3"):
        team.reset(game[0], ["agent_3"], 0)


@pytest.mark.parametrize("wrap", [policies.from_callable, lambda f: policies.from_agents(lambda name, env: f)])
def test_a_boat_that_is_not_observed_is_one_line(game, wrap):
    class Both:
        def __call__(self, obs):
            return 4

        def compute_action(self, obs, info):
            return 4

    team = wrap(Both())
    team.reset(game[0], ["agent_0"], 0)
    with pytest.raises(PolicyError, match=r"^no observation of agent_0; reset the game first$"):
        team.act({}, {})
    assert team.report().held == 0


def test_what_is_not_callable_is_refused():
    for wrong in (4, {}, {"agent_0": 4}):
        with pytest.raises(PolicyError, match=r"f\(obs\)"):
            policies.from_callable(wrong)
    with pytest.raises(PolicyError, match="dict agent_id -> agent"):
        policies.from_agents(4)


class Agent:
    """Shaped like the reference simulator's own policies: built with the env, looks at infos only."""

    def __init__(self, agent_id, env):
        self.agent_id = agent_id
        self.max_speed = env.max_speeds[env.players[agent_id].idx]
        self.team = 0 if agent_id in env.agent_ids_of_team[0] else 1

    def compute_action(self, obs, info):
        state = info[self.agent_id]["global_state"]
        assert set(obs) == set(info)
        flag = state[("red" if self.team == 0 else "blue") + "_flag_pos"]
        offset = flag - state[(self.agent_id, "pos")]
        bearing = np.degrees(np.arctan2(*offset)) - state[(self.agent_id, "heading")]
        return self.max_speed, (bearing + 180.0) % 360.0 - 180.0


def test_pyquaticus_style_agents_from_a_class_and_from_a_dict(game):
    env, observations, infos = game
    own = ["agent_3", "agent_4", "agent_5"]
    made = policies.from_agents(Agent)
    made.reset(env, own, 0)
    given = policies.from_agents({agent_id: Agent(agent_id, env) for agent_id in own})
    given.reset(env, own, 0)
    actions = made.act(observations, infos)
    assert actions == given.act(observations, infos)
    assert {action[0] for action in actions.values()} == {2.0}
    assert not made.report().failures
    with pytest.raises(PolicyError, match="no agent for agent_0"):
        given.reset(env, ["agent_0"], 0)


def test_agents_without_compute_action_are_refused(game):
    with pytest.raises(PolicyError, match=r"agent_0 \(int\) has no compute_action"):
        policies.from_agents({"agent_0": 4}).reset(game[0], ["agent_0"], 0)


def test_a_factory_that_raises_is_one_clear_error(game):
    def factory(agent_id, env):
        raise RuntimeError("no weights")

    with pytest.raises(PolicyError, match="cannot begin a game: RuntimeError: no weights"):
        policies.from_agents(factory).reset(game[0], ["agent_0"], 0)


def test_a_boat_whose_code_raises_holds_and_the_others_play_on(game, caplog):
    def broken(observation):
        raise ValueError("lost my\nmap")

    team = policies.from_callable({"agent_0": lambda obs: 4, "agent_1": broken, "agent_2": lambda obs: 2}, name="crew")
    with caplog.at_level(logging.WARNING):
        actions = run(team, game, steps=20)
    assert actions == [{"agent_0": 4, "agent_1": policies.HOLD, "agent_2": 2}] * 20
    report = team.report()
    assert (report.policy, report.games, report.calls, report.held) == ("crew", 1, 60, 20)
    (failure,) = report.failures
    assert (failure.kind, failure.agent_id, failure.game, failure.step) == ("raised ValueError", "agent_1", 0, 0)
    assert failure.count == 20
    assert "lost my map" in failure.message
    assert __file__ in failure.message
    assert len(caplog.records) == 1
    assert "crew" in caplog.text
    assert "agent_1" in caplog.text


def test_every_kind_of_failure_is_told_apart_and_dated(game):
    answers = iter([4, None, 4, (np.nan, 0.0), 99, "nowhere", None, SystemExit(3)])

    def answer(observation):
        given = next(answers)
        if isinstance(given, BaseException):
            raise given
        return given

    team = policies.from_callable(answer)
    actions = run(team, game, steps=8, own=["agent_0"])
    usable = [action["agent_0"] == 4 for action in actions]
    assert usable == [True, False, True, False, False, False, False, False]
    assert all(action["agent_0"] == policies.HOLD for action, good in zip(actions, usable, strict=True) if not good)
    found = [(failure.kind, failure.step, failure.count) for failure in team.report().failures]
    assert found == [("no answer", 1, 2), ("not finite", 3, 1), ("no action", 4, 2), ("raised SystemExit", 7, 1)]
    assert team.report().held == 6


def test_ctrl_c_is_not_swallowed(game):
    def interrupted(observation):
        raise KeyboardInterrupt

    team = policies.from_callable(interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(team, game)


def test_slow_answers_are_timed_and_reported(game):
    def answer(observation, calls=[]):  # noqa: B006 (counts the calls)
        calls.append(1)
        if len(calls) == 5:
            time.sleep(0.12)
        return 16

    team = policies.from_callable(answer)
    run(team, game, steps=3)
    report = team.report()
    assert report.step_ms == pytest.approx(100.0)
    assert report.late == 1
    assert report.slowest == ("agent_1", 0, 1)
    assert 120.0 <= report.max_ms < 2000.0
    assert report.max_ms / report.calls <= report.mean_ms <= report.max_ms
    assert "1 longer than a step of 100 ms" in report.lines()[0]
    assert report.as_dict()["late"] == 1


def test_the_report_of_several_games_goes_on_counting(game):
    team = policies.from_callable(lambda obs: None)
    run(team, game)
    env = game[0]
    run(team, (env, *env.reset(seed=2)), steps=2)
    report = team.report()
    assert (report.games, report.calls, report.held) == (2, 9, 9)
    assert report.failures[0].game == 0
    assert "no answer x 9, first agent_0, game 0, step 0" in report.lines()[1]


def test_a_report_before_any_game():
    report = policies.from_callable(lambda obs: 4, name="new").report()
    assert report.lines() == ["new: 0 calls in 0 games, 0 held; mean 0.000 ms, longest 0.0 ms"]


def test_acting_without_a_game_is_refused():
    with pytest.raises(PolicyError, match="call reset"):
        policies.from_callable(lambda obs: 4).act({}, {})


def test_an_error_without_a_place_is_still_described():
    assert describe_error(ValueError("x")) == "ValueError: x"


def keyboard(game, pressed, **options):
    env, observations, infos = game
    team = policies.make(KEYBOARD, keys=lambda: set(pressed), **options)
    team.reset(env, ["agent_0", "agent_1", "agent_2"], 0)
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
    medium.reset(env, ["agent_0", "agent_1", "agent_2"], 0)
    wanted = medium.act(observations, infos)
    actions = keyboard(game, ["up"], agent="agent_1")
    assert actions == {"agent_0": wanted["agent_0"], "agent_1": (2.0, 0.0), "agent_2": wanted["agent_2"]}
    assert keyboard(game, [], agent=2, others="hold") == dict.fromkeys(actions, (0.0, 0.0))


def test_a_human_alone(game):
    env, observations, infos = game
    team = policies.make(KEYBOARD, keys=lambda: {"up"})
    team.reset(env, ["agent_4"], 0)
    assert team.act(observations, infos) == {"agent_4": (2.0, 0.0)}


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
