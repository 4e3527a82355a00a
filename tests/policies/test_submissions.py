"""What an entry that steerclear wrote says of itself is read, and a game it is not for is refused or told."""

import logging
import multiprocessing
import os
import random
import shutil
import stat
import sys
import zipfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.policies.submissions.loader import ages_of
from steerclear.policies.submissions.made_for import (
    ABOUT_FILE,
    MAX_BYTES,
    MadeFor,
    check_game,
    made_for,
    platform_names,
    words_of_less,
)
from steerclear.policies.submissions.stage import MAX_FILES, Stage, check_members, is_inside
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
        ("class solution(:\n", r"solution.py cannot be imported: SyntaxError"),
        ("raise SystemExit(0)\n", r"cannot be imported: SystemExit"),
        ("class Solution:\n    pass\n", r"has no class 'solution'"),
        ("solution = 4\n", r"has no class 'solution'"),
        ("class solution:\n    pass\n", r"has no method 'compute_action'"),
        (
            "class solution:\n    def __init__(self, x):\n        pass\n    def compute_action(self):\n        pass\n",
            r"solution\(\) cannot be built: TypeError",
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


SOLUTION = "class solution:\n    def compute_action(self, *args):\n        return 4\n"


def pack(path, **files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def staged(source, **options):
    stage = Stage(source, **options)
    try:
        return {path.name: path.read_text() for path in stage.folder.iterdir() if path.is_file()}
    finally:
        stage.close()


def test_a_zip_is_unpacked_and_removed(tmp_path):
    source = pack(tmp_path / "entry.zip", **{"solution.py": SOLUTION, "nets/a.txt": "a"})
    stage = Stage(source)
    assert (stage.folder / "nets" / "a.txt").read_text() == "a"
    assert (stage.folder / "working_dir" / "solution.py").read_text() == SOLUTION
    stage.close()
    assert not stage.folder.exists()
    stage.close()


def test_the_entry_may_lie_in_the_only_folder_of_a_zip(tmp_path):
    assert "solution.py" in staged(pack(tmp_path / "a.zip", **{"team/solution.py": SOLUTION, "team/b.txt": "b"}))
    with pytest.raises(PolicyError, match="several: one, two"):
        staged(pack(tmp_path / "b.zip", **{"one/solution.py": SOLUTION, "two/solution.py": SOLUTION}))
    with pytest.raises(PolicyError, match="none there"):
        staged(pack(tmp_path / "c.zip", **{"agent.py": SOLUTION}))


def test_a_folder_is_linked_and_left_as_it_was(write_entry):
    folder = write_entry(SOLUTION, **{"weights.txt": "w"})
    stage = Stage(folder / "solution.py")
    assert (stage.folder / "weights.txt").read_text() == "w"
    (stage.folder / "log.txt").write_text("x")
    stage.close()
    assert sorted(path.name for path in folder.iterdir()) == ["solution.py", "weights.txt"]
    assert (folder / "weights.txt").read_text() == "w"


@pytest.mark.parametrize(
    "name", ["../evil.txt", "a/../../evil.txt", "/evil.txt", "..\\evil.txt", "C:\\evil.txt", "C:evil.txt", "..", "a\0b"]
)
def test_a_zip_that_reaches_outside_is_refused_whole(tmp_path, name):
    info = zipfile.ZipInfo("placeholder")
    info.filename = name  # the constructor would clean it
    with pytest.raises(PolicyError, match="outside its folder"):
        check_members(tmp_path, [zipfile.ZipInfo("solution.py"), info], 10**9)


def test_an_entry_that_lies_too_deep_is_shown(tmp_path):
    source = pack(tmp_path / "mine.zip", **{"a/b/solution.py": SOLUTION})
    with pytest.raises(PolicyError, match=r"none there, but a/b/solution\.py; zip what lies beside it"):
        Stage(source)


@given(st.lists(st.sampled_from(["..", ".", "a", "b.py", "", "/", "\\", ":"]), min_size=1, max_size=6))
def test_names_taken_to_be_inside_are_inside(parts):
    name = "/".join(parts)
    if is_inside(name):
        top = Path("/top")
        assert (top / name).resolve().is_relative_to(top)


def test_links_are_refused(tmp_path):
    source = tmp_path / "link.zip"
    link = zipfile.ZipInfo("passwords")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(source, "w") as archive:
        archive.writestr("solution.py", SOLUTION)
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(PolicyError, match="'passwords' is a link"):
        Stage(source)


def test_the_unpacked_size_is_bounded(tmp_path):
    source = pack(tmp_path / "bomb.zip", **{"solution.py": SOLUTION, "zeros.bin": "0" * 1_000_000})
    assert source.stat().st_size < 5000
    with pytest.raises(PolicyError, match="more than 100000"):
        Stage(source, max_bytes=100_000)
    assert len(staged(source, max_bytes=2_000_000)["zeros.bin"]) == 1_000_000


def test_broken_zips_are_one_clear_error(tmp_path):
    good = pack(tmp_path / "good.zip", **{"solution.py": SOLUTION * 50}).read_bytes()
    spoiled = bytearray(good)
    spoiled[60:70] = bytes(10)
    for content in (b"", b"not a zip", good[: len(good) // 2], bytes(spoiled)):
        source = tmp_path / "broken.zip"
        source.write_bytes(content)
        with pytest.raises(PolicyError, match="cannot be unpacked"):
            Stage(source)


def hold_a_stage(source, told):
    """In another process: make a stage, keep it to the end."""
    global HELD
    HELD = Stage(source)
    told.put(str(HELD.folder))


@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_stage_held_to_the_end_of_a_pools_process_is_removed(tmp_path, method):
    """Such processes end by os._exit: nothing of the interpreter's own end is run."""
    context = multiprocessing.get_context(method)
    told = context.SimpleQueue()
    process = context.Process(target=hold_a_stage, args=(pack(tmp_path / "a.zip", **{"solution.py": SOLUTION}), told))
    process.start()
    folder = Path(told.get())
    process.join(60.0)
    assert process.exitcode == 0
    assert not folder.exists()


@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_a_forked_process_does_not_take_its_parents_stage_away(tmp_path):
    stage = Stage(pack(tmp_path / "a.zip", **{"solution.py": SOLUTION}))
    process = multiprocessing.get_context("fork").Process(target=stage.close)
    process.start()
    process.join(60.0)
    assert stage.folder.exists()
    stage.close()
    assert not stage.folder.exists()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"filename": "team\\solution.py"}, "has a backslash; zip it with / in its names"),
        ({"flag_bits": 1}, "without a password"),
        ({"compress_type": zipfile.ZIP_LZMA}, "plain deflate"),
        ({}, "leave out"),
    ],
)
def test_members_that_are_unusual_or_too_many_are_refused(tmp_path, changes, words):
    member = zipfile.ZipInfo("solution.py")
    for name, value in changes.items():
        setattr(member, name, value)
    with pytest.raises(PolicyError, match=words):
        check_members(tmp_path, [member] * (1 if changes else MAX_FILES + 1), 10**9)


GAME = GameConfig.preset("mctf2026")

MADE = MadeFor("mctf2026", 1.0, platform_names(GAME), 2.5, {"separation_m": 2.5, "adversary_horizon_s": "inf"})


def write_zip(path, about, inside=""):
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr(f"{inside}solution.py", SOLUTION)
        packed.writestr(f"{inside}{ABOUT_FILE}", about)
    return path


def test_it_is_read_from_zips_and_folders_as_it_was_written(tmp_path):
    assert made_for(write_zip(tmp_path / "a.zip", MADE.to_bytes())) == MADE
    assert made_for(write_zip(tmp_path / "b.zip", MADE.to_bytes(), "team/")) == MADE
    (tmp_path / ABOUT_FILE).write_bytes(MADE.to_bytes())
    assert made_for(tmp_path) == made_for(tmp_path / "solution.py") == MADE
    bare = MadeFor("aamas2024", 0.1)
    assert not made_for(write_zip(tmp_path / "c.zip", bare.to_bytes())).shielded


@pytest.mark.parametrize(
    "about",
    [b"", b"{", b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"preset": "x"}', MADE.to_bytes() + b" " * MAX_BYTES],
)
def test_what_others_put_there_says_nothing(about, tmp_path):
    assert made_for(write_zip(tmp_path / "a.zip", about)) is None


@pytest.mark.parametrize("name", ["entry.zip", "entry.py", "entry"])
def test_a_pipe_says_nothing_and_is_not_waited_for(name, tmp_path):
    os.mkfifo(tmp_path / name)
    assert made_for(tmp_path / name) is None


@pytest.mark.parametrize("offset", [6, 30])
def test_an_encrypted_or_garbled_file_in_a_zip_says_nothing(offset, tmp_path):
    """Byte 6 of a file's header says whether it is encrypted; what is garbled shows in its sum."""
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(ABOUT_FILE, MADE.to_bytes())
    content = bytearray(path.read_bytes())
    if offset == 6:
        content[6] |= 1
        content[content.index(b"PK\x01\x02") + 8] |= 1
    else:
        content[30 + len(ABOUT_FILE) + 2] ^= 0xFF
    path.write_bytes(content)
    assert made_for(path) is None


@pytest.mark.parametrize(
    ("game", "words"),
    [
        (
            GameConfig.preset("mctf2025"),
            r"for decisions of 1 s, but this game's last 0\.1 s; play it by preset mctf2026",
        ),
        (GameConfig.preset("mctf2026", decision_steps=4), r"for decisions of 1 s, but this game's last 0\.4 s"),
        (GameConfig.preset("mctf2026", platforms="heron"), "for boats surveyor, .* but this game has heron, "),
    ],
)
def test_a_shield_for_another_game_is_refused_as_wrappers_do(game, words):
    with pytest.raises(PolicyError, match=words):
        check_game(MADE, game, "a.zip")
    check_game(MADE, GAME, "a.zip")
    check_game(MadeFor("mctf2026", 1.0), game, "an entry without a shield")


def test_less_than_the_game_counts_is_told():
    assert words_of_less(MADE, GAME, "a.zip").startswith(
        "the shield in a.zip keeps 2.5 m (separation_m), but this game counts collisions at 4 m"
    )
    assert words_of_less(MADE._replace(separation_m=4.0), GAME, "a.zip") == ""
    assert words_of_less(MadeFor("mctf2026", 1.0), GAME, "a.zip") == ""


def begin(path, game):
    policy, env = policies.make(str(path)), MctfEnv(game)
    try:
        env.reset(seed=1)
        for seed in (1, 2):
            policy.reset(env, env.possible_agents[:3], seed)
    finally:
        env.close()


def test_a_policy_of_ones_own_program_tells_it_once_and_refuses(tmp_path, caplog):
    path = write_zip(tmp_path / "a.zip", MADE.to_bytes())
    with caplog.at_level(logging.WARNING):
        begin(path, GAME)
    assert [record.message.count("keeps 2.5 m") for record in caplog.records] == [1]
    with pytest.raises(PolicyError, match="or the bare entry with --shield"):
        begin(path, GameConfig.preset("mctf2025"))
