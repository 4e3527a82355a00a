"""A tournament end to end, small: kept, gone on with, reported; what one team does reaches no other."""

import json
import textwrap

from json_keys import KEYS, undocumented
from steerclear.experiments.runner import execute, job_id
from steerclear.experiments.tournament import (
    TournamentSettings,
    label,
    most_changed,
    names_of,
    play_game,
    results_of,
    write_html,
    write_markdown,
)

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


def play(chosen, folder, resume=False):
    return execute(chosen.experiment(), folder, 1, resume)


def without_times(rows):
    timed = ("wall_s", "blue_think_p95_ms", "red_think_p95_ms")
    return [{name: value for name, value in row.items() if name not in timed} for row in rows]


def test_every_pair_meets_on_both_sides_from_the_same_seeds():
    jobs = settings(states=("off", "meo"), repetitions=2, seed=7).experiment().jobs
    assert len(jobs) == len({job_id(job) for job in jobs}) == 3 * 2 * 2 * 2
    assert label("entries/our_team.zip") == label("x/our_team/solution.py") == "our_team"
    assert {(job["game"], job["seed"]) for job in jobs} == {(0, 7), (1, 8)}
    met = {(job["own"], job["opponent"]) for job in jobs}
    assert met == {(b, r) for b, r in met} | {(r, b) for b, r in met}
    covered = [(job["own"], job["opponent"]) for job in jobs if job["shield"] is not None]
    assert {own for own, _ in covered} == {"meo"}
    assert all(job["shield"] is None and job["opponent_shield"] is None for job in jobs if job["state"] == "off")


def test_results_rows_report_and_page_hold_what_they_say(tmp_path):
    chosen = settings(teams=("ohto", "hold"), states=("off", "all"))
    run = play(chosen, tmp_path / "run")
    content = json.loads(json.dumps(results_of(run, chosen), default=str))
    assert undocumented(content, KEYS["tournament"]) == []
    assert undocumented(run.rows[0], KEYS["rows of tournament"]) == []
    assert content["prices"][0]["games"] == 2
    html = write_html(content, tmp_path / "report.html").read_text()
    name, text, (picture,) = write_markdown(content, tmp_path)
    assert (name, picture.read_bytes()[1:4]) == ("tournament_aamas2024.md", b"PNG")
    for words in ("Standings, no shields", "Standings, all shielded", "Price of safety, a game"):
        assert words in html
        assert words in text
    assert "; not complete: no shields 2 games" in write_markdown({**content, "complete": False}, tmp_path)[1]
    assert '<img alt="net captures against collisions' in html
    tables = html.split('<section class="tables">')[1]
    wide = tables.count('<section class="card wide"><h3>')  # which scroll
    assert wide == tables.count("<h3>") >= 3, "tables of many teams stay within their cards"
    words, jobs = most_changed(run, chosen.compared)
    assert words == "most changed by the shield (ohto against hold, repetition 0)"
    assert [names_of(job)["state"] for job in jobs] == ["off", "all"]
    assert len(most_changed(run, None)[1]) == 1


def test_a_polluter_changes_nothing_for_the_team_beside_it(tmp_path):
    clean, dirty = entry(tmp_path, "clean", CLEAN), entry(tmp_path, "dirty", POLLUTER)
    jobs = settings(teams=(clean, dirty, "ohto"), rules={"max_time_s": 0.4}).experiment().jobs
    game = {(job["own"], job["opponent"]): job for job in jobs}
    before = play_game(game[clean, "ohto"])
    (beside,) = play_game(game[clean, dirty])
    after = play_game(game[clean, "ohto"])
    assert without_times(before) == without_times(after)
    assert (beside["blue_failures"], beside["blue_usable_steps"]) == (0, beside["steps"])


def test_a_team_that_ends_itself_is_named_and_stops_nothing(tmp_path):
    quitter = entry(tmp_path, "quitter", "import os\nclass solution:\n    compute_action = lambda *a: os._exit(3)\n")
    chosen = settings(teams=("ohto", quitter))
    content = results_of(play(chosen, tmp_path / "run"), chosen)
    assert content["complete"]
    assert content["silent"] == ["quitter"]
    assert any("quitter failed" in words and "exit status 3" in words for words in content["warnings"])
