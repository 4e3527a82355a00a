import math
import re
from xml.etree import ElementTree

import pytest
from steerclear.experiments import plots
from steerclear.experiments.metrics import REASONS
from steerclear.experiments.report import write_report

NAMES = ("captures", "closest_m", "changed_share", "violations_teammate_2.5m", "violations_opponent_2.5m", "tags")


def figure(value):
    return {"value": value, "low": 0.8 * value, "high": 1.2 * value}


def pairing(name, off, on):
    metrics = {
        key: {"label": key.replace("_", " "), "off": figure(off), "on": figure(on), "difference": figure(on - off)}
        for key in NAMES
    }
    del metrics["changed_share"]["off"], metrics["changed_share"]["difference"]
    reasons = {"PASSED": 960, "QP": 30, "BEST_EFFORT": 10}
    return {"pairing": name, "games_off": 3, "games_on": 1, "metrics": metrics, "reasons": reasons}


def game(pairing, number, shielded, closest_m):
    return {"pairing": pairing, "game": number, "shielded": shielded, "seed": number, "closest_m": closest_m}


@pytest.fixture
def results():
    return {
        "settings": {"preset": "aamas2024", "own": "medium", "opponents": ["easy", "<b>"], "seed": 4, "shield": {}},
        "versions": {"python": "3.11", "steerclear": "0.1.0", "torch": None},
        "pairings": [pairing("medium vs easy", 9.0, 0.5), pairing("medium vs <b>", 4.0, 0.25)],
        "games": [game("medium vs easy", k, on, 1.5 + on) for k in range(3) for on in (False, True)]
        + [game("medium vs <b>", 0, False, None)],
        "goals": [
            {"name": "hits", "value": 0.05, "low": None, "high": None, "sense": "<=", "limit": 0.1, "met": True},
            {"name": "captures", "value": 0.5, "low": 0.4, "high": 0.6, "sense": ">=", "limit": 0.9, "met": False},
            {"name": "nothing", "value": math.nan, "low": None, "high": None, "sense": "<=", "limit": 1, "met": None},
        ],
        "replays": [{"label": "game 3", "path": "replay.html"}],
        "machine": {"cores": 2},
        "something new": object(),
    }


def plots_in(text):
    return [ElementTree.fromstring(plot) for plot in re.findall(r"<svg.*?</svg>", text, re.DOTALL)]


def painted(plot, name):
    """How many shapes of a plot are filled with a colour of the page."""
    shapes = (part.get("style") or "" for part in plot.iter())
    return sum(f"fill: var(--{name})" in style for style in shapes)


def test_the_report_shows_what_it_was_given(results, tmp_path):
    text = write_report(results, tmp_path / "deep" / "report.html").read_text()
    assert "What the shield changes" in text
    assert "7 games, each start played without and with the shield ·" in text
    hits, teammates, captures, closest, changed, reasons = plots_in(text)
    for plot in (hits, teammates, captures):
        assert (painted(plot, "off"), painted(plot, "on")) == (2, 2)
    assert (painted(closest, "off"), painted(closest, "on")) == (3, 3)
    assert "var(--mark)" in ElementTree.tostring(closest, encoding="unicode"), "the separation is marked"
    assert (painted(changed, "off"), painted(changed, "on")) == (0, 2)
    assert (painted(reasons, "on"), painted(reasons, "r1")) == (2, 2)
    assert "#" not in "".join(re.findall(r"(?:fill|stroke): ?#\w+", text.split("</style>", 1)[1])), "colours follow"
    for wanted in (
        "9.00 [7.20, 10.8]",
        "0.50 [0.40, 0.60]",
        "aamas2024",
        "3.11",
        'href="replay.html"',
        "separation 2.5 m",
    ):
        assert wanted in text
    for verdict in ("good", "bad", "muted"):
        assert f'<span class="verdict {verdict}">' in text
    assert "<b>" not in text
    assert "@@" not in text
    assert "<script" not in text
    plot = text[text.index("Why commands were changed") :]
    assert REASONS["best_effort"] in plot[: plot.index("</figure>")]
    assert '<span class="off">6.50</span>' in text  # (9 + 4) / 2, three games each
    assert '<span class="on">0.38</span>' in text
    assert "nan" not in text.lower().replace("-nan", "")


def test_the_report_is_small_however_many_games(results, tmp_path):
    many = [game("medium vs easy", k, on, 1.5 + 1e-3 * k) for k in range(20_000) for on in (False, True)]
    path = write_report({**results, "games": many}, tmp_path / "report.html")
    assert path.stat().st_size < 5e6
    assert "one of 34 shown" in path.read_text()
    assert "39400 more in the table of games" in path.read_text()


def test_plots_without_data_and_with_long_labels_are_still_plots():
    figures = [plots.bars([], "m"), plots.dots([("a", [])], "m"), plots.shares([], "%")]
    figures += [plots.bars([("a", [("on", {"value": None})])], "m"), plots.scatter([("<", [])], ("$x$", "y_{z}"))]
    for figure in figures:
        ElementTree.fromstring(plots.svg(figure, 'a "b" <c>'))
    assert len(plots.label("x" * 80)) == plots.LABEL_LETTERS
