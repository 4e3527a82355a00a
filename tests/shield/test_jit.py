"""Machine code is kept on disk, read in new processes, made anew when its sources or its files are not as they were."""

import os
import subprocess
import sys

import numpy as np
import pytest
from steerclear.shield.jit import kernel

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


def test_a_new_process_reads_what_another_kept_and_does_as_it_did(call):
    first, said = call()
    assert first == 12.0
    assert "compiles its machine code" in said
    assert call() == (12.0, "")


def test_what_a_changed_callee_does_is_seen(call):
    call()
    assert call(inner="5.0 * x")[0] == 30.0


def test_what_changes_while_a_process_runs_is_not_taken_for_what_that_compiles(call, tmp_path):
    changed = KERNEL.format(inner="5.0 * x")
    assert call(meanwhile=f"open({str(tmp_path / 'kernels0.py')!r}, 'w').write({changed!r})")[0] == 12.0
    assert call(inner="5.0 * x")[0] == 30.0


def test_a_damaged_file_is_told_and_made_anew(call, tmp_path):
    call()
    (kept,) = (tmp_path / "kept").iterdir()
    for left in (0, 100, -1):
        kept.write_bytes(kept.read_bytes()[:left])
        value, said = call()
        assert value == 12.0
        assert len(said.strip().splitlines()) == 1
    assert call() == (12.0, "")


def test_a_folder_that_cannot_be_written_is_told_and_stops_nothing(call, tmp_path):
    (tmp_path / "file").write_text("")
    value, said = call(kept=tmp_path / "file" / "below")
    assert value == 12.0
    assert "NUMBA_CACHE_DIR" in said or (tmp_path / "home").is_dir()


def test_a_kernel_returns_arrays_that_it_made_to_python():
    @kernel
    def thirds(count):
        made = np.empty((2, count))
        made[:] = 1.0 / 3.0
        return made

    for _ in range(3):
        assert thirds(4).tolist() == [[1.0 / 3.0] * 4] * 2
