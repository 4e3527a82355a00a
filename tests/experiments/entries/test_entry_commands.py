"""``steerclear entry``: an entry is tried, and what the shield does to it is shown on one page."""

import json
from pathlib import Path

import pytest
from commands import run as command
from json_keys import KEYS, undocumented
from steerclear.experiments.console import ExitCode
from steerclear.experiments.entries.imports import imports_of
from steerclear.experiments.entries.report_page import EntryGames, entry_report, games_to_look_at
from steerclear.policies.submissions.made_for import made_for
from steerclear.shield.exceptions import PolicyError

pytestmark = pytest.mark.usefixtures("elsewhere")


def run(*arguments):
    return command("entry", *arguments)


def test_a_check_tells_what_an_entry_imports_how_long_it_takes_and_that_it_plays(write_entry):
    entry = write_entry("return 4", head="import json\nimport numpy as np\nfrom torch.nowhere import nothing_here as x")
    Path(entry, "solution.py").write_text(
        Path(entry, "solution.py").read_text().replace("from torch.nowhere", "if 0: from nowhere_is")
    )
    done = run("check", entry, "--max-time", "3", "--json", "a.json")
    assert done.exit_code == ExitCode.OK, done.output
    assert "loads in" in done.stdout
    assert "numpy" in done.stdout
    assert "not installed here: nowhere_is" in done.stdout
    assert "against boats that hold still, in 3 s: its boats made 0 captures, 0 grabs, 0 tags; the game " in done.stdout
    content = json.loads(Path("a.json").read_text())
    assert undocumented(content, KEYS["entry check"]) == []
    told = {"calls": 9, "held": 0, "decision_ms": 1000.0, "decisions": 3, "steps": 3, "failed_steps": {}}
    assert told.items() <= content.items()
    assert content["mean_decision_ms"] == pytest.approx(3.0 * content["mean_ms"])
    assert content["max_decision_ms"] >= content["max_ms"]
    assert content["game"]["duration_s"] == pytest.approx(3.0)


def test_a_report_that_is_interrupted_before_its_first_game_says_how_to_go_on(write_entry, monkeypatch):
    entry = write_entry("return 4")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("steerclear.experiments.runner.outcomes", interrupted)
    done = run("report", entry, "--opponents", "hold", "--games", "1", "--max-time", "3", "--out", "out")
    assert done.exit_code == ExitCode.INTERRUPTED, done.stderr
    assert "interrupted: 0 of 3 games" in done.stderr
    assert "--out out --resume goes on from there" in done.stderr


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"start": "raise RuntimeError('no luck')", "body": "return 4"}, "no luck"),
        ({"body": "return 'nonsense'"}, "gave nothing usable throughout the game"),
        ({"body": "import nowhere_is"}, "nowhere_is"),
        ({"body": "time.sleep(600)"}, "did not answer within 1 s"),
        ("medium", "medium is no entry; give a folder or a zip"),
        ("gone.zip", "there is no submission at"),
    ],
)
def test_what_does_not_play_or_is_no_entry_is_one_line(write_entry, entry, words):
    name = entry if isinstance(entry, str) else write_entry(**entry)
    done = run("check", name, "--max-time", "2", "--answer-time", "1")
    assert done.exit_code == ExitCode.BAD_INPUT
    assert words in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr


def test_one_boat_that_fails_is_said_first_and_named(write_entry):
    entry = write_entry("return 4 if agent_id != 'agent_1' else full_obs[agent_id]['nothing']")
    done = run("check", entry, "--max-time", "3", "--json", "a.json")
    assert done.exit_code == ExitCode.GOAL_MISSED, done.output
    assert "plays, but agent_1 failed in 3 of 3 steps." in done.stdout.splitlines()[0]
    assert "failed: raised KeyError (agent_1 x 3): KeyError: 'nothing'" in done.stdout
    content = json.loads(Path("a.json").read_text())
    assert undocumented(content, KEYS["entry check"]) == []
    assert content["failed_steps"] == {"agent_1": 3}


def test_an_entry_that_is_late_in_every_decision_is_said_and_no_success(write_entry, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.entries.wrap.TRIED_S", 2.0)
    entry = write_entry("time.sleep(0.35); return 4")
    done = run("check", entry, "--max-time", "2")
    assert done.exit_code == ExitCode.GOAL_MISSED, done.output
    assert "but all 2 decisions took longer than the game gives" in done.stdout.splitlines()[0]
    assert done.stdout.splitlines()[-1].startswith("next: let all boats of the team together answer within ")
    wrapped = run("wrap", entry, "--out", "late.zip")
    assert wrapped.exit_code == ExitCode.OK
    assert "warning:" in wrapped.stderr
    assert "decisions took longer than the game gives" in wrapped.stderr.replace("\n", " ")


def test_a_check_plays_a_whole_game_unless_told_otherwise(write_entry, monkeypatch):
    """What goes wrong late is found: here after a minute."""
    entry = write_entry("self.n += 1\nif self.n > 3 * 70: raise ValueError('worn out')\nreturn 4", start="self.n = 0")
    done = run("check", entry, "--json", "a.json")
    assert done.exit_code == ExitCode.GOAL_MISSED, done.output
    assert "tried in 600 of the 600 decisions of a game" in done.stdout
    assert "agent_0 failed in 530 of 600 steps" in done.stdout.splitlines()[0]
    short = run("check", entry, "--max-time", "3")
    assert short.exit_code == ExitCode.OK
    assert "tried in 3 of the 600 decisions of a game" in short.stdout


def test_a_report_is_a_page_with_the_games_to_look_at(write_entry):
    entry = write_entry("return (3.0, float(full_obs[agent_id]['opponent_home_bearing']))")
    settings = ["--opponents", "hold", "--games", "1", "--max-time", "15", "--jobs", "1", "--out", "out"]
    done = run("report", entry, *settings)
    assert done.exit_code == ExitCode.OK, done.output
    page = Path("out/entry.html").read_text()
    assert "Sums of all games" in page
    assert "hold" in page
    first = done.stdout.splitlines()[:3]
    assert [line.partition(":")[0] for line in first] == [
        "As handed in (entry alone)",
        "With steerclear entry wrap (shield in the zip)",
        "Shield round the game",
    ]
    report = Path("out/report.html").read_text()
    heads = [report.index(words) for words in ("As handed in", "With steerclear entry wrap", "an upper bound")]
    assert heads == sorted(heads)
    assert heads[-1] < report.index("Goals")
    assert "What the shield changes" not in report
    links = [name for name in ("look_1.html", "report.html") if f'href="{name}"' in page]
    assert "report.html" in links
    assert all(Path("out", name).exists() for name in links)
    results = json.loads(Path("out/results.json").read_text())
    assert undocumented(results, KEYS["entry report"]) == []
    assert "1 game against hold; entry alone, shield in the zip, shield round the game: 3 games in all" in (
        done.stderr.replace("\n", " ")
    )
    assert results["games_played"] == 3
    assert [one["heads"]["off"] for one in results["pairings"]] == ["entry alone", "shield in the zip"]
    judged = {goal["name"].partition(":")[0] for goal in results["goals"]}
    assert judged == {"shield in the zip", "shield round the game"}
    assert all(words in done.stdout for words in ("entry alone", "shield in the zip", "shield round the game"))
    assert made_for("out/shielded.zip").shielded
    go_on = run("report", entry, *settings, "--resume")
    assert go_on.exit_code == ExitCode.OK, go_on.output
    assert json.loads(Path("out/results.json").read_text())["games_resumed"] == 3
    there = {path.name: path.read_bytes() for path in Path("out").iterdir() if path.is_file()}
    other = run("report", entry, *settings, "--separation", "5", "--resume")
    assert other.exit_code == ExitCode.BAD_INPUT
    assert "shield.separation_m was 4.0, is 5.0" in other.stderr
    assert there == {path.name: path.read_bytes() for path in Path("out").iterdir() if path.is_file()}


def test_a_report_of_an_entry_that_has_a_shield_or_of_other_rules_plays_no_zip(write_entry, monkeypatch):
    def played(command, settings, where, quick):
        assert settings.experiment(command).about == settings.how_many(), "it is said once nothing refuses the games"
        raise PolicyError(f"zip {settings.zip_file!r}, {settings.how_many()}")

    monkeypatch.setattr("steerclear.experiments.cli_entry.run_games", played)
    told = run("report", write_entry("return 4"), "--preset", "mctf2025", "--opponents", "hold", "--games", "2").stderr
    assert "zip '', 2 games against hold; entry alone, shield round the game: 4 games in all" in told.replace("\n", " ")


def row(game, shielded, captures, against=0, opponents=0, mates=0, counted=0, own="us"):
    hits = {"violations_opponent_4.0m": opponents, "violations_teammate_4.0m": mates, "collisions": counted}
    names = {"own": own, "pairing": f"{own} vs <them>", "opponent": "<them>", "game": game, "shielded": shielded}
    return {**names, **hits, "captures": captures, "captures_against": against}


ROWS = [
    row(0, False, 2, opponents=5, counted=5), row(0, True, 1, against=1),
    row(1, False, 1, opponents=1), row(1, True, 1, mates=1),
    row(2, False, 0), row(2, True, 3),
    row(3, False, 9),
]  # fmt: skip


@pytest.mark.parametrize(
    ("zip_file", "more", "figures"),
    [
        ("", [], ("3 → 5", "6 → 0", "0 → 1", "5 → 0", ">0.33 [-2.00, 3.00]<", ">3<", "entry alone → shield round")),
        (
            "s.zip",
            [row(0, False, 4, opponents=2, own="s.zip"), row(1, False, 0, mates=2, own="s.zip")],
            (
                "3 → 4 → 2",
                "6 → 2 → 0",
                "0 → 2 → 1",
                "entry alone → shield in the zip → shield round the game",
                ": 12 games in all",
            ),
        ),
    ],
)
def test_figures_of_the_page_are_of_games_played_in_every_way_and_names_are_text(zip_file, more, figures, tmp_path):
    told = {"own": "us", "opponents": ("<them>",), "games": 4, "shield": {"separation_m": 4.0}}
    settings = EntryGames(preset="mctf2026", zip_file=zip_file, **told)
    page = entry_report([*ROWS, *more], settings).write(tmp_path / "entry.html").read_text().replace("\u00a0", " ")
    for words in (*figures, "&lt;them&gt;"):
        assert words in page, words
    assert "<them>" not in page
    heads = [page.index(words) for words in ("As handed in", "Shield round the game: an upper bound", "Sums of all")]
    assert heads == sorted(heads), "what is handed in is read first"
    assert ("entry wrap (shield in the zip)" in page[heads[0] : heads[1]]) is bool(zip_file)


def test_headlines_of_an_entry_are_means_of_each_way_the_bare_one_first():
    told = {"own": "us", "opponents": ("<them>",), "games": 4, "shield": {"separation_m": 4.0}}
    more = [row(0, False, 4, opponents=2, own="s.zip"), row(1, False, 0, mates=3, own="s.zip")]
    tiles = entry_report([*ROWS, *more], EntryGames(preset="mctf2026", zip_file="s.zip", **told)).tiles
    assert [(tile.off, tile.on, tile.unit) for tile in tiles] == [
        (None, hits, "hits a game") for hits in ("3.00", "2.50", "0.50")
    ]
    assert "1.50 with teammates, 1.00 with opponents, within 4 m; 2.00 captures, 0.00 given up" in tiles[1].note
    assert "No zip can do this" in tiles[2].note


def test_games_to_look_at_are_chosen_once_each():
    settings = EntryGames(preset="mctf2026", own="us", opponents=("<them>",), games=4, shield={"separation_m": 4.0})
    chosen = games_to_look_at(ROWS, settings)
    assert [(words, off["game"]) for words, off, _ in chosen] == [
        ("most hits without the shield", 0),
        ("hits with the shield", 1),
    ]
    assert games_to_look_at([ROWS[4], ROWS[5]], settings) == []


def test_imports_are_read_without_running_anything(tmp_path):
    (tmp_path / "solution.py").write_text("import os, helper\nimport numpy.linalg\nfrom . import x\nraise SystemExit\n")
    (tmp_path / "helper.py").write_text("def f(:")
    found = imports_of(tmp_path)
    assert (found.needed, found.missing, found.unread) == (("numpy",), (), ("helper.py",))
