"""Settings are checked when they are given, in words that help."""

import math
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.backup.family import OPPONENT_MODELS
from steerclear.shield.config import COORDINATION, PROFILES
from steerclear.shield.exceptions import ConfigError, SolverError, SteerclearError

RANGES = {entry.name: entry.metadata["range"] for entry in fields(ShieldConfig) if "range" in entry.metadata}
TEXTS = ("beyond_then", "opponent_model", "coordination", "profile", "solver")
ABOVE_ZERO = {
    *("separation_m", "dt_s", "move_s", "cbf_rate_per_s", "table_cbf_rate_per_s", "static_cbf_rate_per_s"),
    *("deadlock_timeout_s", "work_budget", "speed_weight", "horizon_s"),
}
MAY_BE_NONE = {"adversary_horizon_s", "intruder_horizon_s", "move_s", "horizon_s", "edge_m", "beyond_m"}
MAY_BE_INFINITE = {
    *("adversary_horizon_s", "intruder_horizon_s", "cbf_rate_per_s", "table_cbf_rate_per_s", "static_cbf_rate_per_s"),
    *("deadlock_timeout_s", "max_track_age_s", "work_budget"),
}


@pytest.mark.parametrize("name", RANGES)
def test_a_number_is_taken_where_it_makes_sense_and_else_refused_by_name(name):
    for value in (math.nan, "2.5", True, [1.0], {}, 1 + 1j):
        with pytest.raises(ConfigError, match=f"^{name} is .*give a number"):
            ShieldConfig(**{name: value})
    for value, taken in (
        (-0.25, ()),
        (0.0, set(RANGES) - ABOVE_ZERO),
        (None, MAY_BE_NONE),
        (math.inf, MAY_BE_INFINITE),
    ):
        if name in taken:
            assert getattr(ShieldConfig(**{name: value}), name) == value
        else:
            with pytest.raises(ConfigError, match=f"^{name} is {value}"):
                ShieldConfig(**{name: value})
    low, high, _ = RANGES[name]
    for value in {low if low > 0.0 else 0.25, high}:
        more = {"dt_s": value} if name == "dt_s" else {"dt_s": 1.0} if name == "move_s" else {}
        assert getattr(ShieldConfig(**{name: value, **more}), name) == value


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("separation_m", 2500, r"2500 \(if that is mm, give 2.5\); give more than 0 and at most 1000 m"),
        ("dt_s", 100.0, r"100.0 \(if that is ms, give 0.1\); give 0.01 to 2 s"),
        ("current_mps", 300, r"300 \(if that is mm/s, give 0.3\); give 0 to 10 m/s"),
        ("track_error_mps", 51, "51; give 0 to 50 m/s$"),
        ("speed_weight", 1e7, r"10000000.0; give more than 0 and at most 1e\+06$"),
        ("work_budget", 10, "10; give 1000 to inf clearances$"),
        ("cbf_rate_per_s", -1, "-1; give more than 0 and at most inf 1/s$"),
        ("separation_m", 10**400, "too large; give a finite number"),
    ],
)
def test_a_number_of_another_unit_is_told_its_range_and_what_it_may_be(name, value, text):
    with pytest.raises(ConfigError, match=f"^{name} is {text}"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("value", [None, 3, ["daqp"], True])
def test_names_must_be_texts(name, value):
    with pytest.raises(ConfigError, match=f"{name} is .*give a name"):
        ShieldConfig(**{name: value})


@pytest.mark.parametrize(
    ("name", "known"), [("opponent_model", OPPONENT_MODELS), ("coordination", COORDINATION), ("profile", PROFILES)]
)
def test_unknown_names_are_told_the_known_ones(name, known):
    with pytest.raises(ConfigError, match=f"unknown {name} 'magic'; choose one of {', '.join(known)}"):
        ShieldConfig(**{name: "magic"})


def test_a_backend_that_is_not_installed_is_told_with_the_remedy():
    with pytest.raises(SolverError, match=r"'gurobi' is unknown .*not installed; choose one of .*daqp.*, or install"):
        Shield(solver="gurobi")


@pytest.mark.parametrize("entry", fields(ShieldConfig), ids=lambda entry: entry.name)
def test_a_misspelt_key_is_told_the_nearest_known_one(entry):
    misspelt = entry.name[:2] + entry.name[3:]
    with pytest.raises(ConfigError, match=f"unknown shield setting '{misspelt}'; did you mean '{entry.name}'"):
        ShieldConfig.of(**{misspelt: 1.0})


@pytest.mark.parametrize("key", ["separation", "radius_m", "separation_km", "dt", "DT_S"])
def test_keys_without_their_unit_are_unknown(key):
    with pytest.raises(ConfigError, match="unknown shield setting"):
        ShieldConfig.of(**{key: 1.0})
    with pytest.raises(ConfigError, match=r"known settings: separation_m, .*barriers"):
        Shield(zzz=1)


@pytest.mark.parametrize(
    ("config", "more", "told"),
    [
        (ShieldConfig(), {"separation_m": 3.0}, "not both"),
        ({"separation_m": 3.0}, {}, r"config is a dict; give a ShieldConfig, or settings: Shield\(\*\*settings\)"),
        (None, {"surroundings": (0, 0, 10, 10)}, r"surroundings are a tuple; build them with Surroundings\("),
    ],
)
def test_arguments_of_another_kind_are_refused(config, more, told):
    with pytest.raises(ConfigError, match=told):
        Shield(config, **more)


def test_a_config_cannot_be_changed_behind_the_shields_back():
    config = ShieldConfig()
    assert Shield(config).config is config
    with pytest.raises(FrozenInstanceError):
        config.separation_m = 0.1
    for error in (ConfigError, SolverError):
        assert issubclass(error, SteerclearError)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, int])
def test_numbers_of_any_kind_are_kept_as_floats_for_compiled_code(kind):
    config = ShieldConfig(separation_m=kind(3), margin_cap_m=kind(0), horizon_s=kind(6), edge_m=None)
    assert config == ShieldConfig(separation_m=3.0, margin_cap_m=0.0, horizon_s=6.0, edge_m=None)
    assert {type(config.separation_m), type(config.margin_cap_m), type(config.horizon_s)} == {float}
