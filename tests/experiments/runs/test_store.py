import csv
import json

import numpy as np
import pytest
from steerclear.experiments.runs import store
from steerclear.experiments.runs.store import ResultStore, finite, key_of, write_json, write_table
from steerclear.shield.exceptions import ConfigError


def test_results_come_back_by_key_and_the_last_one_counts(tmp_path):
    kept = ResultStore(tmp_path / "deep" / "out")
    kept.append("a", {"value": 1})
    kept.append("b", {"value": np.float64(2.5)})
    kept.append("a", {"value": 3})
    assert kept.load() == {"a": {"value": 3}, "b": {"value": 2.5}}


def test_a_line_cut_by_a_kill_is_left_out_and_the_next_result_is_not_lost(tmp_path, caplog):
    kept = ResultStore(tmp_path)
    kept.append("a", {"value": 1})
    with kept.lines.open("a") as file:
        file.write('{"key": "b", "val')
    again = ResultStore(tmp_path, resume=True)
    assert again.load() == {"a": {"value": 1}}
    assert "not complete" in caplog.text
    again.append("c", {"value": 3})
    assert again.load() == {"a": {"value": 1}, "c": {"value": 3}}


def test_a_folder_with_results_is_not_written_to_by_accident(tmp_path):
    ResultStore(tmp_path).append("a", {})
    with pytest.raises(ConfigError, match="add --resume"):
        ResultStore(tmp_path)


def test_results_that_are_no_text_are_one_clear_error(tmp_path):
    (tmp_path / "games.jsonl").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"cannot read .*games.jsonl .*is no text.*move it away"):
        ResultStore(tmp_path, resume=True).load()
    (tmp_path / "games.jsonl").unlink()
    (tmp_path / "games.jsonl").mkdir()
    with pytest.raises(ConfigError, match=r"games\.jsonl|choose another --out"):
        ResultStore(tmp_path, resume=True).load()


def test_a_folder_that_holds_something_else_is_neither_begun_nor_gone_on_with(tmp_path):
    (tmp_path / "games.jsonl").touch()
    ResultStore(tmp_path)  # an empty file is nothing to lose
    (tmp_path / "results.json").write_text('{"my": "results"}')
    with pytest.raises(ConfigError, match="already holds results"):
        ResultStore(tmp_path)
    with pytest.raises(ConfigError, match="that are not ours, not of 'encounters'; choose another --out"):
        ResultStore(tmp_path, True, "encounters")
    (tmp_path / "results.json").write_text('{"command": "ablate"}')
    with pytest.raises(ConfigError, match="holds results of 'ablate', not of 'encounters'"):
        ResultStore(tmp_path, True, "encounters")
    ResultStore(tmp_path, True, "ablate")
    assert (tmp_path / "results.json").read_text() == '{"command": "ablate"}'


def test_an_unwritable_folder_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="choose another --out"):
        ResultStore(tmp_path / "file" / "out")


def test_keys_depend_on_the_settings_and_not_on_their_order():
    assert key_of({"a": 1, "b": [2]}) == key_of({"b": [2], "a": 1})
    assert key_of({"a": 1}) != key_of({"a": 2})


def test_json_has_no_numbers_that_other_readers_refuse(tmp_path):
    write_json(tmp_path / "sub" / "x.json", {"a": [float("nan"), np.inf, np.int64(3)], "p": tmp_path})
    assert json.loads((tmp_path / "sub" / "x.json").read_text()) == {"a": [None, None, 3], "p": str(tmp_path)}
    assert finite({"a": (1.0, float("-inf"))}) == {"a": [1.0, None]}


def test_json_refuses_what_it_cannot_write(tmp_path):
    with pytest.raises(TypeError, match="set"):
        write_json(tmp_path / "x.json", {"a": {1}})
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="choose another place"):
        write_json(tmp_path / "file" / "x.json", {})


def test_rows_with_different_columns_make_one_table_in_both_formats(tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = [{"a": 1, "b": "x"}, {"a": 2, "c": 0.5}]
    path = write_table(tmp_path, rows)
    assert parquet.read_table(path).to_pylist() == [{"a": 1, "b": "x", "c": None}, {"a": 2, "b": None, "c": 0.5}]
    monkeypatch.setattr(store, "find_spec", lambda name: None)
    with write_table(tmp_path, rows).open() as file:
        assert list(csv.DictReader(file))[1] == {"a": "2", "b": "", "c": "0.5"}
