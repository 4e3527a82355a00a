"""What every filter that has a name answers for, whatever it is made of; then what each alone answers for."""

import numpy as np
import pytest
from steerclear.experiments.baselines.plcbf import share_left
from steerclear.experiments.baselines.reach import ReachFilter
from steerclear.experiments.baselines.registry import FILTERS, NONE, SHIELD
from steerclear.experiments.baselines.textbook import BARRIERS, Barrier, TextbookFilter
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.outcomes import tally
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.platforms import Platform, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, table_value
from steerclear.shield.workspace import NOT_COVERED, PASSED

CONFIG = ShieldConfig(edge_m=None)
NAMES = [name for name in FILTERS if name not in (NONE, SHIELD)]
ALL = pytest.mark.parametrize("name", NAMES)
FAR = pytest.mark.parametrize("name", [name for name in NAMES if name != "parabolic"])
"""With the gains tuned for herons the parabola still asks for something of boats half a kilometre apart."""
HOLDS = ("reach",)
"""Those that hold a boat without a usable command; the others refuse."""
HERON = get_platform("heron").pack()


def scene(*boats, speed=2.0):
    """One game of boats given as (x, y, heading deg), under way."""
    state = np.array([[fresh_state(x, y, heading, speed) for x, y, heading in boats]])
    state[..., L.THRUST] = 100.0
    return state


def crowd(games, seed=2, reach_m=14.0, boats=4):
    """Games of boats at random places."""
    random = np.random.default_rng(seed)
    spots = [
        zip(*random.uniform(-reach_m, reach_m, (2, boats)), random.uniform(-180, 180, boats), strict=True)
        for _ in range(games)
    ]
    return np.concatenate([scene(*one) for one in spots])


def ahead(state, speed=2.0):
    """Commands to go straight on."""
    wanted = np.zeros((*state.shape[:2], 2))
    wanted[..., 0] = speed
    return wanted


def filter_for(name, state, team=None, config=CONFIG, **settings):
    """The filter of a name, for herons."""
    n = state.shape[1]
    fleet = (config, len(state), ("heron",) * n, team or tuple(range(n)), OPEN_WATER)
    return FILTERS[name].make(*fleet, settings)


@FAR
def test_safe_commands_pass_bit_for_bit(name):
    random = np.random.default_rng(1)
    state = scene((0, 0, 0), (600, 5, 90), (-700, 0, -90))
    guard = filter_for(name, state)
    for _ in range(20):
        wanted = np.stack([random.uniform(0, 2, (1, 3)), random.uniform(-40, 40, (1, 3))], axis=2)
        sent = guard.decide(state, wanted, np.ones((1, 3), bool))
        assert sent.tobytes() == wanted.tobytes()
        assert (guard.reason == 0).all()


@ALL
def test_boats_of_others_are_left_alone_and_reset_forgets(name):
    state, ours = scene((0, 0, 0), (0.5, 5, 180)), np.array([[True, False]])
    wanted = ahead(state)
    wanted[0, 1] = np.nan, -0.0
    guard = filter_for(name, state)
    sent = guard.decide(state, wanted, ours).copy()
    assert sent[0, 1].tobytes() == wanted[0, 1].tobytes()
    assert (sent[0, 0] != wanted[0, 0]).any()
    assert guard.reason[0, 0] > 0
    assert np.isinf(guard.safety_margin_m[0, 1])
    guard.reset(np.array([True]))
    assert (guard.reason == 0).all()
    assert np.isinf(guard.safety_margin_m).all()
    assert (guard.memory == guard.forgotten).all()
    assert guard.decide(state, wanted, ours).tobytes() == sent.tobytes()


@ALL
def test_reason_tells_whether_a_command_was_changed(name):
    state, ours = crowd(100), np.tile([True, True, True, False], (100, 1))
    wanted = ahead(state)
    wanted[..., 1] = np.random.default_rng(3).uniform(-90, 90, state.shape[:2])
    guard = filter_for(name, state, team=(0, 0, 0, 1))
    sent = guard.decide(state, wanted, ours)
    changed = (sent != wanted).any(axis=2)
    assert np.isfinite(sent).all()
    assert not changed[guard.reason == 0].any()
    assert changed[guard.reason == 1].all()
    assert changed[ours].any()
    assert (np.abs(sent[changed][:, 1]) <= 180.0).all()
    assert ((sent[changed][:, 0] >= -1e-9) & (sent[changed][:, 0] <= 2.0 + 1e-9)).all()


@ALL
def test_batches_are_games_one_by_one_and_decisions_repeat(name):
    state, team = crowd(9, 4, 9.0), (0, 0, 1, 1)
    ours = np.tile([True, True, False, False], (len(state), 1))
    batch = filter_for(name, state, team)
    sent = [batch.decide(state, ahead(state), ours).copy() for _ in range(2)]
    for b in range(0, len(state), 3):
        alone = filter_for(name, state[:1], team)
        for one in sent:
            assert alone.decide(state[b : b + 1], ahead(state[:1]), ours[:1])[0].tobytes() == one[b].tobytes()


@ALL
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_what_is_not_a_number_never_passes(name, bad):
    state, ours = scene((0, 0, 0), (100, 0, 0)), np.array([[True, False]])
    guard, broken, wanted = filter_for(name, state), state.copy(), ahead(state)
    broken[0, 1, L.X] = bad
    with pytest.raises(FleetError, match="not finite"):
        guard.decide(broken, wanted, ours)
    wanted[0, 0, 1] = bad
    if name in HOLDS:
        assert guard.decide(state, wanted, ours)[0, 0].tolist() == [0.0, 0.0]
        return
    with pytest.raises(FleetError, match="nominal command"):
        guard.decide(state, wanted, ours)


@ALL
def test_a_fleet_that_does_not_fit_is_refused(name):
    state = scene((0, 0, 0), (20, 0, 0))
    guard, both = filter_for(name, state), np.ones((1, 2), bool)
    with pytest.raises(FleetError, match="nominal has shape"):
        guard.decide(state, np.zeros((1, 3, 2)), both)
    with pytest.raises(FleetError, match="state has shape"):
        guard.decide(state[0], ahead(state), both)
    make = FILTERS[name].make
    for config, games, platforms, words in (
        (ShieldConfig(delay_s=0.2), 1, ("heron",), "no delay"),
        (CONFIG, 0, ("heron",), "games is 0"),
        (CONFIG, 1, ("heron", "heron"), "one of each per boat"),
    ):
        with pytest.raises(ConfigError, match=words):
            make(config, games, platforms, (0,), OPEN_WATER, {})


@ALL
def test_head_on_is_avoided_and_commands_pass_again(name):
    outcome = measure("head_on", name, n=8, seed=3, judge=False)
    changed = outcome.columns["changed_share"]
    assert outcome.summary["violated"] == 0 < outcome.summary["unshielded_violated"]
    assert (changed > 0.0).mean() > 0.5
    assert (changed < 1.0).all()


def test_a_heron_keeps_off_a_rammer_by_the_table():
    summary = measure("rammer_1", "reach", n=6, seed=4, judge=False).summary
    assert (summary["unshielded_violated"], summary["violated"]) == (6, 0)
    assert summary["changed_percent"] < 95.0


def test_the_margin_of_the_table_is_the_value_after_the_step():
    """A teammate not decided for keeps its course for the step; the rest is the table's."""
    state, ours = scene((0, 0, 0), (4, 9, -120)), np.array([[True, False]])
    guard = filter_for("reach", state, team=(0, 0))
    guard.decide(state, ahead(state), ours)
    own, other = state[0].copy()
    for row in (own, other):
        step_boat(HERON, row, 2.0, 0.0, 0.1)
    tables = stack_tables([load_table("heron", "heron", "cooperative")])
    place, angles = other[:2] - own[:2], np.radians([own[L.HEADING], other[L.HEADING]])
    value = table_value(tables, 0, WHOLE_S, *place, *angles, own[L.SPEED], other[L.SPEED])
    assert guard.reason.tolist() == [[PASSED, NOT_COVERED]]
    assert guard.safety_margin_m[0, 0] == pytest.approx(value - 2.55, abs=1e-3)
    assert np.isinf(guard.safety_margin_m[0, 1])


def test_what_the_tables_cannot_tell_is_refused_with_the_remedy(monkeypatch, tmp_path):
    with pytest.raises(ConfigError, match="choose a smaller separation_m"):
        ReachFilter(ShieldConfig(separation_m=7.0), 1, ("heron",) * 2, (0, 1))
    monkeypatch.setenv("STEERCLEAR_TABLES", str(tmp_path))
    point = Platform(name="point", kind="single_integrator", max_speed_mps=2.0, max_turn_rate_dps=90.0)
    with pytest.raises(
        ConfigError, match=r"steerclear reach solve --own heron --other point\.yaml --other-may worst-case"
    ):
        ReachFilter(CONFIG, 1, ("heron", point), (0, 1))
    ReachFilter(CONFIG, 1, (point,), (0,))


GATEKEEPERS = pytest.mark.parametrize("name", ["gatekeeper", "gatekeeper-worst"])


@GATEKEEPERS
def test_a_boat_already_inside_goes_on_with_what_it_committed_to(name):
    state, ours = scene((0, 0, 0), (0.5, 40, 180)), np.array([[True, False]])
    guard = filter_for(name, state)
    guard.decide(state, ahead(state), ours)
    assert guard.memory[0, 0, 0] >= 1.0
    first, _, _, speed, heading = guard.memory[0, 0]
    state[0, 1, : L.Y + 1] = 0.0, 1.0
    for _ in range(int(first)):
        sent = guard.decide(state, ahead(state, 1.0), ours)
        assert guard.reason[0, 0] == 2
        np.testing.assert_array_equal(sent[0, 0], [2.0, 0.0])  # what was wanted when it was committed to
        assert guard.safety_margin_m[0, 0] < 0.0
    sent = guard.decide(state, ahead(state, 1.0), ours)
    np.testing.assert_allclose(sent[0, 0], [speed, heading])


def test_the_worst_opponent_is_met_earlier_than_one_that_holds_course():
    """Two boats head on: the step of the first changed command."""
    first = []
    for name in ("gatekeeper-worst", "gatekeeper"):
        state, ours, step = scene((0, 0, 0), (0.3, 40, 180)), np.array([[True, False]]), 0
        guard = filter_for(name, state)
        while step < 100:
            guard.decide(state, ahead(state), ours)
            if guard.reason[0, 0]:
                break
            for boat in state[0]:
                step_boat(HERON, boat, 2.0, 0.0, 0.1)
            step += 1
        first.append(step)
    assert first[0] < first[1] < 100


@pytest.mark.parametrize(
    ("row", "need", "share"),
    [((1.0, 0.0), -5.0, 1.0), ((1.0, 0.0), 5.0, 0.0), ((1.0, 0.0), 0.0, 0.5), ((0.0, -1.0), 0.5, 0.25),
     ((1.0, 1.0), 0.0, 0.5), ((1.0, 1.0), 1.0, 0.125), ((0.0, 0.0), -1.0, 1.0), ((0.0, 0.0), 1.0, 0.0)],
)  # fmt: skip
def test_share_of_the_inputs_that_a_row_leaves(row, need, share):
    square = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    assert share_left(np.array(row), need, square) == pytest.approx(share)


UNICYCLE = Platform(
    name="unicycle",
    kind="double_integrator",
    max_speed_mps=2.0,
    max_acc=1.0,
    max_turn_rate_dps=90.0,
    max_angular_acc_dps2=1e5,
)


def textbook(name, state, gains=None):
    n = state.shape[1]
    return TextbookFilter(name, CONFIG, len(state), ("heron",) * n, tuple(range(n)), gains)


def test_unknown_names_and_gains_of_another_filter_are_refused():
    state = scene((0, 0, 0), (20, 0, 0))
    with pytest.raises(ConfigError, match="unknown filter 'parabola'; choose one of velocity_cbf"):
        textbook("parabola", state)
    with pytest.raises(ConfigError, match="3 gains for velocity_cbf; give 1"):
        textbook("velocity_cbf", state, gains=(1.0, 2.0, 3.0))


def test_a_barrier_of_ones_own_is_a_filter_and_one_without_a_number_lets_nothing_through(monkeypatch, caplog):
    """The same row as the distance's, by another function: h = 3 (|p|^2 - R^2)."""

    def tripled(p, v, radius_m):
        return 3.0 * ((p * p).sum(axis=0) - radius_m**2), 6.0 * p, 6.0 * p

    def broken(p, v, radius_m):
        return np.full(p.shape[1:], np.nan), 6.0 * p, 6.0 * p

    for name, barrier in (("tripled", tripled), ("broken", broken)):
        monkeypatch.setitem(BARRIERS, name, Barrier(barrier, tuned={}, tried=((0.025,),), of_velocity=True))
    state, ours = crowd(30, 5, 8.0, boats=2), np.tile([True, False], (30, 1))
    sent = textbook("tripled", state).decide(state, ahead(state), ours)
    known = textbook("velocity_cbf", state, gains=(0.025,)).decide(state, ahead(state), ours)
    assert (sent != ahead(state)).any()
    np.testing.assert_allclose(sent, known, atol=1e-9)
    state = scene((0, 0, 0), (0.5, 3.0, 180))
    guard = textbook("broken", state)
    assert guard.decide(state, ahead(state), ours[:1])[0, 0, 0] == 0.0
    assert guard.reason[0, 0] == 3
    (message,) = caplog.messages
    assert "broken returned what is no number (h or a gradient) for p = (0.5, 3) m, and boats stop there" in message


@pytest.mark.parametrize("family", ["head_on", "crossing_left"])
@pytest.mark.parametrize(
    ("name", "gains"), [("exponential_cbf", (0.5, 0.5)), ("collision_cone", (1.0,)), ("parabolic", (1.0, 2.0, 2.0))]
)
def test_a_unicycle_keeps_the_radius_while_its_program_has_an_answer(name, gains, family):
    """In its own model a filter fails only where it says so: reason 2, no answer within the limits of the inputs."""

    def make(config, games, platforms, team, _around):
        return TextbookFilter(name, config, games, platforms, team, gains)

    played = play(draw(family, UNICYCLE, UNICYCLE, Conditions(), 3, 0, 16), make, Conditions())
    relaxed, violated = (played.reason[:, :, 0] > 1).mean(axis=0), tally(played)["closest_m"] < 2.5
    assert (relaxed[violated] > 0.0).all()
    assert not violated.all()
