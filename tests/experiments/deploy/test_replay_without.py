"""What would have happened without the shield: tracks, distances, verdicts."""

import dataclasses
import math

import numpy as np
import pytest
from logged_runs import NAMES, START_S, Encounter, header_of
from steerclear.env.record import find_breaches, read_meta, validate
from steerclear.experiments.deploy.tracks import BACK_S, GONE_S, TrackBuilder, placed, record_of, sail_without
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import LogError
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

STEPS = 250
PROMPT = ShieldConfig()


def tracks_of(ticks, header):
    builder = TrackBuilder(header)
    for tick in ticks:
        builder.add(tick)
    return builder.finish()


@pytest.fixture(scope="module")
def run():
    """Boats that all head for one point: header, ticks, tracks."""
    header = header_of(PROMPT)
    ticks = list(Encounter(header, STEPS))
    return header, ticks, tracks_of(ticks, header)


def closest_m(states, own):
    gap = np.linalg.norm(states[:, own, None, :2] - states[:, None, :, :2], axis=-1)
    gap[:, range(len(own)), own] = np.inf
    return np.nanmin(gap)


def test_tracks_are_what_was_seen(run):
    _, ticks, tracks = run
    assert tracks.names == NAMES
    assert tracks.ours.tolist() == [True, True, False, False]
    assert tracks.states.shape == (STEPS, 4, L.N_STATE)
    assert tracks.time_s[0] == pytest.approx(ticks[0].began_s - START_S)
    for k in (0, 1, 100, STEPS - 1):
        gap = tracks.states[k] - ticks[k].fleet.state
        gap[:, L.HEADING] = (gap[:, L.HEADING] + 180.0) % 360.0 - 180.0
        assert np.nan_to_num(gap) == pytest.approx(0.0, abs=1e-6)
    for k in (0, 77, STEPS - 2):
        decisions = ticks[k].decisions
        assert tracks.sent[k, 0] == pytest.approx(decisions.filtered.absolute(0, decisions.fleet.heading_rad[0]))
        assert tracks.wanted[k, 1] == pytest.approx(decisions.nominal.absolute(1, decisions.fleet.heading_rad[1]))
        assert np.array_equal(tracks.reason[k], decisions.reason)
        assert np.isnan(tracks.wanted[k, 2:]).all()  # nobody knows what opponents wanted


def test_without_the_shield_the_boats_collide(run):
    _, _, tracks = run
    without = sail_without(tracks)
    assert closest_m(tracks.states, [0, 1]) > PROMPT.separation_m
    assert closest_m(without.states, [0, 1]) < PROMPT.separation_m
    assert without.stretches >= 1


def test_boats_that_were_left_alone_stay_on_their_tracks_bit_for_bit(run):
    _, _, tracks = run
    without = sail_without(tracks)
    same = ~without.away
    same[:-1] &= ~tracks.intervened
    assert same.any()
    assert without.states[same].tobytes() == tracks.states[same].tobytes()
    assert without.states[:, 2:].tobytes() == tracks.states[:, 2:].tobytes()


def test_a_boat_that_was_changed_is_steered_by_what_was_wanted(run):
    _, _, tracks = run
    without = sail_without(tracks)
    k = int(np.flatnonzero(tracks.intervened[:, 0])[0])
    row = tracks.states[k, 0].copy()
    for later in range(k, k + 10):
        speed, heading = tracks.wanted[later, 0]
        error = (math.degrees(heading) - row[L.HEADING] + 180.0) % 360.0 - 180.0
        step_boat(get_platform("heron").pack(), row, speed, error, 0.1)
        assert without.states[later + 1, 0].tobytes() == row.tobytes()
    assert not without.away[k, 0]
    assert without.away[k + 1 : k + 11, 0].all()


def test_it_is_put_back_when_nothing_was_changed_for_a_while_and_commands_work_after_the_delay(run):
    _, _, tracks = run
    once = np.zeros_like(tracks.intervened)
    once[20, 0] = True
    changed = dataclasses.replace(tracks, intervened=once)
    without = sail_without(changed)
    assert np.flatnonzero(without.away[:, 0]).tolist() == list(range(21, 21 + round(BACK_S / 0.1)))
    assert not without.away[:, 1:].any()
    assert without.stretches == 1
    assert np.flatnonzero(sail_without(changed, delay_s=0.4).away[:, 0])[0] == 25


def test_the_unshielded_run_is_the_one_that_is_found(run):
    """From a first change on, what is steered by the recorded wishes is where an unshielded boat really goes."""
    header, _, tracks = run
    real = tracks_of(list(Encounter(header, STEPS, shielded=False)), header)
    without = sail_without(tracks)
    first = int(np.flatnonzero(tracks.intervened.any(axis=1))[0])
    gap = np.linalg.norm(without.states[:, 0, :2] - real.states[:, 0, :2], axis=1)
    assert gap[: first + 1].max() < 1e-6
    assert gap[: first + 15].max() < 0.2  # the wishes were made for where the shield led it


def test_a_wish_nobody_can_follow_leaves_the_boat_to_stop(run):
    _, _, tracks = run
    wanted = np.full_like(tracks.wanted, np.nan)
    without = sail_without(dataclasses.replace(tracks, wanted=wanted))
    assert np.isfinite(without.states[without.away]).all(axis=1).any()
    assert np.isfinite(without.states[..., : L.SPEED + 1]).all()


def test_ages_put_a_boat_back_to_where_it_was_then(run):
    header, ticks, tracks = run
    aged = [
        dataclasses.replace(t, fleet=dataclasses.replace(t.fleet, age_s=np.array([0.0, 0.0, 0.3, 0.0]))) for t in ticks
    ]
    late = tracks_of(aged, header)
    assert late.states[50, 2, :4] == pytest.approx(tracks.states[53, 2, :4], abs=1e-6)
    assert late.states[50, 0, :4] == pytest.approx(tracks.states[50, 0, :4], abs=1e-6)


def test_a_boat_nothing_was_heard_of_is_not_there(run):
    header, ticks, _ = run
    found = [_alone(tick) if 60 <= tick.number < 120 else tick for tick in ticks]
    tracks = tracks_of(found, header)
    assert np.isnan(tracks.states[90, 3, L.X])
    assert np.isfinite(tracks.states[[50, 130], 3, L.X]).all()
    assert np.isfinite(tracks.states[:, :3, L.X]).all()
    far = placed(tracks.states)
    assert np.isfinite(far[..., : L.SPEED]).all()
    assert far[90, 3, L.X] > 1e5
    record = record_of(header, tracks, tracks.states, "", True)
    validate(record)
    assert record["position"][90, 3] == pytest.approx(tracks.states[59, 3, :2], abs=2.0 * GONE_S)


def _alone(tick):
    parts = {name: getattr(tick.fleet, name)[:3] for name in ("state", "team", "platforms", "controlled", "names")}
    return dataclasses.replace(tick, fleet=dataclasses.replace(tick.fleet, **parts), decisions=None, wanted=None)


def test_ticks_that_come_unevenly_make_an_even_track(run):
    header, ticks, tracks = run
    shaken = [
        dataclasses.replace(tick, began_s=tick.began_s + 0.02 * math.sin(tick.number))
        for tick in ticks
        if tick.number % 7 != 3
    ]
    even = tracks_of(shaken, header)
    assert np.allclose(np.diff(even.time_s), 0.1)
    k = min(len(even.states), len(tracks.states))
    assert np.abs(even.states[:k, :, :2] - tracks.states[:k, :, :2]).max() < 0.25


def test_the_game_is_in_the_record(run):
    header, ticks, _ = run
    game = {
        "boats": {"blue_1": {"tagged": True, "has_flag": False, "oob": True, "driven": True}},
        "flags": [{"x_m": 1.0, "y_m": 2.0, "taken": False}, {"x_m": 3.0, "y_m": 4.0, "taken": True}],
        "captures": [2, 1],
    }
    tracks = tracks_of([dataclasses.replace(tick, game=game) for tick in ticks], header)
    record = record_of(header, tracks, tracks.states, "title", True)
    meta = read_meta(record)
    assert record["is_tagged"][:, 0].all()
    assert not record["is_tagged"][:, 1:].any()
    assert record["flag_position"][5].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert record["captures"][-1].tolist() == [2, 1]
    assert tracks.marked("driven")[:, 0].all()
    assert meta["shielded"] == ["blue_1", "blue_2"]
    assert meta["policies"] == {"blue": "collider", "red": ""}
    assert meta["separation_m"] == PROMPT.separation_m


def test_breaches_of_the_record_are_those_of_the_track(run):
    header, _, tracks = run
    without = sail_without(tracks)
    record = record_of(header, tracks, without.states, "", False)
    assert np.array_equal(record["breaches"], find_breaches(without.states[..., :2], PROMPT.separation_m))
    assert len(record["breaches"]) > 0
    assert (record["reason"] == 6).all()
    assert np.array_equal(record["wanted"], record["sent"], equal_nan=True)


def test_team_mates_of_another_process_are_not_ours(run):
    header, ticks, _ = run
    boats = tuple(dataclasses.replace(boat, ours=boat.name == "blue_1") for boat in header.boats)
    tracks = tracks_of(ticks, dataclasses.replace(header, boats=boats))
    assert tracks.ours.tolist() == [True, False, False, False]
    assert not sail_without(tracks).away[:, 1].any()


def test_a_log_without_boats_has_no_tracks(run):
    header, ticks, _ = run
    none = [dataclasses.replace(tick, fleet=None, decisions=None) for tick in ticks[:5]]
    for found in ([], ticks[:1], none):
        with pytest.raises(LogError, match="no two ticks with boats"):
            tracks_of(found, header)
