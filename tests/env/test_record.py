"""Records of games: whole on disk or one clear error, and what the game showed."""

import json
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import (
    ARRAYS,
    META_KEYS,
    NOT_COVERED,
    GameRecorder,
    absolute_commands,
    find_violations,
    load,
    make_record,
    meta_of,
    read_meta,
    save,
    validate,
)
from steerclear.env.record_file import LATER
from steerclear.shield.exceptions import TraceError
from steerclear.shield.renamed import current_keys, earlier_keys


def test_a_record_survives_the_disk_bit_for_bit(game_record, tmp_path):
    path = save(game_record, tmp_path / "deep" / "game")
    back = load(path)
    assert path.name == "game.npz"
    assert set(back) == set(game_record) == {*ARRAYS, "meta"}
    for name in ARRAYS:
        np.testing.assert_array_equal(back[name], game_record[name])
        assert back[name].dtype == game_record[name].dtype
    assert read_meta(back) == read_meta(game_record)


def test_a_failed_save_leaves_the_older_file(game_record, tmp_path):
    target = save(game_record, tmp_path / "game.npz")
    before = target.read_bytes()
    broken = {**game_record, "position": np.array([object()] * 3)}
    with pytest.raises(TraceError):
        save(broken, target)
    assert target.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_a_folder_or_an_older_file_is_replaced_whole_or_left_as_it_was(game_record, tmp_path):
    target = save(game_record, tmp_path / "game.npz")
    before = target.read_bytes()
    with pytest.raises(TraceError):
        save({**game_record, "position": np.array([object()] * 3)}, target)
    assert target.read_bytes() == before
    save(game_record, target)
    assert [file.name for file in tmp_path.iterdir()] == ["game.npz"]
    with pytest.raises(TraceError, match="Choose a folder you may write to"):
        save(game_record, target / "game.npz")


def test_other_and_damaged_files_are_one_clear_error(game_record, tmp_path):
    with pytest.raises(TraceError, match=r"there is no record .*none\.npz; check the path.* `steerclear play --save"):
        load(tmp_path / "none.npz")
    path = save(game_record, tmp_path / "game.npz")
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        start = archive.getinfo("position.npy").header_offset + 100
    damaged = whole[:start] + bytes(60) + whole[start + 60 :]
    for content in (b"", whole[: len(whole) // 3], whole[: int(0.97 * len(whole))], damaged, b"hello"):
        path.write_bytes(content)
        with pytest.raises(TraceError, match=r"game\.npz is cut or not a record.* Record a game with") as refused:
            load(path)
        assert "pickle" not in str(refused.value)


@pytest.mark.parametrize("name", [name for name in ARRAYS if name not in LATER])
def test_a_missing_array_is_named(game_record, tmp_path, name):
    arrays = {key: value for key, value in game_record.items() if key != name}
    np.savez(tmp_path / "game.npz", **arrays)
    with pytest.raises(TraceError, match=rf"game\.npz: the record lacks {name}\."):
        load(tmp_path / "game.npz")


def test_what_older_versions_did_not_write_is_filled_in(game_record, tmp_path):
    np.savez(tmp_path / "game.npz", **{key: value for key, value in game_record.items() if key not in LATER})
    loaded = load(tmp_path / "game.npz")
    assert loaded["is_disabled"].shape == loaded["is_tagged"].shape
    assert not loaded["is_disabled"].any()


@pytest.mark.parametrize("name", [name for name in ARRAYS if name != "nominal"])
def test_an_array_of_another_length_is_named(game_record, name):
    values = game_record[name]
    short = values[:, :3] if name == "violations" else values[:-1]
    with pytest.raises(TraceError, match=f"{name} has shape"):
        validate({**game_record, name: short})


@pytest.mark.parametrize("name", ["position", "heading_deg", "speed_mps", "flag_position"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_must_be_finite(game_record, name, value):
    broken = game_record[name].copy()
    broken.flat[5] = value
    with pytest.raises(TraceError, match=f"{name} holds NaN or infinity"):
        validate({**game_record, name: broken})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"meta": np.array("{")}, "meta is not JSON"),
        ({"meta": np.array("[]")}, "meta lacks"),
        ({"violations": np.array([[999.0, 0, 1, 1.0]])}, "step beyond 60"),
        ({"violations": np.array([[5.0, 0, 9, 1.0]])}, "boat beyond 3"),
        ({"violations": np.array([[-1.0, 0, 1, 1.0]])}, "violations name a step"),
        *(({"meta": {key: None}}, f"meta lacks {key}") for key in META_KEYS),
        ({"meta": {"team": [0, 1]}}, "one entry for each of the 4 boats"),
    ],
)
def test_values_that_fit_nothing_are_refused(game_record, changes, words):
    if isinstance(changes.get("meta"), dict):
        meta = {**read_meta(game_record), **changes["meta"]}
        changes = {"meta": np.array(json.dumps({key: value for key, value in meta.items() if value is not None}))}
    with pytest.raises(TraceError, match=words):
        validate({**game_record, **changes})


def test_a_folder_that_cannot_be_written_to(game_record, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(TraceError, match="Choose a folder you may write to"):
        save(game_record, tmp_path / "file" / "game.npz")


def test_a_recorded_game_is_what_the_env_showed():
    env = MctfEnv(GameConfig.preset("aamas2024", max_time_s=2.0))
    env.reset(seed=5)
    recorder = GameRecorder()
    recorder.start(env.view(), meta_of(env.config, seed=5))
    views = [env.view()]
    while env.agents:
        commands = np.tile([1.5, 20.0], (6, 1))
        absolute = absolute_commands(commands, env.view().heading_deg)
        env.step({name: tuple(commands[k]) for k, name in enumerate(env.agents)})
        views.append(env.view())
        recorder.step(env.view(), absolute, absolute)
    record = recorder.finish()
    assert record["position"].shape == (21, 6, 2)
    np.testing.assert_array_equal(record["position"], [view.position for view in views])
    np.testing.assert_array_equal(record["heading_deg"], [view.heading_deg for view in views])
    np.testing.assert_array_equal(record["captures"], [view.captures for view in views])
    assert (record["reason"] == NOT_COVERED).all()
    assert not record["intervened"].any()
    assert np.isnan(record["safety_margin_m"]).all()
    assert record["violations"].shape == (0, 4)


def view_of(record, step):
    state = np.zeros((4, 11))
    state[:, :2] = record["position"][step]
    state[:, 2], state[:, 3] = record["heading_deg"][step], record["speed_mps"][step]
    marks = {
        name: record[name][step]
        for name in ("has_flag", "is_tagged", "oob", "is_disabled", "flag_position", "captures")
    }
    return SimpleNamespace(state=state, time_s=0.1 * step, **marks)


REST = ("reason", "intervened", "safety_margin_m")


def test_recording_step_by_step_gives_the_same_record_and_a_step_that_does_not_fit_leaves_it_whole(
    game_record, game_meta
):
    recorder = GameRecorder()
    with pytest.raises(TraceError, match=r"Call start\(\) before step"):
        recorder.step(view_of(game_record, 1), np.zeros((4, 2)), np.zeros((4, 2)))
    with pytest.raises(TraceError, match=r"Call start\(\) before finish"):
        recorder.finish()
    recorder.start(view_of(game_record, 0), game_meta)
    with pytest.raises(TraceError, match=r"filtered has shape \(3, 2\), expected \(4, 2\)"):
        recorder.step(view_of(game_record, 1), np.zeros((4, 2)), np.zeros((3, 2)))
    for step in range(60):
        commands = [game_record[name][step] for name in ("nominal", "filtered", *REST)]
        if step == 30:
            with pytest.warns(DeprecationWarning, match="is now '(nominal|filtered)'"):
                recorder.step(
                    view_of(game_record, 31),
                    wanted=commands[0],
                    sent=commands[1],
                    **dict(zip(REST, commands[2:], strict=True)),
                )
        else:
            recorder.step(view_of(game_record, step + 1), *commands)
    with pytest.warns(DeprecationWarning, match="'breaches' is now 'violations'"):
        again = recorder.finish(breaches=game_record["violations"])
    for name in ARRAYS:
        np.testing.assert_array_equal(again[name], game_record[name])


def test_a_game_without_a_step_is_a_record(game_record, game_meta, tmp_path):
    recorder = GameRecorder()
    recorder.start(view_of(game_record, 0), game_meta)
    record = load(save(recorder.finish(), tmp_path / "game.npz"))
    assert record["nominal"].shape == (0, 4, 2)


@given(st.floats(-360, 360), st.floats(-180, 180))
def test_absolute_headings_are_wrapped_and_agree_with_the_relative_ones(relative_deg, heading_deg):
    absolute = absolute_commands(np.array([[1.5, relative_deg]]), np.array([heading_deg]))
    assert absolute[0, 0] == 1.5
    assert -180.0 <= absolute[0, 1] <= 180.0
    difference = (absolute[0, 1] - heading_deg - relative_deg) % 360.0
    assert min(difference, 360.0 - difference) < 1e-9


def gaps(*gaps_m):
    position = np.zeros((len(gaps_m), 2, 2))
    position[:, 1, 0] = gaps_m
    return position


@pytest.mark.parametrize(
    ("gaps_m", "rows"),
    [
        ((5, 2, 1.5, 2, 5, 2.25), [[1, 0, 1, 1.5], [5, 0, 1, 2.25]]),
        ((5, 2.5, 5), [[1, 0, 1, 2.5]]),  # exactly on the radius is inside
        ((2, 5, 5), []),  # the start itself is not counted
        ((2, 2.1, 5), [[1, 0, 1, 2.1]]),  # but a pair that starts inside counts at the first step
        ((5,), []),
    ],
)
def test_violations_are_entries_into_the_radius(gaps_m, rows):
    np.testing.assert_allclose(find_violations(gaps(*gaps_m), 2.5), np.array(rows).reshape(-1, 4))


def test_a_record_has_all_of_a_config(game_meta):
    assert game_meta["flag_home"] == [(10.0, 20.0), (70.0, 20.0)]
    assert game_meta["agent_radius_m"] == 1.25
    assert game_meta["platforms"] == ["heron"] * 4
    uneven = meta_of(GameConfig.preset("aamas2024", team_size=1, agent_radius_m=(1.0, 2.0)))
    assert uneven["agent_radius_m"] == (1.0, 2.0)
    with pytest.raises(TraceError, match="no array speeds; it has position"):
        make_record(game_meta, speeds=np.zeros(3))
    with pytest.raises(TraceError, match="unknown separation; a record takes separation_m"):
        meta_of(GameConfig.preset("aamas2024"), separation=2.5)


OLD = {"wanted": "nominal", "sent": "filtered", "breaches": "violations"}


def test_names_of_0_9_are_read_and_answered_with_a_warning(game_record, tmp_path):
    old = {{new: name for name, new in OLD.items()}.get(name, name): values for name, values in game_record.items()}
    np.savez(tmp_path / "old.npz", **old)
    for record in (load(tmp_path / "old.npz"), load(save(old, tmp_path / "again.npz"))):
        assert set(record) == set(game_record)
        for name, new in OLD.items():
            with pytest.warns(DeprecationWarning, match=f"'{name}' is now '{new}'") as caught:
                np.testing.assert_array_equal(record[name], game_record[new])
            assert caught[0].filename == __file__
            with pytest.warns(DeprecationWarning, match=f"'{name}' is now '{new}'") as caught:
                np.testing.assert_array_equal(record.get(name), game_record[new])
            assert caught[0].filename == __file__
            assert name in record
    with pytest.raises(KeyError, match="told"):
        game_record["told"]
    assert "told" not in game_record
    assert game_record.get("told", 1) == 1
    arrays = {name: values for name, values in old.items() if name != "meta"}
    assert set(make_record(read_meta(old), **arrays)) == set(game_record)


def test_renamed_keys_of_results_stand_under_their_earlier_names_and_are_read():
    results = {
        "command": "encounters",
        "settings": {"filters": ["none"], "seed": 0},
        "cells": [{"filter": "none", "violated": 2, "closest_m": 1.0}, {"filter": "shield", "violated": 0}],
        "pairings": [{"on": {"violations_opponent_2.5m": {"value": 1.0}}, "name": "a"}],
    }
    earlier = {
        "settings": {"guards": ["none"]},
        "cells": [{"guard": "none", "breached": 2}, {"guard": "shield", "breached": 0}],
        "pairings": [{"on": {"breaches_opponent_2.5m": {"value": 1.0}}}],
    }
    assert earlier_keys(results) == earlier
    assert current_keys(earlier)["cells"][0] == {"filter": "none", "violated": 2}
    assert earlier_keys({"command": "reach", "settings": {"n": 1}}) == {}
