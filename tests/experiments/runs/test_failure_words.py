"""What is said first when policies failed."""

import pytest
from steerclear.experiments.play.match import play_row
from steerclear.experiments.play.spec import MatchSpec
from steerclear.experiments.report.page import as_text
from steerclear.experiments.runs.ablation import AblationSettings
from steerclear.experiments.runs.campaign import Played
from steerclear.experiments.runs.failure_words import failure_warnings, held_games
from steerclear.experiments.runs.results import results_of, write_results


def row(own=0, other=0, text=None, usable=(7, 7)):
    steps = dict(zip(("policy_usable_steps", "opponent_policy_usable_steps"), usable, strict=True))
    return {"policy_failures": own, "opponent_policy_failures": other, "first_failure": text, **steps}


def played(steps, row):
    return {"steps": steps, **row}


def test_games_in_which_nothing_failed_need_no_warning():
    assert failure_warnings([row(), row()]) == []
    assert failure_warnings([]) == []


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([row(), row(1200, 0, "own: KeyError: 'a'")], "own policy failed 1,200 times, in 1 of 2 games"),
        ([row(0, 3, "opponent: no"), row(0, 4, "opponent: yes")], "opponents' policy failed 7 times, in 2 of 2 games"),
        ([row(1, 0, "own: no")], "own policy failed 1 time, in 1 of 1 games"),
    ],
)
def test_failures_are_counted_and_the_first_is_quoted(rows, words):
    (text,) = failure_warnings(rows)
    assert words in text
    first = next(row["first_failure"] for row in rows if row["first_failure"])
    assert text.endswith(f"First failure: {first.partition(': ')[2]}")


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            [played(10, row(10, 0, "own: raised", usable=(0, 7)))],
            "the own policy gave no usable answer throughout 1 of 1 games",
        ),
        ([played(10, row(30, 0, usable=(0, 7))), played(10, row(9))], "throughout 1 of 2 games"),
        (
            [played(5, row(0, 15, "opponent: late", usable=(5, 0)))],
            "the opponents' policy gave no usable answer throughout 1 of 1",
        ),
    ],
)
def test_policies_that_did_not_play_are_named(rows, words):
    (text,) = held_games(rows)
    assert words in text
    quoted = (rows[0]["first_failure"] or "").partition(": ")[2]
    assert f"({quoted})" in text or not quoted


def test_policies_that_failed_now_and_then_did_play():
    assert held_games([played(10, row(29, 10, usable=(1, 10))), played(0, row(usable=(0, 0)))]) == []


def test_nobody_is_quoted_with_the_others_words():
    own, opponents = failure_warnings([row(2, 3, "own: lost")])
    assert own.endswith("First failure: lost")
    assert "lost" not in opponents


def test_results_and_report_say_it_before_any_figure(tmp_path):
    settings = AblationSettings(own="hold", opponents=("hold",), games=1, states=(False,), rules={"max_time_s": 1.0})
    played = play_row(MatchSpec("aamas2024", "hold", "hold", rules={"max_time_s": 1.0}))
    rows = [played | row(10, 0, "own: step 1: <lost>")]
    results = results_of("evaluate", settings, Played(rows), 1.0)
    assert results["warnings"] == failure_warnings(rows)
    write_results(tmp_path, results, rows)
    page = (tmp_path / "report.html").read_text()
    assert page.index(as_text(results["warnings"][0])) < page.index('class="tiles"')
