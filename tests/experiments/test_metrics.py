"""Adding to the experiments: a metric in one line, an experiment in one file, as CONTRIBUTING shows."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from json_keys import KEYS, undocumented
from steerclear.env.record import read_meta
from steerclear.experiments import metrics
from steerclear.experiments.ablation import AblationSettings, results_of, write_results
from steerclear.experiments.docs import keys_page
from steerclear.experiments.metrics import Goal, Metric, check, game_metrics_of
from steerclear.experiments.report import Report, Section, Table
from steerclear.experiments.runner import Experiment, execute
from steerclear.experiments.statistics import count_interval, mean_interval, summarise
from steerclear.experiments.tables import interval_text, pairing_table
from steerclear.shield import ShieldConfig
from steerclear.shield.decision import Reason
from steerclear.shield.exceptions import ConfigError
from test_ablation import printed


def slowest_mps(record, side):
    """As CONTRIBUTING has it: from a game's record and a team to the column."""
    return float(record["speed_mps"][:, np.asarray(read_meta(record)["team"]) == side].min())


def test_a_metric_of_one_line_reaches_rows_table_report_and_keys(monkeypatch, tmp_path):
    line = Metric("slowest_mps", "mean", "slowest, m/s", "m/s", "lowest speed of an own boat", measure=slowest_mps)
    monkeypatch.setattr(metrics, "OWN", (line,))
    settings = AblationSettings(opponents=("hold",), games=2, rules={"max_time_s": 1.0})
    run = execute(settings.experiment("ablate"), tmp_path)
    results = results_of(run, settings)
    figures = results["pairings"][0]["metrics"]["slowest_mps"]
    assert figures["off"]["value"] == pytest.approx(mean_interval([row["slowest_mps"] for row in run.rows[::2]]).value)
    assert {"off", "on", "difference"} <= set(figures)
    assert "slowest, m/s" in printed(pairing_table(results["pairings"][0]), 80)
    write_results(run, results)
    page = (tmp_path / "report.html").read_text().replace("\u00a0", " ")
    assert "lowest speed of an own boat" in page
    assert interval_text(figures["on"]) in page
    content = json.loads((tmp_path / "results.json").read_text())
    assert undocumented({"pairings": content["pairings"]}, KEYS["ablate"]) == []


THROWS = [Metric("hit", "share", "hits", "", "whether it hit"), Metric("off_m", "mean", "off by", "m", "distance")]


def throw(job):
    """An experiment's ``run``: from a job to its rows."""
    return [{"hand": job["hand"], "number": n, "hit": n % 2 == 0, "off_m": n * job["scale"]} for n in range(6)]


def test_an_experiment_is_jobs_a_function_metrics_and_goals(tmp_path):
    jobs = [{"hand": hand, "scale": scale} for hand, scale in (("left", 0.5), ("right", 0.2))]
    run = execute(Experiment("throw", {"scales": [0.5, 0.2]}, jobs, throw, unit="hands"), tmp_path)
    figures = summarise(run.table.assign(all="all"), THROWS, ["all"], ("hand", "left", "right"), ["number"])
    told = {(line.hand, line.metric): line for line in figures.itertuples()}
    assert told["difference", "off_m"].value == pytest.approx(-0.75)
    assert told["difference", "off_m"].high < 0.0
    assert (told["left", "hit"].value, told["left", "hit"].n) == (0.5, 6)
    goals = check(
        [Goal("hits", lambda table: count_interval(int(table["hit"].sum()), len(table)), ">=", 0.4)], run.table
    )
    assert goals[0]["met"] is True
    run.write({**run.head(), "goals": goals})
    rows = [[line.hand, line.metric, f"{line.value:.2f}"] for line in figures.itertuples()]
    page = Report("Throws", "two hands", goals=goals, sections=[Section("", [Table("", ["", "", "value"], rows)])])
    assert "-0.75" in page.write(tmp_path / "report.html").read_text()
    assert json.loads((tmp_path / "results.json").read_text())["complete"] is True


def test_a_kind_of_metric_that_there_is_not_is_refused(tmp_path):
    run = execute(Experiment("throw", {}, [{"hand": "left", "scale": 1.0}], throw), tmp_path)
    with pytest.raises(ConfigError, match="unknown kind of metric 'median'; choose count, share, mean, percent or"):
        summarise(run.table, [Metric("off_m", "median", "", "", "")], ["hand"])


def test_every_metric_says_what_it_is_and_keys_are_no_two_alike():
    keys = [metric.key for metric in game_metrics_of()]
    assert len(set(keys)) == len(keys)
    assert all(
        len(words.split()) >= 2 and not words.endswith(".") for words in (one.meaning for one in game_metrics_of())
    )


def test_every_reason_for_which_a_command_is_changed_has_a_meaning():
    assert {name.lower() for name in Reason.__members__} - {"passed", "not_covered"} <= set(metrics.REASONS)
    assert Reason["ESCAPE"] is Reason.BACKUP, "the name in results of 0.2.0 and before"
    assert Reason["QP"] is Reason.LEAST_CHANGE, "the name in logs of 0.8.0 and before"


def test_the_page_names_every_metric_of_a_game():
    page = keys_page()
    for metric in game_metrics_of((2.5,)):
        assert f"`{metric.name}" in page or metric.column in page, metric


def test_the_page_of_settings_has_all_there_are_and_no_other():
    text = (Path(__file__).parents[2] / "docs" / "settings.md").read_text(encoding="utf-8")
    named = [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")]
    assert sorted(named) == sorted(entry.name for entry in fields(ShieldConfig))
