"""Delay, position errors and current in a game."""

from dataclasses import replace

import numpy as np
import pytest
from steerclear.env.mctf import MctfEnv
from steerclear.experiments import verdicts
from steerclear.experiments.play.conditions import CALM, Conditions, Disturbances
from steerclear.experiments.play.match import Match
from steerclear.experiments.play.spec import MatchSpec
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat

ALL = Conditions(delay_s=0.3, noise_m=0.5, current_mps=0.3)
SHORT = {"max_time_s": 10.0}


def spec_of(conditions, own="medium", opponent="medium", **settings):
    rules = settings.pop("rules", SHORT)
    return MatchSpec("aamas2024", own, opponent, rules=rules, conditions=conditions, **settings)


def watched(spec):
    """Per step of a game the errors (T, n, 2) of positions as shields see them; and the match."""
    match, seen = Match(spec), []
    record = match.play(lambda env: seen.append(match.shielding.disturbances.seen[:, :2]) or True).record
    return np.array(seen) - record["position"][:-1], match


@pytest.mark.parametrize("shield", [None, {}])
def test_without_conditions_a_game_is_bit_for_bit_what_it_was(shield, monkeypatch):
    plain = Match(spec_of(CALM, shield=shield))
    assert plain.shielding.disturbances is None
    plain = plain.play()
    monkeypatch.setattr(Conditions, "calm", False)  # the hooks are in place and have nothing to do
    hooked = Match(spec_of(CALM, shield=shield))
    assert hooked.shielding.disturbances is not None
    hooked = hooked.play()
    for name, array in plain.record.items():
        np.testing.assert_array_equal(array, hooked.record[name])


@pytest.mark.parametrize(("side", "shield"), [("blue", None), ("red", {})])
def test_own_boats_obey_so_many_steps_later_and_all_are_carried(side, shield):
    """The one law of motion that the oracle takes a game to have: command of k steps ago, plus the way of the water."""
    match = Match(spec_of(replace(ALL, delay_s=0.25), side=side, shield=shield, judge="all", seed=1))
    filtered = match.play().record["filtered"]
    states, motion, params = match._log.states, match.shielding.motion, match.env.core.params
    assert motion.delay_steps == ((3, 3, 3, 0, 0, 0) if side == "blue" else (0, 0, 0, 3, 3, 3))
    assert np.hypot(*motion.current_mps) == pytest.approx(0.3)
    drift = 0.1 * np.array(motion.current_mps)
    for k in range(len(filtered)):
        for i, late in enumerate(motion.delay_steps):
            moved = states[k, i].copy()
            speed, course = filtered[k - late, i] if k >= late else states[0, i, [L.SPEED, L.HEADING]]
            step_boat(params[i], moved, speed, (course - moved[L.HEADING] + 180.0) % 360.0 - 180.0, 0.1)
            moved[[L.X, L.Y]] += drift
            np.testing.assert_allclose(moved[: L.SPEED + 1], states[k + 1, i, : L.SPEED + 1], atol=1e-5)
    changed = np.abs(np.diff(filtered[:, :, 1], axis=0)) > 1.0
    assert changed[:, : 3 if side == "blue" else 6].any()


def test_errors_stay_within_the_bound_and_change_slowly():
    errors, match = watched(spec_of(Conditions(noise_m=0.8), rules={"max_time_s": 30.0}))
    size = np.linalg.norm(errors, axis=-1)
    assert size.max() <= 0.8 + 1e-9
    assert (size.max(axis=0) > 0.5).all()
    assert (errors.std(axis=0) > 0.1).all()
    assert np.linalg.norm(np.diff(errors, axis=0), axis=-1).mean() < 0.2
    assert len({round(value, 9) for value in errors[0].ravel()}) == errors[0].size  # each boat has its own
    assert match.shielding.wrappers == []


def test_off_and_on_share_their_draws_and_another_seed_has_others():
    (off, a), (on, b), (other, c) = (watched(spec_of(ALL, **s)) for s in ({}, {"shield": {}}, {"seed": 1}))
    np.testing.assert_allclose(off, on, atol=1e-12)
    assert a.shielding.motion == b.shielding.motion != c.shielding.motion
    assert np.abs(off - other).max() > 0.1
    seen = b.shielding.wrappers[0].decisions.fleet.state
    np.testing.assert_array_equal(seen, b.shielding.disturbances.seen)


def test_a_boat_carried_over_the_edge_is_out_of_bounds_and_comes_back():
    env = MctfEnv("aamas2024")
    sea = Disturbances(env, Conditions(current_mps=0.4), 0, 0)
    sea.current_mps[:] = -0.4, 0.0
    env.reset(seed=0)
    env.core.state[0, 0, [L.X, L.Y]] = 0.1, 5.0
    sea.begin()
    env.command_filter = sea.carry
    out = []
    for _ in range(400):
        env.step({})
        x = env.core.state[0, 0, L.X]
        assert env.core.oob[0, 0] == (x <= 0.0)
        out.append(bool(env.core.oob[0, 0]))
        if any(out) and not out[-1]:
            break
    assert out.index(True) == 2
    assert not out[-1]


def test_a_shield_is_told_of_delay_and_noise_unless_its_settings_say_otherwise():
    def config(**shield):
        return Match(spec_of(replace(ALL, delay_s=0.25), shield=shield)).shielding.wrappers[0].shield.config

    assert (config().delay_s, config().position_error_m) == (pytest.approx(0.3), 0.5)
    assert config(delay_s=0.1).delay_s == 0.1
    assert (config(position_error_m=0).position_error_m, config(position_error_m=0).delay_s) == (0, pytest.approx(0.3))
    calm = Match(spec_of(CALM, shield={})).shielding.wrappers[0].shield.config
    assert (calm.delay_s, calm.position_error_m) == (0.0, 0.0)


@pytest.mark.parametrize("side", ["blue", "red"])
def test_the_other_teams_shield_is_not_told_of_a_delay_its_boats_do_not_have(side):
    match = Match(spec_of(ALL, side=side, shield={}, opponent_shield={}))
    own, other = (wrapped.shield.config for wrapped in match.shielding.wrappers)
    assert (own.delay_s, other.delay_s) == (pytest.approx(0.3), 0.0)
    assert own.position_error_m == other.position_error_m == 0.5


def test_the_oracle_is_told_of_the_same_physics(monkeypatch):
    told, ask = [], verdicts.oracle.judge_violations

    def note(*args, motion, **kwargs):
        told.append(motion)
        return ask(*args, motion=motion, **kwargs)

    monkeypatch.setattr(verdicts.oracle, "judge_violations", note)
    match = Match(spec_of(ALL, seed=1, judge="all", rules={"max_time_s": 40.0}))
    row = match.play().row
    assert told == [match.shielding.motion]
    assert told[0].delay_steps == (3, 3, 3, 0, 0, 0)
    assert row["violations"]


def test_a_current_that_nobody_comes_back_against_is_refused():
    with pytest.raises(ConfigError, match="driven back at 1 m/s; give less"):
        Match(spec_of(Conditions(current_mps=1.0)))
    Match(spec_of(Conditions(current_mps=1.0), rules={"oob_speed_frac": 0.6}))
