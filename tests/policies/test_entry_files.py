"""What submissions are unpacked from, and what an entry that steerclear wrote says of itself."""

import logging
import multiprocessing
import os
import stat
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
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


HELPER = "import os\n\ndef lost():\n    raise RuntimeError('no map at ' + os.path.abspath('map.txt'))\n"
LOST = "import helper\nclass solution:\n    def compute_action(self, *args):\n        return helper.lost()\n"


@pytest.mark.parametrize("folder", ["", "team/"])
@pytest.mark.parametrize("is_zip", [True, False])
def test_a_failure_names_the_file_in_the_entry_not_the_copy_that_ran(tmp_path, folder, is_zip, caplog):
    files = {f"{folder}solution.py": LOST, f"{folder}helper.py": HELPER}
    source = tmp_path / ("entry.zip" if is_zip else "entry")
    if is_zip:
        pack(source, **files)
    else:
        (source / folder).mkdir(parents=True)
        for name, text in files.items():
            (source / name).write_text(text)
    team, env = policies.make(str(source)), MctfEnv("aamas2024")
    observations, infos = env.reset(seed=0)
    own = list(observations)[:3]
    team.reset(env, own, 0)
    team.act({name: observations[name] for name in own}, infos)
    (failure,) = {one.message for one in team.report().failures}
    assert f"no map at {source}/{folder}map.txt ({source}/{folder}helper.py:4)" in failure
    assert "steerclear-submission" not in failure + caplog.text
    team.close()
    env.close()


def test_the_entry_may_lie_in_the_only_folder_of_a_zip(tmp_path):
    assert "solution.py" in staged(pack(tmp_path / "a.zip", **{"team/solution.py": SOLUTION, "team/b.txt": "b"}))
    beside = {"team/solution.py": SOLUTION, "__MACOSX/solution.py": "\x00\x05", "__MACOSX/team/._solution.py": "x"}
    assert "solution.py" in staged(pack(tmp_path / "mac.zip", **beside))
    with pytest.raises(PolicyError, match=r"Solution\.py is there; name it solution\.py"):
        staged(pack(tmp_path / "upper.zip", **{"Solution.py": SOLUTION}))
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
            r"for a decision every 1 s, but this game decides every 0\.1 s; play it by preset mctf2026",
        ),
        (GameConfig.preset("mctf2026", decision_steps=4), r"a decision every 1 s, but this game decides every 0\.4 s"),
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
    assert caplog.text.count("keeps 2.5 m") == 1
    with pytest.raises(PolicyError, match="or the bare entry with --shield"):
        begin(path, GameConfig.preset("mctf2025"))
