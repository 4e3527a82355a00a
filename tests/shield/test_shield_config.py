"""Settings and surroundings are checked when they are given; old names are taken with a warning."""

import copy
import math
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import CallError, ConfigError
from steerclear.shield.platforms import fresh_state
from steerclear.shield.renamed import DECISION, DECISIONS, PROFILES, SETTINGS, current_settings

RANGES = {entry.name: entry.metadata["range"] for entry in fields(ShieldConfig) if "range" in entry.metadata}

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


@pytest.mark.parametrize("entry", fields(ShieldConfig), ids=lambda entry: entry.name)
def test_a_misspelt_key_is_told_the_nearest_known_one(entry):
    misspelt = entry.name[:2] + entry.name[3:]
    with pytest.raises(ConfigError, match=f"unknown shield setting '{misspelt}'; did you mean '{entry.name}'"):
        ShieldConfig.of(**{misspelt: 1.0})


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, int])
def test_numbers_of_any_kind_are_kept_as_floats_for_compiled_code(kind):
    config = ShieldConfig(separation_m=kind(3), margin_cap_m=kind(0), horizon_s=kind(6), edge_m=None)
    assert config == ShieldConfig(separation_m=3.0, margin_cap_m=0.0, horizon_s=6.0, edge_m=None)
    assert {type(config.separation_m), type(config.margin_cap_m), type(config.horizon_s)} == {float}


TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (2.0, 3.0)]

HARBOUR = Surroundings((0, 0, 40, 20), [(1, 2, 3)], [TRIANGLE], [(5, 5, 2)], [(7, 7, 3)])


def test_packing_widens_by_the_distances_of_the_settings_and_by_what_positions_may_be_off():
    exact, off = (
        HARBOUR.pack(ShieldConfig(edge_m=0.5, obstacle_clearance_m=1.5, position_error_m=error_m))
        for error_m in (0.0, 0.25)
    )
    assert exact.field.tolist() == [0.5, 0.5, 39.5, 19.5]
    assert exact.circles.tolist() == [[1.0, 2.0, 4.5], [7.0, 7.0, 3.0]]  # a circle that stops boats has no hull
    assert exact.keep_out.tolist() == [[5.0, 5.0, 2.0]]
    assert exact.segment_m == 1.5
    starts, ends = ({tuple(row) for row in rows} for rows in (exact.segments[:, :2], exact.segments[:, 2:]))
    assert starts == ends == set(TRIANGLE), "walls of a polygon close"
    np.testing.assert_allclose(off.field - exact.field, [0.25, 0.25, -0.25, -0.25])
    np.testing.assert_allclose(off.circles[:, 2] - exact.circles[:, 2], 0.25)
    np.testing.assert_allclose(off.keep_out[:, 2] - exact.keep_out[:, 2], 0.25)
    assert off.segment_m - exact.segment_m == 0.25
    np.testing.assert_array_equal(off.segments, exact.segments)
    assert np.isinf(HARBOUR.pack(ShieldConfig(edge_m=None)).field).all()


def test_a_field_of_which_nothing_is_left_is_refused_when_the_shield_is_built():
    small = Surroundings(field=(0.0, 0.0, 40.0, 3.0))
    Shield(ShieldConfig(edge_m=0.5, position_error_m=0.9), small)
    with pytest.raises(ConfigError, match=r"too small to keep 1\.6 m inside its edge; give a larger field"):
        Shield(ShieldConfig(edge_m=0.5, position_error_m=1.1), small)
    Shield(ShieldConfig(edge_m=None, position_error_m=1.1), small)


@pytest.mark.parametrize(("old", "new"), SETTINGS.items())
def test_a_setting_is_taken_by_its_old_name_with_a_warning(old, new):
    value = "turning_circle" if old == "certificate" else 1500.0 if old == "search_limit" else 1.5
    for make in (ShieldConfig, ShieldConfig.of, lambda **one: Shield(**one).config):
        with pytest.warns(DeprecationWarning, match=f"'{old}' is now '{new}'"):
            config = make(**{old: value})
        assert getattr(config, new) == value
        with pytest.warns(DeprecationWarning, match=new):
            assert getattr(config, old) == value
    with pytest.warns(DeprecationWarning, match=new):
        assert getattr(replace(ShieldConfig(), **{old: value}), new) == value


@pytest.mark.parametrize(("old", "new"), PROFILES.items())
def test_a_profile_is_taken_by_its_old_name(old, new):
    with pytest.warns(DeprecationWarning, match=new):
        assert ShieldConfig(profile=old) == ShieldConfig(profile=new)


def test_decisions_are_read_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="adversary_horizon_s"):
        told = Fleet.of(
            position_m=[[0, 0], [0, 30]],
            heading_deg=[0, 180],
            speed_mps=[1, 1],
            team=[0, 1],
            platforms="heron",
            adversary_s=[math.nan, 3.0],
        )
    with pytest.warns(DeprecationWarning, match="adversary_horizon_s"):
        assert told.adversary_s is told.adversary_horizon_s
    decisions = Shield().decide(told, Commands.relative_deg([[1.0, 0.0]] * 2))
    for owner, names in ((decisions, DECISIONS), (decisions[0], DECISION)):
        for old, new in names.items():
            with pytest.warns(DeprecationWarning, match=f"'{old}' is now '{new}'"):
                assert getattr(owner, old) is getattr(owner, new)
        with pytest.raises(AttributeError, match="no attribute 'wnated'"):
            owner.wnated  # noqa: B018
        assert copy.copy(owner).reason is owner.reason
    assert pickle.loads(pickle.dumps(decisions[0])) == decisions[0]


def test_stored_settings_are_read_without_a_warning(caplog):
    stored = {"adversary_s": 5.0, "profile": "rammers", "separation_m": 4.0, "barriers": ["ferry"]}
    now = {"adversary_horizon_s": 5.0, "profile": "ramming", "separation_m": 4.0, "barriers": ["ferry"]}
    assert current_settings(stored) == current_settings(now) == now
    assert not caplog.text
    assert current_settings(stored, warned=True) == now
    assert "adversary_s is now adversary_horizon_s" in caplog.text
    assert "rammers is now ramming" in caplog.text


def test_decide_takes_nominal_commands_by_their_old_name_too_and_warns():
    fleet = Fleet.of(position_m=[[0, 0]], heading_rad=[0.0], speed_mps=[1.0], team=[0], platforms="heron")
    commands = Commands.absolute_deg([[1.0, 0.0]])
    with pytest.warns(DeprecationWarning, match="'wanted' is now 'nominal'"):
        old = Shield().decide(fleet, wanted=commands)
    assert (old.filtered.values == Shield().decide(fleet, commands).filtered.values).all()
    with pytest.raises(TypeError, match="nominal"):
        Shield().decide(fleet)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Fleet.of(heading=[0.0]), "Fleet.of has no heading=; did you mean heading_rad= or heading_deg=?"),
        (lambda: Fleet.of(speed_mps=[1.0]), "Fleet.of was called without position_m, team, platforms; it takes"),
        (lambda: Shield().decide(None), "Shield.decide was called without nominal; it takes fleet, nominal, surround"),
        (lambda: Shield().decide(None, None, None, 4), r"got 4 arguments without a name and takes \(fleet, nominal"),
        (lambda: Surroundings(polygon=()), "Surroundings has no polygon=; did you mean polygons=?"),
        (lambda: ShieldConfig(separation=3.0), "ShieldConfig has no separation=; did you mean separation_m="),
        (lambda: BatchedShield(ShieldConfig(), game=3), "BatchedShield has no game=; did you mean games="),
    ],
)
def test_a_call_with_wrong_arguments_names_the_right_ones(call, words):
    with pytest.raises(CallError, match=words.replace("?", r"\?")):
        call()
    assert issubclass(CallError, TypeError)


def test_a_shield_says_in_one_line_what_it_keeps_and_for_whom():
    shield = Shield(separation_m=4.0, surroundings=Surroundings(field=(0.0, 0.0, 160.0, 80.0)))
    kept = "<Shield: separation 4 m, profile competitive, a decision every 0.1 s; area (0, 0, 160, 80) m; "
    assert repr(shield) == kept + "no boats yet>"
    fleet = Fleet.of(
        position_m=[[20, 20], [80, 40], [90, 60]],
        heading_rad=[0.0] * 3,
        speed_mps=[1.0] * 3,
        team=[0, 0, 1],
        platforms=["heron", "heron", "surveyor"],
    )
    shield.decide(fleet, Commands.absolute_rad([[1.0, 0.0]] * 3))
    assert repr(shield) == kept + "2 heron of team 0, 1 surveyor of team 1>"


def test_a_batch_takes_nominal_commands_by_their_old_name_too_and_warns():
    shield = BatchedShield(ShieldConfig(), 1, ("heron",), (0,))
    state, nominal = fresh_state(0.0, 0.0, 0.0)[None, None], np.array([[[1.0, 0.0]]])
    with pytest.warns(DeprecationWarning, match="'wanted' is now 'nominal'"):
        assert (shield.decide(state, wanted=nominal, ours=np.ones((1, 1), bool)) == nominal).all()
