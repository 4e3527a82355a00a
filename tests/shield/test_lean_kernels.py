"""Kernels that count no references: what they must not do."""

import importlib
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest
import steerclear.shield
from numba.core.dispatcher import Dispatcher
from steerclear.env.arrays import Games, Rules
from steerclear.shield.workspace import Boats, Registered, Scene, Static, Tuning

ROOT = Path(steerclear.shield.__file__).parent.parent
FOLDERS = ("shield", "env", "policies")


def kernels():
    """Every compiled function of the product and the games, by name."""
    found = {}
    for path in sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")):
        if "kernel" not in path.read_text():
            continue
        module = ".".join(("steerclear", *path.relative_to(ROOT).with_suffix("").parts))
        members = vars(importlib.import_module(module)).values()
        found |= {f"{v.__module__}.{v.__name__}": v for v in members if isinstance(v, Dispatcher)}
    return found


KERNELS = kernels()
LEAN = {name: function for name, function in KERNELS.items() if not function.targetoptions["_nrt"]}


def holds_array(hint):
    """Whether values of a type are arrays or have some in them."""
    if (get_origin(hint) or hint) is np.ndarray:
        return True
    fields = get_type_hints(hint).values() if hasattr(hint, "_fields") else get_args(hint)
    return any(holds_array(part) for part in fields)


def gives_array(function):
    return holds_array(get_type_hints(function.py_func)["return"])


def test_there_are_both_kinds():
    assert len(LEAN) > 100
    assert len(KERNELS) > len(LEAN)
    assert any(map(gives_array, KERNELS.values())), "some counted ones return arrays: the test can tell"


SHARED = (Boats, Static, Registered, Tuning, Scene, Rules, Games)
TAKE_SHARED = [name for name, function in KERNELS.items() if {*get_type_hints(function.py_func).values()} & {*SHARED}]


def test_no_array_of_a_shared_tuple_is_returned():
    """It would not keep alive what it is a part of, in counting kernels neither."""
    assert len(TAKE_SHARED) > 100
    assert [name for name in TAKE_SHARED if gives_array(KERNELS[name])] == []


@pytest.mark.parametrize("name", sorted(LEAN))
def test_it_returns_no_array_and_takes_none_from_another(name):
    """One it was handed would be freed while its caller has it; one that a counted kernel made would never be."""
    function = LEAN[name].py_func
    assert not gives_array(LEAN[name])
    called = (function.__globals__.get(word) for word in function.__code__.co_names)
    assert [other.__name__ for other in called if isinstance(other, Dispatcher) and gives_array(other)] == []
