"""Fixtures that several folders of tests share."""

import gc
import logging
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from steerclear.env.config import GameConfig
from steerclear.env.record import find_violations, make_record, meta_of

settings.register_profile("shared_machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared_machine")  # how long an example takes says more of the machine than of the code

REASONS = ["PASSED", "QP", "QP_RELAXED", "BACKUP", "BEST_EFFORT", "HELD", "NOT_COVERED", "RIGHT_OF_WAY"]

COMPILING = "from steerclear.experiments.warming import compile_share; compile_share({}, {})"


def cores():
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config):
    """Workers of ``-n auto``: one more than cores, since tests of boats and of other processes often wait."""
    return cores() + 1


def pytest_configure(config):
    """Compile before workers start (``-n``), a share in a process of each core: they would else do it several times."""
    workers = getattr(config.option, "numprocesses", None) or 0
    if workers < 2 or hasattr(config, "workerinput") or config.option.collectonly:
        return
    if config.option.dist == "load":  # neighbours share fixtures: each worker takes a stretch, and helps when done
        config.option.dist = "worksteal"
    n = min(workers, cores())
    shares = [subprocess.Popen([sys.executable, "-c", COMPILING.format(k, n)]) for k in range(n)]
    for share in shares:  # what goes wrong is for the tests to tell
        share.wait()


def pytest_collection(session):
    """Collect tests without looking for garbage meanwhile: nothing of what is made then can go."""
    gc.disable()


def pytest_collection_finish(session):
    """Look for garbage from now on, among what tests make alone."""
    gc.freeze()
    gc.enable()


class Stall:
    """The longest time this process was not let run while the block ran, s: a busy machine, not the tested code."""

    def __enter__(self):
        self.longest_s, self._over = 0.0, threading.Event()
        self._watch = threading.Thread(target=self._measure, daemon=True)
        self._watch.start()
        return self

    def __exit__(self, *_):
        self._over.set()
        self._watch.join()

    def _measure(self):
        before = time.monotonic()
        while not self._over.wait(0.02):
            now = time.monotonic()
            self.longest_s, before = max(self.longest_s, now - before), now


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    """Try a test marked ``real_time`` again, twice at most, if it failed while the machine stood still for a while."""
    if pyfuncitem.get_closest_marker("real_time") is None:
        return None
    arguments = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    for tries_left in (2, 1, 0):
        stall = Stall()
        try:
            with stall:
                pyfuncitem.obj(**arguments)
            break
        except AssertionError:
            if stall.longest_s < 0.25 or not tries_left:
                raise
    return True


@pytest.fixture(autouse=True)
def logs_are_as_before():
    """Submissions that run in the tests' own process may switch logs off, and nobody puts that back for them."""
    level = logging.root.level
    yield
    logging.disable(logging.NOTSET)
    logging.root.setLevel(level)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("steerclear"):
            logger = logging.getLogger(name)
            logger.disabled, logger.propagate = False, True
            logger.setLevel(logging.NOTSET)


@pytest.fixture
def game_meta():
    """Settings of a small game whose blue team has a shield."""
    obstacles = {"circle": [(3.0, (40.0, 8.0))], "polygon": [((20.0, 2.0), (24.0, 2.0), (22.0, 6.0))]}
    config = GameConfig.preset("aamas2024", team_size=2, obstacles=obstacles)
    return meta_of(
        config,
        policies={"blue": "medium", "red": "easy"},
        shielded=["agent_0", "agent_1"],
        seed=7,
        reason_names=REASONS,
    )


@pytest.fixture
def game_record(game_meta):
    """A made-up game of 60 steps with two changed stretches, a held boat, a capture, and boats 0 and 2 too near."""
    return synthetic_record(game_meta, steps=60)


def synthetic_record(meta, steps, seed=3):
    """Boats on smooth random paths; the arrays have every feature that a replay shows."""
    random = np.random.default_rng(seed)
    n, time = 4, np.arange(steps + 1)[:, None] * 0.1
    start = np.array([[10.0, 12.0], [14.0, 30.0], [30.0, 12.0], [60.0, 25.0]])
    velocity = np.array([[1.5, 0.0], [0.4, -0.9], [-1.9, 0.02], [-0.5, 0.6]])
    wave = np.sin(time[..., None] + random.uniform(0, 6, (n, 2)))
    position = start + velocity * time[..., None] * (10.0 / max(steps * 0.1, 1.0)) + 0.2 * wave
    heading = (np.degrees(np.arctan2(velocity[:, 0], velocity[:, 1])) + 20 * np.sin(time) + 180.0) % 360.0 - 180.0
    wanted = np.stack([random.uniform(0.0, 2.0, (steps, n)), random.uniform(-180.0, 180.0, (steps, n))], axis=-1)
    sent, intervened = wanted.copy(), np.zeros((steps, n), bool)
    intervened[10:20, 0] = intervened[30:33, :2] = True
    sent[intervened] = [1.25, 42.0]
    reason = np.where(intervened, 1, 0)
    reason[:, 2:] = 6
    wanted[31, 1], reason[31, 1] = np.nan, 5
    certificate = np.where(reason == 6, np.nan, random.normal(3.0, 2.0, (steps, n)))
    has_flag = np.zeros((steps + 1, n), bool)
    has_flag[20:40, 1] = True
    flag_position = np.tile(np.array(meta["flag_home"], float), (steps + 1, 1, 1))
    flag_position[20:40, 1] = position[20:40, 1]
    return make_record(
        meta,
        position=position,
        heading_deg=heading,
        speed_mps=1.0 + 0.5 * np.sin(time + np.arange(n)),
        has_flag=has_flag,
        is_tagged=np.arange(n) == np.where(time > 4.0, 3, -1),
        oob=np.zeros((steps + 1, n), bool),
        flag_position=flag_position,
        captures=np.where(np.arange(steps + 1)[:, None] >= 40, [1, 0], [0, 0]),
        nominal=wanted,
        filtered=sent,
        reason=reason,
        intervened=intervened,
        safety_margin_m=certificate,
        violations=find_violations(position, meta["separation_m"]),
    )
