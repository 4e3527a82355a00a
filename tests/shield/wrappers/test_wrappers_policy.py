"""The shield around a policy: what the policy answers is already safe."""

import copy

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Commands, Fleet, Reason, Shield
from steerclear.shield.exceptions import ConfigError, PolicyError
from steerclear.shield.wrappers import ShieldedCallable, ShieldedParallelEnv, ShieldedTeamPolicy, games_shield

OWN = ["agent_0", "agent_1", "agent_2"]


def crowd():
    """Three own boats close together, making for one another, and opponents far away."""
    places = [[18.0, 8.0], [32.0, 8.0], [25.0, 24.0], [60.0, 5.0], [60.0, 20.0], [60.0, 35.0]]
    headings = [90.0, -90.0, 180.0, 0.0, 0.0, 0.0]
    start = {"agent_position": places, "agent_heading": headings, "agent_speed": [1.5] * 6}
    return MctfEnv(GameConfig.preset("aamas2024")), {"init_dict": start}


def straight():
    return policies.from_callable(lambda observation: 4)


def test_the_answers_keep_the_team_apart_and_are_pairs_only_where_changed():
    closest = {}
    for team in (straight(), Shield().wrap(straight())):
        env, options = crowd()
        observations, infos = env.reset(seed=0, options=options)
        team.reset(env, OWN, 0)
        gaps = []
        for _ in range(70):
            actions = team.act(observations, infos)
            if isinstance(team, ShieldedTeamPolicy):
                changed = [np.shape(actions[agent]) == (2,) for agent in OWN]
                assert changed == team.decisions.intervened[:3].tolist()
            observations, *_, infos = env.step(actions)
            place = env.view().position[:3]
            gaps += [np.hypot(*(place[i] - place[j])) for i in range(3) for j in range(i)]
        closest[type(team)] = min(gaps)
    wrapped = closest.pop(ShieldedTeamPolicy)
    assert closest.popitem()[1] < 2.5 <= wrapped


def test_the_decisions_are_those_of_a_shielded_env():
    (env, options), (inner, _) = crowd(), crowd()
    other = ShieldedParallelEnv(inner, Shield(), shield_autopilot=False)
    team, bare = Shield().wrap(straight()), straight()
    start = options["init_dict"]["agent_position"]
    seen, likewise = env.reset(seed=0, options=options), other.reset(seed=0, options=options)
    team.reset(env, OWN, 0)
    bare.reset(other, OWN, 0)
    for _ in range(60):
        actions = team.act(*seen)
        observations, *_, infos = env.step(actions)
        *_, shielded_infos = other.step(bare.act(*likewise))
        seen = likewise = observations, infos
        for i, agent in enumerate(OWN):
            mine, theirs = team.decisions[i], shielded_infos[agent]["shield"]
            assert (mine.reason, mine.active_constraints) == (theirs.reason, theirs.active_constraints)
        # actions outside the env are float32, commands inside its step are not
        np.testing.assert_allclose(env.view().position, inner.view().position, atol=1e-4)
    assert (env.view().position[0] != start[0]).any()


def test_what_is_wrapped_says_what_its_shield_keeps_and_has_what_it_wraps():
    team = policies.make("medium")
    shielded = copy.copy(Shield().wrap(team))
    shielded.reset(crowd()[0], OWN, 0)
    assert (shielded.name, shielded.behaviours) == (f"shielded {team.name}", team.behaviours)
    with pytest.raises(AttributeError):
        _ = shielded.nonsense
    kept = "Shield(separation_m=4, profile='ramming', dt_s=0.1)"
    settings = {"separation_m": 4.0, "profile": "ramming"}
    assert repr(Shield(**settings).wrap(policies.make("medium"))) == f"<shielded medium: {kept}>"
    assert repr(Shield(**settings).wrap(crowd, read=straight)) == f"<shielded crowd: {kept}>"
    env = repr(ShieldedParallelEnv(crowd()[0], Shield(**settings), team="red"))
    assert env.startswith("<ShieldedParallelEnv of red in ")
    assert env.endswith(f": {kept}>")


def test_misuse_is_refused():
    env, _ = crowd()
    team = Shield().wrap(straight())
    with pytest.raises(PolicyError, match="call reset"):
        team.act({}, {})
    with pytest.raises(ConfigError, match="are of two teams; give the boats of one"):
        team.reset(env, ["agent_0", "agent_3"], 0)
    with pytest.raises(ConfigError, match="unknown boat 'agent_9'; the game has agent_0, "):
        team.reset(env, ["agent_9"], 0)
    with pytest.raises(ConfigError, match="names no boat; give the boats of one team"):
        team.reset(env, [], 0)
    with pytest.raises(ConfigError, match="a plain function needs read="):
        Shield().wrap(lambda seen: None)
    with pytest.raises(ConfigError, match="cannot wrap the name 'medium'; give the policy: wrap"):
        Shield().wrap("medium")
    with pytest.raises(ConfigError, match="read is 5; give a function"):
        Shield().wrap(lambda seen: None, read=5)
    with pytest.raises(ConfigError, match=r"ScriptedTeam is a class; give a policy: ScriptedTeam\(...\)"):
        Shield().wrap(type(policies.make("medium")))
    with pytest.raises(ConfigError, match=r"read= is for plain functions; .* leave it out"):
        Shield().wrap(policies.make("medium"), read=near)
    for shield in (5, Shield, None, games_shield(BatchedMctf("aamas2024", n_games=1))):
        with pytest.raises(ConfigError, match="is no shield of one game; give"):
            ShieldedTeamPolicy(straight(), shield)
        with pytest.raises(ConfigError, match="is no shield of one game; give"):
            ShieldedCallable(straight, shield, near)
        with pytest.raises(ConfigError, match="is no shield of one game; give"):
            ShieldedParallelEnv(env, shield)


def near(gap_m):
    return Fleet.of(
        position_m=[[0, 0], [0, gap_m]], heading_rad=[0, np.pi], speed_mps=[2, 2], team=[0, 1], platforms="heron"
    )


def test_a_function_of_what_is_seen_gets_a_shield_too():
    wanted = Commands.absolute_rad([[2.0, 0.0], [2.0, np.pi]])
    team = Shield(profile="ramming").wrap(lambda gap_m: wanted, read=near)
    assert isinstance(team, ShieldedCallable)
    assert team(60.0).values.tobytes() == wanted.values.tobytes()
    assert team(6.0).values[0, 1] != 0.0
    assert team.decisions[0].intervened


@pytest.mark.parametrize("answer", [None, Commands.relative_deg([[1.0, 0.0]]), [[2.0, 0.0], [2.0, 0.0]], ValueError])
def test_a_function_that_fails_holds_the_boats(answer, caplog):
    def policy(seen):
        if answer is ValueError:
            raise ValueError("broken")
        return answer

    team = Shield().wrap(policy, read=near)
    sent = team(60.0)
    assert team.decisions[0].reason == Reason.HELD
    assert np.isfinite(sent.values[0]).all()
    assert sent.values[0, 0] == 0.0
    assert caplog.messages
    assert ("ValueError: broken" in caplog.text) == (answer is ValueError)
    assert (f"({__file__}:" in caplog.text) == (answer is ValueError), "where the function failed"


def test_a_command_that_is_not_finite_holds_its_boat_and_the_log_says_whose(caplog):
    answers = iter([[[2.0, 0.0], [np.nan, 0.0]], *[[[bad, 0.0], [2.0, 0.0]] for bad in (np.nan, np.inf, 2.0)]])
    team = Shield().wrap(lambda gap_m: Commands.absolute_rad(next(answers)), read=near)
    reasons = [(team(60.0), team.decisions["boat_0"].reason)[1] for _ in range(4)]
    assert reasons == [Reason.PASSED, Reason.HELD, Reason.HELD, Reason.PASSED]
    said = [record.message for record in caplog.records]
    assert said == ["policy failed: commands of 'boat_0' are not finite; they hold", "policy answers again"]


def test_a_function_that_fails_is_answered_for_in_its_own_frame(caplog):
    """Absolute headings sent on as they are: a relative one among them would turn the boats."""
    answers = [None, Commands.absolute_rad([[2.0, 0.0], [2.0, np.pi]]), None, None, "no", None, None]
    answers[4:4] = [Commands.absolute_rad([[2.0, 0.0], [2.0, np.pi]])]
    told, team = iter(answers), Shield().wrap(lambda gap_m: next(told), read=near)
    sent = [team(60.0) for _ in answers]
    assert [one.relative for one in sent] == [False] * 8
    np.testing.assert_allclose(sent[2].values[0], [0.0, 0.0], atol=1e-12)
    assert team.decisions[0].reason == Reason.HELD
    failed = [record.message for record in caplog.records if "failed" in record.message]
    assert len(failed) == 4, "once when it begins, and when it becomes another"
    assert sum("answers again" in record.message for record in caplog.records) == 2


class Always:
    """A team that always gives the same answer."""

    def __init__(self, answer):
        self.answer = answer

    def reset(self, env, agent_ids, seed):
        pass

    def act(self, observations, infos):
        return self.answer


def begun(policy):
    """A wrapped policy in a game, and what it sees first."""
    env, _ = crowd()
    seen = env.reset(seed=1)
    team = Shield().wrap(policy)
    team.reset(env, OWN, 0)
    return env, team, seen


@pytest.mark.parametrize(("answer", "words"), [(None, "None"), ([4, 4, 4], r"\[4, 4, 4\]"), (4, "4")])
def test_a_policy_that_answers_no_dict_is_told_what_to_answer(answer, words):
    _, team, seen = begun(Always(answer))
    with pytest.raises(PolicyError, match=f"act answered {words}; return a dict of boat to action, such as"):
        team.act(*seen)


def test_a_boat_without_an_action_is_held_and_what_is_said_of_other_boats_counts_for_nothing(caplog):
    env, team, seen = begun(Always({"agent_0": 4, "agent_2": 4, "agent_3": 4, 7: 4}))
    for _ in range(2):
        actions = team.act(*seen)
        seen = env.step(actions)[0], {}
        assert [team.decisions[agent].reason for agent in ("agent_1", "agent_0")] == [Reason.HELD, Reason.PASSED]
        assert set(actions) == set(OWN)
        assert actions["agent_1"][0] == 0.0
    told = [message.partition(": ")[2] for message in caplog.messages]
    assert told == [
        f"{words}; boats without an action hold"
        for words in (
            "no action for agent_1",
            "an action for 'agent_3', which is no boat of this team (agent_0, agent_1, agent_2)",
            "an action for 7, which is no boat of this team (agent_0, agent_1, agent_2)",
        )
    ]


@pytest.mark.parametrize("bad", [float("nan"), None, 99, ValueError])
def test_foreign_code_without_a_usable_answer_is_held_and_the_reason_says_so(bad):
    calls = iter(range(99))

    def function(observation):
        if next(calls) % 3 != 1:
            return 4
        if bad is ValueError:
            raise ValueError
        return bad

    _, team, seen = begun(policies.from_callable(function))
    actions = team.act(*seen)
    assert [team.decisions[agent].reason.name for agent in OWN] == ["PASSED", "HELD", "PASSED"]
    assert actions["agent_1"][0] == 0.0
    assert team.report().held == 1


def test_one_boat_s_name_in_place_of_a_list_is_named():
    env, _ = crowd()
    words = r"the text 'agent_0'; give a list of boats: \['agent_0'\]"
    for team in (straight(), policies.make("medium"), policies.make("ohto"), Shield().wrap(straight())):
        with pytest.raises((PolicyError, ConfigError), match=words):
            team.reset(env, "agent_0", 0)


def test_a_function_that_fails_at_first_is_answered_in_absolute_headings_and_its_loop_can_go_on():
    def failing(seen):
        raise RuntimeError("out of order")

    fleet = Fleet.of(
        position_m=[[0, 0], [0, 30]], heading_deg=[90, 180], speed_mps=[1, 1], team=[0, 1], platforms="heron"
    )
    shielded = Shield().wrap(failing, read=lambda seen: seen)
    filtered = shielded(fleet)
    assert not filtered.relative
    assert np.isfinite(filtered.values).all()
    assert filtered.values[1, 0] == 0.0
    assert np.cos(filtered.values[1, 1]) == pytest.approx(-1.0)
    assert [decision.reason.name for decision in shielded.decisions] == ["HELD", "NOT_COVERED"]
