"""Code that cannot be called as it will be is refused when it is loaded, not held for a whole game."""

import pytest
from steerclear import policies
from steerclear.policies.signatures import call_fault
from steerclear.shield.exceptions import PolicyError

OF_2024 = "self, agent_id:int, observation_normalized:list, observation:dict"


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
    remedy = r"define compute_action\(self, agent_id, full_obs_normalized, full_obs, global_state\)"
    assert caught.match(remedy)


@pytest.mark.parametrize(("prefix", "body"), [("async ", "return 4"), ("", "yield 4"), ("async ", "yield 4")])
def test_answers_that_come_later_are_none(write_entry, prefix, body):
    entry = write_entry(solution("self, a, b, c, d", body, prefix))
    with pytest.raises(PolicyError, match=r"generator.*return the action"):
        policies.make(str(entry))


@pytest.mark.parametrize(
    "arguments",
    ["self, a, b, c, d", "self, a, b, c, d, e=None", "self, agent_id, *rest", "*everything", "self, *a, **more"],
)
def test_whatever_can_be_called_is_taken(game, write_entry, load, arguments):
    env, observations, infos = game
    team = load(write_entry(solution(arguments)))
    team.reset(env, ["agent_0"], 0)
    assert team.act(observations, infos) == {"agent_0": 4}


def test_methods_made_while_it_is_built_count_too(game, write_entry, load):
    made = """
    class solution:
        def __init__(self):
            self.compute_action = lambda a, b, c, d: 4
        def compute_action(self):
            return 4
    """
    env, observations, infos = game
    team = load(write_entry(made))
    team.reset(env, ["agent_0"], 0)
    assert team.act(observations, infos) == {"agent_0": 4}


def test_agents_and_functions_that_cannot_be_called_are_refused(game):
    class Agent:
        def compute_action(self, agent_id, obs, info):
            return 4

    team = policies.from_agents(lambda agent_id, env: Agent())
    with pytest.raises(
        PolicyError, match=r"compute_action of agent agent_0 \(Agent\) takes .*called with \(obs, info\)"
    ):
        team.reset(game[0], ["agent_0"], 0)
    with pytest.raises(PolicyError, match=r"takes \(obs, info\), and is called with \(obs\); give f\(obs\) -> action"):
        policies.from_callable(lambda obs, info: 4)


def test_what_tells_nothing_of_itself_is_given_a_chance():
    class Strange:
        @property
        def __signature__(self):
            raise RuntimeError("not yours")

        def __call__(self):
            return 4

    assert call_fault(Strange(), ("a", "b")) is None
    assert call_fault(dict.fromkeys, ("a",)) is None or "takes" in call_fault(dict.fromkeys, ("a",))


def test_tensors_are_played_and_never_break_the_guard(game):
    torch = pytest.importorskip("torch")
    env, observations, infos = game
    answers = iter([torch.tensor(4), torch.tensor([1.0, 20.0], requires_grad=True), torch.tensor([float("nan"), 0.0])])
    team = policies.from_callable(lambda obs: next(answers))
    team.reset(env, ["agent_0", "agent_1", "agent_2"], 0)
    actions = team.act(observations, infos)
    assert [failure.kind for failure in team.report().failures] == ["not finite"]
    assert actions["agent_2"] == policies.HOLD
    env.step(actions)
