import json

import pytest
from steerclear.experiments.docs import write_pages
from steerclear.experiments.result_files import write_json
from steerclear.experiments.training.config_file import config_of
from steerclear.experiments.training.study import cells, learning_of, settings_of_cell
from steerclear.shield.exceptions import ConfigError


def test_a_deployed_shield_shares_the_training_without_one():
    found = list(cells(seeds=2))
    assert len(found) == 16
    assert len({cell.training for cell in found}) == 12
    bare, deployed = (next(c for c in found if c.shield == shield) for shield in ("none", "deployment"))
    base = config_of({"rewards": {"sparse": 1.0, "collision": 9.0}})
    assert settings_of_cell(base, bare) == settings_of_cell(base, deployed)
    assert settings_of_cell(base, bare).rewards == {"sparse": 1.0}
    with_term = next(cell for cell in found if cell.collision == "on")
    assert settings_of_cell(base, with_term).rewards["collision"] == 0.25


def test_what_a_training_tells_of_its_learning():
    def row(decisions, games, net):
        if not games:
            return {"decisions": decisions, "games": 0, "captures": None, "captures_against": None, "hits": None}
        return {"decisions": decisions, "games": games, "captures": net + 1, "captures_against": 1.0, "hits": net}

    found = learning_of([row(10, 1, 0.0), row(20, 1, 2.0), row(30, 0, None), row(35, 1, 4.0), row(40, 3, 8.0)])
    assert found == {"learned": [0.0, 2.0, None, 7.0], "training_hits": 5.0}


def test_the_page_tells_every_cell_with_its_interval(tmp_path):
    rows = []
    for cell in cells(seeds=2):
        nets = [1.0, 2.0, 3.0] if cell.shield == "none" else [2.0, 2.0, 3.0]
        hits = [4.0, 5.0, 3.0] if cell.shield == "none" else [0.0, 0.0, 0.0]
        figures = {"captures": 2.0, "captures_against": 0.0, "interventions": 4.0, "nets": nets, "hit_counts": hits}
        about = {"shield": cell.shield, "collision": cell.collision, "seed": cell.seed, "opponent": "hard"}
        rows.append({**about, **figures, "learned": [None, 0.0, 1.0, 2.0], "training_hits": 3.0})
    training = {"decisions": 1000, "interval": 10, "preset": "aamas2024", "stages": [{"opponents": ["medium"]}]}
    settings = {"seeds": 2, "games": 3, "training": training}
    write_pages([{"command": "train-study", "settings": settings, "rows": rows}], tmp_path)
    page = (tmp_path / "learning.md").read_text()
    assert "2 training(s) a cell, of 1,000 decisions" in page
    write_pages([{"command": "train-study", "settings": settings, "rows": rows[:-1]}], tmp_path)
    assert "1 or 2 trainings a cell, of 1,000 decisions" in (tmp_path / "learning.md").read_text()
    assert "game steps against medium, on aamas2024;" in page
    assert page.count("| training+intervention |") == 4
    assert "| none | off | +2.00 (+1.33 to +2.67) | +2.00, +2.00 | 2.00 | 0.00 | 4.00 (2.56 to 5.95) | 4.00 |" in page
    assert "net captures +0.33" in page
    assert "| nothing to shield, deployment | +0.33 | -4.00 |" in page
    assert "| training | on | - | +0.00 | +1.00 | +2.00 | 3.00 |" in page


def test_trainings_at_once_give_what_they_give_one_after_another(tiny_content, tmp_path):
    pytest.importorskip("stable_baselines3")
    from steerclear.experiments.training.study import run_study

    base = config_of({**tiny_content, "evaluation": {"every": 100, "games": 1, "opponents": ["hold"]}})
    told = []
    rows = [
        run_study(base, tmp_path / str(jobs), 1, 1, lambda done, words: told.append(done), jobs)["rows"]
        for jobs in (1, 2)
    ]
    assert rows[0] == rows[1]
    assert [row["shield"] for row in rows[0]] == [cell.shield for cell in cells(1)]
    assert told[-1] == 8


def test_a_folder_of_another_config_is_not_gone_on_with(tmp_path):
    """Its networks would be taken for those of the config given."""
    pytest.importorskip("stable_baselines3")
    from steerclear.experiments.training.study import RESULTS, _results, run_study

    base = config_of({"decisions": 100})
    write_json(tmp_path / RESULTS, _results(config_of({"decisions": 200}), 1, 1, {}))
    with pytest.raises(ConfigError, match=r"holds a study of another config \(decisions\); give its own, or name"):
        run_study(base, tmp_path, 1, 1, lambda done, words: None)
    (tmp_path / RESULTS).write_text('{"command": "ablate"}')
    with pytest.raises(ConfigError, match="holds no study; name another --out"):
        run_study(base, tmp_path, 1, 1, lambda done, words: None)


def test_a_training_that_fails_is_named_and_the_others_are_kept(tiny_content, tmp_path):
    pytest.importorskip("stable_baselines3")
    from steerclear.experiments.training.study import RESULTS, run_study

    base = config_of({**tiny_content, "evaluation": {"every": 100, "games": 1, "opponents": ["hold"]}})
    spoiled = tmp_path / "training-collision_on-seed_0"
    (spoiled / "checkpoints").mkdir(parents=True)
    (spoiled / "checkpoints" / "00000001.zip").write_bytes(b"no checkpoint")
    with pytest.raises(ConfigError, match=r"7 cells are done and kept; training-collision_on-seed_0: "):
        run_study(base, tmp_path, 1, 1, lambda done, words: None)
    assert len(json.loads((tmp_path / RESULTS).read_text())["rows"]) == 7
