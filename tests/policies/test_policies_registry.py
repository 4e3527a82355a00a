import re
from pathlib import Path

import pytest
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.policies.protocol import TeamPolicy
from steerclear.policies.scripted.layout import Behaviour
from steerclear.policies.scripted.plan import Plan
from steerclear.shield.exceptions import PolicyError

DOCS = Path(__file__).parents[2] / "docs" / "policies.md"


def test_the_registry_is_the_list_in_the_docs():
    listed = re.findall(r"^\| `(\w+)` \|", DOCS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert sorted(listed) == sorted(policies.names())
    assert list(policies.describe()) == policies.names()


@pytest.mark.parametrize("name", policies.names())
def test_every_name_builds_a_policy_that_names_itself(name):
    team = policies.make(name)
    assert isinstance(team, TeamPolicy)
    assert team.name == name


def test_an_unknown_name_lists_near_matches_and_all_names():
    with pytest.raises(PolicyError, match=r"'medum'; did you mean medium.*known: easy, .*keyboard"):
        policies.make("medum")
    with pytest.raises(PolicyError, match="did you mean rammer"):
        policies.make_batch("ramer")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("", "unknown policy ''"),
        ("medum", "did you mean medium"),
        ("nowhere/solution.py", "there is no policy at nowhere/solution.py"),
        ("sb3:nowhere.zip", "there is no policy at nowhere.zip"),
    ],
)
def test_what_is_not_there_is_said_without_loading_anything(name, text):
    with pytest.raises(PolicyError, match=text):
        policies.check(name)


def test_what_is_there_passes(tmp_path):
    for name in policies.names():
        policies.check(name)
    policies.check(tmp_path)
    (tmp_path / "weights.zip").touch()
    policies.check(f"sb3:{tmp_path / 'weights.zip'}")


def test_an_unknown_option_is_explained():
    with pytest.raises(PolicyError, match="'medium' has no option 'role'; did you mean 'roles'"):
        policies.make("medium", role="attack")
    with pytest.raises(PolicyError, match="'hold' has no option 'speed'; its options are: none"):
        policies.make_batch("hold", speed=1)


def test_a_batch_takes_no_single_game_policies(tmp_path):
    for name in ("keyboard", "meo", str(tmp_path)):
        with pytest.raises(PolicyError, match="single games only"):
            policies.make_batch(name)


@pytest.mark.parametrize(("team_size", "defenders"), [(1, 0), (2, 1), (3, 1), (4, 1), (5, 2), (6, 2), (9, 3)])
def test_a_third_of_a_team_defends(team_size, defenders):
    cast = Plan((Behaviour.EASY_ATTACK, Behaviour.EASY_DEFEND)).cast(team_size, 0)
    assert len(cast) == team_size
    assert cast == sorted(cast)  # attackers first
    assert cast.count(Behaviour.EASY_DEFEND) == defenders


def test_roles_are_words_in_a_string_or_a_list():
    for roles in ("attack, Defend,attack", ["attack", "defend", "attack"]):
        assert [one.name[5] for one in policies.make_batch("easy", roles=roles).plan.cast(3, 0)] == ["A", "D", "A"]
    assert policies.make_batch("easy", roles="defend").plan.cast(3, 0) == [Behaviour.EASY_DEFEND] * 3


def test_wrong_roles_are_explained():
    with pytest.raises(PolicyError, match="roles has 'goalie'; choose from attack, defend"):
        policies.make("easy", roles="attack,goalie")
    with pytest.raises(PolicyError, match="empty"):
        policies.make("easy", roles=[])
    with pytest.raises(PolicyError, match="names 2 boats for a team of 3"):
        policies.make_batch("easy", roles="attack,defend").plan.cast(3, 0)


def behaviours(name, game=None, seed=0, **options):
    core = BatchedMctf("aamas2024")
    team = policies.make_batch(name, **options) if game is None else policies.make(name, game=game, **options)._batch
    team.reset(core, 0, seed)
    return "".join(behaviour.name[7] for behaviour in team.behaviours[0])


def test_the_hidden_team_follows_the_game_or_the_seed():
    assert [behaviours("hidden", seed=seed) for seed in range(4)] == ["DDD", "AAA", "AAD", "DDD"]
    assert [behaviours("hidden", game=game, seed=17) for game in range(4)] == ["DDD", "AAA", "AAD", "DDD"]
    assert behaviours("hidden", game=0, composition="mixed") == "AAD"
    assert [behaviours("hidden", composition=k) for k in (0, 1, "mixed")] == ["DDD", "AAA", "AAD"]


def test_the_game_is_known_to_every_policy_and_checked():
    assert policies.make("medium", game=4).name == "medium"
    for game in (-1, 1.5, True):
        with pytest.raises(PolicyError, match="game is"):
            policies.make("hidden", game=game)
    for composition in (3, "all", True):
        with pytest.raises(PolicyError, match="composition is"):
            policies.make("hidden", composition=composition)


def test_mixed_teams():
    core = BatchedMctf("aamas2024")
    team = policies.make_batch("mixed", boats="rammer,hold,easy_defend")
    team.reset(core, 1, 0)
    assert [behaviour.name for behaviour in team.behaviours[0]] == ["RAMMER", "HOLD", "EASY_DEFEND"]
    with pytest.raises(PolicyError, match="boats has 'shark'; choose from hold, random"):
        policies.make("mixed", boats="shark")


@pytest.mark.parametrize("points", [[], [(1.0, 2.0, 3.0)], [(float("nan"), 1.0)], "home", [[(1, 2)], [(1, 2), (3, 4)]]])
def test_unusable_waypoints_are_refused(points):
    with pytest.raises(PolicyError, match="points"):
        policies.make("waypoints", points=points)


def test_waypoints_per_boat_need_a_list_for_each():
    team = policies.make_batch("waypoints", points=[[(10.0, 10.0)], [(20.0, 10.0)]])
    with pytest.raises(PolicyError, match="points are for 2 boats but the team has 3"):
        team.reset(BatchedMctf("aamas2024"), 0, 0)


@pytest.mark.parametrize("reach_m", [0.0, -1.0, float("inf"), float("nan"), "far", True])
def test_unusable_reach_is_refused(reach_m):
    with pytest.raises(PolicyError, match="reach_m"):
        policies.make("medium", reach_m=reach_m)


def test_reach_decides_how_far_away_opponents_push():
    core = BatchedMctf("mctf2025")
    far, near = (policies.make_batch("medium", reach_m=reach) for reach in (60.0, 5.0))
    far.reset(core, 0, 0)
    near.reset(core, 0, 0)
    core.state[0, 3:, :2] = [[100.0, 60.0], [101.0, 60.0], [102.0, 60.0]]
    assert abs(far.act(core, 0) - near.act(core, 0))[0, 0, 1] > 5.0
