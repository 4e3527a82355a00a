"""Drills of boats that run MOOS: something fails while the gate filters, and the time to each response is measured.

Run it as a script for the table: ``python tests/shield/bridge/moos/drills.py``. Where ``MOOSDB`` is on the path
the drills are run beside the real one as well, and where all of MOOS-IvP is, three against three are played on it
(``drills.py mission``: that alone; ``drills.py mission heron``: with boats taken for herons); elsewhere it says so.
``drills.py fit FILE.yaml`` drives one of its boats alone and writes the platform that fits it.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, os.path.dirname(__file__))
sys.path.insert(1, str(Path(__file__).parents[3]))

from moos_boats import fleet_text, sim_of
from real_db import RealDb
from steerclear.experiments.sim_boats import moos as boats_of_moos
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.moos.client import MoosClient
from steerclear.shield.bridge.moos.links import MoosLinks, MoosNominal
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.platforms import layout as L
from waiting import until

SPEED_MPS, HEADING_DEG = 1.2, 90.0


class Ticks:
    """A sink that keeps what the drills look at."""

    def __init__(self):
        self.all = []

    def take(self, tick):
        self.all.append(tick)

    def close(self):
        pass

    def first(self, since_s, condition):
        return next(
            (tick.began_s - since_s for tick in list(self.all) if tick.began_s >= since_s and condition(tick)), None
        )


class Gate:
    """The loop with its shield over MOOS links, in a thread."""

    def __init__(self, fleet, speed=1.0):
        self.fleet, self.clock, self.ticks = fleet, MonotonicClock(speed), Ticks()
        self.maker = MoosLinks(fleet, self.clock)
        self.links = {boat.name: self.maker.link(boat) for boat in fleet.ours}
        self.nominal = MoosNominal(fleet, tuple(self.links))
        self.operator = Operator()

    def __enter__(self):
        for link in self.links.values():
            link.connect(15.0)
            link.prepare(1.0)
        self.nominal.use(self.links)
        parts = Parts(self.links, self.nominal, contacts=self.maker.sources(), sinks=(self.ticks,))
        self.loop = ControlLoop(self.fleet, parts, self.operator, self.clock)
        self.thread = threading.Thread(target=self.loop.run, daemon=True)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.operator.end("the drill is over")
        self.thread.join(60.0)
        for link in self.links.values():
            link.release()


def command(port, speed, heading_deg, speed_mps, ends=None):
    """A commander: RAW_DESIRED_* at 10 Hz until it is killed, or told to end."""
    client = MoosClient("pCommander", "127.0.0.1", port, MonotonicClock(speed), (), lambda message, time_s: None)
    client.start()
    ends = ends or threading.Event()
    while not ends.wait(0.1 / speed):
        client.post({"RAW_DESIRED_HEADING": heading_deg, "RAW_DESIRED_SPEED": speed_mps})
    client.close()


@contextlib.contextmanager
def commander_beside(port, speed):
    """A commander in a thread of this process."""
    ends = threading.Event()
    arguments = (port, speed, HEADING_DEG, SPEED_MPS, ends)
    thread = threading.Thread(target=command, args=arguments, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


def gate_alone(text, speed):
    """A gate of its own process, to be killed."""
    with Gate(parse_fleet(text), speed):
        time.sleep(3600.0)


@contextlib.contextmanager
def process(target, *arguments):
    child = multiprocessing.get_context("spawn").Process(target=target, args=arguments, daemon=True)
    child.start()
    try:
        yield child
    finally:
        child.kill()
        child.join()


class Scene:
    """Two boats of ours under way behind the gate, and one that lies still."""

    def __init__(self, speed=1.0, gate=True, killable=False):
        self.killable = killable
        self.speed, self.text, self.has_gate = speed, fleet_text(2, 1), gate
        self.fleet = parse_fleet(self.text)
        self.stack = contextlib.ExitStack()

    def __enter__(self):
        self.boats = self.stack.enter_context(sim_of(self.fleet, self.speed))
        self.boats.place("blue_1", 10.0, 10.0, 90.0)
        self.boats.place("blue_2", 10.0, 30.0, 90.0)
        self.boats.place("red_1", 70.0, 50.0, 0.0)
        self.community = self.boats.boats["blue_1"].community
        for name in ("blue_1", "blue_2"):
            port = self.boats.boats[name].community.db.port
            if self.killable and name == "blue_1":
                self.commander = self.stack.enter_context(process(command, port, self.speed, HEADING_DEG, SPEED_MPS))
            else:
                self.stack.enter_context(commander_beside(port, self.speed))
        if self.has_gate:
            self.gate = self.stack.enter_context(Gate(self.fleet, self.speed))
            try:
                self.under_way()
            except BaseException:
                self.stack.close()
                raise
        return self

    def __exit__(self, *_):
        self.stack.close()

    def under_way(self):
        if not until(lambda: self.boats.states()["blue_1"][L.SPEED] > 0.8, 180.0):
            raise RuntimeError(f"the boat does not move: {self.boats.states()['blue_1']}")

    @property
    def now_s(self):
        return self.gate.clock.now_s()

    def response(self, since_s, condition, wait_s=20.0):
        until(lambda: self.gate.ticks.first(since_s, condition) is not None, wait_s)
        return self.gate.ticks.first(since_s, condition)

    def acts(self, since_s, kind, wait_s=20.0):
        return self.response(
            since_s, lambda tick: any(a.condition == kind and a.response != "none" for a in tick.actions), wait_s
        )

    def passed(self, since_s, condition, wait_s=20.0):
        return self.clock_until(condition, wait_s) - since_s

    def clock_until(self, condition, wait_s):
        return self.now_s if until(condition, wait_s) else math.inf


def is_steered(tick, boat="blue_1"):
    return tick.readings[boat].age_s < 0.5 and tick.sent[boat].delivered


def drill_override(speed=1.0):
    with Scene(speed) as scene:
        began = scene.now_s
        scene.community.post("MOOS_MANUAL_OVERRIDE", "true", "pMarineViewer")
        idle = scene.response(began, lambda tick: not tick.sent["blue_1"].delivered)
        at_rest = scene.passed(began, lambda: scene.boats.states()["blue_1"][L.SPEED] < 0.1, 40.0)
        back = scene.now_s
        scene.community.post("MOOS_MANUAL_OVERRIDE", "false", "pMarineViewer")
        again = scene.response(back, lambda tick: tick.sent["blue_1"].delivered)
        return {"nothing is sent after": idle, "boat at rest after": at_rest, "given back, filtered again after": again}


def drill_commander_killed(speed=1.0):
    with Scene(speed, killable=True) as scene:
        began = scene.now_s
        os.kill(scene.commander.pid, signal.SIGKILL)
        stop = scene.response(began, lambda tick: tick.nominal is not None and tick.nominal.values[0, 0] == 0.0)
        told = scene.response(began, lambda tick: any("silent" in text for text in tick.readings["blue_1"].texts))
        return {"stop wanted after": stop, "told after": told}


def drill_two_commanders(speed=1.0):
    with Scene(speed) as scene:
        began, ends = scene.now_s, threading.Event()

        def rival():
            while not ends.wait(0.1 / speed):
                scene.community.post("DESIRED_HEADING", 270.0, "pBehave")

        thread = threading.Thread(target=rival)
        thread.start()
        stop = scene.acts(began, "commander")
        named = scene.response(began, lambda tick: any("pBehave" in text for text in tick.readings["blue_1"].texts))
        ends.set()
        thread.join()
        return {"named after": named, "told to stop after": stop}


def drill_nav_frozen(speed=1.0):
    with Scene(speed) as scene:
        began = scene.now_s
        scene.community.frozen_nav = scene.boats.boats["blue_1"].seen
        seen = scene.acts(began, "navigation")
        return {"response after": seen}


def drill_nav_silent(speed=1.0):
    with Scene(speed) as scene:
        began = scene.now_s
        scene.community.publish = lambda seen: None
        return {"response after": scene.acts(began, "navigation")}


def drill_contact_frozen(speed=1.0):
    with Scene(speed) as scene:
        for boat in scene.boats.boats.values():
            if boat.community is not None:
                boat.community.report = lambda others, time_s: None
        ends, moving = threading.Event(), threading.Event()
        moving.set()

        def reporter():
            place = 50.0
            while not ends.wait(0.5 / speed):
                place += 0.75 if moving.is_set() else 0.0
                for boat in ("blue_1", "blue_2"):
                    db = scene.boats.boats[boat].community.db
                    east, north = scene.fleet.frame.turn_to_earth(70.0, place)
                    heading = math.degrees(scene.fleet.frame.heading_to_true_rad(0.0))
                    text = f"NAME=red_1,X={east:.2f},Y={north:.2f},SPD=1.5,HDG={heading:.1f},TIME={db.now_s():.2f}"
                    db.post("NODE_REPORT", text, "pShare")

        thread = threading.Thread(target=reporter)
        thread.start()
        time.sleep(4.0 / speed)
        moving.clear()
        began = scene.now_s
        seen = scene.acts(began, "contact")
        ends.set()
        thread.join()
        return {"response after": seen}


def drill_not_a_number(speed=1.0):
    with Scene(speed) as scene:
        began, db = scene.now_s, scene.community.db
        for key in (
            "RAW_DESIRED_HEADING",
            "RAW_DESIRED_SPEED",
            "NAV_X",
            "NAV_Y",
            "NAV_HEADING",
            "NAV_SPEED",
            "NAV_LAT",
        ):
            for value in (math.nan, math.inf, -math.inf):
                db.post(key, value, "broken")
        db.post("NODE_REPORT", "NAME=red_1,X=nan,Y=inf,SPD=nan,HDG=nan,TIME=nan", "broken")
        told = scene.response(began, lambda tick: any("no number" in text for text in tick.readings["blue_1"].texts))
        time.sleep(2.0 / speed)
        posts = [db.latest[key].value for key in ("DESIRED_HEADING", "DESIRED_SPEED")]
        sent = [
            v
            for t in scene.gate.ticks.all
            for s in t.sent.values()
            if s.delivered
            for v in (s.heading_rad, s.speed_mps)
        ]
        if not all(map(math.isfinite, [*posts, *sent])):
            raise AssertionError("a number that is none was posted")
        if scene.community.pid.broken:
            raise AssertionError("the PID was told what is no number")
        return {"told after": told, "numbers posted that are none": 0.0}


def drill_moosdb_frozen(speed=1.0):
    with Scene(speed) as scene:
        began = scene.now_s
        scene.community.db.frozen.set()
        pid = scene.passed(began, lambda: not scene.boats.boats["blue_1"].is_commanded)
        stop = scene.acts(began, "navigation")
        lost = scene.response(began, lambda tick: not math.isfinite(tick.readings["blue_1"].heartbeat_age_s))
        until(lambda: scene.now_s - began >= 8.0 * speed, 10.0)
        thawed = scene.now_s
        scene.community.db.frozen.clear()
        again = scene.response(thawed, is_steered)
        return {
            "told to stop after": stop,
            "its PID drops thrust after": pid,
            "given up after": lost,
            "thawed, steered again after": again,
        }


def drill_moosdb_killed(speed=1.0):
    with Scene(speed) as scene:
        began, aboard = scene.now_s, scene.community
        port, hear = aboard.db.port, aboard.db._hear
        aboard.db.close()
        told = scene.response(began, lambda tick: bool(tick.readings["blue_1"].why_not))
        time.sleep(1.0)
        back = scene.now_s
        aboard.db = type(aboard.db)("blue_1", port, speed, hear)
        again = scene.response(back, is_steered)
        return {"told after": told, "restarted, steered again after": again}


def drill_gate_killed(speed=1.0):
    with Scene(speed, gate=False) as scene:
        text, clock = scene.text, MonotonicClock(speed)
        with process(gate_alone, text, speed) as child:
            scene.under_way()
            began = clock.now_s()
            os.kill(child.pid, signal.SIGKILL)
            until(lambda: not scene.boats.boats["blue_1"].is_commanded, 10.0)
            dropped = clock.now_s() - began
            until(lambda: scene.boats.states()["blue_1"][L.SPEED] < 0.1, 60.0)
            return {"its PID drops thrust after": dropped, "boat at rest after": clock.now_s() - began}


def drill_slow_reader(speed=1.0):
    """The gate's process stands still for 8 s: whoever serves it must not keep it for good."""
    with Scene(speed, gate=False) as scene:
        text, clock = scene.text, MonotonicClock(speed)
        with process(gate_alone, text, speed) as child:
            scene.under_way()
            began = clock.now_s()
            os.kill(child.pid, signal.SIGSTOP)
            until(lambda: not scene.boats.boats["blue_1"].is_commanded, 10.0)
            dropped = clock.now_s() - began
            until(lambda: clock.now_s() - began > 8.0 * speed, 10.0)
            resumed = clock.now_s()
            os.kill(child.pid, signal.SIGCONT)
            until(lambda: scene.boats.boats["blue_1"].is_commanded, 20.0)
            return {"its PID drops thrust after": dropped, "goes on, steered again after": clock.now_s() - resumed}


DRILLS = {
    "kill -9 of the gate": drill_gate_killed,
    "kill -9 of MOOSDB": drill_moosdb_killed,
    "kill -9 of the commander": drill_commander_killed,
    "MOOSDB frozen for 8 s": drill_moosdb_frozen,
    "gate frozen for 8 s (a slow reader)": drill_slow_reader,
    "NAV_* frozen, stamps fresh": drill_nav_frozen,
    "NAV_* silent": drill_nav_silent,
    "contact frozen, TIME fresh": drill_contact_frozen,
    "NaN and inf in every double": drill_not_a_number,
    "override while filtering": drill_override,
    "two commanders": drill_two_commanders,
}


def say(text):
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def drill_all(chosen):
    say("| drill | warp | response, s of boat's time |\n|---|---|---|")
    for name, drill in DRILLS.items():
        for warp in (1.0, 4.0, 5.0) if drill in (drill_commander_killed, drill_override, drill_nav_frozen) else (1.0,):
            if chosen and not any(word in name for word in chosen):
                continue
            found = drill(warp)
            words = "; ".join(
                f"{what} {value:.2f}" if value is not None else f"{what}: never" for what, value in found.items()
            )
            say(f"| {name} | {warp:g} | {words} |")


def main():
    import real_mission  # it needs this module

    if sys.argv[1:2] == ["fit"]:
        say(real_mission.missing() or real_mission.fit(Path(sys.argv[2])))
        return
    if sys.argv[1:2] != ["mission"]:
        say("On the stand-in:")
        drill_all(sys.argv[1:])
        if shutil.which("MOOSDB") is None:
            say("MOOSDB is not on the path: only the stand-in was drilled")
            return
        say("Beside MOOSDB:")
        boats_of_moos.StandInDb = RealDb
        drill_all(sys.argv[1:])
    platform = next(iter(sys.argv[2:]), None) if sys.argv[1:2] == ["mission"] else None
    say(real_mission.missing() or "On the real MOOS-IvP, 3 against 3:")
    for what, value in {} if real_mission.missing() else real_mission.play(platform=platform).items():
        say(f"| {what} | {value:.4g} |")


if __name__ == "__main__":
    main()
