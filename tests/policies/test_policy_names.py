"""Policies by name: the registry, files of one's own, their digests, and a person at the keyboard."""

import os
import re
import shutil
from pathlib import Path

import pytest
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.entries.team import is_entry
from steerclear.policies.own import own_code
from steerclear.policies.protocol import TeamPolicy
from steerclear.policies.registry import KEYBOARD
from steerclear.policies.scripted.layout import Behaviour
from steerclear.policies.scripted.plan import Plan
from steerclear.shield.exceptions import PolicyError

DOCS = Path(__file__).parents[2] / "docs" / "policies.md"


def test_the_registry_is_the_list_in_the_docs():
    listed = re.findall(r"^\| `(\w+)` \|", DOCS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert sorted(listed) == sorted(policies.names())
    assert list(policies.describe()) == policies.names()


@pytest.mark.parametrize("name", policies.names())
def test_every_name_passes_and_builds_a_policy_that_names_itself(name):
    policies.check(name)
    team = policies.make(name)
    assert isinstance(team, TeamPolicy)
    assert team.name == name


def test_files_and_folders_that_are_there_pass(tmp_path):
    (tmp_path / "weights.zip").touch()
    for name in (tmp_path, f"sb3:{tmp_path / 'weights.zip'}"):
        policies.check(name)


def test_a_batch_takes_no_single_game_policies(tmp_path):
    with pytest.raises(PolicyError, match="single games only"):
        policies.make_batch(str(tmp_path))


@pytest.mark.parametrize(("team_size", "defenders"), [(1, 0), (2, 1), (3, 1), (4, 1), (5, 2), (6, 2), (9, 3)])
def test_a_third_of_a_team_defends(team_size, defenders):
    cast = Plan((Behaviour.EASY_ATTACK, Behaviour.EASY_DEFEND)).cast(team_size, 0)
    assert len(cast) == team_size
    assert cast == sorted(cast)  # attackers first
    assert cast.count(Behaviour.EASY_DEFEND) == defenders


def test_waypoints_per_boat_need_a_list_for_each():
    with pytest.raises(PolicyError, match="points are for 2 boats but the team has 3"):
        policies.make_batch("waypoints", points=[[(10.0, 10.0)], [(20.0, 10.0)]]).reset(BatchedMctf("aamas2024"), 0, 0)


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


def test_reach_decides_how_far_away_opponents_push():
    core = BatchedMctf("mctf2025")
    far, near = (policies.make_batch("medium", reach_m=reach) for reach in (60.0, 5.0))
    far.reset(core, 0, 0)
    near.reset(core, 0, 0)
    core.state[0, 3:, :2] = [[100.0, 60.0], [101.0, 60.0], [102.0, 60.0]]
    assert abs(far.act(core, 0) - near.act(core, 0))[0, 0, 1] > 5.0


OWN = ["agent_0", "agent_1", "agent_2"]

CODE = """
import beside

def act(observation):
    return beside.COMMAND

class Team:
    name = "mine"
    def reset(self, env, agent_ids, seed):
        self.ids = agent_ids
    def act(self, observations, infos):
        return dict.fromkeys(self.ids, (1.0, 10.0))

class Agent:
    def __init__(self, agent_id, env): pass
    def compute_action(self, obs, info):
        return (1.0, 20.0)

NUMBER = 3
class Broken:
    def __init__(self): raise RuntimeError("no luck")
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", ["", *__import__("sys").path])
    Path("mypol.py").write_text(CODE)
    Path("beside.py").write_text("COMMAND = (1.0, 5.0)\n")


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("mypol.py", (1.0, 5.0)),
        ("./mypol.py", (1.0, 5.0)),
        ("mypol:act", (1.0, 5.0)),
        ("mypol.py:Team", (1.0, 10.0)),
        ("mypol:Agent", (1.0, 20.0)),
    ],
)
def test_what_is_in_a_file_plays(name, action):
    policies.check(name)
    assert not is_entry(name)
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1)
    team = policies.make(name)
    team.reset(env, OWN, 1)
    assert team.act(observations, infos) == dict.fromkeys(OWN, action)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gone.py", "there is no policy gone.py:act"),
        ("gone:act", "there is no policy gone:act"),
        ("mypol:swim", "mypol has no 'swim'; define there a function act"),
        ("mypol:NUMBER", "is a int; give a function act"),
        ("torn.py", "torn.py, line 2: .*correct the Python there"),
        ("mypol:Broken", "cannot be built: RuntimeError: no luck"),
    ],
)
def test_what_is_no_policy_is_refused_in_words(name, words):
    Path("torn.py").write_text("X = 1\nclass Torn(:\n")

    def both():
        policies.check(name)
        policies.make(name)

    with pytest.raises(PolicyError, match=words):
        both()


@pytest.mark.parametrize("content", [b"class Torn(:", b"\0", b"x = '\xff'", b"(" * 5000], ids=range(4))
def test_a_file_that_is_no_python_is_refused_without_running_it(content):
    Path("torn.py").write_bytes(content)
    with pytest.raises(PolicyError, match=r"torn\.py.*correct"):
        policies.check("torn.py:act")


@pytest.mark.parametrize("name", ["medium", "sb3:model", "weights:net", "team/solution.py", "team.zip", "a b:c"])
def test_other_names_stay_what_they_are(name):
    assert own_code(name) is None


def test_its_digest_is_of_its_own_file():
    before = policies.fingerprint("mypol:act")
    assert before == policies.fingerprint("mypol.py") != ""
    Path("other.py").write_text("")
    assert policies.fingerprint("mypol.py") == before
    Path("mypol.py").write_text(CODE + "#")
    assert policies.fingerprint("mypol.py") != before


@pytest.fixture
def entry(tmp_path):
    folder = tmp_path / "entry"
    (folder / "weights").mkdir(parents=True)
    (folder / "solution.py").write_text("SPEED = 1")
    (folder / "weights" / "actor.pt").write_bytes(b"\x01\x02")
    return folder


@pytest.mark.parametrize(
    ("file", "content"), [("solution.py", b"SPEED = 2"), ("weights/actor.pt", b"\x01\x03"), ("roles.json", b"{}")]
)
def test_other_code_or_weights_give_another_digest(entry, file, content):
    before = policies.fingerprint(entry)
    assert policies.fingerprint("medium") == policies.fingerprint("nowhere/solution.py") == "" != before
    (entry / file).write_bytes(content)
    assert policies.fingerprint(entry) != before


def test_what_lies_behind_links_counts_once(entry, tmp_path):
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "helper.py").write_text("A = 1")
    (entry / "shared").symlink_to(tmp_path / "shared")
    (tmp_path / "shared" / "round").symlink_to(tmp_path / "shared")
    before = policies.fingerprint(entry)
    (tmp_path / "shared" / "helper.py").write_text("A = 2")
    assert policies.fingerprint(entry) != before


def test_a_file_that_cannot_be_read_is_said(entry):
    (entry / "gone.py").symlink_to(entry / "nowhere.py")
    with pytest.raises(PolicyError, match=r"gone\.py cannot be read"):
        policies.fingerprint(entry)


def test_what_a_run_leaves_behind_does_not_count(entry):
    before = policies.fingerprint(entry)
    for place in (
        "__pycache__/solution.pyc",
        "results/run/rows.jsonl",
        "results/old/games.jsonl",
        "results/run/replay.npz",
        ".venv/lib.py",
        "venv/pyvenv.cfg",
        "venv/lib.py",
    ):
        (entry / place).parent.mkdir(parents=True, exist_ok=True)
        (entry / place).write_text("new")
    os.mkfifo(entry / "orders")  # reading it would never end
    assert policies.fingerprint(entry) == before


def test_a_solution_file_stands_for_its_folder_wherever_that_lies(entry, tmp_path):
    moved = tmp_path / "elsewhere"
    shutil.copytree(entry, moved)
    assert policies.fingerprint(entry / "solution.py") == policies.fingerprint(moved) == policies.fingerprint(entry)


def test_of_an_archive_and_of_learned_weights_only_the_file_counts(tmp_path):
    model = tmp_path / "model.zip"
    model.write_bytes(b"one")
    first = policies.fingerprint(model)
    (tmp_path / "other.py").write_text("x = 1")
    assert policies.fingerprint(f"sb3:{model}") == policies.fingerprint(model) == first
    model.write_bytes(b"two")
    assert policies.fingerprint(model) != first


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
