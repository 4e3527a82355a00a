"""Foreign code plays boat by boat, whatever it does the game goes on, and what cannot be called is refused at load."""

import importlib
import logging
import time

import numpy as np
import pytest
from steerclear import policies
from steerclear.policies.adapters import call_fault
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error

OF_2024 = "self, agent_id:int, observation_normalized:list, observation:dict"

OWN = ("agent_0", "agent_1", "agent_2")


def run(team, game, steps=1, own=OWN):
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
    assert tuple(actions) == OWN
    for observation, agent_id in zip(seen, actions, strict=True):
        np.testing.assert_array_equal(observation, game[1][agent_id])
        assert actions[agent_id].dtype == np.float64
    team = policies.from_callable({f"agent_{k}": (lambda obs, k=k: k) for k in range(3)})
    assert run(team, game)[0] == {"agent_0": 0, "agent_1": 1, "agent_2": 2}
    with pytest.raises(PolicyError, match="no function for agent_3"):
        team.reset(game[0], ["agent_3"], 0)


class NoAgent:
    """Nothing that plays."""


@pytest.mark.parametrize(
    ("agents", "words"),
    [
        (NoAgent, r"class NoAgent has no compute_action\(obs, info\); define it, or give a function"),
        ({"agent_0": NoAgent()}, r"agent agent_0 \(NoAgent\) has no compute_action"),
    ],
)
def test_what_has_no_compute_action_is_refused_before_a_game(agents, words):
    with pytest.raises(PolicyError, match=words):
        policies.from_agents(agents)


def test_the_earlier_module_of_foreign_code_warns():
    guard = importlib.import_module("steerclear.policies.guard")
    with pytest.warns(DeprecationWarning, match="'steerclear.policies.guard' is now 'steerclear.policies.foreign'"):
        assert guard.GuardedTeam is policies.GuardedTeam


class Both:
    """A function, and an agent."""

    def __call__(self, obs):
        return 4

    def compute_action(self, obs, info):
        return 4


@pytest.mark.parametrize("wrap", [policies.from_callable, lambda f: policies.from_agents(lambda name, env: f)])
def test_a_boat_that_is_not_observed_and_a_game_that_was_not_begun_are_one_line(game, wrap):
    team = wrap(Both())
    with pytest.raises(PolicyError, match="call reset"):
        team.act({}, {})
    team.reset(game[0], ["agent_0"], 0)
    with pytest.raises(PolicyError, match=r"^no observation of agent_0; reset the game first$"):
        team.act({}, {})
    assert team.report().held == 0


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


def failing(agent_id, env):
    raise RuntimeError("no weights")


class Other:
    def compute_action(self, agent_id, obs, info):
        return 4


@pytest.mark.parametrize(
    ("agents", "words"),
    [
        (4, "dict agent_id -> agent"),
        ({"agent_0": 4}, r"agent_0 \(int\) has no compute_action"),
        (failing, "cannot begin a game: RuntimeError: no weights"),
        (lambda agent_id, env: Other(), r"compute_action of agent agent_0 \(Other\) takes .*called with \(obs, info\)"),
    ],
)
def test_agents_that_cannot_play_are_refused(game, agents, words):
    with pytest.raises(PolicyError, match=words):
        policies.from_agents(agents).reset(game[0], ["agent_0"], 0)


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


@pytest.mark.parametrize(
    ("body", "place"),
    [
        ("raise ValueError('x')", "theirs.py:2)"),
        ("__import__('json').loads('{')", "theirs.py:2, raised in "),
        ("__import__('steerclear.shield.foreign').shield.foreign.plain_text(3, most='a')", "theirs.py:2, raised in "),
    ],
)
def test_an_error_names_their_line_before_ours_or_a_librarys(body, place):
    names = {}
    exec(compile(f"def play():\n    {body}\n", "theirs.py", "exec"), names)
    with pytest.raises(Exception) as raised:  # noqa: PT011
        names["play"]()
    told = describe_error(raised.value)
    assert place in told
    assert "test_policies_guard" not in told


def test_every_kind_of_failure_is_told_apart_and_dated(game):
    answers = iter([4, None, 4, (np.nan, 0.0), 99, "nowhere", None, SystemExit(3), (1e9, 0.0), ZeroDivisionError()])

    def answer(observation):
        given = next(answers)
        if isinstance(given, BaseException):  # of which an interrupt is not swallowed
            raise given
        return given

    team = policies.from_callable(answer)
    actions = run(team, game, steps=10, own=["agent_0"])
    assert [action["agent_0"] for action in actions] == [4, policies.HOLD, 4, *[policies.HOLD] * 7]
    found = [(failure.kind, failure.step, failure.count) for failure in team.report().failures]
    assert found[:3] == [("no answer", 1, 2), ("not finite", 3, 1), ("no action", 4, 2)]
    assert found[3:] == [("raised SystemExit", 7, 1), ("too large", 8, 1), ("raised ZeroDivisionError", 9, 1)]
    report = team.report()
    assert report.held == 8
    assert "no answer x 2, first agent_0, game 0, step 1" in report.lines()[1]
    answers = iter([KeyboardInterrupt()])
    with pytest.raises(KeyboardInterrupt):
        run(team, (game[0], *game[0].reset(seed=2)), own=["agent_0"])
    assert team.report().games == 2


def test_slow_answers_are_timed_and_reported(game):
    def answer(observation, calls=[]):  # noqa: B006 (counts the calls)
        calls.append(1)
        if len(calls) == 5:
            time.sleep(0.12)
        return 16

    team = policies.from_callable(answer)
    assert team.report().lines() == ["callable: 0 calls in 0 games, 0 held; mean 0.000 ms, longest 0.0 ms"]
    run(team, game, steps=3)
    report = team.report()
    assert report.step_ms == pytest.approx(100.0)
    assert report.late == 1
    assert report.slowest == ("agent_1", 0, 1)
    assert 120.0 <= report.max_ms < 2000.0
    assert report.max_ms / report.calls <= report.mean_ms <= report.max_ms
    assert "1 longer than a step of 100 ms" in report.lines()[0]
    assert report.as_dict()["late"] == 1


def solution(arguments, body="return 4", prefix=""):
    return f"""
    class solution:
        {prefix}def compute_action({arguments}):
            {body}
    """


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (OF_2024, r"takes \(agent_id, observation_normalized, observation\).*looks like the interface of 2024"),
        ("self, agent_id, observation, global_state", "looks like the interface of 2024"),
        ("self, obs, info", r"takes \(obs, info\), and is called with \(agent_id, full_obs_normalized, full_obs, gl"),
        ("self", r"takes \(\)"),
        ("self, a, b, c, d, info", r"takes \(a, b, c, d, info\)"),
        ("self, a, b, c, d, *, info", r"takes \(a, b, c, d, info=\)"),
        ("self, *, agent_id", r"takes \(agent_id=\)"),
    ],
)
def test_other_interfaces_are_refused_at_load_with_the_one_that_is_called(write_entry, arguments, words):
    with pytest.raises(PolicyError, match=words) as caught:
        policies.make(str(write_entry(solution(arguments))))
    assert caught.match(r"define compute_action\(self, agent_id, full_obs_normalized, full_obs, global_state\)")


@pytest.mark.parametrize(("prefix", "body"), [("async ", "return 4"), ("", "yield 4"), ("async ", "yield 4")])
def test_answers_that_come_later_are_none(write_entry, prefix, body):
    with pytest.raises(PolicyError, match=r"generator.*return the action"):
        policies.make(str(write_entry(solution("self, a, b, c, d", body, prefix))))


MADE_WHILE_BUILT = """
    class solution:
        def __init__(self): self.compute_action = lambda a, b, c, d: 4
        def compute_action(self): return 4
"""


@pytest.mark.parametrize(
    "code",
    [
        *map(solution, ("self, a, b, c, d", "self, a, b, c, d, e=None", "self, agent_id, *rest", "*everything")),
        MADE_WHILE_BUILT,
    ],
)
def test_whatever_can_be_called_is_taken(game, write_entry, load, code):
    assert run(load(write_entry(code)), game, own=["agent_0"]) == [{"agent_0": 4}]


class Strange:
    """Tells nothing of itself, and so is given a chance."""

    def __call__(self):
        return 4

    @property
    def __signature__(self):
        raise RuntimeError("not yours")


def test_what_tells_nothing_of_itself_is_taken():
    assert call_fault(Strange(), ("a", "b")) is None


NONSENSE = [
    (None, "no answer"),
    (float("nan"), "not finite"),
    ((1.0, float("nan")), "not finite"),
    (np.array([np.inf, 0.0]), "not finite"),
    (17, "no action"),
    (-2, "no action"),
    (10**400, "no action"),
    ((10**400, 1), "no action"),
    ((1.0, 2.0, 3.0), "no action"),
    ((), "no action"),
    ([], "no action"),
    ("XYZ", "no action"),
    ("", "no action"),
    (["CC", "CC"], "no action"),
    (True, "no action"),
    (3.7, "no action"),
    ({"speed": 1.0}, "no action"),
    ({1, 2}, "no action"),
    (object(), "no action"),
    (b"4", "no action"),
    ((1 + 2j, 0.0), "no action"),
    (np.array([1 + 2j, 0.0]), "no action"),
    ([[1.0], [2.0]], "no action"),
    ((1e6, 0.0), "too large"),
    ((1.0, 1e9), "too large"),
    ((-50.0, 0.0), "too large"),
]


@pytest.mark.parametrize(("action", "kind"), NONSENSE, ids=lambda value: repr(value).split(" at 0x")[0][:24])
def test_nonsense_is_named(game, action, kind):
    reader = policies.ActionReader(game[0])
    found = reader.problem("agent_1", action)
    assert found is not None
    assert found[0] == kind
    with pytest.raises(PolicyError, match=kind):
        reader.command("agent_1", action)


def test_unknown_agents_and_envs_are_refused(game):
    with pytest.raises(PolicyError, match="unknown agent 'agent_9'"):
        policies.to_command(game[0], "agent_9", 4)
    with pytest.raises(PolicyError, match="MctfEnv"):
        policies.ActionReader(object())
