"""Submissions find their files, get what they were promised, and stay apart."""

import os
import random
import shutil
import sys
from types import ModuleType

import numpy as np
import pytest
from steerclear import policies
from steerclear.policies.submissions.loader import ages_of
from steerclear.shield.exceptions import PolicyError

OWN = ["agent_0", "agent_1", "agent_2"]

AT_HOME = """
    import os, pickle, sys
    import helper
    from .helper import SIDE
    from parts.engine import Engine

    class Note:
        pass

    class solution:
        def __init__(self):
            with open("weights.txt") as file:
                self.weights = file.read()
            with open(os.path.abspath("./working_dir/" + "weights.txt")) as file:
                self.same = file.read()
            with open(os.path.join(os.path.dirname(__file__), "weights.txt")) as file:
                self.beside = file.read()
            self.copy = pickle.loads(pickle.dumps(Note()))
            self.calls = 0

        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            import late
            assert self.weights == self.same == self.beside == "7"
            assert helper.SIDE == SIDE == late.SIDE
            assert os.path.exists("weights.txt") and sys.path[0] == os.getcwd()
            self.calls += 1
            return Engine(helper.SIDE).number() if self.calls < 4 else 16
"""


def files(side):
    return {
        "helper.py": f"SIDE = {side}\n",
        "late.py": "from helper import SIDE\n",
        "weights.txt": "7",
        "parts/__init__.py": "",
        "parts/engine.py": "class Engine:\n  def __init__(self, n): self.n = n\n  def number(self): return self.n\n",
    }


def play(team, game, own=OWN, steps=1, seed=0):
    env, observations, infos = game
    team.reset(env, own, seed)
    actions = []
    for _ in range(steps):
        actions.append(team.act(observations, infos))
        observations, *_, infos = env.step(actions[-1])
    return actions


@pytest.mark.parametrize("as_zip", [False, True])
def test_a_submission_finds_its_files_and_modules(game, write_entry, load, as_zip, tmp_path):
    folder = write_entry(AT_HOME, **files(side=3))
    source = shutil.make_archive(tmp_path / "packed", "zip", folder) if as_zip else folder
    before = os.getcwd(), list(sys.path), set(sys.modules)
    team = load(source)
    actions = play(team, game, steps=2)
    assert team.report().failures == ()
    assert actions == [dict.fromkeys(OWN, 3), dict.fromkeys(OWN, 16)]  # one instance plays all boats
    assert (os.getcwd(), sys.path) == before[:2]
    assert not {"solution", "helper", "late", "parts", "parts.engine"} & set(sys.modules)
    assert not {name for name in set(sys.modules) - before[2] if name.startswith("submission_")}


def test_two_submissions_and_other_code_with_modules_of_the_same_name_stay_apart(game, write_entry, load, monkeypatch):
    env, observations, infos = game
    mine = ModuleType("helper")
    monkeypatch.setitem(sys.modules, "helper", mine)
    teams = [load(write_entry(AT_HOME, name=f"entry{side}", **files(side))) for side in (3, 5)]
    teams[0].reset(env, OWN, 0)
    teams[1].reset(env, ["agent_3", "agent_4", "agent_5"], 0)
    for _ in range(1):
        for team, side in zip(teams, (3, 5), strict=True):
            assert set(team.act(observations, infos).values()) == {side}
    assert [team.report().failures for team in teams] == [(), ()]
    assert sys.modules["helper"] is mine


ECHO = """
    class solution:
        seen = []
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            solution.seen.append((agent_id, full_obs_normalized, full_obs, global_state))
            return 4
"""


def echoed(team):
    return team.code._class.seen


def test_a_submission_gets_three_dicts_of_all_boats(game, write_entry, load):
    _, observations, infos = game
    team = load(write_entry(ECHO))
    play(team, game, own=["agent_3", "agent_5", "agent_4"])
    assert [entry[0] for entry in echoed(team)] == ["agent_3", "agent_5", "agent_4"]
    _, normalized, raw, state = echoed(team)[0]
    assert set(normalized) == set(raw) == set(observations)
    for agent_id in observations:
        np.testing.assert_array_equal(normalized[agent_id], observations[agent_id])
        assert raw[agent_id] == infos[agent_id]["unnorm_obs"]
    assert isinstance(state, dict)
    assert set(state) == set(infos["agent_0"]["global_state"])
    np.testing.assert_array_equal(state["agent_3"][("agent_3", "pos")], state[("agent_3", "pos")])
    assert state.get("agent_3") is state
    assert state.get("agent_9", 5) == 5
    with pytest.raises(KeyError, match="agent_9"):
        state["agent_9"]


VANDAL = """
    class solution:
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            for row in full_obs_normalized.values():
                row[:] = 9.0
            for raw in full_obs.values():
                raw.clear()
            global_state.clear()
            return 4
"""


def test_what_a_submission_writes_into_its_inputs_stays_with_it(game, write_entry, load):
    _, observations, infos = game
    kept = observations["agent_3"].copy(), dict(infos["agent_3"]["unnorm_obs"]), len(infos["agent_3"]["global_state"])
    env = game[0]
    team = load(write_entry(VANDAL))
    team.reset(env, OWN, 0)
    team.act(observations, infos)
    for lacking in ({}, {"agent_0": {}}):
        with pytest.raises(PolicyError, match="infos lack"):
            team.act(observations, lacking)
    np.testing.assert_array_equal(observations["agent_3"], kept[0])
    assert infos["agent_3"]["unnorm_obs"] == kept[1]
    assert len(infos["agent_3"]["global_state"]) == kept[2]


DICE = """
    import random
    import numpy as np
    class solution:
        def __init__(self):
            self.first = random.random()
        def compute_action(self, agent_id, *rest):
            return (self.first + random.random() + np.random.rand()) / 3.0, 0.0
"""


def test_the_seed_decides_a_submissions_random_numbers(game, write_entry, load):
    random.seed(0)
    folder = write_entry(DICE)
    first, again, other = (play(load(folder), game, seed=seed)[0] for seed in (1, 1, 2))
    assert first == again
    assert first != other


@pytest.mark.parametrize(
    ("solution", "message"),
    [
        ("import no_such_package_xyz\n", r"cannot be imported: ModuleNotFoundError.*install 'no_such_package_xyz'"),
        (
            "import math\nclass solution(:\n",
            r"solution.py cannot be imported: SyntaxError: [a-z ]+ \(\S*entry/solution.py:2\)$",
        ),
        ("raise SystemExit(0)\n", r"cannot be imported: SystemExit"),
        ("class Solution:\n    pass\n", r"has no class 'solution'; rename 'Solution': capitals count$"),
        ("open('weights.npy')\n", r"FileNotFoundError.*; put the file beside solution.py and open it by"),
        ("solution = 4\n", r"has no class 'solution'; define one$"),
        ("class solution:\n    pass\n", r"has no method 'compute_action'"),
        (
            "class solution:\n    def __init__(self, x):\n        pass\n    def compute_action(self):\n        pass\n",
            r"solution\(\) cannot be built: TypeError.*; its __init__ is given no arguments$",
        ),
    ],
)
def test_a_submission_that_cannot_be_loaded_says_why(write_entry, solution, message):
    folder = write_entry(solution)
    with pytest.raises(PolicyError, match=message):
        policies.make(str(folder))


def test_a_submission_by_path_through_the_registry(game, write_entry):
    team = policies.make(write_entry(ECHO, name="ours"), game=3)
    assert team.name == "ours"
    assert play(team, game)[0] == dict.fromkeys(OWN, 4)
    team.close()
    assert not team.code.stage.folder.exists()
    with pytest.raises(PolicyError, match="has no option 'max_byte'; did you mean 'max_bytes'"):
        policies.make("entries/ours.zip", max_byte=3)


def config_module(**settings):
    module = ModuleType("gen_config")
    module.config_dict_std = {"short_obs_hist_length": 9}
    module.config_dict_competition = settings
    return module


def test_observation_settings_are_read():
    assert ages_of(ModuleType("empty")) == (0,)
    settings = {"short_obs_hist_length": 3, "short_obs_hist_interval": 1, "long_obs_hist_length": 3}
    settings["long_obs_hist_interval"] = 4
    assert ages_of(config_module(**settings)) == (0, 1, 2, 4, 8)
    with pytest.raises(PolicyError, match="lidar"):
        ages_of(config_module(lidar_obs=True))
    for wrong in (0, 1.5, True, "3"):
        with pytest.raises(PolicyError, match="short_obs_hist_length"):
            ages_of(config_module(short_obs_hist_length=wrong))


def test_a_submission_trained_on_past_observations_gets_them(game, write_entry, load):
    config = "config_dict_competition = {'short_obs_hist_length': 2, 'short_obs_hist_interval': 2}\n"
    team = load(write_entry(ECHO, **{"gen_config.py": config}))
    first = game[1]["agent_3"]
    play(team, game, own=["agent_3"], steps=4)
    rows = [entry[1]["agent_3"] for entry in echoed(team)]
    assert rows[0].shape == (2, first.size)
    np.testing.assert_array_equal(rows[0], [first, first])
    np.testing.assert_array_equal(rows[3][1], rows[1][0])
    np.testing.assert_array_equal(rows[2][1], first)
    assert not np.array_equal(rows[3][0], rows[3][1])
    raw = echoed(team)[3][2]["agent_3"]
    assert raw.shape == (2,)
    assert raw[1] == echoed(team)[1][2]["agent_3"][0]
    play(team, game, own=["agent_3"])  # a new game forgets
    np.testing.assert_array_equal(echoed(team)[-1][1]["agent_3"][1], first)
