import itertools
import math
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from boat_links import READY, station
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.sim_boats import RadioSettings, SimBoat, SimFleet
from steerclear.experiments.sim_boats.faults import faults_page
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

HERE = "127.0.0.1"


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((HERE, 0))
        return probe.getsockname()[1]


def test_the_page_of_faults_is_made_of_the_code():
    page = (Path(__file__).parents[3] / "docs" / "boat_reference.md").read_text()
    assert f"<!-- faults -->\n{faults_page()}\n<!-- /faults -->" in page


def alone(**settings):
    return SimFleet([SimBoat("b", start=(10.0, 10.0, 0.0))], autopilot=READY, **settings)


@pytest.mark.parametrize("kind", ["", "udpout", "udpin", "tcp"])
def test_boats_behind_every_kind_of_link(kind):
    port = free_port(socket.SOCK_STREAM if kind == "tcp" else socket.SOCK_DGRAM)
    address = f"{kind}:{HERE}:{port}" if kind else ""
    fleet = SimFleet([SimBoat("b", address=address, system_id=9)], autopilot=READY)
    with station(fleet) as ground:
        assert fleet.addresses["b"] == address or not kind
        ground.run(0.5)
        ground.call()
        ground.guide(9)
        ground.run(3.0, lambda: ground.steer(9, 1.0, 0.5))
        assert ground.of("HEARTBEAT", 9)[-1].custom_mode == 15
        assert len(ground.of("GLOBAL_POSITION_INT", 9)) > 30
        assert fleet.states()["b"][L.SPEED] > 0.3


def test_boats_share_a_port_and_hear_only_what_is_for_them():
    address = f"udpout:{HERE}:{free_port()}"
    boats = [SimBoat(f"b{i}", address=address, system_id=10 + i) for i in range(3)]
    fleet = SimFleet(boats, autopilot=READY)
    with station(fleet) as ground:
        assert set(fleet.addresses.values()) == {address}
        ground.run(0.2)
        ground.guide(11)
        ground.run(3.0, lambda: ground.steer(11, 1.0, 0.5))
        moving = {name: state[L.SPEED] > 0.1 for name, state in fleet.states().items()}
        assert moving == {"b0": False, "b1": True, "b2": False}
        assert {m.get_srcSystem() for m in ground.heard} == {10, 11, 12}
        assert fleet.boats["b0"].autopilot.counts["taken"] <= 1  # the heartbeat for all


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


def test_any_bytes_are_survived():
    random = np.random.default_rng(1)
    fleet = alone()
    host, port = fleet.addresses["b"].removeprefix("udpout:").split(":")
    good = bytes(
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0).pack(mavlink.MAVLink(None, 255))
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hostile:
        for k in range(1000):
            data = bytearray(good) if k % 2 else bytearray(random.bytes(int(random.integers(1, 300))))
            data[random.integers(len(data))] ^= 1 << int(random.integers(8))
            hostile.sendto(bytes(data), (host, int(port)))
            if k % 50 == 0:
                fleet.advance(0.1)
    with station(fleet) as ground:
        counts = fleet.boats["b"].autopilot.counts
        assert counts["taken"] < 3  # a checksum of 16 bits lets hardly any through
        assert not fleet.boats["b"].is_held
        ground.guide(1)
        ground.run(3.0, lambda: ground.steer(1, 1.0, 0.5))
        assert fleet.states()["b"][L.SPEED] > 0.3


def test_the_same_seed_gives_the_same_sensors():
    def seen(seed):
        with alone(noise=1.0, seed=seed, radio=RadioSettings(loss=0.3)) as _:
            pass
        fleet = alone(noise=1.0, seed=seed)
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
    ("telemetry_stop", {"duration_s": 1.0}, lambda before, during, ground: 30 < len(during) < 45),
]  # fmt: skip
LASTING = ("restart", "mode", "power_off")
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
        ("b", "jump", {"far": 1}, "far"),
    ],
)
def test_faults_that_do_not_exist_are_refused(boat, kind, options, match):
    fleet = alone()
    try:
        with pytest.raises(ConfigError, match=match):
            fleet.fault(boat, kind, **options)
    finally:
        fleet.close()
