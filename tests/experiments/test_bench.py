import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from json_keys import KEYS, undocumented
from steerclear.experiments.bench import POLICIES, BenchSettings, bench_goals, bench_tables, run_bench
from steerclear.experiments.bench_measures import BatchSize, programs_of, questions_of_games, solver_times
from steerclear.experiments.docs import write_pages
from steerclear.experiments.result_files import finite, write_json
from steerclear.shield import ShieldConfig
from steerclear.shield.filter.program import Program

TINY = replace(
    BenchSettings(),
    repeats=1,
    game_s=4.0,
    lookups=1000,
    programs=5,
    batch=BatchSize(game_steps=12, repeats=2),
    games=4,
    games_at_once=(4, 8),
    memory_games=16,
    scenes=3,
    counts=(4, 8),
)


@pytest.fixture(scope="module")
def content():
    return run_bench(TINY)


def test_everything_is_measured_and_documented(content):
    assert undocumented(finite(content), KEYS["bench"]) == []
    assert content["decide"]["decisions"] == content["decide_by_table"]["decisions"] == 4 * 40
    assert content["decide_by_table"]["all"]["p50_us"] > 0.0
    assert content["decide"]["all"]["p50_us"] > 0.0
    runs = {(row["preset"], row["policy"], row["shielded"], row["games"], row["threads"]) for row in content["batch"]}
    for preset in ("aamas2024", "mctf2025"):
        assert {(preset, policy, shielded, 4, 1) for policy in POLICIES for shielded in (False, True)} <= runs
        assert {(preset, "medium", True, games, threads) for games in (4, 8) for threads in (1, 2)} <= runs
    assert len(runs) == len(content["batch"]) == 22
    assert all(row["low"] <= row["median"] <= row["high"] for row in content["batch"])
    assert [(row["preset"], row["policy"]) for row in content["policies"]] == [
        (preset, policy) for preset in ("aamas2024", "mctf2025") for policy in POLICIES
    ]
    sizes = [(row["platform"], row["boats"], row["ours"]) for row in content["scaling"]]
    assert sizes == [(platform, *size) for platform in ("surveyor", "heron") for size in ((4, 2), (8, 4))]
    assert content["memory"]["games_mib"] > 0.0
    for preset in ("aamas2024", "mctf2025"):
        rows = [row for row in content["stages"] if row["preset"] == preset]
        assert [row["kind"] for row in rows] == ["passes", "searches", "changes"]
        assert sum(row["decisions"] for row in rows) == 4 * 39
        for part in ("share", "time_share"):
            assert sum(row[part] for row in rows) == pytest.approx(1.0)
        for row in rows:
            assert row["all_us"] == pytest.approx(row["check_us"] + row["rest_us"] + row["python_us"])
    assert [row["what"] for row in content["lookups"]] == ["value", "value and gradient"]
    assert all(row["us"] > 0.0 and row["lookups"] == 1000 for row in content["lookups"])
    assert {"daqp", "osqp", "active set (baselines)"} <= {row["solver"] for row in content["solvers"]}


def test_figures_become_tables_and_a_page(content, tmp_path):
    titles = [table.title for table in bench_tables(content)]
    assert len(set(titles)) == len(titles) == 10
    for table in bench_tables(content):
        assert all(len(row) == len(table.heads) for row in table.rows)
    write_json(tmp_path / "bench.json", content)
    pages = write_pages([json.loads((tmp_path / "bench.json").read_text())], tmp_path / "docs")
    text = (tmp_path / "docs" / "bench.md").read_text()
    assert all(title in text for title in titles)
    assert "decision p99.9, us" in text
    assert {page.name for page in pages} == {"bench.md", "json_keys.md"}


def test_goals_judge_the_slowest_policy_without_a_shield_and_medium_with_one(content):
    rates = {"random": (2e5, 7e4), "easy": (3e5, 9e4), "medium": (4e5, 8.5e4), "hard": (4e5, 9e4)}
    batch = [
        {"preset": preset, "policy": policy, "shielded": shielded, "games": games, "threads": 1, "median": rate}
        for preset, games in (("aamas2024", 256), ("mctf2025", 256), ("aamas2024", 64))
        for policy, both in rates.items()
        for shielded, rate in zip((False, True), both if games == 256 else (1.0, 1.0), strict=True)
    ]
    more = ({**row, "threads": 2, "median": 1.9 * row["median"]} for row in batch if row["policy"] == "medium")
    fast, slow = {"p50_us": 35.0, "p99_9_us": 600.0}, {"p50_us": 51.0, "p99_9_us": 500.0}
    goals = bench_goals(
        {
            "settings": asdict(BenchSettings()),
            "decide": {"all": fast},
            "decide_by_table": {"all": slow},
            "batch": [*batch, *(row for row in more if row["shielded"])],
            "memory": {"games": 4096, "games_mib": 100.0, "shield_mib": 91.0},
            "scaling": [{"platform": "heron", "boats": boats, "p50_us": 16_000.0} for boats in (50, 100, 1000)],
        }
    )
    assert [goal["met"] for goal in goals] == [True, False, False, True, False, *[True] * 4, False, True, False]
    assert [goal["value"] for goal in goals[4:9]] == pytest.approx([2e5, 8.5e4, 1.9, 8.5e4, 1.9])


def test_programs_are_those_that_the_shield_solves_in_games():
    assert len(programs_of(questions_of_games("aamas2024", 20.0, 0, ShieldConfig()), ShieldConfig(), 3, 0)) == 3


def test_solvers_are_held_against_each_other_on_the_same_programs():
    rows = np.array([[1.0, 0.0], [0.0, 1.0]])
    feasible = Program(rows, np.array([1.0, -2.0]), np.array([0.5, 0.5]))
    impossible = Program(np.vstack([rows, -rows]), np.array([1.0, 1.0, 1.0, 1.0]), np.zeros(2))
    times = {row["solver"]: row for row in solver_times([feasible, impossible], 1)}
    assert times["daqp"]["ratio"] == 1.0
    assert times["daqp"]["solved"] == times["osqp"]["solved"] == times["active set (baselines)"]["solved"] == 0.5
    assert max(row["differs"] for row in times.values() if row["differs"] is not None) < 1e-3
