"""A well-behaved entry plays in its own process what it plays in ours, to the bit."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear import policies
from steerclear.experiments.entries import sandbox
from steerclear.experiments.entries import team as entry_team
from steerclear.experiments.entries.child import from_plain
from steerclear.experiments.entries.team import EntryTeam, is_entry, make_team
from steerclear.experiments.play import match
from steerclear.experiments.play.match import play_match
from steerclear.experiments.play.spec import MatchSpec
from steerclear.shield.exceptions import PolicyError

NO_NETWORK_TAKEN = "this system lets nobody take the network from entries: they may reach it"
DICE = """
self.n += 1
seen, place = full_obs_normalized[agent_id], global_state[(agent_id, "pos")]
raw = full_obs[agent_id]
r = random.random() + np.random.rand() + np.random.standard_normal() * 0.1
kinds = (
    int(abs(r) * 4), np.array([abs(r), float(seen[0]) * 180], dtype=np.float32), (1.0 + r / 4, float(place[0])),
    np.int64(3), [1.5, -20.0 * r], "PC", None, (float("nan"), 0.0), np.float32([1.0, sum(raw.values()) % 90])
)
return kinds[self.n % len(kinds)]
"""


def test_games_are_the_same_to_the_bit(write_entry, monkeypatch):
    entry = write_entry(DICE, start="self.n = 0", head="import random\nimport numpy as np")
    spec = MatchSpec("aamas2024", entry, "medium", rules={"max_time_s": 4.0}, shield={}, seed=3)
    apart, again = play_match(spec), play_match(spec)
    monkeypatch.setattr(match, "make_team", lambda name, game, trust, answer_s: policies.make(name, game=game))
    here = play_match(spec)
    for other in (apart, again):
        for name, array in here.record.items():
            np.testing.assert_array_equal(array, other.record[name])
        timed = ("wall_s", "decision_p50_us", "decision_p99_us", "decision_max_us")
        assert {k: v for k, v in other.row.items() if k not in timed} == {
            k: v for k, v in here.row.items() if k not in timed
        }
    assert here.row["policy_failures"] > 0, "the two name failures alike as well"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["array", "dtype", "tuple", "list", "unreadable"]) | st.text(max_size=2), inner
        )
    ),
)


@given(JSON | st.builds(lambda a, d: {"array": a, "dtype": d}, JSON, st.sampled_from(["float64", "int8", "bool", "x"])))
def test_whatever_an_entry_says_is_read_without_an_error(content):
    found = from_plain(content)
    if content is None or isinstance(content, (bool, int, str)):
        assert found == content


def test_only_foreign_code_is_put_apart(write_entry):
    assert type(make_team("medium")) is type(policies.make("medium"))
    assert not any(map(is_entry, ("medium", "keyboard", "nobody")))
    assert all(map(is_entry, ("sb3:x.zip", "a/b", "x.zip", write_entry("return 4"))))
    with pytest.raises(PolicyError, match="did you mean medium"):
        make_team("mediun")
    with pytest.raises(PolicyError, match="there is no submission at"):
        make_team("nowhere/entry.zip")


def test_a_model_plays_in_its_own_process_as_in_ours(game, tmp_path):
    library = pytest.importorskip("stable_baselines3")
    gymnasium = pytest.importorskip("gymnasium")

    class Spaces(gymnasium.Env):
        observation_space = gymnasium.spaces.Box(-1.0, 1.0, (game[0].core.n_obs,), np.float32)
        action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    options = {"policy_kwargs": {"net_arch": [4]}, "seed": 0, "device": "cpu"}
    library.SAC("MlpPolicy", Spaces(), **options).save(tmp_path / "model")
    env, observations, infos = game
    teams = [policies.make(f"sb3:{tmp_path / 'model.zip'}"), make_team(f"sb3:{tmp_path / 'model.zip'}")]
    assert isinstance(teams[1], EntryTeam)
    here, apart = [], []
    for team, actions in zip(teams, (here, apart), strict=True):
        team.reset(env, ["agent_0", "agent_2"], 0)
        actions.append(team.act(observations, infos))
        assert team.report().failures == ()
        team.close()
    assert here == apart


def test_an_entry_cannot_be_asked_without_what_its_game_tells(game, write_entry):
    env, observations, _ = game
    team = make_team(write_entry("return 4"))
    team.reset(env, ["agent_0"], 0)
    with pytest.raises(PolicyError, match="pass those of MctfEnv"):
        team.act(observations, {})
    team.close()


def test_where_nothing_can_be_put_apart_it_plays_here_and_that_is_said(write_entry, monkeypatch, caplog):
    monkeypatch.delattr(sandbox.os, "fork")
    entry_team._say_once.cache_clear()
    for _ in range(2):
        team = make_team(write_entry("return 4"))
        assert not isinstance(team, EntryTeam)
        team.close()
    assert caplog.text.count("entries cannot be run in a process of their own on this system") == 1
    monkeypatch.undo()
    assert sandbox.unlimited() in ("", NO_NETWORK_TAKEN) or sys.platform != "linux"
    monkeypatch.setattr(sandbox.sys, "platform", "darwin")
    assert "memory, number of processes and network of entries are not limited" in sandbox.unlimited()
