"""Numbers in a log: every bit comes back, and JSON stays JSON."""

import json
import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.blackbox.header import _settings
from steerclear.shield.bridge.blackbox.numbers import from_json, plain, restored, row_from_json, row_to_json, to_json
from steerclear.shield.exceptions import ConfigError, LogError

quick = settings(max_examples=200, deadline=None, derandomize=True)


def bits(value):
    return struct.pack(">d", value)


@quick
@given(st.integers(0, 2**64 - 1))
def test_every_bit_pattern_of_a_float_comes_back(pattern):
    value = struct.unpack(">d", struct.pack(">Q", pattern))[0]
    text = json.dumps(to_json(value), allow_nan=False)
    assert bits(from_json(json.loads(text))) == bits(value)


@pytest.mark.parametrize(
    "value", [0.0, -0.0, 5e-324, 1.7976931348623157e308, math.inf, -math.inf, math.nan, 0.1, -1e22]
)
def test_edges_come_back(value):
    assert bits(from_json(json.loads(json.dumps(to_json(value), allow_nan=False)))) == bits(value)


@quick
@given(st.lists(st.floats(), min_size=0, max_size=12))
def test_rows_come_back(values):
    row = np.array(values, dtype=np.float64)
    text = json.dumps(row_to_json(row), allow_nan=False)
    assert np.array(row_from_json(json.loads(text), len(row)), dtype=np.float64).tobytes() == row.tobytes()


@pytest.mark.parametrize("bad", ["fast", "nan:", "nan:zz", "nan:3ff0000000000000", None, True, [1.0], {}])
def test_what_is_no_number_is_refused(bad):
    with pytest.raises(LogError, match="where a number belongs"):
        from_json(bad)


@pytest.mark.parametrize("bad", [[1.0], [1.0, 2.0, 3.0], "ab", None, {"0": 1.0}])
def test_rows_of_another_length_are_refused(bad):
    with pytest.raises(LogError, match="2 numbers belong"):
        row_from_json(bad, 2)


def test_settings_come_back():
    value = {"a": math.inf, "b": [1, 2.5, -math.inf], "c": {"d": None, "e": "text", "f": True}}
    assert restored(json.loads(json.dumps(plain(value), allow_nan=False))) == value


def test_settings_of_another_kind_are_refused():
    with pytest.raises(TypeError, match="no place in a log"):
        plain({"a": object()})


def test_settings_of_older_logs_are_called_as_they_are_now():
    old = {"separation_m": 2.5, "mate_cap_m": 0.2, "opponent_share": 1.0, "hunt_s": None}
    assert ShieldConfig.of(**_settings(old)).feared_s == math.inf
    assert ShieldConfig.of(**_settings(old | {"opponent_share": 0.0})).feared_s == 0.0
    assert ShieldConfig.of(**_settings({"adversary_s": None, "profile": "players"})).feared_s == 12.0
    assert ShieldConfig.of(**_settings({"hysteresis_m": 0.3, "adversary_s": 12.0})).feared_s == 12.0
    for change in ({"opponent_share": 0.5}, {"hunt_s": 12.0}):
        with pytest.raises(ConfigError, match="no settings of this version"):
            _settings(old | change)
