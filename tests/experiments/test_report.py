import math
import re
from xml.etree import ElementTree

import pytest
from steerclear.experiments import plots
from steerclear.experiments.deploy.dashboard_view import WHY
from steerclear.experiments.metrics import REASONS
from steerclear.experiments.report import game_report, write_report
from steerclear.experiments.tables import IN_ZIP, ITS_OWN, goals_table, limits_text
from steerclear.experiments.words import count_text, seeds_text

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
    text = write_report(results, tmp_path / "deep" / "report.html").read_text().replace("\u00a0", " ")
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


def test_long_names_lose_their_middle_and_are_whole_in_the_title(results, tmp_path):
    name = "/home/us/our_very_long_entry_of_2026_final.zip vs a&b.zip"
    assert plots.label("/tmp/shielded.zip vs medium") == "shielded.zip vs medium"
    short = plots.label(name)
    assert short.startswith("our_very…")
    assert short.endswith(".zip vs a&b.zip"[-13:])
    results["pairings"][0]["pairing"] = name
    results["games"] = [{**one, "pairing": one["pairing"].replace("medium vs easy", name)} for one in results["games"]]
    for plot in plots_in(write_report(results, tmp_path / "report.html").read_text()):
        titles = [part.text for part in plot.iter() if part.tag.endswith("title")]
        assert name in titles
        assert short in [part.text for part in plot.iter() if part.tag.endswith("text")]


def test_letters_of_a_plot_are_legible_on_a_phone(results, tmp_path):
    """A page of 390 px leaves a plot 324 px; the widest plot is drawn so that its letters have 9 px there."""
    plots_shown = plots_in(write_report(results, tmp_path / "report.html").read_text())
    for plot in plots_shown:
        width = float(plot.get("viewBox").split()[2])
        styles = [part.get("style") for part in plot.iter() if part.tag.endswith("text")]
        sizes = [float(re.search(r"font-size: ([\d.]+)px", style)[1]) for style in styles]
        assert sizes
        assert min(sizes) * 324.0 / width >= 9.0


def test_goals_and_figures_fit_their_cards_on_any_screen(results, tmp_path):
    """On a phone a goal's name stands above its figures; five columns of figures have a line of the page each."""
    text = write_report(results, tmp_path / "two.html").read_text()
    assert '<table class="goals">' in text
    assert ".goals td:first-child { grid-column: 1 / -1; }" in text
    assert game_report(results).sections[0].wide is False
    for one in results["pairings"]:
        for figures in one["metrics"].values():
            figures |= {"covered": figure(1.0), "difference_covered": figure(1.0)}
    assert game_report(results).sections[0].wide is True


def test_what_the_figures_are_is_said_once(results, tmp_path):
    text = write_report(results, tmp_path / "report.html").read_text()
    assert text.count("flags captured") == 1
    assert "changed share" in text[: text.index("Hits judged")]


def test_games_of_a_shield_in_the_entry_are_not_drawn_or_named_as_shield_off(results, tmp_path):
    zipped = {**pairing("s.zip vs easy", 3.0, 3.0), "games_on": 0, "heads": {"off": IN_ZIP}}
    for figures in zipped["metrics"].values():
        for state in ("on", "difference"):
            figures.pop(state, None)
    results["pairings"][1] = zipped
    results["pairings"][0]["heads"] = {"off": "entry alone", "on": "shield round the game"}
    results["games"][-1] = game("s.zip vs easy", 0, False, 3.0)
    text = write_report(results, tmp_path / "report.html").read_text()
    hits, _, _, closest, *_ = plots_in(text)
    assert (painted(hits, "off"), painted(hits, "r4"), painted(hits, "on")) == (1, 1, 1)
    assert painted(closest, "r4") == 1
    legend = text[text.index('class="legend"') : text.index("<svg")]
    assert [name for name in ("entry alone", IN_ZIP, "shield round the game", "shield off") if name in legend] == [
        "entry alone",
        IN_ZIP,
        "shield round the game",
    ]
    assert "shield in the zip: 3 games" in text
    results["pairings"] = [{**pairing("s.zip vs easy", 1.0, 1.0), "heads": {"off": ITS_OWN}}]
    results["games"] = []
    assert (
        "each start played with its own shield and with ours round it"
        in write_report(results, tmp_path / "own.html").read_text()
    )


def test_a_dashed_line_is_named_in_its_plot_and_no_goal_is_drawn_that_no_table_has(results, tmp_path):
    text = write_report(results, tmp_path / "report.html").read_text()
    _, _, _, closest, changed, _ = (ElementTree.tostring(plot, encoding="unicode") for plot in plots_in(text))
    assert "dashed: the separation, 2.5 m" in closest
    assert "stroke-dasharray" in closest
    assert "stroke-dasharray" not in changed
    assert "5 %" not in text.replace("95 %", "")


def test_no_two_reasons_or_curves_look_alike(results, tmp_path):
    results["pairings"][0]["reasons"] = {"PASSED": 1000, **dict.fromkeys(map(str.upper, REASONS), 10)}
    text = write_report(results, tmp_path / "report.html").read_text()
    plot = text[text.index("Why commands were changed") :]
    looks = re.findall(r'<i class="(\w*)" style="background-color: var\(--(\w+)\)">', plot[: plot.index("<svg")])
    assert len(looks) == len(set(looks)) == len(REASONS) > 6
    assert len(set(plots.SERIES)) == len(plots.SERIES) == 18
    drawn = ElementTree.tostring(plots_in(text)[-1], encoding="unicode")
    assert "pattern" in drawn
    curves = plots.curves([(look, look, [0.0, 1.0], [0.0, 1.0]) for look in plots.SERIES], 0.5, "m").axes[0].lines
    assert len({(line.get_color(), line.get_linestyle()) for line in curves[:-1]}) == 18


def test_numbers_of_things_and_what_cannot_be_told_read_well(results, tmp_path):
    assert [count_text(n, "game") for n in (0, 1, 2, 2000)] == ["0 games", "1 game", "2 games", "2,000 games"]
    assert count_text(2, "boat is", "boats are") == "2 boats are"
    assert (seeds_text(0, 0), seeds_text(4, 8)) == ("seed 0", "seeds 4 to 8")
    assert limits_text({"value": math.nan, "low": 0.0, "high": math.inf}) == ""
    results["goals"] = [
        {"name": "captures", "value": math.nan, "low": 0.0, "high": math.inf, "sense": ">=", "limit": 0.9, "met": None}
    ]
    text = write_report({**results, "seeds": [3], "games_played": 1}, tmp_path / "report.html").read_text()
    assert "1 game, each" in text
    assert "· seed 3 ·" in text
    assert "inf" not in re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)
    assert all("inf" not in str(cell) for row in goals_table(results["goals"]).renderables[1].rows for cell in row)


def test_reports_speak_of_the_present():
    """What former versions called or did is in the changelog."""
    for words in (*REASONS.values(), *(meaning for *_, meaning in WHY.values())):
        assert not re.search(r"\d\.\d|before|former|earlier|since", words), words
