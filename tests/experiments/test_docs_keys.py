"""The pages of JSON keys and settings have what there is."""

from dataclasses import fields
from pathlib import Path

from steerclear.experiments.docs import keys_page
from steerclear.experiments.metrics import game_metrics_of
from steerclear.shield import ShieldConfig

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_names_every_metric_of_a_game():
    page = keys_page()
    for metric in game_metrics_of((2.5,)):
        assert f"`{metric.name}" in page or metric.column in page, metric


def test_the_page_of_settings_has_all_there_are_and_no_other():
    text = (DOCS / "settings.md").read_text(encoding="utf-8")
    named = [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")]
    assert sorted(named) == sorted(entry.name for entry in fields(ShieldConfig))
