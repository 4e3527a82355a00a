"""A tournament end to end, small: kept, gone on with, reported; what one team does reaches no other."""

import json
import subprocess
import sys
import textwrap
import time

import pytest
from steerclear.experiments.docs_keys import KEYS, undocumented
from steerclear.experiments.tournament import campaign as played
from steerclear.experiments.tournament.campaign import Tournament
from steerclear.experiments.tournament.keys import TOURNAMENT_GAME
from steerclear.experiments.tournament.pages import subtitle, write_html, write_markdown
from steerclear.experiments.tournament.play import play_game
from steerclear.experiments.tournament.replays import chosen_games
from steerclear.experiments.tournament.results import _qualifying, results_of, silent_teams
from steerclear.experiments.tournament.settings import GameJob, TournamentSettings, label
from steerclear.shield.exceptions import ConfigError

SHORT = {"max_time_s": 1.0}
POLLUTER = """
    import builtins, logging, os, sys, threading, warnings
    import numpy as np

    class solution:
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            np.seterr(all="raise")
            np.random.seed(0)
            os.environ["OMP_NUM_THREADS"] = "64"
            os.chdir("/")
            logging.disable(logging.CRITICAL)
            warnings.simplefilter("error")
            sys.stdout.write("noise " * 1000)
            sys.path[:] = []
            builtins.sum = lambda *a: 0
            threading.Thread(target=lambda: None, daemon=True).start()
            return 4
"""
CLEAN = """
    class solution:
        def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
            return sum([2, 2])
"""


def entry(folder, name, text):
    path = folder / name
    path.mkdir()
    (path / "solution.py").write_text(textwrap.dedent(text))
    return str(path)


def settings(**changed):
    return TournamentSettings(**{"teams": ("ohto", "meo", "hold"), "states": ("off",), "rules": SHORT, **changed})


def without_times(rows):
    timed = ("wall_s", "blue_think_p95_ms", "red_think_p95_ms")
    return [{name: value for name, value in row.items() if name not in timed} for row in rows]


def results(run, **changed):
    made = results_of(run.settings, run.rows(), run.expected, run.failed, 1.0)
    return made | {"silent": silent_teams(run.rows()), "files": {"results": "results.json"}} | changed


def test_every_pair_meets_on_both_sides_from_the_same_seeds():
    jobs = settings(states=("off", "meo"), repetitions=2, seed=7).final(("ohto", "meo", "hold"))
    assert len(jobs) == len({job.key for job in jobs}) == 3 * 2 * 2 * 2
    assert {(job.spec.game, job.spec.seed) for job in jobs} == {(0, 7), (1, 8)}
    met = {(job.spec.own, job.spec.opponent) for job in jobs}
    assert met == {(b, r) for b, r in met} | {(r, b) for b, r in met}
    covered = [job for job in jobs if job.state == "meo" and job.spec.shield is not None]
    assert {job.spec.own for job in covered} == {"meo"}
    assert all(job.spec.shield is None and job.spec.opponent_shield is None for job in jobs if job.state == "off")


def test_an_interrupted_tournament_ends_with_the_same_table(tmp_path, monkeypatch):
    whole = Tournament(settings(), tmp_path / "whole", False)
    whole.run()
    assert len(whole.rows()) == whole.expected == 6
    count = iter(range(100))

    def killed_at_the_third(job):
        if next(count) == 2:
            raise KeyboardInterrupt
        return play_game(job)

    monkeypatch.setattr(played, "play_game", killed_at_the_third)
    with pytest.raises(KeyboardInterrupt):
        Tournament(settings(), tmp_path / "cut", False).run()
    monkeypatch.undo()
    again = Tournament(settings(), tmp_path / "cut", True)
    assert again.resumed == 2
    assert subtitle(results(again)).endswith("not complete: no shields 2 games, repetitions of every pair that met: 1")
    again.run()
    assert without_times(again.rows()) == without_times(whole.rows())
    assert str(results(again)["states"]) == str(results(whole)["states"])


@pytest.mark.study
def test_a_tournament_that_was_killed_goes_on_to_the_same_table(tmp_path):
    command = [sys.executable, "-m", "steerclear.experiments.cli", "tournament", "--teams", "ohto,meo,hold"]
    command += ["--shield", "off", "--max-time", "20", "--jobs", "1", "--no-replays", "--out"]
    lines = tmp_path / "cut" / "rows.jsonl"
    killed = subprocess.Popen([*command, str(tmp_path / "cut")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline and not (lines.exists() and lines.read_bytes().count(b"\n") >= 2):
        time.sleep(0.02)
    killed.kill()
    killed.wait(60.0)
    kept = lines.read_bytes().count(b"\n")
    assert 2 <= kept < 6
    lines.write_bytes(lines.read_bytes() + b'{"key": "half a li')  # what a kill in the middle of a write leaves
    for folder, more in (("cut", ["--resume"]), ("whole", [])):
        subprocess.run([*command, str(tmp_path / folder), *more], check=True, capture_output=True, timeout=300.0)
    cut, whole = (json.loads((tmp_path / folder / "results.json").read_text()) for folder in ("cut", "whole"))
    assert cut["games_resumed"] == kept
    assert cut["states"] == whole["states"]
    assert cut["complete"]


def test_results_rows_report_and_page_hold_what_they_say(tmp_path):
    run = Tournament(settings(states=("off",)), tmp_path / "run", False)
    run.run()
    content = results(run)
    assert undocumented(content, KEYS["tournament"]) == []
    assert undocumented(run.rows()[0], TOURNAMENT_GAME) == []
    html = write_html(content, tmp_path / "report.html").read_text()
    name, text, pictures = write_markdown(content, tmp_path)
    assert (name, pictures) == ("tournament_aamas2024.md", [])
    for words in ("Table 3, with the penalty: no shields", "Table 4, penalty off", "Alpha-rank"):
        assert words in html
        assert words in text
    tables = html.split('<section class="tables">')[1]
    wide = tables.count('<section class="card wide"><h3>')  # which scroll
    assert wide == tables.count("<h3>") > 3, "tables of many teams stay within their cards"
    chosen = chosen_games(run.rows(), run.jobs, None)
    assert [len(jobs) for _, jobs in chosen] == [1, 1]


def test_a_polluter_changes_nothing_for_the_team_beside_it(tmp_path):
    clean, dirty = entry(tmp_path, "clean", CLEAN), entry(tmp_path, "dirty", POLLUTER)
    jobs = settings(teams=(clean, dirty, "ohto"), rules={"max_time_s": 0.4}).final((clean, dirty, "ohto"))
    game = {(job.spec.own, job.spec.opponent): job for job in jobs}
    before = play_game(game[clean, "ohto"])
    beside = play_game(game[clean, dirty])
    after = play_game(game[clean, "ohto"])
    assert without_times([before]) == without_times([after])
    assert (beside["blue_failures"], beside["blue_usable_steps"]) == (0, beside["steps"])


def test_a_team_that_ends_itself_is_named_and_stops_nothing(tmp_path):
    quitter = entry(tmp_path, "quitter", "import os\nclass solution:\n    compute_action = lambda *a: os._exit(3)\n")
    run = Tournament(settings(teams=("ohto", quitter)), tmp_path / "run", False)
    run.run()
    content = results(run)
    assert content["complete"]
    assert content["silent"] == ["quitter"]
    assert any("quitter failed" in words and "exit status 3" in words for words in content["warnings"])


def test_the_best_of_the_qualifying_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr(played, "play_game", played_by_rank)
    run = Tournament(settings(qualifying=True, finalists=2), tmp_path / "run", False)
    run.run()
    assert len(run.rows()) == run.expected == 3 * 5 * 2 + 2
    assert {row["blue"] for row in run.rows() if row["phase"] == "final"} == {"ohto", "hold"}


def test_a_team_that_examines_others_too_is_scored_by_its_own_games_alone(tmp_path, monkeypatch):
    """`medium` wins all ten of its own, and loses the games in which it examines others."""

    def played_game(job: GameJob):
        names = {"blue": label(job.spec.own), "red": label(job.spec.opponent)}
        row = {"phase": job.phase, "state": job.state, **names, "examined": job.examined}
        row |= {"repetition": job.spec.game, "steps": 1}
        for side, name in names.items():
            won = 3 if name in ("ohto", "meo") and "medium" in names.values() else 2 if name == "medium" else 0
            row |= {f"{side}_captures": won, f"{side}_collisions": 0}
        return row

    monkeypatch.setattr(played, "play_game", played_game)
    chosen = settings(teams=("ohto", "meo", "medium", "easy"), qualifying=True, finalists=2)
    run = Tournament(chosen, tmp_path / "run", False)
    run.run()
    table = {line["team"]: line for line in _qualifying(run.rows(), chosen)}
    assert {line["games"] for line in table.values()} == {10}
    assert table["medium"]["score"] == 1.6  # two games against itself are drawn
    assert "medium" in {row["blue"] for row in run.rows() if row["phase"] == "final"}


def played_by_rank(job: GameJob):
    """A game in which meo never captures and all others do."""
    row = {"phase": job.phase, "state": job.state, "blue": job.spec.own, "red": job.spec.opponent}
    row |= {"repetition": job.spec.game, "steps": 1, "examined": job.examined}
    for side in ("blue", "red"):
        row |= {f"{side}_captures": int(row[side] in ("ohto", "hold")), f"{side}_collisions": 0}
    return row


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"teams": ("ohto",)}, "give two or more"),
        ({"teams": ("a/x.zip", "b/x.zip")}, "of different names"),
        ({"states": ("metro",)}, "names 'metro', which does not play; did you mean meo"),
        ({"states": ("off", "off")}, "give each state once"),
        ({"repetitions": 0}, "must be 1 to 10,000"),
        ({"finalists": 2}, "goes with --qualifying"),
    ],
)
def test_bad_settings_are_refused(changed, text):
    with pytest.raises(ConfigError, match=text):
        settings(**changed)


def test_labels_are_short_names(tmp_path):
    assert label("ohto") == "ohto"
    assert label("entries/our_team.zip") == label("x/our_team/solution.py") == "our_team"
