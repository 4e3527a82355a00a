import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from steerclear.env.parity import Tolerances, compare, replay_trace
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import TraceError

TRACES = sorted((Path(__file__).parents[1] / "data" / "traces").glob("*.npz"))


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.stem)
def test_recorded_games_are_replayed(path):
    report = replay_trace(path)
    assert report.mismatches == ()
    assert report.over() == {}
    assert report.passed
    assert report.steps > 200


def test_the_recorded_games_hold_every_kind_of_event(traces):
    seen = dict.fromkeys(("captures", "grabs", "tags", "agent_collisions", "oob", "is_tagged", "untag", "keepout"), 0)
    boats, discrete, sizes = set(), 0, set()
    for path in traces.values():
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
    assert all(count > 0 for count in seen.values()), seen
    assert boats == {"heron", "surveyor", "large_usv", "si", "di"}
    assert discrete == 1
    assert sizes == {2, 3}
    assert sum(path.stat().st_size for path in traces.values()) < 3_000_000


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
def test_a_deviation_anywhere_is_found(traces, name, field, shift):
    trace = load_trace(traces["heron_captures"]).cut(20)
    last = len(trace.arrays[name]) - 1
    report = compare(changed(trace, name, last, trace.arrays[name][last] + shift))
    assert list(report.over()) == [field]
    assert not report.passed
    assert report.over(Tolerances(**{field: 1.0})) == {}
    broken = compare(changed(trace, name, last, np.nan)) if name not in ("position", "heading", "speed") else report
    assert field in broken.over()


@pytest.mark.parametrize("name", ["captures", "grabs", "tags", "agent_collisions"])
def test_a_wrong_count_is_named_with_step_and_owner(traces, name):
    trace = load_trace(traces["heron_captures"]).cut(20)
    report = compare(changed(trace, name, (7, 1), 9))
    (mismatch,) = report.mismatches
    assert (mismatch.step, mismatch.event, mismatch.expected, mismatch.got) == (7, name, 9, 0)
    assert mismatch.who == ("agent_1" if name == "agent_collisions" else "red")
    assert not report.passed


@pytest.mark.parametrize("name", ["is_tagged", "has_flag", "oob", "flag_taken", "on_side"])
def test_a_wrong_status_is_found(traces, name):
    trace = load_trace(traces["heron_captures"]).cut(20)
    report = compare(changed(trace, name, (7, 0), not trace.arrays[name][7, 0]))
    assert [(m.step, m.event) for m in report.mismatches] == [(7, name)]


def test_half_a_turn_either_way_is_one_heading(traces):
    trace = load_trace(traces["heron_captures"]).cut(20)
    turned = changed(trace, "heading", 3, trace.arrays["heading"][3] + 360.0)
    assert compare(turned).passed


def test_the_report_is_plain_data(traces):
    report = replay_trace(traces["heron_captures"])
    data = json.loads(json.dumps(report.to_dict()))
    assert data["passed"] is True
    assert data["mismatches"] == []
    assert data["position_m"] == report.position_m


def test_a_start_or_an_action_that_the_rules_do_not_allow_is_a_trace_error(traces):
    trace = load_trace(traces["heron_captures"]).cut(20)
    with pytest.raises(TraceError, match="not inside the field"):
        compare(changed(trace, "position", (0, 0), (-5.0, 3.0)))
    with pytest.raises(TraceError, match="action of agent_2"):
        compare(changed(trace, "action", (4, 2), np.nan))
