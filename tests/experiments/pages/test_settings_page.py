"""The table of settings is of the settings there are, and the page in docs/ is what the code says."""

from dataclasses import fields
from pathlib import Path

import pytest
from steerclear.experiments.pages.settings_page import COSTS, meanings, settings_page
from steerclear.shield.config import ShieldConfig

PAGE = Path(__file__).parents[3] / "docs" / "settings.md"
NAMES = [entry.name for entry in fields(ShieldConfig)]


def test_every_setting_has_its_cost_and_no_other():
    assert sorted(COSTS) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_setting_has_a_meaning(name):
    assert len(meanings()[name]) > 20


def test_the_page_is_made_of_them():
    assert PAGE.read_text(encoding="utf-8") == settings_page(), "steerclear docs --out docs writes it anew"


def test_units_stand_where_the_name_has_one():
    for name, cost in COSTS.items():
        for ending, unit in {"_m": "m", "_mps": "m/s", "_per_s": "1/s"}.items():
            if name.endswith(ending):
                assert cost.unit == unit
    assert COSTS["delay_s"].unit == "s"
