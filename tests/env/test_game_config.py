import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig, RewardWeights, as_config
from steerclear.shield.exceptions import ConfigError, PlatformError, SteerclearError
from steerclear.shield.platforms import get_platform


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


def test_one_value_is_repeated_for_every_boat_and_a_mixed_fleet_is_kept():
    config = GameConfig.preset("mctf2025", team_size=1, platforms=("heron", "si"), agent_radius_m=(1.0, 2))
    assert [p.name for p in config.platforms] == ["heron", "si"]
    assert config.agent_radius_m == (1.0, 2.0)
    assert GameConfig(team_size=2).agent_radius_m == (2.0,) * 4
    assert config.agent_ids == ("agent_0", "agent_1")


def test_replace_changes_only_what_is_named():
    config = GameConfig.preset("aamas2024", flag_keepout_m=2.0).replace(max_score=3)
    assert (config.max_score, config.flag_keepout_m, config.preset_name) == (3, 2.0, "aamas2024")


def test_configs_are_frozen_comparable_hashable_and_can_be_sent_to_processes():
    config = GameConfig.preset("aamas2024", obstacles={"circle": [(1.0, (40.0, 10.0))]})
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.max_score = 3
    assert pickle.loads(pickle.dumps(config)) == config
    assert hash(config) == hash(config.replace())


@pytest.mark.parametrize(
    ("name", "hint"), [("tag_cooldown_s", "tagging_cooldown_s"), ("team_sise", "team_size"), ("zzz", "known settings")]
)
def test_a_misspelt_setting_is_explained(name, hint):
    with pytest.raises(ConfigError, match=f"unknown game setting '{name}'.*{hint}"):
        GameConfig.preset("aamas2024", **{name: 1})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"team_size": 0}, "team_size is 0; give a whole number >= 1"),
        ({"team_size": 2.0}, "team_size is 2.0"),
        ({"team_size": True}, "team_size is True"),
        ({"team_size": 10**21}, "team_size is 1000000000000000000000; give at most 1000"),
        ({"dt_s": 0.0}, "dt_s is 0.0; it must be > 0"),
        ({"dt_s": float("nan")}, "dt_s is nan; give a finite number"),
        ({"max_time_s": float("inf")}, "max_time_s is inf"),
        ({"catch_radius_m": -1.0}, "catch_radius_m is -1.0"),
        ({"flag_keepout_m": -0.1}, "flag_keepout_m is -0.1; it must be >= 0"),
        ({"agent_radius_m": -1.25}, "agent_radius_m is -1.25"),
        ({"agent_radius_m": (1.0, 2.0)}, "agent_radius_m has 2 entries for 6 boats"),
        ({"agent_radius_m": "big"}, "agent_radius_m is 'big'"),
        ({"tag_on_oob": 1}, "tag_on_oob is 1; choose one of True, False"),
        ({"capture_at": "home"}, "choose one of 'own_side', 'own_base'"),
        ({"env_bounds_m": (10.0,)}, "env_bounds_m is .* give a pair"),
        ({"env_bounds_m": (10.0, -1.0)}, "env_bounds_m height is -1.0"),
        ({"env_bounds_m": "big"}, "give a pair"),
        ({"blue_flag_home_m": (1.0, 1.0)}, "give both"),
        ({"scrimmage_m": ((1.0, 1.0), (1.0, 1.0))}, "two different points"),
        ({"reward": {"capture": 1}}, "give a RewardWeights"),
        ({"obstacles": {"square": []}}, "keys 'circle' and 'polygon' only"),
        ({"obstacles": {"circle": [(-1.0, (3.0, 3.0))]}}, "circle obstacle radius is -1.0"),
        ({"obstacles": {"circle": [3.0]}}, "give a tuple"),
        ({"obstacles": {"circle": 3.0}}, "give a list"),
        ({"obstacles": {"polygon": [((0.0, 0.0), (1.0, 1.0))]}}, "at least 3 corners"),
    ],
)
def test_unusable_settings_are_refused_with_the_remedy(settings, message):
    with pytest.raises(ConfigError, match=message):
        GameConfig.preset("aamas2024", **settings)


def test_unknown_names_list_what_exists():
    with pytest.raises(ConfigError, match="unknown preset 'x'; known presets: aamas2024, mctf2025"):
        GameConfig.preset("x")
    with pytest.raises(PlatformError, match=r"unknown platform 'canoe'.*heron"):
        GameConfig.preset("aamas2024", platforms="canoe")
    with pytest.raises(ConfigError, match="give a GameConfig or a preset name"):
        as_config(3)


def test_as_config_takes_configs_names_and_nothing():
    config = GameConfig(max_score=2)
    assert as_config(config) is config
    assert as_config("aamas2024").preset_name == "aamas2024"
    assert as_config(None).preset_name == "mctf2025"


def test_a_platform_object_of_ones_own_is_used():
    slow = dataclasses.replace(get_platform("heron"), name="slow", max_speed_mps=0.5)
    assert GameConfig(platforms=slow).platforms[0].max_speed_mps == 0.5


def test_reward_weights_must_be_finite():
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
