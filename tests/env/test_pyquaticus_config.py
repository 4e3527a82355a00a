import pytest
from steerclear.env.config import GameConfig
from steerclear.env.pyquaticus_config import from_pyquaticus
from steerclear.shield.exceptions import ConfigError

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


def test_the_competitions_own_settings_are_the_preset():
    assert from_pyquaticus(COMPETITION, team_size=3, preset_name="mctf2025") == GameConfig.preset("mctf2025")


def test_what_is_missing_has_pyquaticus_default():
    config = from_pyquaticus({}, team_size=1)
    assert [p.name for p in config.platforms] == ["heron"] * 2
    assert (config.flag_radius_m, config.preset_name) == (1.5, "pyquaticus")


def test_what_is_set_on_top_takes_precedence():
    config = from_pyquaticus({"env_bounds": "auto"}, team_size=1, env_bounds_m=(100.0, 50.0))
    assert config.env_bounds_m == (100.0, 50.0)


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


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"catch_radus": 3.0}, "unknown Pyquaticus setting 'catch_radus'; did you mean catch_radius"),
        ({"zzzz": 3.0}, "unknown Pyquaticus setting 'zzzz'; remove it"),
        ({"gps_env": True}, "gps_env = True is not supported; use False"),
        ({"env_bounds": "auto"}, "give the field's width and height"),
        ([1], "the configuration is list"),
    ],
)
def test_what_cannot_be_played_is_refused(settings, message):
    with pytest.raises(ConfigError, match=message):
        from_pyquaticus(settings, team_size=1)
