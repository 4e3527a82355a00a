"""Digests of policies' files."""

import os
import shutil

import pytest
from steerclear import policies
from steerclear.shield.exceptions import PolicyError


@pytest.fixture
def entry(tmp_path):
    folder = tmp_path / "entry"
    (folder / "weights").mkdir(parents=True)
    (folder / "solution.py").write_text("SPEED = 1")
    (folder / "weights" / "actor.pt").write_bytes(b"\x01\x02")
    return folder


@pytest.mark.parametrize("name", ["medium", "keyboard", "nowhere/solution.py"])
def test_what_has_no_file_has_no_digest(name):
    assert policies.fingerprint(name) == ""


@pytest.mark.parametrize(
    ("file", "content"), [("solution.py", b"SPEED = 2"), ("weights/actor.pt", b"\x01\x03"), ("roles.json", b"{}")]
)
def test_other_code_or_weights_give_another_digest(entry, file, content):
    before = policies.fingerprint(entry)
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
