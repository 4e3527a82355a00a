"""Table files: whole or refused with the command that makes them anew."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from steerclear.shield.exceptions import TableError
from steerclear.shield.platforms.registry import get_platform
from steerclear.shield.tables.files import (
    CACHE_VARIABLE,
    SHIPPED,
    Card,
    cache_folder,
    find_table,
    load_table,
    read_table,
    save_table,
    with_figures,
)
from steerclear.shield.tables.settings import OtherMay
from table_scenes import random_table

TABLE = random_table(own="mctf2024_sim", other="heron")
NAME = "mctf2024_sim-heron-worst-case.npz"
COMMAND = "steerclear reach solve --own mctf2024_sim --other heron --other-may worst-case"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache folder."""
    folder = tmp_path / "tables"
    monkeypatch.setenv(CACHE_VARIABLE, str(folder))
    return folder


def test_a_table_comes_back_as_it_was(tmp_path):
    table = with_figures(TABLE, checked_radii_m=(2.5,), margin={"2.5": {"breaches": 0}})
    save_table(table, tmp_path / "deep" / "one.npz")
    back = read_table(tmp_path / "deep" / "one.npz")
    assert back.card == table.card
    np.testing.assert_array_equal(back.values, table.values)
    np.testing.assert_array_equal(back.levels, table.levels)
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["one.npz"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes of a table file and a place for damaged ones."""
    path = tmp_path_factory.mktemp("tables") / "one.npz"
    save_table(TABLE, path)
    return path.read_bytes(), path.with_name("damaged.npz")


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_changed_byte_is_seen_or_harmless(whole, data):
    good, path = whole
    at, change = data.draw(st.integers(0, len(good) - 1)), data.draw(st.integers(1, 255))
    path.write_bytes(good[:at] + bytes([good[at] ^ change]) + good[at + 1 :])
    try:
        table = read_table(path)
    except TableError:
        return
    np.testing.assert_array_equal(table.values, TABLE.values)
    assert table.card == TABLE.card


@pytest.mark.parametrize("length", [0, 1, 100, 0.5, 0.99])
def test_files_cut_short_are_refused(whole, length):
    good, path = whole
    path.write_bytes(good[: length if isinstance(length, int) else int(length * len(good))])
    with pytest.raises(TableError, match="is damaged"):
        read_table(path)


def rewritten(path, card=TABLE.card, **arrays):
    shape = TABLE.values.shape
    steps = np.diff(TABLE.values.reshape(*shape[:3], -1), axis=2, prepend=np.uint8(0))
    more = TABLE.levels - np.concatenate([TABLE.levels[1:], TABLE.values[None]])
    content = {"card": np.array(card.to_json()), "steps": np.moveaxis(steps, 3, 0), "more": more} | arrays
    np.savez_compressed(path, **content)
    return path


def test_altered_values_are_refused(tmp_path):
    read_table(rewritten(tmp_path / "same.npz"))
    card = replace(TABLE.card, payload_sha256="0" * 64)
    with pytest.raises(TableError, match=r"damaged \(checksum differs\)"):
        read_table(rewritten(tmp_path / "other.npz", card))
    with pytest.raises(TableError, match="values do not fit its grid"):
        read_table(rewritten(tmp_path / "shape.npz", steps=np.zeros((2, 2), np.uint8)))
    with pytest.raises(TableError, match="levels do not fit its card"):
        read_table(rewritten(tmp_path / "levels.npz", more=np.zeros(3, np.uint8)))
    np.savez(tmp_path / "no_card.npz", steps=np.zeros(3))
    with pytest.raises(TableError, match="is no value table"):
        read_table(tmp_path / "no_card.npz")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 99}, "format is 99"),
        *((change, "cannot be read") for change in ({"grid": {"n_rho": 3}}, {"surprise": 1}, "", "[]", "null", "{")),
    ],
)
def test_cards_of_other_kinds_are_refused(change, words):
    text = change if isinstance(change, str) else json.dumps(json.loads(TABLE.card.to_json()) | change)
    with pytest.raises(TableError, match=words):
        Card.of_json(text)


def test_a_missing_table_names_the_command_that_makes_it(cache):
    with pytest.raises(TableError) as caught:
        load_table("mctf2024_sim", "heron")
    assert COMMAND in str(caught.value)
    assert str(cache) in str(caught.value)
    cache.mkdir()
    (cache / NAME).write_bytes(b"nonsense")
    with pytest.raises(TableError, match=f"is damaged .*; make it anew with: {COMMAND}"):
        load_table("mctf2024_sim", "heron")


def test_a_table_in_the_cache_is_found(cache):
    save_table(TABLE, cache / NAME)
    assert load_table("mctf2024_sim", get_platform("heron"), "worst-case").card == TABLE.card
    assert find_table("mctf2024_sim", "heron", OtherMay.COOPERATIVE) is None


@pytest.mark.parametrize("role", ["own", "other"])
def test_a_table_of_other_parameters_is_refused(cache, role):
    save_table(TABLE, cache / NAME)
    boats = {"own": get_platform("mctf2024_sim"), "other": get_platform("heron")}
    boats[role] = replace(boats[role], turn_gain=boats[role].turn_gain + 1.0)
    with pytest.raises(TableError, match=f"other parameters of the {role} boat .*; make it anew with: {COMMAND}"):
        load_table(**boats)


def test_a_table_under_anothers_name_is_refused(cache):
    save_table(TABLE, cache / "heron-mctf2024_sim-worst-case.npz")
    with pytest.raises(TableError, match="is for mctf2024_sim with heron, worst-case, but heron with mctf"):
        load_table("heron", "mctf2024_sim")


def test_a_table_made_by_the_user_goes_before_the_shipped_one(cache):
    assert find_table("heron", "heron", OtherMay.WORST_CASE) == SHIPPED / "heron-heron-worst-case.npz"
    save_table(TABLE, cache / "heron-heron-worst-case.npz")
    assert find_table("heron", "heron", OtherMay.WORST_CASE) == cache / "heron-heron-worst-case.npz"


def test_a_place_that_cannot_be_written_to_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(TableError, match=r"cannot be written .* choose another place with --out"):
        save_table(TABLE, tmp_path / "file" / "one.npz")


@pytest.mark.parametrize(
    ("platform", "variable", "tail"),
    [
        ("linux", "XDG_CACHE_HOME", "base/steerclear/tables"),
        ("win32", "LOCALAPPDATA", "base/steerclear/tables"),
        ("darwin", "XDG_CACHE_HOME", "Library/Caches/steerclear/tables"),
    ],
)
def test_cache_folders(monkeypatch, tmp_path, platform, variable, tail):
    monkeypatch.delenv(CACHE_VARIABLE, raising=False)
    monkeypatch.setenv(variable, str(tmp_path / "base"))
    monkeypatch.setattr("sys.platform", platform)
    assert cache_folder().as_posix().endswith(tail)
