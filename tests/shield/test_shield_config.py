"""Settings are checked when they are given, in words that help."""

import math
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.backup.family import CERTIFICATES
from steerclear.shield.config import COORDINATION, PROFILES, RANGES
from steerclear.shield.exceptions import ConfigError, SolverError, SteerclearError

TEXTS = ("beyond_then", "opponent_model", "coordination", "profile", "solver")
NUMBERS = [entry.name for entry in fields(ShieldConfig) if entry.name not in (*TEXTS, "barriers")]
NOT_ZERO = [
    "move_s",
    "separation_m",
    "dt_s",
    "cbf_rate_per_s",
    "table_cbf_rate_per_s",
    "static_cbf_rate_per_s",
    "deadlock_timeout_s",
    "work_budget",
    "speed_weight",
    "horizon_s",
]
MAY_BE_NONE = ["adversary_horizon_s", "intruder_horizon_s", "move_s", "horizon_s", "edge_m", "beyond_m"]
MAY_BE_INFINITE = [
    "adversary_horizon_s",
    "intruder_horizon_s",
    "cbf_rate_per_s",
    "table_cbf_rate_per_s",
    "static_cbf_rate_per_s",
    "deadlock_timeout_s",
    "max_track_age_s",
    "work_budget",
]


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [math.nan, "2.5", True, [1.0], {}, 1 + 1j])
def test_values_that_are_no_numbers_are_refused_by_name(name, value):
    with pytest.raises(ConfigError, match=f"^{name} is .*give a number"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize("name", NUMBERS)
def test_negative_numbers_are_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"^{name} is -0.25"):
        ShieldConfig(**{name: -0.25})


@pytest.mark.parametrize("name", NUMBERS)
def test_zero_is_refused_where_it_makes_no_sense(name):
    if name in NOT_ZERO:
        with pytest.raises(ConfigError, match=f"^{name} is 0.*must be > 0"):
            ShieldConfig(**{name: 0.0})
    else:
        assert getattr(ShieldConfig(**{name: 0.0}), name) == 0.0


@pytest.mark.parametrize("name", NUMBERS)
def test_infinity_is_refused_where_it_makes_no_sense(name):
    if name in MAY_BE_INFINITE:
        assert getattr(ShieldConfig(**{name: math.inf}), name) == math.inf
    else:
        with pytest.raises(ConfigError, match=name):
            ShieldConfig(**{name: math.inf})


@pytest.mark.parametrize("name", NUMBERS)
def test_none_means_off_only_where_it_says_so(name):
    if name in MAY_BE_NONE:
        assert getattr(ShieldConfig(**{name: None}), name) is None
    else:
        with pytest.raises(ConfigError, match=name):
            ShieldConfig(**{name: None})


def test_profiles_are_names_of_the_time_opponents_are_feared_for():
    told = {name: ShieldConfig(profile=name) for name in PROFILES}
    assert {
        name: (config.effective_adversary_horizon_s, config.effective_intruder_horizon_s)
        for name, config in told.items()
    } == PROFILES
    assert ShieldConfig(profile="ramming", adversary_horizon_s=5.0).effective_adversary_horizon_s == 5.0
    with pytest.raises(
        ConfigError, match="unknown profile 'competitive!'; choose one of competitive, ramming, constant_velocity"
    ):
        ShieldConfig(profile="competitive!")


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("value", [None, 3, ["daqp"], True])
def test_names_must_be_texts(name, value):
    with pytest.raises(ConfigError, match=f"{name} is .*give a name"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize(("name", "known"), [("opponent_model", CERTIFICATES), ("coordination", COORDINATION)])
def test_unknown_names_are_told_the_known_ones(name, known):
    with pytest.raises(ConfigError, match=rf"unknown {name} 'magic'.*{'.*'.join(known)}"):
        ShieldConfig(**{name: "magic"})


def test_a_backend_that_is_not_installed_is_told_with_the_remedy():
    with pytest.raises(SolverError, match=r"'gurobi' is unknown .*not installed; choose one of .*daqp.*, or install"):
        Shield(solver="gurobi")


@pytest.mark.parametrize("entry", fields(ShieldConfig), ids=lambda entry: entry.name)
def test_a_misspelt_key_is_told_the_nearest_known_one(entry):
    misspelt = entry.name[:2] + entry.name[3:]
    with pytest.raises(ConfigError, match=f"unknown shield setting '{misspelt}'; did you mean '{entry.name}'"):
        ShieldConfig.of(**{misspelt: 1.0})


def test_a_key_like_no_other_is_told_all():
    with pytest.raises(ConfigError, match=r"known settings: separation_m, .*barriers"):
        Shield(zzz=1)


@pytest.mark.parametrize("key", ["separation", "radius_m", "separation_km", "dt", "DT_S"])
def test_keys_without_their_unit_are_unknown(key):
    with pytest.raises(ConfigError, match="unknown shield setting"):
        ShieldConfig.of(**{key: 1.0})


def test_settings_and_config_together_are_refused():
    with pytest.raises(ConfigError, match="not both"):
        Shield(ShieldConfig(), separation_m=3.0)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            {"config": {"separation_m": 3.0}},
            r"config is a dict; give a ShieldConfig, or settings: Shield\(\*\*settings\)",
        ),
        ({"surroundings": (0, 0, 10, 10)}, r"surroundings are a tuple; build them with Surroundings\("),
    ],
)
def test_arguments_of_another_kind_are_refused(arguments, told):
    with pytest.raises(ConfigError, match=told):
        Shield(**arguments)


def test_a_config_cannot_be_changed_behind_the_shields_back():
    config = ShieldConfig()
    with pytest.raises(FrozenInstanceError):
        config.separation_m = 0.1


def test_all_errors_are_of_one_tree():
    for error in (ConfigError, SolverError):
        assert issubclass(error, SteerclearError)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(0.01, 50.0), st.floats(0.0, 200.0), st.sampled_from(list(CERTIFICATES)))
def test_sensible_settings_are_taken_as_given(separation, fear, opponent_model):
    config = ShieldConfig.of(separation_m=separation, adversary_horizon_s=fear, opponent_model=opponent_model)
    assert (config.separation_m, config.adversary_horizon_s, config.opponent_model) == (
        separation,
        fear,
        opponent_model,
    )
    assert Shield(config).config is config


def test_numbers_no_float_holds_are_refused():
    with pytest.raises(ConfigError, match="separation_m is too large; give a finite number"):
        ShieldConfig(separation_m=10**400)


def test_whole_numbers_are_kept_as_floats_for_compiled_code():
    config = ShieldConfig(
        separation_m=3, margin_cap_m=0, cbf_rate_per_s=1, horizon_s=6, edge_m=None, obstacle_clearance_m=1
    )
    numbers = [value for value in vars(config).values() if not isinstance(value, str | tuple) and value is not None]
    assert {type(value) for value in numbers} == {float}
    assert config == ShieldConfig(
        separation_m=3.0, margin_cap_m=0.0, cbf_rate_per_s=1.0, horizon_s=6.0, edge_m=None, obstacle_clearance_m=1.0
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("dt_s", 100),
        ("dt_s", 1e-9),
        ("horizon_s", 121.0),
        ("straight_horizon_s", 1e4),
        ("delay_s", 1e4),
        ("margin_cap_m", 51),
        ("separation_m", 2500),
        ("position_error_m", 1e6),
        ("obstacle_clearance_m", 1000),
        ("buffer_m", 50.1),
        ("edge_m", 201),
        ("table_margin_m", 450),
    ],
)
def test_what_nothing_can_be_decided_for_is_refused(name, value):
    with pytest.raises(ConfigError, match=rf"{name} is .*; give .* [0-9]+ (s|m)$"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("separation_m", 2500, r"2500 \(if that is mm, give 2.5\); give more than 0 and at most 1000 m"),
        ("dt_s", 100.0, r"100.0 \(if that is ms, give 0.1\); give 0.01 to 2 s"),
        ("current_mps", 300, r"300 \(if that is mm/s, give 0.3\); give 0 to 10 m/s"),
        ("track_error_mps", 51, "51; give 0 to 50 m/s$"),
        ("speed_weight", 1e7, r"10000000.0; give more than 0 and at most 1e\+06$"),
        ("work_budget", 10, "10; give 1000 to inf clearances$"),
    ],
)
def test_a_number_of_another_unit_is_told_its_range_and_what_it_may_be(name, value, text):
    with pytest.raises(ConfigError, match=f"^{name} is {text}"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize("name", RANGES)
def test_ranges_are_taken_to_their_ends(name):
    low, high = RANGES[name]
    for value in {low if low > 0.0 else 0.25, high}:
        more = {"dt_s": value, "move_s": None} if name == "dt_s" else {"dt_s": 1.0} if name == "move_s" else {}
        assert getattr(ShieldConfig(**{name: value, **more}), name) == (None if more.get(name, 0) is None else value)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, int])
def test_numbers_of_numpy_are_numbers(kind):
    config = ShieldConfig(separation_m=kind(3))
    assert config == ShieldConfig(separation_m=3.0)
    assert type(config.separation_m) is float
