import json

import numpy as np
import pytest
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import TraceError


@pytest.fixture
def arrays(traces):
    with np.load(traces["heron_captures"]) as archive:
        return dict(archive)


@pytest.fixture
def write(tmp_path, arrays):
    def save(**changes):
        kept = {name: values for name, values in {**arrays, **changes}.items() if values is not None}
        np.savez(tmp_path / "trace.npz", **kept)
        return tmp_path / "trace.npz"

    return save


def meta_with(arrays, **changes):
    meta = json.loads(str(arrays["meta"]))
    return np.array(json.dumps({**meta, **changes}))


def test_a_cut_trace_written_and_read_again_is_the_same(traces, tmp_path):
    trace = load_trace(traces["heron_2v2_random_starts"])
    again = load_trace(trace.cut(33).save(tmp_path / "short.npz"))
    assert (again.steps, trace.steps) == (33, 590)
    assert again.config == trace.config
    for name, values in again.arrays.items():
        np.testing.assert_array_equal(values, trace.arrays[name][: len(values)])
    assert len(again.arrays["obs"]) == 7
    for steps in (0, 591):
        with pytest.raises(TraceError, match=r"give 1\.\.590"):
            trace.cut(steps)


def test_a_damaged_file_is_refused(traces, tmp_path):
    content = bytearray(traces["heron_captures"].read_bytes())
    content[len(content) // 2] ^= 0xFF
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(bytes(content))
    with pytest.raises(TraceError, match="is cut or not a trace"):
        load_trace(damaged)


@pytest.mark.parametrize("name", ["meta", "action", "position", "obs_normalized", "is_tagged", "captures"])
def test_a_missing_array_is_named(write, name):
    with pytest.raises(TraceError, match=f"lacks {name}"):
        load_trace(write(**{name: None}))


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("position", lambda a: a[:-1], "position has shape"),
        ("action", lambda a: a[:, :3], "action has shape"),
        ("action", lambda a: a[:0], "has shape"),
        ("obs", lambda a: a[:, :, :60], "obs has shape"),
        ("heading", lambda a: np.where(np.arange(len(a))[:, None] == 5, np.nan, a), "heading holds NaN"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(write, arrays, name, change, message):
    with pytest.raises(TraceError, match=message):
        load_trace(write(**{name: change(arrays[name])}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"config": {"dynamics": "canoe"}}, "fit no game: unknown platform 'canoe'"),
        ({"config": {"lidar_obs": True}}, "lidar_obs = True is not supported"),
        ({"team_size": 0}, "team_size in meta is 0"),
        ({"dt": None}, "dt_s is None"),
    ],
)
def test_settings_that_fit_no_game_are_refused(write, arrays, changes, message):
    with pytest.raises(TraceError, match=message):
        load_trace(write(meta=meta_with(arrays, **changes)))


def test_meta_must_be_whole_json(write, arrays):
    with pytest.raises(TraceError, match="meta is not JSON"):
        load_trace(write(meta=np.array("{")))
    with pytest.raises(TraceError, match="meta lacks config, team_size"):
        load_trace(write(meta=np.array("{}")))
