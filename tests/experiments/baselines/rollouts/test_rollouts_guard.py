"""gatekeeper and PL-CBF as guards: known answers, commands that pass, games of their own, refusals."""

import numpy as np
import pytest
from guard_scenes import ahead, scene
from steerclear.experiments.baselines.rollouts import NAMES, RolloutGuard, check_settings
from steerclear.experiments.baselines.rollouts.area import share_left
from steerclear.experiments.baselines.rollouts.paths import NO_PLAN
from steerclear.experiments.baselines.rollouts.settings import library, switch_steps
from steerclear.experiments.encounters.guards import check_guard, parse_guards
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

CONFIG = ShieldConfig(edge_m=None)
FILTERS = pytest.mark.parametrize("name", NAMES)
GATEKEEPERS = pytest.mark.parametrize("name", ["gatekeeper", "gatekeeper-worst"])
HERON = get_platform("heron").pack()


def guard_for(name, state, team=None, **settings):
    n = state.shape[1]
    return RolloutGuard(name, CONFIG, len(state), ("heron",) * n, team or tuple(range(n)), settings)


def sail(guard, state, ours, steps=200):
    """Closest distance of the first two boats and reasons of the first, all boats wanting to go straight on."""
    state, closest, reasons = state.copy(), np.inf, []
    for _ in range(steps):
        sent = ahead(state)
        if guard is not None:
            sent = guard.decide(state, ahead(state), ours).copy()
            reasons.append(int(guard.reason[0, 0]))
        for i in range(state.shape[1]):
            step_boat(HERON, state[0, i], sent[0, i, 0], sent[0, i, 1], 0.1)
        closest = min(closest, float(np.hypot(*(state[0, 0, :2] - state[0, 1, :2]))))
    return closest, reasons


@FILTERS
def test_head_on_in_open_water_keeps_the_radius(name):
    state, ours = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, False]])
    assert sail(None, state, ours)[0] < 1.0
    closest, reasons = sail(guard_for(name, state), state, ours)
    assert closest >= 2.5
    assert reasons[0] == 0
    assert set(reasons) > {0}
    assert reasons[-1] == 0


@FILTERS
def test_team_mates_that_meet_both_plan_for_each_other(name):
    state, ours = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, True]])
    closest, _ = sail(guard_for(name, state, team=(0, 0)), state, ours)
    assert closest >= 2.5


@FILTERS
def test_with_nobody_near_commands_pass_bit_for_bit(name):
    random = np.random.default_rng(1)
    state = scene((0, 0, 0), (600, 5, 90), (-700, 0, -90))
    guard = guard_for(name, state)
    for _ in range(20):
        wanted = np.stack([random.uniform(0, 2, (1, 3)), random.uniform(-40, 40, (1, 3))], axis=2)
        wanted[0, 1] = -0.0, 190.0
        sent = guard.decide(state, wanted, np.ones((1, 3), bool))
        assert sent.tobytes() == wanted.tobytes()
        assert (guard.reason == 0).all()
        assert np.isinf(guard.certificate_m).all()


@FILTERS
def test_boats_of_others_are_left_alone(name):
    state = scene((0, 0, 0), (0.5, 5, 180))
    wanted = ahead(state)
    wanted[0, 1] = np.nan, -0.0
    guard = guard_for(name, state)
    sent = guard.decide(state, wanted, np.array([[True, False]]))
    assert sent[0, 1].tobytes() == wanted[0, 1].tobytes()
    assert (sent[0, 0] != wanted[0, 0]).any()
    assert guard.reason.tolist() != [[0, 0]]
    assert np.isinf(guard.certificate_m[0, 1])


@GATEKEEPERS
def test_a_boat_already_inside_goes_on_with_what_it_committed_to(name):
    state, ours = scene((0, 0, 0), (0.5, 40, 180)), np.array([[True, False]])
    guard = guard_for(name, state)
    guard.decide(state, ahead(state), ours)
    assert guard.memory[0, 0, 0] >= 1.0
    first, _, _, speed, heading = guard.memory[0, 0]
    state[0, 1, : L.Y + 1] = 0.0, 1.0
    for _ in range(int(first)):
        sent = guard.decide(state, ahead(state, 1.0), ours)
        assert guard.reason[0, 0] == 2
        np.testing.assert_array_equal(sent[0, 0], [2.0, 0.0])  # what was wanted when it was committed to
        assert guard.certificate_m[0, 0] < 0.0
    sent = guard.decide(state, ahead(state, 1.0), ours)
    np.testing.assert_allclose(sent[0, 0], [speed, heading])


@GATEKEEPERS
def test_who_starts_inside_stops(name):
    state = scene((0, 0, 0), (0.5, 1, 180))
    sent = guard_for(name, state).decide(state, ahead(state), np.array([[True, False]]))
    np.testing.assert_array_equal(sent[0, 0], [0.0, 0.0])


def test_inside_the_radius_pl_cbf_answers_with_numbers():
    for gap in (0.0, 0.5, 2.4):
        state = scene((0, 0, 0), (0, gap, 180))
        guard = guard_for("pl-cbf", state)
        sent = guard.decide(state, ahead(state), np.array([[True, False]]))
        assert np.isfinite(sent).all()
        assert guard.certificate_m[0, 0] < 0.0


def test_the_worst_opponent_is_met_earlier_than_one_that_holds_course():
    state, ours = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, False]])
    first = [sail(guard_for(name, state), state, ours, 100)[1].index(1) for name in ("gatekeeper-worst", "gatekeeper")]
    assert first[0] < first[1]


def crowd(games=12, seed=4):
    random = np.random.default_rng(seed)
    boats = [zip(*random.uniform(-9, 9, (2, 4)), random.uniform(-180, 180, 4), strict=True) for _ in range(games)]
    return np.concatenate([scene(*one) for one in boats])


@FILTERS
def test_batches_are_games_one_by_one_and_decisions_repeat(name):
    state = crowd()
    ours = np.tile([True, True, False, False], (len(state), 1))
    batch, twin = guard_for(name, state, (0, 0, 1, 1)), guard_for(name, state, (0, 0, 1, 1))
    sent = [batch.decide(state, ahead(state), ours).copy() for _ in range(2)]
    assert [twin.decide(state, ahead(state), ours).tobytes() for _ in range(2)] == [one.tobytes() for one in sent]
    assert np.isfinite(sent).all()
    for b in range(0, len(state), 3):
        alone = guard_for(name, state[:1], (0, 0, 1, 1))
        for one in sent:
            assert alone.decide(state[b : b + 1], ahead(state[:1]), ours[:1])[0].tobytes() == one[b].tobytes()


@FILTERS
def test_reason_tells_whether_a_command_was_changed(name):
    state = crowd(60)
    ours = np.tile([True, True, True, False], (60, 1))
    guard = guard_for(name, state, (0, 0, 0, 1))
    sent = guard.decide(state, ahead(state), ours)
    changed = (sent != ahead(state)).any(axis=2)
    assert not changed[guard.reason == 0].any()
    assert changed[ours].any()
    assert changed[guard.reason == 1].all()
    assert ((sent[..., 0] >= 0.0) & (sent[..., 0] <= 2.0)).all()
    assert (np.abs(sent[..., 1]) <= 180.0).all()


def test_reset_forgets_what_was_committed():
    state, ours = scene((0, 0, 0), (0.5, 20, 180)), np.array([[True, False]])
    guard = guard_for("gatekeeper", state)
    guard.decide(state, ahead(state), ours)
    guard.reset(np.array([True]))
    assert (guard.memory == NO_PLAN).all()
    assert np.isinf(guard.certificate_m).all()


@pytest.mark.parametrize(("pick", "least_m"), [("area", 2.5), ("nearest", 2.5)])
def test_both_ways_to_pick_a_mode_keep_clear_of_a_crossing_boat(pick, least_m):
    state, ours = scene((0, 0, 0), (18, 20, -90)), np.array([[True, False]])
    assert sail(None, state, ours, 150)[0] < 1.5
    assert sail(guard_for("pl-cbf", state, pick=pick), state, ours, 150)[0] >= least_m


@pytest.mark.parametrize(
    ("row", "need", "share"),
    [((1.0, 0.0), -5.0, 1.0), ((1.0, 0.0), 5.0, 0.0), ((1.0, 0.0), 0.0, 0.5), ((0.0, -1.0), 0.5, 0.25),
     ((1.0, 1.0), 0.0, 0.5), ((1.0, 1.0), 1.0, 0.125), ((0.0, 0.0), -1.0, 1.0), ((0.0, 0.0), 1.0, 0.0)],
)  # fmt: skip
def test_share_of_the_inputs_that_a_row_leaves(row, need, share):
    square = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    assert share_left(np.array(row), need, square) == pytest.approx(share)


def test_a_box_without_width_is_measured_along_its_line():
    line = np.array([[0.3, 0.3], [-1.0, 1.0]])
    assert share_left(np.array([0.0, 1.0]), 0.5, line) == pytest.approx(0.25)
    assert share_left(np.array([1.0, 0.0]), 0.2, line) == 1.0
    assert share_left(np.array([1.0, 0.0]), 0.4, line) == 0.0


def test_the_library_is_the_same_to_either_side():
    turns = library()
    assert sorted(turns[:, 0]) == sorted(-turns[:, 0])
    assert turns[-1].tolist() == [0.0, 0.0]
    assert switch_steps(4.0, 0.1).tolist() == [40, 20, 10, 5, 1, 0]
    assert switch_steps(0.1, 0.1).tolist() == [1, 0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gatekeeper:horizon=3", "no setting 'horizon'; it knows horizon_s, switch_s"),
        ("gatekeeper:horizon_s=0", "at least 0.1, at most 60"),
        ("gatekeeper-worst:switch_s=31", "at most 30"),
        ("gatekeeper:alpha_per_s=1", "no setting 'alpha_per_s'"),
        ("pl-cbf:alpha_per_s=0", "above 0, at most 10"),
        ("pl-cbf:alpha_per_s=nan", "give a number"),
        ("pl-cbf:horizon_s=true", "give a number"),
        ("pl-cbf:pick=both", "choose area or nearest"),
        ("pl-cbf:separation_m=3", "set it with --radius"),
    ],
)
def test_bad_settings_are_refused(text, words):
    with pytest.raises(ConfigError, match=words):
        check_guard(text)


def test_settings_are_read_from_the_name():
    assert parse_guards("gatekeeper:horizon_s=6,switch_s=2,pl-cbf") == ["gatekeeper:horizon_s=6,switch_s=2", "pl-cbf"]
    assert check_settings("gatekeeper", {"horizon_s": 6}).horizon_s == 6
    with pytest.raises(ConfigError, match="unknown filter 'keeper'"):
        check_settings("keeper", {})


@FILTERS
def test_what_is_not_a_number_is_refused(name):
    state = scene((0, 0, 0), (20, 0, 0))
    guard, ours = guard_for(name, state), np.array([[True, False]])
    broken = state.copy()
    broken[0, 1, L.X] = np.nan
    with pytest.raises(FleetError, match="not finite"):
        guard.decide(broken, ahead(state), ours)
    wanted = ahead(state)
    wanted[0, 0, 1] = np.inf
    with pytest.raises(FleetError, match="wanted command"):
        guard.decide(state, wanted, ours)
    with pytest.raises(ConfigError, match="no delay"):
        RolloutGuard(name, ShieldConfig(delay_s=0.2), 1, ("heron",), (0,))
