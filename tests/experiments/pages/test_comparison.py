"""The comparison of guards: who met the same encounters, figures over families, the page."""

from pathlib import Path

import pytest
from steerclear.experiments.pages.comparison import cells_of, contests_of
from steerclear.experiments.pages.comparison_page import comparison_page
from steerclear.experiments.pages.comparison_plot import legend_columns, looks_of, plot_contests
from steerclear.experiments.pages.docs_pages import write_pages
from steerclear.shield.exceptions import ConfigError

SETTINGS = {"radius_m": 2.5, "delay_s": 0.0, "noise_m": 0.0, "current_mps": 0.0, "seed": 7}


def cell(guard, family, breached=0, avoidable=0, changed=5.0, n=100, own="heron", **more):
    return {
        "guard": guard, "family": family, "own": own, "other": "heron", "encounters": n, "breached": breached,
        "avoidable": avoidable, "unavoidable": breached - avoidable, "not_judged": 0, "deadlocked": 0,
        "changed_percent": changed, "goal_time_ratio": 1.1, "reversals_per_min": 2.0, "decision_us": 9.0, **more,
    }  # fmt: skip


def content(*cells, **settings):
    return {
        "command": "encounters", "settings": SETTINGS | settings, "versions": {"steerclear": "9.9"}, "cells": [*cells],
    }  # fmt: skip


def both(first="head_on", second="rammer_1"):
    """A cautious guard that changes much, a bold one that fails once, none."""
    return content(
        *(cell("none", family, breached=60, changed=0.0, goal_time_ratio=1.0) for family in (first, second)),
        cell("cautious", first, changed=40.0), cell("cautious", second, changed=60.0, n=100),
        cell("bold", first, changed=1.0), cell("bold", second, breached=1, avoidable=1, changed=3.0),
    )  # fmt: skip


def one_contest(*contents):
    (contest,) = contests_of(each for one in contents for each in cells_of(one))
    return contest


def test_counts_add_up_and_means_are_weighted():
    contest = one_contest(
        content(
            cell("a", "head_on", breached=3, avoidable=1, changed=10.0, n=100),
            cell("a", "rammer_1", breached=2, changed=40.0, n=300, goal_time_ratio=None),
        )
    )
    figures = contest.totals["a"]
    assert (figures["encounters"], figures["breached"], figures["avoidable"]) == (400, 5, 1)
    assert figures["changed_percent"] == pytest.approx((10 * 100 + 40 * 300) / 400)
    assert figures["goal_time_ratio"] == pytest.approx(1.1)
    assert figures["breached_upper"] > 5 / 400


def test_a_total_of_results_that_do_not_all_tell_who_never_arrived_is_unknown():
    told = (
        cell("a", "circle_3", n=100, never_arrived_percent=40.0),
        cell("a", "head_on", n=300, never_arrived_percent=0),
    )
    figures = one_contest(content(*told)).totals["a"]
    assert figures["never_arrived_percent"] == pytest.approx(10.0)
    older = one_contest(content(*told, cell("a", "rammer_1"))).totals["a"]
    assert older["never_arrived_percent"] is None
    assert older["encounters"] == 500


def test_the_page_is_made_of_older_results_beside_newer_ones(tmp_path):
    newer = content(
        cell("new", "head_on", never_arrived_percent=40.0), cell("new", "rammer_1", never_arrived_percent=0.0)
    )
    (page,) = (path for path in write_pages([both(), newer], tmp_path) if path.name == "comparison.md")
    lines = page.read_text().splitlines()
    heads, *rows = [[part.strip() for part in line.split("|")] for line in lines if line.count("|") == 14]
    column = heads.index("never arrived")
    assert {row[1].strip("*"): row[column] for row in rows[1:]} == {
        "none": "",
        "cautious": "",
        "bold": "",
        "new": "20.0 %",
    }


def test_best_is_safe_first_then_gentle():
    assert one_contest(both()).winner == "cautious"
    gentle = content(cell("gentle", "head_on", changed=30.0), cell("gentle", "rammer_1", changed=50.0))
    assert one_contest(both(), gentle).winner == "gentle"
    assert one_contest(content(cell("none", "head_on"))).winner is None


def test_breaches_nobody_judged_are_not_taken_for_unavoidable():
    unjudged = cell("hidden", "head_on", breached=1, changed=1.0, not_judged=1, unavoidable=0)
    contest = one_contest(content(unjudged, cell("open", "head_on", changed=90.0)))
    assert contest.winner == "open"
    assert contest.totals["hidden"]["avoidable_upper"] == contest.totals["hidden"]["breached_upper"]
    assert "| hidden | 100 | 0 to 1 [" in comparison_page([contest], Path("plot.png"), ["9.9"])


def test_only_families_that_all_met_count():
    extra = content(cell("bold", "crossing_left", breached=50), cell("late", "head_on", changed=2.0))
    contest = one_contest(both(), extra)
    assert contest.families == ("head_on",)
    assert set(contest.left_out) == {"rammer_1", "crossing_left"}
    assert contest.totals["bold"]["encounters"] == 100
    fewer = content(cell("late", "head_on", n=50))
    assert one_contest(both(), fewer).families == ()


def test_other_scenes_are_another_section():
    titles = [
        contest.title
        for contest in contests_of(
            each
            for one in (both(), content(cell("a", "head_on"), seed=8), content(cell("a", "head_on"), delay_s=0.3))
            for each in cells_of(one)
        )
    ]
    assert titles == ["heron meets heron, 2.5 m"] * 2 + ["heron meets heron, 2.5 m, 0.3 s delay"]


def test_conditions_and_figures_may_stand_in_their_own_mappings():
    flat = cell("a", "head_on")
    figures = {key: flat.pop(key) for key in list(flat) if key not in ("guard", "family", "own", "other")}
    nested = {**flat, "summary": figures, "conditions": {"radius_m": 4.0}}
    assert one_contest(content(nested)).title == "heron meets heron, 4 m"


def test_the_page_shows_what_the_results_say(tmp_path):
    page, picture = (
        path for path in write_pages([both()], tmp_path) if path.name in ("comparison.md", "comparison.png")
    )
    text = page.read_text()
    assert (
        "Best (fewest avoidable or unjudged, then fewest breached, then fewest commands changed): **cautious**" in text
    )
    assert "| **cautious** | 200 | 0 [1.5 %] | 0 | 0 | 0 [1.5 %] | 50.0 % |" in text
    assert "| rammer_1 | 60, 0 % | 0, 60 % | 1, 3 % |" in text
    assert "steerclear 9.9" in text
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_of_one_guard_every_family_has_its_figures():
    outside = {"started_outside": 1000, "breaches_outside": 0}
    cells = [
        cell("shield", "head_on", n=1000, never_arrived_percent=0.0, **outside),
        cell("shield", "at_rest", breached=99, avoidable=90, changed=60.0, never_arrived_percent=2.0),
    ]
    lines = comparison_page([one_contest(content(*cells))], Path("plot.png"), ["9.9"]).splitlines()
    assert "| head_on | 0 [0.3 %] | 0 [0.3 %] | 0 | 1,000 | 0 [0.3 %] | 5.0 % | 1.10 | 0.00 % |" in lines
    assert "| at_rest | 99 [100 %] | 90 [94 %] | 9 |  |  | 60.0 % | 1.10 | 2.00 % |" in lines
    assert not any(line.startswith("Encounters breached, and") for line in lines)
    assert lines[0] == "# Encounters with shield"
    assert not any("Best" in line or "**shield**" in line for line in lines)


def test_the_plot_of_one_guard_has_a_line_for_every_family(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda self, path: saved.append(self))
    told = {"started_outside": 50, "breaches_outside": 5}
    cells = [cell("shield", "head_on", **told), cell("shield", "rammer_1", breached=7), cell("shield", "at_rest")]
    plot_contests([one_contest(content(*cells))], tmp_path / "plot.png")
    (axis,) = saved[0].axes
    assert [label.get_text() for label in axis.get_yticklabels()] == ["head_on", "rammer_1", "at_rest"]
    every, outside = axis.containers
    assert list(every.lines[0].get_xdata()) == [0.0, 7.0, 0.0]
    assert list(outside.lines[0].get_xdata()) == [10.0]


def test_panels_of_one_guard_have_one_scale(tmp_path, monkeypatch):
    """Two families take two lines of room beside a panel of more, and shares are drawn alike."""
    from matplotlib.figure import Figure

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda self, path: saved.append(self))
    few = one_contest(content(cell("shield", "head_on", breached=50), cell("shield", "rammer_1")))
    many = one_contest(content(*(cell("shield", family) for family in ("head_on", "rammer_1", "at_rest", "crowd_6"))))
    plot_contests([few, many], tmp_path / "plot.png")
    assert [axis.get_ylim() for axis in saved[0].axes] == [(3.5, -0.5)] * 2
    assert saved[0].axes[0].get_xlim() == saved[0].axes[1].get_xlim()
    assert saved[0].axes[0].get_xlim()[1] > 50.0


def test_guards_that_do_the_same_show_around_each_other(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda self, path: saved.append(self))
    cells = [cell(guard, "head_on", changed=changed) for guard, changed in
             (("bold", 5.1), ("shield", 5.0), ("calm", 4.9), ("wild", 40.0))]  # fmt: skip
    plot_contests([one_contest(content(*cells))], tmp_path / "plot.png")
    drawn = {bars.get_label(): bars.lines[0] for bars in saved[0].axes[0].containers}
    sizes = {guard: line.get_markersize() for guard, line in drawn.items()}
    assert sizes == {"shield": 5, "bold": 9, "calm": 13, "wild": 5}
    assert {guard for guard, line in drawn.items() if line.get_markerfacecolor() == "none"} == {"bold", "calm"}
    assert [float(drawn[guard].get_xdata()[0]) for guard in ("shield", "bold")] == [5.0, 5.1]


def test_bad_results_are_refused(tmp_path):
    broken = cell("a", "head_on")
    del broken["avoidable"]
    with pytest.raises(ConfigError, match="has no avoidable; run `encounters` again"):
        write_pages([content(broken)], tmp_path)
    with pytest.raises(ConfigError, match="no family that all guards met"):
        write_pages([content()], tmp_path)


def test_guards_are_told_apart_when_colours_run_out():
    guards = ["none", "shield", *(f"shield:adversary_s={k}" for k in range(20))]
    looks = looks_of(guards)
    assert list(looks) == guards
    assert len(set(looks.values())) == len(guards)


@pytest.mark.parametrize(
    ("names", "width_in", "columns"),
    [
        (["none", "shield"], 4.4, 4),
        (["none", "shield:certificate=value_table"], 4.4, 1),
        (["none", "shield:certificate=value_table"], 8.8, 3),
        (["x" * 400], 4.4, 1),
        ([], 4.4, 4),
    ],
)
def test_a_legend_has_as_many_columns_as_fit(names, width_in, columns):
    assert legend_columns(names, width_in) == columns


def test_filters_by_rollouts_have_a_page_of_their_own(tmp_path):
    tried = content(*(cell(guard, "head_on", inactive_percent=80.0) for guard in ("none", "pl-cbf:alpha_per_s=2")))
    pages = {path.name: path for path in write_pages([both(), tried], tmp_path)}
    assert {"comparison.md", "comparison.png", "library_filters.md", "library_filters.png"} <= set(pages)
    assert "pl-cbf:alpha" not in pages["comparison.md"].read_text()
    text = pages["library_filters.md"].read_text()
    assert "| **pl-cbf:alpha_per_s=2** | 100 |" in text
    assert "| 5.0 % | 80.0 % | 1.10 |" in text
    assert "library_filters.png" in text
