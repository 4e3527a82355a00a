import json
import shutil
from pathlib import Path

import pytest
from steerclear.experiments.docs import write_pages
from steerclear.experiments.result_files import write_json
from steerclear.experiments.runner import RESULTS_FILE
from steerclear.experiments.training.config import SHIELDS, config_of
from steerclear.experiments.training.study import config_of_training, learning_of, run_study, trainings_of
from steerclear.experiments.training.training import training_of
from steerclear.shield.exceptions import ConfigError


def test_a_deployed_shield_shares_the_training_without_one(tmp_path):
    base = config_of({"rewards": {"sparse": 1.0, "collision": 9.0}, "seed": 5})
    found = trainings_of(base, tmp_path, 2, 1)
    assert len(found) == len({job["folder"] for job in found}) == 12
    bare, with_term = found[0], found[3]
    assert [cell["shield"] for cell in bare["cells"]] == ["none", "deployment"]
    assert (bare["config"]["rewards"], bare["config"]["shield"], bare["config"]["seed"]) == ({"sparse": 1.0}, "none", 5)
    assert with_term["config"]["rewards"]["collision"] == 0.25
    assert config_of(found[-1]["config"]) == config_of_training(base, "training+intervention", 0.25, 1)


def test_what_a_training_tells_of_its_learning():
    def row(decisions, games, net):
        if not games:
            return {"decisions": decisions, "games": 0, "captures": None, "captures_against": None, "hits": None}
        return {"decisions": decisions, "games": games, "captures": net + 1, "captures_against": 1.0, "hits": net}

    found = learning_of([row(10, 1, 0.0), row(20, 1, 2.0), row(30, 0, None), row(35, 1, 4.0), row(40, 3, 8.0)])
    assert found == {"learned": [0.0, 2.0, None, 7.0], "training_hits": 5.0}


def test_the_page_tells_every_cell_with_its_interval(tmp_path):
    rows = []
    for cell in [cell for job in trainings_of(config_of({}), tmp_path, 2, 1) for cell in job["cells"]]:
        nets = [1.0, 2.0, 3.0] if cell["shield"] == "none" else [2.0, 2.0, 3.0]
        hits = [4.0, 5.0, 3.0] if cell["shield"] == "none" else [0.0, 0.0, 0.0]
        figures = {"captures": 2.0, "captures_against": 0.0, "interventions": 4.0, "nets": nets, "hit_counts": hits}
        learned = {"learned": [None, 0.0, 1.0, 2.0], "training_hits": 3.0}
        rows.append({**cell, "opponent": "hard", **figures, **learned})
    training = {"decisions": 1000, "interval": 10, "preset": "aamas2024", "stages": [{"opponents": ["medium"]}]}
    settings = {"seeds": 2, "games": 3, "training": training}
    write_pages([{"command": "train-study", "settings": settings, "rows": rows}], tmp_path)
    page = (tmp_path / "learning.md").read_text()
    assert "2 trainings a cell, of 1,000 decisions" in page
    write_pages([{"command": "train-study", "settings": settings, "rows": rows[:-1]}], tmp_path)
    assert "1 or 2 trainings a cell, of 1,000 decisions" in (tmp_path / "learning.md").read_text()
    assert "game steps against medium, on aamas2024;" in page
    assert page.count("| training+intervention |") == 4
    assert "| none | off | +2.00 (+1.33 to +2.67) | +2.00, +2.00 | 2.00 | 0.00 | 4.00 (2.56 to 5.95) | 4.00 |" in page
    assert "net captures +0.33" in page
    assert "| nothing to shield, deployment | +0.33 | -4.00 |" in page
    assert "| training | on | - | +0.00 | +1.00 | +2.00 | 3.00 |" in page


def test_a_folder_of_another_config_is_not_gone_on_with(tmp_path):
    """Its networks would be taken for those of the config given."""
    base, other = (config_of({"decisions": decisions}) for decisions in (100, 200))
    for name in ("results.json", "experiment.json"):  # the second is there from the beginning
        settings = {"seeds": 1, "games": 1, "training": other.told()}
        write_json(tmp_path / name, {"command": "train-study", "settings": settings})
        with pytest.raises(ConfigError, match=r"holds a study of another config \(decisions\); give its own, or name"):
            run_study(base, tmp_path, 1, 1, lambda done, of: None)
        (tmp_path / name).write_text('{"command": "ablate"}')
        with pytest.raises(ConfigError, match="holds no study; name another --out"):
            run_study(base, tmp_path, 1, 1, lambda done, of: None)
        (tmp_path / name).unlink()


def test_a_study_comes_to_the_same_results_whatever_happens_to_it(tiny_content, tmp_path):
    """One training was stopped after an evaluation had left weights, one spoiled, and another process goes on."""
    told, tiny = [], {**tiny_content, "decisions": 72, "stages": [{"opponents": ["hold"]}]}
    base = config_of(
        {**tiny, "rules": {"max_time_s": 3.0}, "evaluation": {"every": 1, "games": 1, "opponents": ["hold"]}}
    )
    rows = run_study(base, tmp_path / "whole", 1, 1, lambda done, of: told.append((done, of)))["rows"]
    assert [(row["shield"], row["collision"]) for row in rows] == [
        (shield, collision) for collision in ("off", "on") for shield in SHIELDS
    ]
    assert told[-1] == (6, 6)

    def stop(done, words):
        raise KeyboardInterrupt

    folder = tmp_path / "broken"
    job = trainings_of(base, folder, 1, 1)[0]
    with pytest.raises(KeyboardInterrupt):
        training_of(config_of(job["config"]), Path(job["folder"]), False).run(stop)
    assert (Path(job["folder"]) / "final.npz").exists()
    spoiled = folder / "training-collision_on-seed_0"
    (spoiled / "checkpoints").mkdir(parents=True)
    (spoiled / "checkpoints" / "00000001.zip").write_bytes(b"no checkpoint")
    with pytest.raises(ConfigError, match=r"7 cells are done and kept; training-collision_on-seed_0: "):
        run_study(base, folder, 1, 1, lambda done, of: None)
    assert len(json.loads((folder / RESULTS_FILE).read_text())["rows"]) == 7
    shutil.rmtree(spoiled)
    assert run_study(base, folder, 1, 1, lambda done, of: None, 2)["rows"] == rows
