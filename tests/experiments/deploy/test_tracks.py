"""A log as tracks: where boats were at even steps of time, and the record of a game made of them."""

import dataclasses
import math

import numpy as np
import pytest
from logged_runs import NAMES, START_S, Encounter, header_of
from steerclear.env.record import find_violations, read_meta, validate
from steerclear.experiments.deploy.tracks import GONE_S, TrackBuilder, placed, record_of
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import LogError
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
        assert tracks.filtered[k, 0] == pytest.approx(decisions.filtered.absolute(0, decisions.fleet.heading_rad[0]))
        assert tracks.nominal[k, 1] == pytest.approx(decisions.nominal.absolute(1, decisions.fleet.heading_rad[1]))
        assert np.array_equal(tracks.reason[k], decisions.reason)
        assert np.isnan(tracks.nominal[k, 2:]).all()  # nobody knows what opponents nominal


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
    record = record_of(header, tracks)
    validate(record)
    assert np.array_equal(record["violations"], find_violations(placed(tracks.states)[..., :2], PROMPT.separation_m))
    assert record["position"][90, 3] == pytest.approx(tracks.states[59, 3, :2], abs=2.0 * GONE_S)


def _alone(tick):
    parts = {name: getattr(tick.fleet, name)[:3] for name in ("state", "team", "platforms", "controlled", "names")}
    return dataclasses.replace(tick, fleet=dataclasses.replace(tick.fleet, **parts), decisions=None, nominal=None)


def test_ticks_that_come_unevenly_make_an_even_track(run):
    header, ticks, tracks = run
    shaken = [
        dataclasses.replace(tick, began_s=tick.began_s + 0.02 * math.sin(tick.number))
        for tick in ticks
        if tick.number % 7 != 3
    ]
    shaken.insert(50, shaken[49])  # a turn that stands twice
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
    boats = tuple(dataclasses.replace(boat, ours=boat.name == "blue_1") for boat in header.boats)
    # blue_2 is steered by another process; the rules for the radii to draw are not known
    header = dataclasses.replace(header, boats=boats, preset="chess")
    tracks = tracks_of([dataclasses.replace(tick, game=game) for tick in ticks], header)
    record = record_of(header, tracks)
    meta = read_meta(record)
    assert record["is_tagged"][:, 0].all()
    assert not record["is_tagged"][:, 1:].any()
    assert record["flag_position"][5].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert record["captures"][-1].tolist() == [2, 1]
    assert tracks.marked("driven")[:, 0].all()
    assert meta["shielded"] == ["blue_1"]
    assert meta["policies"] == {"blue": "collider", "red": ""}
    assert meta["separation_m"] == PROMPT.separation_m


def test_a_log_without_boats_has_no_tracks(run):
    header, ticks, _ = run
    none = [dataclasses.replace(tick, fleet=None, decisions=None) for tick in ticks[:5]]
    for found in ([], ticks[:1], none):
        with pytest.raises(LogError, match="no two ticks with boats"):
            tracks_of(found, header)
