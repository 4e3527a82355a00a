import json
from dataclasses import replace

import pytest
from steerclear.experiments.pages.docs_pages import write_pages
from steerclear.experiments.pages.keys import GAME_COLUMNS, RESULTS, undocumented
from steerclear.experiments.report.tables import interval_text
from steerclear.experiments.runs.ablation import (
    AblationSettings,
    ablation_bars,
    most_instructive,
    quick,
    spec_of,
    summaries,
)
from steerclear.experiments.runs.campaign import Campaign, Played
from steerclear.experiments.runs.results import replay_of, results_of, same_game, write_results
from steerclear.experiments.runs.store import ResultStore, finite
from steerclear.shield.exceptions import GameError

SETTINGS = AblationSettings(opponents=("easy", "hold"), games=2, rules={"max_time_s": 3.0})


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    store = ResultStore(tmp_path_factory.mktemp("played"))
    campaign = Campaign(SETTINGS.specs(), store)
    return campaign, campaign.run()


def hits(row, off, on):
    return {**row, "breaches_opponent_2.5m": on if row["shielded"] else off}


def test_every_pairing_is_played_off_and_on_from_the_same_seeds():
    specs = SETTINGS.specs()
    assert len(specs) == 8
    for off, on in zip(specs[::2], specs[1::2], strict=True):
        assert (off.shield, on.shield) == (None, {})
        assert (off.pairing, off.game, off.seed, off.side) == (on.pairing, on.game, on.seed, on.side)
    assert [spec.side for spec in specs] == ["blue"] * 4 + ["red"] * 4
    assert {spec.seed for spec in specs} == {0, 1}


def test_the_separation_is_counted_beside_the_usual_radii():
    assert AblationSettings(shield={"separation_m": 3.0}).radii_m == (2.5, 3.0, 4.0)
    assert AblationSettings().radii_m == (2.5, 4.0)


def test_games_come_back_in_order_with_documented_columns(played):
    _, games = played
    assert not games.failed
    assert [(row["game"], row["opponent"], row["shielded"]) for row in games.rows] == [
        (game, opponent, shielded) for game in (0, 1) for opponent in ("easy", "hold") for shielded in (False, True)
    ]
    assert undocumented(games.rows[1], GAME_COLUMNS) == []


def test_an_interrupted_run_goes_on_where_it_stopped(played, tmp_path):
    _, games = played
    store = ResultStore(tmp_path)
    interrupted = Campaign(SETTINGS.specs(), store)

    def stop_after_three(done):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted.run(stop_after_three)
    assert len(interrupted.so_far().rows) == 3
    noticed = []
    resumed = Campaign(SETTINGS.specs(), ResultStore(tmp_path, resume=True)).run(noticed.append)
    assert noticed == [3, 4, 5, 6, 7, 8]
    assert resumed.resumed == 3
    assert all(same_game(one, other) for one, other in zip(resumed.rows, games.rows, strict=True))


def test_resuming_with_other_settings_plays_anew(played, tmp_path):
    campaign, _ = played
    (tmp_path / "games.jsonl").write_text(campaign.store.lines.read_text())
    other = AblationSettings(opponents=("easy",), games=1, rules={"max_time_s": 2.0})
    fresh = Campaign(other.specs(), ResultStore(tmp_path, resume=True))
    assert fresh.so_far().rows == []
    others = len(campaign.store.load())
    assert others > 0
    assert fresh.words_of_before == (
        f"0 of 2 games are in {tmp_path / 'games.jsonl'} and are taken from there; "
        f"{others} there are of other settings, or of a policy's files before they changed, and count for nothing here"
    )


def test_games_of_a_policy_whose_file_changed_are_played_anew(tmp_path):
    entry = tmp_path / "entry.py"
    entry.write_text("SPEED = 1")
    settings = AblationSettings(own=str(entry), opponents=("easy",), games=1)
    store = ResultStore(tmp_path / "out")
    for spec in settings.specs():
        store.append(spec.key, {"pairing": spec.pairing, "game": spec.game, "shielded": spec.shield is not None})
    assert len(Campaign(settings.specs(), store).so_far().rows) == 2
    entry.write_text("SPEED = 2")
    changed = Campaign(settings.specs(), store)
    assert changed.so_far().rows == []
    assert "of a policy's files before they changed" in changed.words_of_before


def explode(spec):
    if spec.opponent == "hold":
        raise GameError("no room; use a larger field")
    return {"pairing": spec.pairing, "game": spec.game}


def test_a_bad_later_pairing_loses_nothing(tmp_path):
    games = Campaign(SETTINGS.specs(), ResultStore(tmp_path), play=explode).run()
    assert len(games.rows) == 4
    assert len(games.failed) == 4
    assert games.failed[0] == {
        "pairing": "medium vs hold",
        "game": 0,
        "shielded": False,
        "error": "no room; use a larger field",
        "fault": False,
    }
    assert len(ResultStore(tmp_path, resume=True).load()) == 4


def test_the_most_instructive_game_has_the_most_breaches_without_shield(played):
    _, games = played
    rows = [hits(row, 5 if (row["game"], row["opponent"]) == (1, "hold") else 1, 9) for row in games.rows]
    off, on = most_instructive(rows, 2.5)
    assert (off["game"], off["opponent"], off["shielded"], on["shielded"]) == (1, "hold", False, True)
    assert spec_of(off, SETTINGS.specs()).shield is None
    assert most_instructive([row for row in rows if row["shielded"]], 2.5) is None


def test_bars_judge_pairs_of_all_pairings(played):
    _, games = played
    rows = [{**hits(row, 10, 1), "captures": 4, "breaches_teammate_2.5m": 0} for row in games.rows]
    bars = ablation_bars(rows, 2.5)
    assert [bar["met"] for bar in bars] == [True, True, True, True, True]
    assert bars[1]["value"] == pytest.approx(0.1)
    worse = [{**hits(row, 10, 2), "captures": 3 if row["shielded"] else 4, "breaches_teammate_2.5m": 1} for row in rows]
    assert [bar["met"] for bar in ablation_bars(worse, 2.5)] == [False, False, False, True, True]
    assert ablation_bars(worse, 2.5)[0]["value"] == 4
    stuck = [{**row, "deadlocks": 1 if row["shielded"] else 0} for row in rows]
    assert [bar["met"] for bar in ablation_bars(stuck, 2.5)] == [True, True, True, False, True]
    older = [{name: value for name, value in row.items() if name != "deadlocks"} for row in rows]
    assert len(ablation_bars(older, 2.5)) == 4
    nothing = [{**row, "captures": 0} for row in rows]
    assert ablation_bars(nothing, 2.5)[2]["met"] is None
    assert ablation_bars([row for row in rows if row["shielded"]], 2.5) == []


def test_results_are_written_whole_and_documented(played, tmp_path):
    campaign, games = played
    results = results_of("ablate", SETTINGS, games, 1.0)
    replay = replay_of(games.rows, campaign.specs, 2.5, 1)
    results["replay"] = replay[0]
    path = write_results(tmp_path, results, games.rows, replay[1])
    content = json.loads(path.read_text())
    assert undocumented(content, RESULTS) == []
    assert content["complete"]
    assert content["replay"]["same_as_played"]
    assert content["settings"]["opponents"] == ["easy", "hold"]
    assert content["seeds"] == [0, 1]
    for name in content["files"].values():
        assert (tmp_path / name).stat().st_size > 0


def test_documentation_pages_are_made_of_results(played, tmp_path):
    _, games = played
    content = json.loads(json.dumps(finite(results_of("ablate", SETTINGS, games, 1.0))))
    alone = finite(results_of("evaluate", replace(SETTINGS, states=(True,)), Played(games.rows[1::2]), 1.0))
    pages = write_pages([content, alone], tmp_path)
    text = (tmp_path / "ablation_aamas2024.md").read_text()
    figure = content["pairings"][0]["metrics"]["tags"]["off"]
    assert f"| tags | {interval_text(figure)} |" in text
    assert "| hits with opponents at 2.5 m, on / off |" in text
    assert (tmp_path / "ablation_aamas2024.png").read_bytes()[1:4] == b"PNG"
    assert "shield off" not in (tmp_path / "evaluation_aamas2024.md").read_text()
    assert all(page.exists() for page in pages)


def test_documentation_of_keys_can_fail():
    assert undocumented({"pairings": [{"metrics": {"captures": {"off": {"valeu": 1}}}}]}, RESULTS) == [
        "pairings[].metrics.captures.off.valeu"
    ]


def test_an_incomplete_run_says_so(played):
    _, games = played
    games.rows, rows = games.rows[:3], games.rows
    assert not results_of("ablate", SETTINGS, games, 1.0)["complete"]
    games.rows = rows


def test_the_small_version_keeps_everything_but_size():
    small = quick(SETTINGS, 30.0, 1)
    assert (small.games, small.rules, small.opponents) == (1, {"max_time_s": 30.0}, SETTINGS.opponents)


def test_summaries_name_every_pairing(played):
    _, games = played
    found = summaries(games.rows, SETTINGS)
    assert [(s["pairing"], s["games_off"], s["games_on"]) for s in found] == [
        ("medium vs easy", 2, 2),
        ("medium vs hold", 2, 2),
    ]
