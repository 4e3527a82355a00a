"""Results, records, scenes and traces that were changed: done, or one line and status 2; quick, in little memory."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from commands import run
from mutants import as_json, other_arrays, torn
from steerclear.env.record import save
from steerclear.env.trace import load_trace
from steerclear.experiments.console import ExitCode
from steerclear.experiments.provenance import head_of
from steerclear.experiments.reach.pages import played_content, sets_content
from steerclear.experiments.reach.sets import PlayedSet, SetPair
from test_report import results as _report_results

DATA = Path(__file__).parents[1] / "data"
LONGEST_S = 5.0
MOST_MIB = 300


def ablation():
    content = _report_results.__wrapped__()
    content.pop("something new")
    content["settings"] |= {"games": 3, "rules": {"max_time_s": 60.0}, "conditions": {"delay_s": 0.0}}
    machine = {"processor": "one", "cores": 2, "memory_gib": 8, "system": "Linux"}
    return {**content, "command": "ablate", "quick": False, "seeds": [4, 5, 6], "machine": machine}


def encounters():
    cell = {"family": "head_on", "filter": "shield", "own": "heron", "other": "heron", "seed": 0, "radius_m": 2.5}
    cell |= {"delay_s": 0.0, "noise_m": 0.0, "current_mps": 0.0, "encounters": 200, "violated": 3, "avoidable": 0}
    cell |= {"unavoidable": 3, "not_judged": 0, "deadlocked": 0, "changed_percent": 12.5, "goal_time_ratio": 1.1}
    cell |= {"reversals_per_min": 0.3, "decision_us": None, "started_outside": 190, "violations_outside": 1}
    cell |= {"never_arrived_percent": 0.0, "inactive_percent": None}
    cells = [cell, {**cell, "filter": "none", "violated": 150}, {**cell, "family": "rammer_1"}]
    return {"command": "encounters", "settings": {}, "versions": {"steerclear": "0.1.0"}, "cells": cells}


def sets():
    settings = {"own": "heron", "other": "heron", "radius_m": 2.5, "shield": {"dt_s": 0.1}}
    pairs = [SetPair(2.0, 2.0, 180.0, *(4.0 for _ in range(len(SetPair.__dataclass_fields__) - 3)))]
    played = [PlayedSet(2.0, 2.0, 180.0, *(4 for _ in range(len(PlayedSet.__dataclass_fields__) - 3)))]
    return sets_content(settings, pairs, True, 1.0), played_content(head_of("reach-play", settings, 0.0), played)


@pytest.fixture
def seeds(game_record, tmp_path, monkeypatch):
    """What is changed: contents of JSON files by kind, arrays by kind, and files as they are."""
    monkeypatch.chdir(tmp_path)
    scene = json.loads((DATA / "encounters" / "heron_rammer_a.json").read_text())
    trace = load_trace(DATA / "traces" / "heron_captures.npz").cut(10).save(tmp_path / "trace.npz")
    save(game_record, "game.npz")
    with np.load(trace) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return {
        "results": [ablation(), encounters(), *(json.loads(json.dumps(one, default=str)) for one in sets())],
        "scene": [{**scene, "length_s": 1.0}],
        "record": [dict(game_record)],
        "trace": [arrays],
    }


COMMANDS = {
    "results": [["docs", "mutant.json", "--out", "pages"]],
    "scene": [["encounters", "--scene", "mutant.json", "--guard", "none", "--no-judge"]],
    "record": [["render", "mutant.npz", "--to", "a.html"], ["render", "mutant.npz", "--to", "a.png"]],
    "trace": [["parity", "mutant.npz"]],
}


def write(kind, seeds, random):
    """Write a mutant; its command."""
    seed = seeds[kind][random.integers(len(seeds[kind]))]
    if kind in ("results", "scene"):
        Path("mutant.json").write_bytes(as_json(seed, random))
    else:
        np.savez("mutant.npz", **(seed if random.integers(3) == 0 else other_arrays(seed, random)))
        if random.integers(4) == 0:
            Path("mutant.npz").write_bytes(torn(Path("mutant.npz").read_bytes(), random))
    return COMMANDS[kind][random.integers(len(COMMANDS[kind]))]


def high_water_mib():
    """Most memory that this process has had, MiB."""
    resource = pytest.importorskip("resource")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def check(kind, number, seeds):
    random = np.random.default_rng([number, list(COMMANDS).index(kind)])
    arguments = write(kind, seeds, random)
    before, started = high_water_mib(), time.process_time()
    done = run(*arguments)
    spent, grown = time.process_time() - started, high_water_mib() - before
    said = f"{kind} {number}: {done.output[-400:]}"
    assert done.exit_code in (ExitCode.OK, ExitCode.GOAL_MISSED, ExitCode.BAD_INPUT), (said, done.exception)
    assert "Traceback" not in done.output, said
    if done.exit_code == ExitCode.BAD_INPUT:
        assert done.stderr.startswith("error: "), said
        assert done.stderr.count("\n") == 1, said
    assert "\x1b" not in done.output, said
    assert grown < MOST_MIB, said
    return done.exit_code, spent


@pytest.mark.parametrize("kind", COMMANDS)
def test_files_as_they_were_written_are_read(kind, seeds):
    for seed in seeds[kind]:
        if kind in ("results", "scene"):
            Path("mutant.json").write_text(json.dumps(seed))
        else:
            np.savez("mutant.npz", **seed)
        for arguments in COMMANDS[kind]:
            done = run(*arguments)
            assert done.exit_code == ExitCode.OK, done.output


@pytest.mark.parametrize("kind", COMMANDS)
@pytest.mark.filterwarnings("default")
def test_changed_files_end_in_words(kind, seeds):
    outcomes = [check(kind, number, seeds)[0] for number in range(25)]
    assert ExitCode.BAD_INPUT in outcomes, "some are noticed"


@pytest.mark.study
@pytest.mark.parametrize("kind", COMMANDS)
@pytest.mark.filterwarnings("default")
def test_20000_changed_files_end_in_words(kind, seeds):
    spent = [check(kind, number, seeds)[1] for number in range(1000, 6000)]
    assert max(spent) < LONGEST_S


def test_a_record_that_unpacks_to_more_than_there_is_room_for_is_refused(tmp_path, monkeypatch, game_record):
    bomb = {**game_record, "position": np.zeros((30_000_000,))}
    monkeypatch.chdir(tmp_path)
    np.savez_compressed("bomb.npz", **bomb)
    assert Path("bomb.npz").stat().st_size < 2**20
    done = run("render", "bomb.npz", "--to", "a.html")
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "unpacks to" in done.stderr
