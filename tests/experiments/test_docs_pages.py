"""Pages of results: the comparison of filters, the price, the keys of JSON; what no page can be made of."""

import pytest
from steerclear.experiments.docs import KEYS, best_of, comparison_page, pool, price_page, write_pages
from steerclear.shield.exceptions import ConfigError

SETTINGS = {"radius_m": 2.5, "delay_s": 0.0, "noise_m": 0.0, "current_mps": 0.0, "seed": 7}


def cell(safety_filter, family, violated=0, avoidable=0, changed=5.0, n=100, own="heron", **more):
    return {
        "filter": safety_filter, "family": family, "own": own, "other": "heron", "encounters": n, "violated": violated,
        "avoidable": avoidable, "unavoidable": violated - avoidable, "not_judged": 0, "deadlocked": 0,
        "changed_percent": changed, "goal_time_ratio": 1.1, "reversals_per_min": 2.0, "decision_us": 9.0,
        "started_outside": n, "violations_outside": violated, "never_arrived_percent": 0.0, "inactive_percent": 90.0,
        **more,
    }  # fmt: skip


def content(*cells, **settings):
    return {
        "command": "encounters", "settings": SETTINGS | settings, "versions": {"steerclear": "9.9"}, "cells": [*cells],
    }  # fmt: skip


def both(first="head_on", second="rammer_1"):
    """A cautious safety_filter that changes much, a bold one that fails once, none."""
    return content(
        *(cell("none", family, violated=60, changed=0.0, goal_time_ratio=1.0) for family in (first, second)),
        cell("cautious", first, changed=40.0), cell("cautious", second, changed=60.0, n=100),
        cell("bold", first, changed=1.0), cell("bold", second, violated=1, avoidable=1, changed=3.0),
    )  # fmt: skip


def test_the_page_shows_what_the_results_say(tmp_path):
    page, picture = (
        path for path in write_pages([both()], tmp_path) if path.name in ("comparison.md", "comparison.png")
    )
    text = page.read_text()
    assert (
        "Best (fewest avoidable or unjudged, then fewest with violations, then fewest commands changed): **caut" in text
    )
    assert "| **cautious** | 200 | 0 [1.5 %] | 0 | 0 | 0 [1.5 %] | 0 [1.5 %] | 50.0 % |" in text
    assert "| rammer_1 | 60, 0 % | 0, 60 % | 1, 3 % |" in text
    assert "steerclear 9.9" in text
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_only_families_that_all_met_count_and_violations_nobody_judged_are_not_taken_for_unavoidable(tmp_path):
    gentle = content(cell("gentle", "head_on", changed=30.0), cell("gentle", "crossing_left", changed=50.0))
    hidden = content(cell("hidden", "head_on", violated=1, changed=1.0, not_judged=1, unavoidable=0))
    text = comparison_page([both(), gentle, hidden], tmp_path)[1]
    assert "Families: head_on; seed 7. Not met equally by all filters and left out: rammer_1, crossing_left." in text
    assert ": **bold**." in text, "of those that are safe the gentlest"
    assert "| hidden | 100 | 0 to 1 [4.7 %] | 0 | 1 | 1 [4.7 %] |" in text
    assert best_of({"none": pool([cell("none", "head_on")])}) is None
    alone = comparison_page([content(cell("shield", "head_on", n=1000))], tmp_path)[1]
    assert alone.startswith("# Encounters with shield")
    assert "| head_on | 1,000 | 0 [0.3 %] | 0 | 0 | 0 [0.3 %] | 0 [0.3 %] | 5.0 % |" in alone
    assert "Best" not in alone


def figure(value):
    return {"value": value, "low": value - 1.0, "high": value + 1.0}


def ablation(shield, changed, hits, radius="2.5"):
    one = {"on": figure(1.0), "off": figure(1.0), "difference": figure(0.25)}
    names = ("captures", "captures_against", "net_captures", "tags", "primary")
    metrics = {name: {"label": name, **one} for name in names}
    metrics["changed_share"] = {"label": "changed", "on": figure(changed)}
    for kind in ("teammate", "opponent"):
        metrics[f"violations_{kind}_{radius}m"] = {"label": kind, **one, "on": figure(hits)}
    return {
        "command": "ablate",
        "settings": {"preset": "mctf2025", "shield": shield},
        "versions": {"steerclear": "1.2.3"},
        "pairings": [{"pairing": "medium vs easy", "games_on": 6, "games_off": 6, "metrics": metrics}],
    }


def test_ablations_of_several_horizons_make_the_page_of_the_price(tmp_path):
    results = [
        ablation({"profile": "ramming"}, 21.5, 0.0),
        ablation({"adversary_horizon_s": 6.0}, 4.25, 0.5),
        ablation({}, 7.75, 0.25),
        ablation({"adversary_horizon_s": 9.0, "separation_m": 4.0}, 12.5, 0.0, "4.0"),
    ]
    pages = write_pages(results, tmp_path)
    assert [page.name for page in pages] == ["json_keys.md", "price.md", "price.png"]
    near, far = (tmp_path / "price.md").read_text().split("## mctf2025, 4 m: medium vs easy")
    rows = [row.split("|")[1:3] for row in near.splitlines() if row.startswith("| ") and "[" in row]
    assert [[cell.strip().split(" ")[0] for cell in row] for row in rows] == [
        ["6", "4.25"],
        ["12", "7.75"],
        ["inf", "21.5"],
    ]
    assert "12.5" in far
    assert "| 1.2.3 |" in far, "a row is of the version that measured it"
    assert price_page(results, tmp_path)[2][0].stat().st_size > 10_000


def test_the_page_of_keys_holds_every_key(tmp_path):
    write_pages([], tmp_path)
    text = (tmp_path / "json_keys.md").read_text()
    assert all(f"`{key}`" in text for keys in KEYS.values() for key in keys)


def test_what_no_page_can_be_made_of_is_refused(tmp_path):
    broken = cell("a", "head_on")
    del broken["avoidable"]
    evaluation = {"command": "evaluate", "settings": {"preset": "aamas2024", "own": "medium", "games": 1, "rules": {}}}
    evaluation |= {"quick": False, "seeds": [0], "versions": {"steerclear": "1"}, "goals": [], "pairings": []}
    for contents, words in (
        ([content(broken)], "has no avoidable; run `encounters` again"),
        ([content()], "no family that all filters met"),
        (
            [{"command": "parity"}],
            "ablate, evaluate, tournament, bench, encounters, reach compare",
        ),
        ([evaluation] * 2, r"two of the results make evaluation_aamas2024\.md; give them one at a time"),
        ([ablation({}, 1.0, 0.0)], "make them again"),
        ([content(cell("bold", "head_on"), cell("shy", "rammer_1"))], "have no family that all filters met"),
    ):
        with pytest.raises(ConfigError, match=words):
            write_pages(contents, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="choose another --out"):
        write_pages([], tmp_path / "file" / "docs")
