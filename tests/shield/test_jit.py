"""Machine code: kept on disk, made anew when sources changed, nothing after the warm-up; numba as it is used."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest
import steerclear.shield
from numba import njit
from numba.core.dispatcher import Dispatcher
from shield_scenes import head_on
from steerclear.env.arrays import Games, Rules
from steerclear.shield import Commands, Shield, jit, whole_program
from steerclear.shield.jit import COMPILE_NOTHING, _beside, _stamp, kernel, lean_kernel
from steerclear.shield.workspace import Boats, Registered, Scene, Static, Tuning

KERNEL = """
import math
from steerclear.shield.jit import kernel, lean_kernel

@lean_kernel
def inner(x):
    return {inner}

@kernel
def outer(x, n):
    total = [inner(x)]
    for k in range(n):
        total.append(math.sin(x) ** k)
    if n < 0:
        raise ValueError("less than none")
    return len(total) * total[0]
"""

RUN = """
import logging, sys
logging.basicConfig(format="%(message)s")
sys.path.insert(0, {folder!r})
from {module} import outer
{meanwhile}
print(outer({x}, 3))
"""


@pytest.fixture
def call(tmp_path):
    """Call a kernel of a module in a process of its own; what it prints and logs."""

    def called(inner="2.0 * x", x=1.5, kept=tmp_path / "kept", number=0, meanwhile=""):
        (tmp_path / f"kernels{number}.py").write_text(KERNEL.format(inner=inner))
        run = RUN.format(folder=str(tmp_path), module=f"kernels{number}", x=x, meanwhile=meanwhile)
        environment = os.environ | {"NUMBA_CACHE_DIR": str(kept), "XDG_CACHE_HOME": str(tmp_path / "home")}
        done = subprocess.run([sys.executable, "-c", run], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return float(done.stdout), done.stderr

    return called


def test_a_new_process_reads_what_another_kept_unless_it_is_damaged_or_its_source_has_changed(call, tmp_path):
    first, said = call()
    assert first == 12.0
    assert "compiles its machine code" in said
    (kept,) = (tmp_path / "kept").iterdir()
    for left in (100, -1):
        kept.write_bytes(kept.read_bytes()[:left])
        value, said = call()
        assert value == 12.0
        assert len(said.strip().splitlines()) == 1, "told and made anew"
    assert call() == (12.0, "")
    assert call(inner="5.0 * x")[0] == 30.0, "what a changed callee does is seen"


def test_what_changes_while_a_process_runs_is_not_taken_for_what_that_compiles(call, tmp_path):
    changed = KERNEL.format(inner="5.0 * x")
    assert call(meanwhile=f"open({str(tmp_path / 'kernels0.py')!r}, 'w').write({changed!r})")[0] == 12.0
    assert call(inner="5.0 * x")[0] == 30.0


def test_a_kernel_returns_arrays_that_it_made_to_python():
    @kernel
    def thirds(count):
        made = np.empty((2, count))
        made[:] = 1.0 / 3.0
        return made

    for _ in range(3):
        assert thirds(4).tolist() == [[1.0 / 3.0] * 4] * 2


ROOT = Path(steerclear.shield.__file__).parent.parent

SOURCES = sorted(path for name in ("shield", "env", "policies") for path in (ROOT / name).rglob("*.py"))

COMPILES = re.compile(r"^@\w*kernel\b|import njit|jit import .*kernel\b", re.MULTILINE)


def _left_out(path):
    return path.relative_to(ROOT).as_posix().startswith(COMPILE_NOTHING)


@pytest.mark.parametrize("folder", COMPILE_NOTHING)
def test_folders_left_out_compile_nothing(folder):
    """Their sources are left out of the stamp of compiled code, so none of them may come into it."""
    assert (ROOT / folder).is_dir()
    for path in (ROOT / folder).rglob("*.py"):
        assert not COMPILES.search(path.read_text()), path


def test_nothing_that_compiles_uses_a_folder_left_out():
    names = "|".join(folder.rpartition("/")[2] for folder in COMPILE_NOTHING)
    uses = re.compile(rf"^from [\w.]*\b(?:{names})\b", re.MULTILINE)  # imports within functions compile nothing
    for path in SOURCES:
        if not _left_out(path) and COMPILES.search(path.read_text()):
            assert not uses.search(path.read_text()), path


def test_the_stamp_reads_all_other_sources(monkeypatch):
    read, really = [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.append(path) or really(path))
    _stamp.__wrapped__(_beside(str(ROOT / "shield" / "jit.py")))
    assert {path for path in SOURCES if not _left_out(path)} <= set(read)
    assert not any(path.is_relative_to(ROOT) and _left_out(path) for path in read)


def test_kernels_of_experiments_and_of_others_hang_on_what_is_beside_them_too(tmp_path):
    (tmp_path / "barrier.py").write_text("x = 1")
    first = _stamp.__wrapped__(_beside(str(tmp_path / "barrier.py")))
    (tmp_path / "beside.py").write_text("x = 2")
    own = {_stamp.__wrapped__(_beside(str(ROOT / folder / "jit.py"))) for folder in ("shield", "experiments")}
    assert len({first, _stamp.__wrapped__(_beside(str(tmp_path / "barrier.py"))), *own}) == 4


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


SHARED = (Boats, Static, Registered, Tuning, Scene, Rules, Games)

TAKE_SHARED = [name for name, function in KERNELS.items() if {*get_type_hints(function.py_func).values()} & {*SHARED}]


def test_no_array_of_a_shared_tuple_is_returned():
    """It would not keep alive what it is a part of, in counting kernels neither."""
    assert len(TAKE_SHARED) > 100
    assert [name for name in TAKE_SHARED if gives_array(KERNELS[name])] == []


def test_no_lean_kernel_returns_an_array_or_takes_one_from_another():
    """One it was handed would be freed while its caller has it; one that a counted kernel made would never be."""
    assert len(LEAN) > 100
    assert [name for name, kernel_ in LEAN.items() if gives_array(kernel_)] == []
    for name, kernel_ in LEAN.items():
        called = (kernel_.py_func.__globals__.get(word) for word in kernel_.py_func.__code__.co_names)
        taken = [other.__name__ for other in called if isinstance(other, Dispatcher) and gives_array(other)]
        assert taken == [], name


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


def test_a_kernel_is_called_by_functions_that_numba_compiles_itself():
    inner = kernel(lambda x: x + 1)
    assert njit(lambda x: inner(x) * 2)(1.5) == 5.0


AHEAD = Commands.relative_deg(np.array([[2.0, 0.0]] * 2))


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
def test_decisions_are_the_same_with_and_without(coordination):
    told = []
    for warm in (False, True):
        guard = Shield(coordination=coordination, delay_s=0.2)
        fleet = head_on(5.5)
        before = [guard.decide(fleet, AHEAD).filtered.values]
        if warm:
            guard.warm_up(fleet)
        before += [guard.decide(fleet, AHEAD).filtered.values for _ in range(3)]
        told.append(np.array(before))
    np.testing.assert_array_equal(*told)
