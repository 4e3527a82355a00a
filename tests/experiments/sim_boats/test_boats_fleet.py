import itertools
import json
import math
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from boat_links import READY, station
from json_keys import KEYS, undocumented
from steerclear.env.record import load
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.demo import demo_file, free_ports
from steerclear.experiments.sim_boats import RadioSettings, SimBoat, SimFleet
from steerclear.experiments.sim_boats.faults import AT_ONCE, KINDS, ON_LINK, Incident, Plan, faults_page, parse_incident
from steerclear.experiments.sim_boats.fleet import boats_of
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.exceptions import ConfigError
from typer.testing import CliRunner
from waiting import wait_for

HERE = "127.0.0.1"


def test_the_page_of_faults_is_made_of_the_code():
    page = (Path(__file__).parents[3] / "docs" / "boat_reference.md").read_text()
    assert f"<!-- faults -->\n{faults_page()}\n<!-- /faults -->" in page


@pytest.mark.parametrize(("settings", "least_m"), [("", 6.0), ("separation_m: 4.0, position_error_m: 1.0", 9.0)])
def test_boats_without_a_game_start_as_far_apart_as_their_file_wants_and_inside(settings, least_m):
    lines = [
        f"  - {{name: b{k}, team: blue, platform: heron, link: {{kind: mavlink, address: 'udpin:{HERE}:14550', "
        f"system_id: {k + 1}}}}}"
        for k in range(5)
    ]
    head = "version: 1\nteam: blue\nfield: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [20, 40]}\n"
    fence = f"geofence: {{xmin_m: 0, ymin_m: 0, xmax_m: 30, ymax_m: 40}}\nshield: {{{settings}}}\nboats:\n"
    starts = [boat.start for boat in boats_of(parse_fleet(head + fence + "\n".join(lines)), "")]
    assert min(math.dist(a[:2], b[:2]) for a, b in itertools.combinations(starts, 2)) >= least_m
    assert all(0.0 < x < 30.0 and 0.0 < y < 40.0 for x, y, _ in starts)


def test_boats_without_a_game_are_not_told_that_none_began(tmp_path):
    (port,) = free_ports(1)
    head = "version: 1\nteam: blue\nfield: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [20, 40]}\n"
    fence = "geofence: {xmin_m: 0, ymin_m: 0, xmax_m: 30, ymax_m: 40}\nboats:\n"
    link = f"{{kind: mavlink, address: 'udpin:{HERE}:{port}', system_id: 1}}"
    boat = f"  - {{name: b, team: blue, platform: heron, link: {link}}}\n"
    path = tmp_path / "FLEET.yaml"
    path.write_text(head + fence + boat)
    result = CliRunner().invoke(app, ["sim-boats", str(path), "--duration", "1", "--speed", "10"])
    assert result.exit_code == 0, result.output
    assert "the game never began" not in result.output
    wrong = CliRunner().invoke(app, ["sim-boats", str(path), "--current", "0.5"])
    assert wrong.exit_code == 2
    assert "give m/s@deg" in wrong.output


def test_the_simulated_gps_tells_the_real_time():
    fleet = alone()
    try:
        message = fleet.boats["b"].autopilot._telemetry.build(2, fleet.boats["b"].seen, 0.0)
    finally:
        fleet.close()
    assert message.get_type() == "SYSTEM_TIME"
    assert message.time_unix_usec * 1e-6 == pytest.approx(time.time(), abs=5.0)


def alone(**settings):
    return SimFleet([SimBoat("b", start=(10.0, 10.0, 0.0))], autopilot=READY, **settings)


@pytest.mark.parametrize(
    ("boats", "match"),
    [
        ([], "at least one"),
        ([SimBoat("a"), SimBoat("a")], "name of its own"),
        ([SimBoat("a", address="serial:/dev/ttyUSB0:57600")], "cannot simulate"),
        ([SimBoat("a", address="udpout:127.0.0.1:x")], "cannot simulate"),
        ([SimBoat("a", address="udpout:10.1.2.3:14550")], "not on this machine"),
        ([SimBoat("a", system_id=300)], "system id 300"),
        ([SimBoat("a", team=2)], "in no team"),
        ([SimBoat("a", address=None, policy="medium")], "no game"),
        ([SimBoat("a", platform="yacht")], "unknown platform"),
        ([SimBoat("a"), SimBoat("b", team=1, address=None, policy="nobody")], "scripted policies only"),
    ],
)
def test_boats_that_cannot_be_are_refused(boats, match):
    with pytest.raises(ConfigError, match=match):
        SimFleet(boats)


def test_the_same_seed_gives_the_same_sensors():
    def seen(seed):
        fleet = alone(noise=1.0, seed=seed, radio=RadioSettings(loss=0.3))
        fleet.advance(5.0)
        fleet.close()
        return fleet.boats["b"].seen

    assert seen(3) == seen(3)
    assert seen(3) != seen(4)


def test_lives_by_its_clock_in_a_thread():
    with alone(speed=5.0) as fleet:
        start = time.monotonic()
        while fleet.time_s < 5.0:
            time.sleep(0.02)
            assert time.monotonic() - start < 30.0
        wall_s = time.monotonic() - start
        assert fleet.is_running
        with pytest.raises(ConfigError, match="runs by itself"):
            fleet.advance(1.0)
    assert not fleet.is_running
    assert wall_s >= 0.9
    assert fleet.cpu_s > 0.0
    fleet.close()  # again


def test_boats_far_behind_their_clock_let_the_time_go():
    clock = ManualClock(0.0)
    with alone(clock=clock) as fleet:
        clock.sleep_until(10.0)
        wait_for(lambda: fleet.let_go_s > 8.0)
        assert fleet.time_s < 2.0


def times(places):
    return [place[0] for place in places]


def disorder(places):
    return sum(b < a for a, b in itertools.pairwise(times(places)))


def obeys(ground):
    ground.run(0.3)
    return ground.fleet.boats["b"].is_commanded


FAULTS = [
    ("telemetry_stop", {}, lambda before, during, ground: not during and obeys(ground)),
    ("link_loss", {}, lambda before, during, ground: not during and not obeys(ground)),
    ("commands_lost", {}, lambda before, during, ground: len(during) > 40 and not obeys(ground)),
    ("freeze", {}, lambda before, during, ground: (
        len({place[1:] for place in during}) == 1 and during[-1][0] - during[0][0] > 2.0
        and math.dist(during[-1][1:], before[-1][1:]) < 0.3
    )),
    ("jump", {"distance_m": 30.0, "course_deg": 90.0},
     lambda before, during, ground: abs(during[0][1] - before[-1][1] - 30.0) < 0.5),
    ("late", {"delay_s": 1.0}, lambda before, during, ground: abs(ground.fleet.time_s - during[-1][0] - 1.0) < 0.15),
    ("out_of_order", {}, lambda before, during, ground: disorder(before) == 0 and disorder(during) > 5),
    ("duplicate", {"copies": 3}, lambda before, during, ground: len(during) / 3.0 > 2.0 * len(before) / 2.0),
    ("corrupt", {"share": 0.5}, lambda before, during, ground: len(during) / 3.0 < 0.8 * len(before) / 2.0),
    ("restart", {}, lambda before, during, ground: (
        len(during) < 5 and not ground.fleet.boats["b"].autopilot.vehicle.armed
    )),
    ("power_off", {}, lambda before, during, ground: not ground.of("HEARTBEAT", 1)),
    ("mode", {"number": 4}, lambda before, during, ground: ground.fleet.boats["b"].is_held),
    ("disarm", {}, lambda before, during, ground: not ground.fleet.boats["b"].autopilot.vehicle.armed),
    ("telemetry_stop", {"duration_s": 1.0}, lambda before, during, ground: 30 < len(during) < 45),
]  # fmt: skip
LASTING = ("restart", "mode", "power_off", "disarm")
"""What is not over when the fault is cleared: somebody must arm the boat, or choose its mode."""


@pytest.mark.parametrize(("kind", "options", "holds"), FAULTS, ids=[f"{kind} {options}" for kind, options, _ in FAULTS])
def test_each_fault_does_what_its_kind_says_and_is_over_when_cleared(kind, options, holds):
    fleet = alone()  # it runs north at 1 m/s
    with station(fleet) as ground:
        ground.run(0.2)
        ground.guide(1)
        ground.run(10.0, lambda: ground.steer(1, 0.0, 0.5))
        ground.heard.clear()
        ground.run(2.0, lambda: ground.steer(1, 0.0, 0.5))
        before = ground.positions(1)
        ground.heard.clear()
        fleet.fault("b", kind, **options)
        ground.run(3.0, lambda: ground.steer(1, 0.0, 0.5))
        assert holds(before, ground.positions(1), ground)
        fleet.clear("b")
        ground.heard.clear()
        ground.run(3.0, lambda: ground.steer(1, 0.0, 0.5))
        after = ground.positions(1)
        if kind in LASTING:
            assert ground.of("HEARTBEAT", 1)
        else:
            assert len(after) > 40
            assert after[-1][1] == pytest.approx(before[-1][1], abs=0.5)
            assert after[-1][2] > before[-1][2] + 3.0


def test_faults_that_happen_at_once_are_those_that_nothing_ends():
    fleet = alone()
    try:
        for kind in KINDS:
            fleet.fault("b", kind)
        assert set(fleet.boats["b"].faults.active) == set(KINDS) - set(AT_ONCE)
    finally:
        fleet.close()


def test_a_compass_that_is_off_turns_the_boat_and_not_what_it_tells():
    fleet = alone()
    fleet.fault("b", "compass", offset_deg=30.0)
    with station(fleet) as ground:
        ground.run(0.2)
        ground.guide(1)
        ground.run(18.0, lambda: ground.steer(1, 0.0, 0.5))
        told = ground.of("GLOBAL_POSITION_INT", 1)[-1]
        assert math.remainder(told.hdg / 100.0, 360.0) == pytest.approx(0.0, abs=3.0)  # it believes to do as told
        assert math.degrees(math.atan2(told.vy, told.vx)) == pytest.approx(-30.0, abs=3.0)


@pytest.mark.parametrize(
    ("boat", "kind", "options", "match"),
    [
        ("c", "jump", {}, "no simulated boat"),
        ("b", "jmp", {}, "did you mean 'jump'"),
        ("b", "xyz", {}, "faults are"),
        ("b", "jump", {"far": 1}, "no option 'far'; it has distance_m, course_deg"),
        ("b", "restart", {"far": 1}, "it has none"),
        ("b", "jump", {"distance_m": "30"}, "distance_m is '30'; give a number"),
        ("b", "jump", {"distance_m": math.nan}, "give a number"),
        ("b", "mode", {"number": 99}, "no mode 99; it has 0 MANUAL"),
        ("b", "mode", {"number": 11}, "no mode 11"),
        ("b", "mode", {"duration_s": 10.0}, "happens at once and has no duration .*number=15"),
        ("b", "disarm", {"duration_s": 10.0}, "happens at once and has no duration"),
        ("b", "restart", {"duration_s": 10.0}, "happens at once and has no duration"),
    ],
)
def test_faults_that_do_not_exist_are_refused(boat, kind, options, match):
    fleet = alone()
    try:
        with pytest.raises(ConfigError, match=match):
            fleet.fault(boat, kind, **options)
    finally:
        fleet.close()


def test_a_fleet_from_its_file_with_a_key_boats_of_nobody_and_boats_beside(tmp_path):
    link = '{kind: mavlink, address: "udpout:127.0.0.1:%d", system_id: %d}'
    ports, key = free_ports(2), tmp_path / "boats.key"
    key.write_text("ab" * 32)
    key.chmod(0o600)
    text = demo_file(tmp_path).read_text() + f"signing: {{key_file: {key}}}\n"
    text = text.replace(
        "red_1, agent: agent_3, platform: heron, contact: feed}",
        f"red_1, agent: agent_3, platform: heron, commanded: false, link: {link % (ports[0], 11)}}}",
    )
    beside = f"  - {{name: safety, platform: heron, commanded: false, link: {link % (ports[1], 12)}}}"
    text = text.replace("feed: {listen", f"{beside}\nfeed: {{listen")
    fleet = SimFleet.from_file(parse_fleet(text), opponents="rammer")
    try:
        assert list(fleet.addresses) == ["blue_1", "blue_2", "blue_3", "red_1", "safety"]
        assert fleet.system_ids["blue_3"] == 3
        policies = {name: boat.spec.policy for name, boat in fleet.boats.items()}
        assert policies == dict.fromkeys(fleet.boats, "") | dict.fromkeys(("red_1", "red_2", "red_3"), "rammer")
        assert fleet.boats["blue_1"].autopilot._codec.signs
        assert fleet.frame == parse_fleet(text).frame
        assert tuple(fleet.states()["safety"][:2]) == pytest.approx((33.6, -3.0))
        fleet.advance(1.0)
    finally:
        fleet.close()


def test_runs_and_writes_figures_and_record(tmp_path):
    figures, record = tmp_path / "run.json", tmp_path / "truth.npz"
    options = ["--no-wait", "--duration", "4", "--speed", "20", "--wind", "5@270", "--noise", "1", "--loss", "0.1"]
    faults = ["--fault", "blue_1:restart@1", "--fault", "red_1:jump@1+2,distance_m=10"]
    files = ["--record", str(record), "--json", str(figures)]
    result = CliRunner().invoke(app, ["sim-boats", str(demo_file(tmp_path)), *options, *faults, *files])
    assert result.exit_code == 0, result.output
    content = json.loads(figures.read_text())
    assert undocumented(content, KEYS["sim-boats"]) == []
    assert content["simulated_s"] >= 4.0
    assert content["played"]
    assert len(content["closest"]) == 15
    assert len(load(record)["nominal"]) >= 35
    assert "blue_1: restart" in result.output
    assert "driven by" in result.output


def test_planned_faults_are_read():
    assert parse_incident("blue_1:jump@60+10,distance_m=5,course_deg=0") == Incident(
        "blue_1", "jump", 60.0, 10.0, {"distance_m": 5, "course_deg": 0}
    )
    assert parse_incident("b:late@2").lasts_s == float("inf")
    for wrong in ("b:mode@1+10", "b:jump@1,far=3", "b:jump@1,distance_m=[1]", "b:mode@1,number=99"):
        with pytest.raises(ConfigError, match="fault"):
            parse_incident(wrong)  # before the run, not when it is due
    for wrong in ("jump@60", "b:jump", "b:jump@x", "b:jump@1,a=x y", "b:jump@1.2.3", ""):
        with pytest.raises(ConfigError):
            parse_incident(wrong)


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_of_links_is_refused_for_a_boat_without_one(kind):
    def planned(has_link):
        fleet = SimpleNamespace(boat=lambda name: SimpleNamespace(has_link=has_link))
        return Plan([parse_incident(f"red_1:{kind}@5")], fleet)

    assert planned(has_link=True)
    if kind in ON_LINK:
        with pytest.raises(ConfigError, match=f"'red_1' has no link, and fault '{kind}' is one of links: it would do"):
            planned(has_link=False)
    else:
        assert planned(has_link=False)
