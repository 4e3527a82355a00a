"""What an entry that steerclear wrote says of itself is read, and a game it is not for is refused or told."""

import json
import logging
import os
import textwrap
import zipfile

import pytest
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
from steerclear.shield.exceptions import PolicyError

GAME = GameConfig.preset("mctf2026")
MADE = MadeFor("mctf2026", 1.0, platform_names(GAME), 2.5, {"separation_m": 2.5, "adversary_horizon_s": "inf"})
SOLUTION = textwrap.dedent(
    """
    class solution:
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            return 4
    """
)


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


def test_settings_are_json_that_every_reader_takes():
    assert json.loads(MADE.to_bytes(), parse_constant=pytest.fail)["shield"]["adversary_horizon_s"] == "inf"
    assert json.loads(MadeFor("x", 1.0).to_bytes(), parse_constant=pytest.fail)["separation_m"] is None
