"""Logs with a value of a wrong form anywhere: read and told, or refused in one line; never a traceback."""

import dataclasses
import json

import numpy as np
import pytest
from forged_logs import read_records, write_records
from logged_runs import write_log
from mutants import changed
from steerclear.experiments.deploy.replay import as_content, judge, replay_log
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.exceptions import SteerclearError

FAST, MANY = 150, 5000


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    write_log(path, 8)
    return read_records(path)


def is_json(value):
    return isinstance(value, str) and value[:1] in ("[", "{")


def mutant(records, seed):
    """The records with one changed; texts in it that hold JSON are changed inside."""
    random = np.random.default_rng(seed)
    topic = random.choice(["/header", "/header", "/tick", "/tick", "/tick", "/log", "/link"])
    k = random.choice([k for k, record in enumerate(records) if record.topic == topic] or [0])
    inner = {key: json.loads(text) for key, text in records[k].content.items() if is_json(text)}
    content = changed({**records[k].content, **inner}, random)
    outer = {key: json.dumps(content[key]) for key in inner if key in content}
    data = json.dumps({**content, **outer}).encode()
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
