"""The canary: what of numba's inside `jit` and `shared` of the shield are built on; a new version shows here."""

import os
import subprocess
import sys

import pytest
from numba import njit, types
from steerclear.shield import jit, whole_program
from steerclear.shield.jit import kernel, lean_kernel

OTHER_NUMBA = """
import logging
logging.basicConfig(format="%(message)s")
from numba.core import compiler, registry
{change}
from typing import NamedTuple
import numpy as np
from numba.core.registry import CPUDispatcher
from steerclear.shield.jit import Array, kernel, lean_kernel
from steerclear.shield.shared import share

class Row(NamedTuple):
    values: Array

@lean_kernel
def inner(row):
    return row.values[1]

@kernel
def outer(row):
    return 2.0 * inner(row)

assert type(outer) is CPUDispatcher
print(outer(share(Row(np.array([1.0, 2.5])))))
"""


def test_what_is_called_and_overridden_has_the_form_it_is_used_in():
    assert whole_program.unlike() == ""
    assert jit._whole_program() is whole_program


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (
            "was = compiler.compile_extra; compiler.compile_extra = lambda *a, **kw: was(*a, **kw)",
            "compile_extra takes a, kw",
        ),
        ("del compiler.CompileResult._reduce", "CompileResult has no _reduce"),
        ("import numba.core.environment; del numba.core.environment.lookup_environment", "lookup_environment"),
    ],
)
def test_with_another_numba_kernels_are_compiled_by_its_own_means(change, named):
    run = [sys.executable, "-c", OTHER_NUMBA.format(change=change)]
    done = subprocess.run(run, env=os.environ, capture_output=True, text=True, check=False)
    assert done.stdout == "5.0\n", done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert named in done.stderr


def test_only_what_python_calls_becomes_machine_code():
    inner = lean_kernel(lambda x: x + 1)
    outer = kernel(lambda x: inner(x) * 2)
    assert outer(1.5) == 5.0
    assert not inner.overloads
    assert len(outer.overloads) == 1


def test_compiling_for_types_gives_what_can_be_called_at_once():
    """Also where the function has machine code already."""
    compiled = kernel(lambda x: x + 1)
    entry = compiled.compile((types.float64,))
    assert entry(1.5) == 2.5
    assert compiled.compile((types.float64,)) is entry


def test_a_kernel_is_called_by_functions_that_numba_compiles_itself():
    inner = kernel(lambda x: x + 1)
    assert njit(lambda x: inner(x) * 2)(1.5) == 5.0


def test_lean_kernels_are_compiled_without_counting():
    assert lean_kernel(lambda x: x).targetoptions["_nrt"] is False
