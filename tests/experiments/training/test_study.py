from steerclear.experiments.docs_pages import write_pages
from steerclear.experiments.training.settings import settings_of
from steerclear.experiments.training.study import cells, settings_of_cell


def test_a_deployed_shield_shares_the_training_without_one():
    found = list(cells(seeds=2))
    assert len(found) == 16
    assert len({cell.training for cell in found}) == 12
    bare, deployed = (next(c for c in found if c.shield == shield) for shield in ("none", "deployment"))
    base = settings_of({"rewards": {"sparse": 1.0, "collision": 9.0}})
    assert settings_of_cell(base, bare) == settings_of_cell(base, deployed)
    assert settings_of_cell(base, bare).rewards == {"sparse": 1.0}
    with_term = next(cell for cell in found if cell.collision == "on")
    assert settings_of_cell(base, with_term).rewards["collision"] == 0.25


def test_the_page_tells_every_cell_with_its_interval(tmp_path):
    rows = []
    for cell in cells(seeds=1):
        nets = [1.0, 2.0, 3.0] if cell.shield == "none" else [2.0, 2.0, 3.0]
        figures = {"captures": 2.0, "captures_against": 0.0, "hits": 1.5, "interventions": 4.0}
        about = {"shield": cell.shield, "collision": cell.collision, "seed": cell.seed, "opponent": "medium"}
        rows.append({**about, **figures, "nets": nets})
    training = {"decisions": 1000, "interval": 10, "preset": "aamas2024"}
    settings = {"seeds": 1, "games": 3, "training": training}
    write_pages([{"command": "train-study", "settings": settings, "rows": rows}], tmp_path)
    page = (tmp_path / "learning.md").read_text()
    assert page.count("| training+intervention |") == 2
    assert "| none | off | 1 | 3 | +2.00 (+1.00 to +3.00) | 2.00 | 0.00 | 1.50 | 4.00 |" in page
    assert "net captures +0.33" in page
