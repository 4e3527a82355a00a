"""The page of JSON keys in docs/ is what the code says."""

from dataclasses import fields
from pathlib import Path

from steerclear.experiments.docs import keys_page
from steerclear.shield import ShieldConfig

PAGE = Path(__file__).parents[2] / "docs" / "json_keys.md"


def test_the_page_is_made_of_the_keys_there_are():
    assert PAGE.read_text(encoding="utf-8") == keys_page(), "steerclear docs --out docs writes it anew"


def test_the_page_of_settings_has_all_there_are_and_no_other():
    text = (PAGE.parent / "settings.md").read_text(encoding="utf-8")
    named = [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")]
    assert sorted(named) == sorted(entry.name for entry in fields(ShieldConfig))
