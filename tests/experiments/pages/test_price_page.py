"""The page of what safety costs: one table a pairing, times in order, figures where they belong."""

import json
import math

import pytest
from steerclear.experiments.pages import docs_pages
from steerclear.experiments.pages.docs_pages import write_pages
from steerclear.experiments.pages.price_page import is_dial, is_shielded, price_page
from steerclear.experiments.runs.ablation import AblationSettings
from steerclear.experiments.runs.campaign import Played
from steerclear.experiments.runs.results import results_of
from steerclear.experiments.runs.store import finite
from steerclear.shield.exceptions import ConfigError


def figure(value):
    return {"value": value, "low": value - 1.0, "high": value + 1.0}


def ablation(shield, changed, hits, radius="2.5"):
    one = {"on": figure(1.0), "off": figure(1.0), "difference": figure(0.25)}
    names = ("captures", "captures_against", "net_captures", "tags", "primary")
    metrics = {name: {"label": name, **one} for name in names}
    metrics["changed_share"] = {"label": "changed", "on": figure(changed)}
    for kind in ("teammate", "opponent"):
        metrics[f"breaches_{kind}_{radius}m"] = {"label": kind, **one, "on": figure(hits)}
    return {
        "command": "ablate",
        "settings": {"preset": "mctf2025", "shield": shield},
        "versions": {"steerclear": "1.2.3"},
        "pairings": [{"pairing": "medium vs easy", "games_on": 6, "games_off": 6, "metrics": metrics}],
    }


def test_a_row_for_each_time_the_least_first(tmp_path):
    results = [
        ablation({"profile": "rammers"}, 21.5, 0.0),
        ablation({"adversary_s": 6.0}, 4.25, 0.5),
        ablation({"profile": "players"}, 7.75, 0.25),
        ablation({"adversary_s": 9.0, "separation_m": 4.0}, 12.5, 0.0, "4.0"),
    ]
    pages = write_pages(results, tmp_path)
    assert [page.name for page in pages] == ["json_keys.md", "settings.md", "price.md", "price.png"]
    text = (tmp_path / "price.md").read_text()
    near, far = text.split("## mctf2025, 4 m: medium vs easy")
    rows = [row.split("|")[1:4] for row in near.splitlines() if row.startswith("| ") and "[" in row]
    assert [[cell.strip().split(" ")[0] for cell in row] for row in rows] == [
        ["6", "4.25", "0.50"],
        ["12", "7.75", "0.25"],
        ["inf", "21.5", "0.00"],
    ]
    assert "12.5" in far
    assert "| 1.2.3 |" in far, "a row is of the version that measured it"
    assert (tmp_path / "price.png").stat().st_size > 10_000


def test_a_single_time_is_an_ablation_and_no_trade(tmp_path, monkeypatch):
    monkeypatch.setattr(docs_pages, "_page_of", lambda content, folder: ("ablation.md", str(content["settings"]), []))
    pages = write_pages([ablation({"profile": "players"}, 7.75, 0.25)], tmp_path)
    assert [page.name for page in pages] == ["json_keys.md", "settings.md", "ablation.md"]


def test_fear_without_end_stays_so_in_results():
    """JSON has no infinity, and None would be the profile's."""
    settings = AblationSettings(shield={"adversary_s": math.inf}, opponents=("easy",), games=1)
    kept = json.loads(json.dumps(finite(results_of("ablate", settings, Played([], [], 0), 1.0)["settings"])))
    assert kept["shield"] == {"adversary_s": "inf"}
    assert float(kept["shield"]["adversary_s"]) == math.inf


def test_other_ablations_keep_their_own_page():
    assert not is_dial(ablation({}, 1.0, 0.0))
    assert not is_dial(ablation(None, 1.0, 0.0))
    assert is_dial(ablation({"profile": "players"}, 1.0, 0.0))


def test_an_ablation_that_was_told_no_time_has_that_of_the_default(tmp_path):
    plain = ablation({}, 7.75, 0.25)
    assert is_shielded(plain)
    assert not is_shielded(ablation(None, 1.0, 0.0))
    _, text, _ = price_page([ablation({"adversary_s": 0.0}, 2.0, 1.0), plain], tmp_path)
    assert [row.split("|")[1].strip() for row in text.splitlines() if row.endswith("1.2.3 |")] == ["0", "12 / 7"]


def test_results_cut_short_are_refused(tmp_path):
    broken = ablation({"profile": "players"}, 1.0, 0.0)
    del broken["pairings"][0]["metrics"]["changed_share"]["on"]
    with pytest.raises(ConfigError, match="cut short or of another version"):
        write_pages([broken], tmp_path)
