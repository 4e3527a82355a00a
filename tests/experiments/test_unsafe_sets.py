"""The shield's unavoidable set beside that of reachability, two methods that share nothing but the boats."""

import json
import math

import pytest
from steerclear.experiments import cli
from steerclear.experiments.docs_pages import write_pages
from steerclear.experiments.keys import SETS, undocumented
from steerclear.experiments.unsafe_sets import HEADS, SetPair, rows_of, shield_area_m2
from steerclear.shield import ShieldConfig
from steerclear.shield.tables.areas import area_m2
from steerclear.shield.tables.files import load_table
from typer.testing import CliRunner

RADIUS_M = 2.5
BARE = ShieldConfig(separation_m=RADIUS_M, buffer_m=0.0)


@pytest.fixture(scope="module")
def heron():
    return load_table("heron", "heron")


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 180.0])
def test_the_manoeuvre_certificate_gives_up_where_reachability_does(heron, heading_deg):
    ours = shield_area_m2(heron, BARE, heading_deg, 2.0, 2.0)
    assert ours == pytest.approx(area_m2(heron, RADIUS_M, heading_deg, 2.0, 2.0), rel=0.06)


def test_opponents_that_only_hold_their_course_leave_a_smaller_set(heron):
    tame = ShieldConfig(separation_m=RADIUS_M, buffer_m=0.0, opponent_share=0.0)
    hunted = shield_area_m2(heron, BARE, 90.0, 2.0, 2.0)
    assert math.pi * RADIUS_M**2 <= shield_area_m2(heron, tame, 90.0, 2.0, 2.0) < hunted


def test_rows_show_the_ratio():
    (row,) = rows_of([SetPair(2.0, 1.0, 90.0, 33.0, 30.0)])
    assert dict(zip(HEADS, row, strict=True))["ratio"] == "1.10"


def test_the_command_writes_documented_json_that_becomes_a_page(tmp_path, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.unsafe_sets.HEADINGS_DEG", (180.0,))
    monkeypatch.setattr("steerclear.experiments.unsafe_sets.SPEED_SHARES", ((1.0, 1.0),))
    file = tmp_path / "sets.json"
    arguments = ["reach", "compare", "--own", "heron", "--other", "heron", "--json", str(file)]
    assert CliRunner().invoke(cli.app, arguments).exit_code == 0
    content = json.loads(file.read_text())
    assert undocumented(content, SETS) == []
    write_pages([content], tmp_path)
    page = (tmp_path / "unsafe_sets.md").read_text()
    assert "heron meets heron, 2.5 m" in page
    assert f"{content['pairs'][0]['shield_m2']:.1f}" in page


def test_a_larger_set_than_the_bar_allows_is_an_exit_status(tmp_path, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.unsafe_sets.HEADINGS_DEG", (180.0,))
    monkeypatch.setattr("steerclear.experiments.unsafe_sets.SPEED_SHARES", ((1.0, 1.0),))
    monkeypatch.setattr("steerclear.experiments.commands.reach.RATIO_BAR", 0.5)
    result = CliRunner().invoke(cli.app, ["reach", "compare", "--own", "heron", "--other", "heron"])
    assert result.exit_code == 1
