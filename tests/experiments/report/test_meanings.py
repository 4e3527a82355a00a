"""Words that need explaining are explained where they stand."""

import pytest
from steerclear.experiments.measure.summary import metrics_of
from steerclear.experiments.report.ablation_html import write_report
from steerclear.experiments.report.meanings import FIGURES, REASONS
from steerclear.shield.decision import Reason
from test_ablation_html import results  # noqa: F401


def test_every_reason_for_which_a_command_is_changed_has_a_meaning():
    assert set(REASONS) == {name.lower() for name in Reason.__members__} - {"passed", "not_covered"}


def test_meanings_are_of_figures_that_there_are():
    assert set(FIGURES) <= {metric.name for metric in metrics_of((2.5, 4.0))}


@pytest.mark.parametrize("reason", ["BACKUP", "ESCAPE", "HELD", "BEST_EFFORT"])
def test_the_report_says_what_a_reason_means_beside_its_plot(reason, results, tmp_path):  # noqa: F811
    results["pairings"][0]["reasons"][reason] = 5
    text = write_report(results, tmp_path / "a.html").read_text(encoding="utf-8")
    plot = text[text.index("Why commands were changed") :]
    assert REASONS[reason.lower()] in plot[: plot.index("</figure>")]


def test_the_report_says_what_reversals_and_scores_are_in_their_rows(results, tmp_path):  # noqa: F811
    figures = results["pairings"][0]["metrics"]
    for name in ("reversals_per_boat_minute", "primary", "secondary"):
        figures[name] = {"label": name, "on": {"value": 1.0, "low": None, "high": None}}
    text = write_report(results, tmp_path / "a.html").read_text(encoding="utf-8")
    for name in ("reversals_per_boat_minute", "primary", "secondary"):
        row = text[text.index(f"<td>{name}") :]
        assert FIGURES[name] in row[: row.index("</tr>")]


def test_the_old_name_of_a_reason_is_still_read():
    assert Reason["ESCAPE"] is Reason.BACKUP
    assert Reason(3).name == "BACKUP"
