"""A link against simulated boats behind stand-in MOOSDBs: what it reads, sends, refuses and leaves behind."""

import math
import time

import pytest
from moos_boats import fleet_of, fleet_text, link_of, sim_of
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import PILOT
from steerclear.shield.bridge.moos import client
from steerclear.shield.bridge.moos.checks import moos_checks
from steerclear.shield.bridge.moos.links import MoosLinks, MoosNominal
from steerclear.shield.bridge.preflight_checks import run_checks
from steerclear.shield.exceptions import ConfigError, FleetFileError, LinkError, LinkRefused
from steerclear.shield.platforms import layout as L
from waiting import until

FLEET = fleet_of(1, 1)


@pytest.fixture(scope="module")
def world():
    with sim_of(FLEET) as boats, link_of(FLEET) as (link, maker):
        yield boats, link, maker


@pytest.fixture
def community(world):
    world[1].read()
    return world[0].boats["blue_1"].community


def sent_for(link, seconds, heading=1.0, speed=1.5):
    for _ in range(round(10 * seconds)):
        link.send(heading, speed)
        time.sleep(0.1)


def texts_of(link, seconds=0.3):
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        found += link.read().texts
        time.sleep(0.02)
    return " ".join(found)


def test_it_reads_where_the_boat_is_and_the_boat_goes_where_it_is_told(world):
    boats, link, maker = world
    sent_for(link, 2.0)
    reading, row = link.read(), boats.states()["blue_1"]
    assert reading.ready
    assert reading.age_s < 0.5
    assert math.dist(reading.position_m, row[:2]) < 0.5
    assert reading.speed_mps > 0.3
    assert reading.heading_rad == pytest.approx(math.radians(row[L.HEADING]), abs=0.3)
    (contact,) = maker.sources()[0].read()
    assert contact.boat == "red_1"


def test_no_number_leaves(world):
    _, link, _ = world
    for heading, speed in ((math.nan, 1.0), (1.0, math.inf)):
        with pytest.raises(LinkError, match="finite"):
            link.send(heading, speed)


def test_a_hand_on_the_boat_is_seen_at_once_and_only_that_hand_lets_go(world, community):
    _, link, _ = world
    community.post("MOOS_MANUAL_OVERRIDE", "true", "pMarineViewer")
    began = time.monotonic()
    assert until(lambda: not link.read().ready)
    assert time.monotonic() - began < 0.5
    assert "pMarineViewer" in link.read().why_not
    assert (link.read().released, link.read().released_by) == (True, PILOT)  # his, also where nobody hears it any more
    with pytest.raises(LinkRefused, match="driven by hand"):
        link.prepare(1.0)
    community.post("MOOS_MANUAL_OVERRIDE", "false", "pMarineViewer")
    assert until(lambda: link.read().ready)
    assert not link.read().released


def test_nominal_commands_come_through_and_silence_of_a_second_is_a_stop(world, community):
    _, link, _ = world
    nominal = MoosNominal(FLEET, ("blue_1",))
    assert all(math.isnan(value) for value in nominal.latest().commands.values.ravel())
    nominal.use({"blue_1": link})
    assert nominal.latest().commands.values[0, 0] == 0.0
    community.post("RAW_DESIRED_HEADING", 120.0, "pHelmIvP")
    community.post("RAW_DESIRED_SPEED", 1.25, "pHelmIvP")
    assert until(lambda: tuple(nominal.latest().commands.values[0]) == (1.25, pytest.approx(math.radians(90.0))))
    began = time.monotonic()
    assert until(lambda: nominal.latest().commands.values[0, 0] == 0.0)
    assert 0.7 < time.monotonic() - began < 1.5
    assert "silent" in texts_of(link)
    community.post("RAW_DESIRED_HEADING", 120.0, "pHelmIvP")
    community.post("RAW_DESIRED_SPEED", 1.25, "pHelmIvP")
    community.post("IVPHELM_ALLSTOP", "MissingDecVars", "pHelmIvP")
    assert until(lambda: "all-stop" in texts_of(link, 0.05))
    assert nominal.latest().commands.values[0, 0] == 0.0
    community.post("IVPHELM_ALLSTOP", "clear", "pHelmIvP")


def test_checks_tell_what_is_there_and_what_nobody_can_know(world, community):
    _, link, _ = world
    community.post("DESIRED_HEADING", 270.0, "pBehave")
    assert until(lambda: link.other_commander()[0] == "pBehave")
    results = {result.name: result for result in run_checks(moos_checks({"blue_1": link}, FLEET, 1.0))}
    assert results["moosdb:blue_1"].passed, results["moosdb:blue_1"].text
    assert results["grid:blue_1"].passed, results["grid:blue_1"].text
    assert not results["mission:blue_1"].passed
    assert results["stop:blue_1"].passed
    assert "its PID, if set as the docs say, takes thrust off 2 s after" in results["stop:blue_1"].text
    assert "pBehave" in results["commanders:blue_1"].text


def test_two_sources_of_where_a_boat_is_do_not_pass():
    fleet = fleet_of(1, 1)

    def rates(link):
        checks = moos_checks({"blue_1": link}, fleet, 0.3)
        return run_checks(check for check in checks if check.name == "rates:blue_1")[0]

    with sim_of(fleet) as boats, link_of(fleet) as (link, _):
        assert rates(link).passed
        boats.boats["blue_1"].community.db.post("NAV_X", 0.0, "iGPS")
        assert until(lambda: len(link.writers["NAV_X"]) == 2)
        assert not rates(link).passed
        assert "NAV_X is written by iGPS and by uSimMarine" in rates(link).text


def test_a_frozen_moosdb_shows_as_age_and_the_boat_stops_by_itself(world, community, monkeypatch):
    boats, link, _ = world
    monkeypatch.setattr(client, "DEAD_S", 1.5)
    sent_for(link, 1.0)
    community.db.frozen.set()
    began = time.monotonic()
    assert until(lambda: link.read().age_s > 0.5)
    assert time.monotonic() - began < 1.0
    assert until(lambda: not link.read().ready, 6.0)  # no echo
    assert until(lambda: not boats.boats["blue_1"].is_commanded, 3.0)
    community.db.frozen.clear()
    assert until(lambda: link.read().ready and link.read().age_s < 0.5, 15.0)


def test_a_boat_nobody_simulates_is_told_with_its_address():
    fleet = fleet_of(1, 1)
    link = MoosLinks(fleet, MonotonicClock()).link(fleet.boat("blue_1"))
    with pytest.raises(LinkError, match="start it, or correct the address"):
        link.connect(1.0)
    link.release()


def test_commands_of_moos_need_links_of_moos():
    fleet = fleet_of(1, 1)
    with pytest.raises(ConfigError, match="has no moos://"):
        MoosNominal(fleet, ("red_1",))


@pytest.mark.parametrize(
    ("link", "word"),
    [
        ("moos://127.0.0.1", "HOST:PORT"),
        ("{kind: moos, address: 'udpin:127.0.0.1:1'}", "moos://HOST:PORT"),
        ("{kind: moos, address: 'moos://127.0.0.1:9000', gate: rudder}", "gate"),
        ("{kind: moos, address: 'moos://127.0.0.1:9000', gate: pid}", "no PID stops it when the gate dies"),
        (
            "{kind: moos, address: 'moos://127.0.0.1:9000', gate: pid, thrust_timeout_s: 1.0, nothing_stops_it: true}",
            "thrust_timeout_s",
        ),
        ("{kind: moos, address: 'moos://127.0.0.1:9000', nothing_stops_it: true}", "are for gate: pid"),
    ],
)
def test_a_link_that_is_none_is_refused_with_its_form(link, word):
    text = "version: 1\nfield: {origin: {latitude_deg: 42, longitude_deg: -71}, size_m: [80, 40]}\nteam: blue\n"
    text += "geofence: {xmin_m: 0, ymin_m: 0, xmax_m: 80, ymax_m: 40}\n"
    with pytest.raises(FleetFileError, match=word):
        parse_fleet(f"{text}boats:\n  - {{name: b, team: blue, platform: heron, link: {link}}}\n")


def test_a_loop_too_slow_for_a_pid_of_moos_is_refused():
    with pytest.raises(FleetFileError, match="rate_hz is 4 and boat 'blue_1' runs MOOS"):
        parse_fleet(f"{fleet_text(1, 1)}\nrate_hz: 4.0\n")


def test_what_is_said_while_a_boat_is_connected_is_kept_for_the_operator():
    fleet = fleet_of(1, 1)
    with sim_of(fleet) as boats:
        boats.boats["blue_1"].community.post("MOOS_MANUAL_OVERRIDE", "true", "pMarineViewer")
        with link_of(fleet) as (link, _):
            assert "took it by hand" in " ".join(link.read().texts)
            assert not link.read().ready
