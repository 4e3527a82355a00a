import numpy as np
import pytest
from steerclear import policies
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.platforms import layout as L


def test_every_kind_of_action_becomes_a_command(game):
    env, *_ = game
    state = env.core.state[0, 0]
    state[[L.X, L.Y, L.HEADING]] = [20.0, 20.0, 30.0]
    assert policies.to_command(env, "agent_0", 4) == (2.0, 0.0)
    assert policies.to_command(env, "agent_0", np.int64(15)) == (1.0, -135.0)
    assert policies.to_command(env, "agent_0", -1) == (0.0, 0.0)
    assert policies.to_command(env, "agent_0", (1.5, -20.0)) == (1.5, -20.0)
    assert policies.to_command(env, "agent_0", np.float32([1.5, -20.0])) == (1.5, -20.0)
    assert policies.to_command(env, "agent_0", "CC") == pytest.approx((2.0, 60.0))


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


@pytest.mark.parametrize(
    "action", [0, 16, -1, np.int32(3), np.array(5), np.array([5]), (0.0, 0.0), [2.0, 359.0], "SSBX"]
)
def test_what_can_be_played_has_no_problem(game, action):
    assert policies.ActionReader(game[0]).problem("agent_4", action) is None


def test_long_answers_are_shortened_in_messages(game):
    kind, text = policies.ActionReader(game[0]).problem("agent_0", np.full(10_000, np.nan))
    assert kind == "not finite"
    assert len(text) < 200


def test_unknown_agents_and_envs_are_refused(game):
    with pytest.raises(PolicyError, match="unknown agent 'agent_9'"):
        policies.to_command(game[0], "agent_9", 4)
    with pytest.raises(PolicyError, match="MctfEnv"):
        policies.ActionReader(object())
