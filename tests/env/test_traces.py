"""Parity: recorded games of Pyquaticus are replayed, any deviation is found and named, unusable traces are refused."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from steerclear.env.parity import Tolerances, compare, replay_trace
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import TraceError

DATA = Path(__file__).parents[1] / "data"
TRACES = [path for folder in ("traces", "traces_2026") for path in sorted((DATA / folder).glob("*.npz"))]
CAPTURES = DATA / "traces" / "heron_captures.npz"


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.stem)
def test_recorded_games_are_replayed(path):
    report = replay_trace(path)
    assert (report.mismatches, report.over(), report.passed) == ((), {}, True)
    data = json.loads(json.dumps(report.to_dict()))
    assert (data["passed"], data["mismatches"], data["position_m"]) == (True, [], report.position_m)


def test_the_recorded_games_hold_every_kind_of_event():
    seen = dict.fromkeys(("captures", "grabs", "tags", "agent_collisions", "oob", "is_tagged", "untag", "keepout"), 0)
    boats, discrete, sizes, decision_steps, disabled, unseen = set(), 0, set(), set(), [], []
    for path in TRACES:
        trace = load_trace(path)
        arrays, config = trace.arrays, trace.config
        for name in ("captures", "grabs", "tags", "agent_collisions"):
            seen[name] += int(arrays[name][-1].sum())
        seen["oob"] += int(arrays["oob"].sum())
        seen["is_tagged"] += int(arrays["is_tagged"].sum())
        seen["untag"] += int((arrays["is_tagged"][:-1] & ~arrays["is_tagged"][1:]).sum())
        homes = np.repeat(trace.meta["flag_home"], config.team_size, axis=0)
        circle = config.flag_keepout_m + 0.1 + np.array(config.agent_radius_m)
        distance = np.linalg.norm(arrays["position"] - homes, axis=-1)
        seen["keepout"] += int((np.abs(distance - circle) < 1e-9).sum())
        boats |= {platform.name for platform in config.platforms}
        discrete += int(np.isnan(arrays["action"][..., 1]).all())
        sizes.add(config.team_size)
        decision_steps.add(config.decision_steps)
        disabled += [int(arrays["is_disabled"].sum(axis=1).max())] if "is_disabled" in arrays else []
        if "contacts" in arrays:
            unseen.append(int(arrays["contacts"][-1].sum() - arrays["agent_collisions"][-1].sum()))
    assert all(count > 0 for count in seen.values()), seen
    assert boats == {"heron", "surveyor", "large_usv", "si", "di"}
    assert (discrete, sizes, decision_steps) == (2, {2, 3}, {1, 4, 10})
    assert max(disabled) == 2
    assert max(unseen) > 0
    assert sum(path.stat().st_size for path in (DATA / "traces").glob("*.npz")) < 3_000_000


@pytest.fixture
def trace():
    return load_trace(CAPTURES).cut(20)


def changed(trace, name, index, value):
    arrays = {**trace.arrays, name: trace.arrays[name].copy()}
    arrays[name][index] = value
    return dataclasses.replace(trace, arrays=arrays)


@pytest.mark.parametrize(
    ("name", "field", "shift"),
    [
        ("position", "position_m", 2e-6),
        ("heading", "heading_deg", 2e-6),
        ("speed", "speed_mps", 2e-6),
        ("tagging_cooldown", "cooldown_s", 1e-6),
        ("flag_position", "flag_position_m", 2e-6),
        ("obs_normalized", "observation_normalised", 2e-5),
        ("obs", "observation_raw", 1e-3),
        ("global_state", "global_state", 1e-3),
    ],
)
def test_a_deviation_anywhere_is_found(trace, name, field, shift):
    last = len(trace.arrays[name]) - 1
    report = compare(changed(trace, name, last, trace.arrays[name][last] + shift))
    assert list(report.over()) == [field]
    assert not report.passed
    assert report.over(Tolerances(**{field: 1.0})) == {}
    broken = compare(changed(trace, name, last, np.nan)) if name not in ("position", "heading", "speed") else report
    assert field in broken.over()


@pytest.mark.parametrize("name", ["captures", "agent_collisions", "is_tagged", "has_flag", "oob", "flag_taken"])
def test_a_wrong_count_or_status_is_named_with_step_and_owner(trace, name):
    was = trace.arrays[name][7, 1]
    report = compare(changed(trace, name, (7, 1), not was if was.dtype == bool else 9))
    (mismatch,) = report.mismatches
    assert (mismatch.step, mismatch.event) == (7, name)
    if was.dtype != bool:
        assert (mismatch.expected, mismatch.got) == (9, 0)
        assert mismatch.who == ("agent_1" if name == "agent_collisions" else "red")
    assert not report.passed


def test_a_contact_that_the_game_does_not_see_is_found():
    trace = load_trace(DATA / "traces_2026" / "powerplay10.npz")
    trace.arrays["contacts"][-1, 0] += 1
    (found,) = compare(trace).mismatches
    assert (found.event, found.who) == ("contacts", "agent_0")


def test_a_start_or_an_action_that_the_rules_do_not_allow_is_a_trace_error(trace):
    with pytest.raises(TraceError, match="not inside the field"):
        compare(changed(trace, "position", (0, 0), (-5.0, 3.0)))
    with pytest.raises(TraceError, match="action of agent_2"):
        compare(changed(trace, "action", (4, 2), np.nan))


@pytest.fixture
def arrays():
    with np.load(CAPTURES) as archive:
        return dict(archive)


def test_a_cut_trace_written_and_read_again_is_the_same(tmp_path):
    trace = load_trace(DATA / "traces" / "heron_2v2_random_starts.npz")
    again = load_trace(trace.cut(33).save(tmp_path / "short.npz"))
    assert (again.steps, trace.steps) == (33, 590)
    assert again.config == trace.config
    for name, values in again.arrays.items():
        np.testing.assert_array_equal(values, trace.arrays[name][: len(values)])
    assert len(again.arrays["obs"]) == 7
    for steps in (0, 591):
        with pytest.raises(TraceError, match=r"give 1\.\.590"):
            trace.cut(steps)


def test_a_damaged_file_is_refused(tmp_path):
    content = bytearray(CAPTURES.read_bytes())
    content[len(content) // 2] ^= 0xFF
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(bytes(content))
    with pytest.raises(TraceError, match="is cut or not a trace"):
        load_trace(damaged)


def meta_with(**changes):
    return lambda meta: np.array(json.dumps({**json.loads(str(meta)), **changes}))


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        *((name, None, f"lacks {name}") for name in ("meta", "action", "position", "obs_normalized", "captures")),
        ("position", lambda a: a[:-1], "position has shape"),
        ("action", lambda a: a[:, :3], "action has shape"),
        ("action", lambda a: a[:0], "has shape"),
        ("obs", lambda a: a[:, :, :60], "obs has shape"),
        ("heading", lambda a: np.where(np.arange(len(a))[:, None] == 5, np.nan, a), "heading holds NaN"),
        ("meta", lambda _: np.array("{"), "meta is not JSON"),
        ("meta", lambda _: np.array("{}"), "meta lacks config, team_size"),
        ("meta", meta_with(config={"dynamics": "canoe"}), "fit no game: unknown platform 'canoe'"),
        ("meta", meta_with(config={"lidar_obs": True}), "lidar_obs = True is not supported"),
        ("meta", meta_with(team_size=0), "team_size in meta is 0"),
        ("meta", meta_with(dt=None), "dt_s is None"),
    ],
)
def test_arrays_that_are_missing_or_do_not_fit_are_refused(tmp_path, arrays, name, change, message):
    content = arrays.pop(name)
    np.savez(tmp_path / "trace.npz", **arrays, **({} if change is None else {name: change(content)}))
    with pytest.raises(TraceError, match=message):
        load_trace(tmp_path / "trace.npz")
