"""Logs with a value of a wrong form anywhere: read and told, or refused in one line; never a traceback."""

import dataclasses
import json
import random

import pytest
from forged_logs import read_records, write_records
from logged_runs import write_log
from steerclear.experiments.deploy.replay import as_content, judge, replay_log
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.exceptions import SteerclearError

FAST, MANY = 150, 5000
ODD = (None, True, -1, 0, 1e308, 2**70, "", "nan", "x", [], {}, [1], {"a": 1}, [[]], "[", "{}", "null", "[1]")


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    write_log(path, 8)
    return read_records(path)


def places(content, path=()):
    yield path
    entries = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in entries:
        yield from places(value, (*path, key))


def changed(content, dice):
    """The content with one value replaced or left out; texts that hold JSON are changed inside."""
    path = dice.choice(list(places(content)))
    if not path:
        return dice.choice(ODD)
    *way, last = path
    node = content
    for key in way:
        node = node[key]
    value = node[last]
    if isinstance(value, str) and value[:1] in ("[", "{") and dice.random() < 0.8:
        node[last] = json.dumps(changed(json.loads(value), dice))
    elif isinstance(node, dict) and dice.random() < 0.2:
        del node[last]
    else:
        node[last] = dice.choice(ODD)
    return content


def mutant(records, seed):
    dice = random.Random(seed)
    topic = dice.choice(["/header", "/header", "/tick", "/tick", "/tick", "/log", "/link"])
    k = dice.choice([k for k, record in enumerate(records) if record.topic == topic] or [0])
    data = json.dumps(changed(records[k].content, dice)).encode()
    return [*records[:k], dataclasses.replace(records[k], data=data), *records[k + 1 :]]


def replayed(path, keep_tracks):
    """Whether a log is proved; None: it was refused."""
    try:
        with LogReader(path) as log:
            found = replay_log(log, keep_tracks)
        judge(found)
    except SteerclearError as error:
        assert "\n" not in str(error)  # noqa: PT017 - other errors are the failure
        return None
    json.dumps(as_content(found))
    return found.proved


def count(records, folder, seeds):
    results = []
    for seed in seeds:
        path = write_records(folder / "x.mcap", mutant(records, seed))
        try:
            results.append(replayed(path, keep_tracks=seed % 2 == 0))
        except Exception as error:
            pytest.fail(f"mutant {seed}: {type(error).__name__}: {error}")
    return results


@pytest.mark.parametrize("seeds", [range(FAST), pytest.param(range(1000, 1000 + MANY), marks=pytest.mark.study)])
def test_a_value_of_a_wrong_form_is_told_or_refused(records, tmp_path, seeds):
    assert {None, False} <= set(count(records, tmp_path, seeds))
