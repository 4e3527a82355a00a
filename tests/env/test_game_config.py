"""Settings of games: presets, fields of one's own, and those of Pyquaticus."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig, RewardWeights, as_config
from steerclear.env.pyquaticus_config import from_pyquaticus
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import ConfigError, SteerclearError


def test_presets_hold_the_competitions_rules():
    paper, year_2025 = GameConfig.preset("aamas2024"), GameConfig.preset("mctf2025")
    assert (paper.env_bounds_m, year_2025.env_bounds_m) == ((80.0, 40.0), (160.0, 80.0))
    assert (paper.tagging_cooldown_s, year_2025.tagging_cooldown_s) == (10.0, 60.0)
    assert (paper.agent_radius_m[0], year_2025.agent_radius_m[0]) == (1.25, 2.0)
    assert {p.name for p in paper.platforms} == {"heron"}
    assert {p.name for p in year_2025.platforms} == {"surveyor"}
    for config in (paper, year_2025):
        assert (config.team_size, config.dt_s, config.max_time_s, config.catch_radius_m) == (3, 0.1, 600.0, 10.0)
        assert (config.flag_keepout_m, config.oob_speed_frac, config.capture_at) == (3.0, 0.5, "own_side")


@pytest.mark.parametrize(
    ("name", "hint"), [("tag_cooldown_s", "tagging_cooldown_s"), ("team_sise", "team_size"), ("zzz", "known settings")]
)
def test_a_misspelt_setting_is_explained(name, hint):
    with pytest.raises(ConfigError, match=f"unknown game setting '{name}'.*{hint}"):
        GameConfig.preset("aamas2024", **{name: 1})


def test_as_config_takes_configs_names_and_nothing_and_weights_must_be_finite():
    config = GameConfig(max_score=2)
    assert as_config(config) is config
    assert as_config("aamas2024").preset_name == "aamas2024"
    assert as_config(None).preset_name == "mctf2025"
    with pytest.raises(ConfigError, match=r"reward.tag is nan"):
        RewardWeights(tag=float("nan"))


ANY_NUMBER = st.one_of(st.floats(), st.integers(-3, 3))

ANY_VALUE = st.one_of(ANY_NUMBER, st.sampled_from(["", "si", "own_base", None]), st.lists(ANY_NUMBER, max_size=3))


@settings(derandomize=True, deadline=None)
@given(st.dictionaries(st.sampled_from(GameConfig.names()), ANY_VALUE, max_size=3))
def test_whatever_is_given_either_builds_or_raises_our_own_error(given_settings):
    try:
        config = GameConfig.preset("aamas2024", **given_settings)
    except SteerclearError:
        return
    assert np.isfinite(config.env_bounds_m).all()
    assert config.dt_s > 0


COMPETITION = {
    "gps_env": False,
    "env_bounds": [160.0, 80.0],
    "env_bounds_unit": "m",
    "blue_flag_home": "auto",
    "red_flag_home": "auto",
    "scrimmage_coords": "auto",
    "agent_radius": 2.0,
    "flag_radius": 2.0,
    "flag_keepout": 3.0,
    "catch_radius": 10.0,
    "slip_radius": 10.0,
    "obstacles": None,
    "oob_speed_frac": 0.5,
    "dynamics": "surveyor",
    "tau": 0.1,
    "sim_speedup_factor": 1,
    "default_init": True,
    "max_score": 20,
    "max_time": 600.0,
    "tagging_cooldown": 60.0,
    "tag_on_collision": False,
    "tag_on_oob": True,
    "normalize_obs": True,
    "lidar_obs": False,
    "normalize_state": True,
    "render_fps": 30,
}


def test_the_2026_competitions_own_settings_are_the_preset():
    settings = load_trace(Path(__file__).parents[1] / "data" / "traces_2026" / "captures10.npz").meta["config"]
    assert from_pyquaticus(settings, team_size=3, preset_name="mctf2026") == GameConfig.preset("mctf2026")


def test_the_competitions_own_settings_are_the_preset_and_what_is_missing_has_pyquaticus_default():
    assert from_pyquaticus(COMPETITION, team_size=3, preset_name="mctf2025") == GameConfig.preset("mctf2025")
    config = from_pyquaticus({"env_bounds": "auto"}, team_size=1, env_bounds_m=(100.0, 50.0))
    assert (config.env_bounds_m, config.flag_radius_m, config.preset_name) == ((100.0, 50.0), 1.5, "pyquaticus")
    assert [p.name for p in config.platforms] == ["heron"] * 2


def test_fleets_radii_places_and_obstacles_are_taken_over():
    config = from_pyquaticus(
        {
            "dynamics": ["heron", "surveyor"],
            "agent_radius": [1.0, 2.0],
            "blue_flag_home": [20.0, 30.0],
            "red_flag_home": [140.0, 30.0],
            "scrimmage_coords": [(80.0, 0.0), (80.0, 80.0)],
            "obstacles": {"circle": [(4.0, (80.0, 40.0))]},
        },
        team_size=1,
    )
    assert [p.name for p in config.platforms] == ["heron", "surveyor"]
    assert config.blue_flag_home_m == (20.0, 30.0)
    assert config.scrimmage_m == ((80.0, 0.0), (80.0, 80.0))
    assert config.obstacles["circle"] == ((4.0, (80.0, 40.0)),)
