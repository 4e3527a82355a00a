"""Machine code on disk: damaged, unwritable, full or contended, functions compute all the same; one line says so."""

import errno
import importlib.util
import os
import subprocess
import sys
import threading

import pytest
from numba.core import config
from numba.core.caching import CompileResultCacheImpl
from steerclear.shield.compiled import code_places, kept_code
from steerclear.shield.compiled.compiling import PATIENCE_S, Compiling
from steerclear.shield.jit import kernel


class Heard:
    """Hears of compiling; without one it is a line in the log where the machine is slow."""

    def __init__(self):
        self.told, self.ended = [], 0

    def goes_on(self, done, of):
        self.told.append((done, of))

    def ends(self):
        self.ended += 1


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch):
    monkeypatch.setattr(kept_code, "_said", set())
    monkeypatch.setattr(kept_code.COMPILING, "listener", Heard())


@pytest.fixture
def function(tmp_path):
    """A function of a file of its own."""
    path = tmp_path / "one_more.py"
    path.write_text("def one_more(x):\n    return x + 1\n")
    spec = importlib.util.spec_from_file_location("one_more", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.one_more


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The folder that code is kept in."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kept"))
    return tmp_path / "kept"


def hits(compiled):
    return sum(compiled.stats.cache_hits.values())


def test_code_is_found_again(function, kept):
    assert kernel(function)(1.5) == 2.5
    again = kernel(function)
    assert again(1.5) == 2.5
    assert hits(again) == 1
    assert {path.suffix for path in kept.rglob("*") if path.is_file()} == {".nbi", ".nbc"}


def emptied(data):
    return b""


def cut(data):
    return data[: len(data) // 2]


def zeroed(data):
    return data[:-200] + bytes(200)


def one_bit_other(data):
    return data[:-9] + bytes([data[-9] ^ 4]) + data[-8:]


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [emptied, cut, zeroed, one_bit_other])
def test_what_a_power_cut_left_is_compiled_anew_and_mended(function, kept, ending, damage, caplog):
    kernel(function)(1.5)
    (path,) = kept.rglob(f"*{ending}")
    path.write_bytes(damage(path.read_bytes()))
    assert kernel(function)(1.5) == 2.5
    assert kernel(function)(1.5) == 2.5
    (record,) = caplog.records
    assert "made anew" in record.getMessage()
    mended = kernel(function)
    mended(1.5)
    assert hits(mended) == 1


def test_a_folder_in_the_place_of_a_file_is_no_obstacle(function, kept, caplog):
    kernel(function)(1.5)
    (path,) = kept.rglob("*.nbc")
    path.unlink()
    path.mkdir()
    assert kernel(function)(1.5) == 2.5
    assert "cannot be kept" in caplog.text


def test_numbas_own_files_of_before_are_left_and_not_read(function, kept, caplog):
    kernel(function)(1.5)
    (path,) = kept.rglob("*.nbi")
    path.write_bytes(b"\x80\x05K\x01.")
    assert kernel(function)(1.5) == 2.5
    assert caplog.records == []


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EROFS])
def test_a_disk_that_takes_nothing_is_said_once(function, kept, monkeypatch, caplog, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(kept_code.SealedFile, "_save_data", refuse)
    compiled = kernel(function)
    assert compiled(1.5) == 2.5
    assert compiled(1) == 2
    (record,) = caplog.records
    assert "NUMBA_CACHE_DIR" in record.getMessage()


@pytest.fixture
def no_place(monkeypatch):
    """No folder that numba keeps code in can be written to."""
    monkeypatch.setattr(CompileResultCacheImpl, "_locator_classes", [])


def test_without_a_place_code_is_kept_in_a_private_folder(function, no_place, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(kept_code, "private_folder", lambda: tmp_path / "private")
    assert kernel(function)(1.5) == 2.5
    again = kernel(function)
    assert again(1.5) == 2.5
    assert hits(again) == 1
    (record,) = caplog.records
    assert "NUMBA_CACHE_DIR" in record.getMessage()


def test_without_any_place_functions_are_compiled_and_computed(function, no_place, monkeypatch, caplog):
    monkeypatch.setattr(kept_code, "private_folder", lambda: None)
    compiled = kernel(function)
    assert compiled._cache.cache_path is None
    assert caplog.records == [], "nothing is said before something is compiled"
    assert (compiled(1.5), compiled(1)) == (2.5, 2)
    (record,) = caplog.records
    assert "kept nowhere" in record.getMessage()


def test_code_beside_the_source_is_read_where_it_cannot_be_written(function, tmp_path, no_place, monkeypatch):
    """An image in which everything was compiled by its maker, run by somebody else."""
    monkeypatch.setattr(config, "CACHE_DIR", "")
    (tmp_path / "__pycache__").mkdir(exist_ok=True)
    with monkeypatch.context() as maker:
        maker.setattr(CompileResultCacheImpl, "_locator_classes", [kept_code._BesideLocator])
        kernel(function)(1.5)
    monkeypatch.setattr(kept_code, "private_folder", lambda: None)
    compiled = kernel(function)
    assert compiled(1.5) == 2.5
    assert hits(compiled) == 1


def test_a_file_that_was_given_to_another_signature_is_not_taken_for_it(function, kept):
    kernel(function)(1.5)
    other = kernel(function)
    other(1)
    first, second = sorted(kept.rglob("*.nbc"))
    swapped = first.read_bytes(), second.read_bytes()
    second.write_bytes(swapped[0])
    first.write_bytes(swapped[1])
    again = kernel(function)
    assert (again(1.5), again(1)) == (2.5, 2)
    assert hits(again) == 0


FILL = """
import sys
sys.path.insert(0, sys.argv[1])
from one_more import one_more
from steerclear.shield.jit import kernel
compiled = kernel(one_more)
values = {"0": (1.5, 1, True), "1": (1, 1.5, 1j), "2": (1j, True, 1)}[sys.argv[2]]
assert [compiled(value) for value in values] == [value + 1 for value in values]
"""


def test_processes_that_fill_one_folder_at_once_all_compute_right(function, kept, tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(kept)}
    started = [subprocess.Popen([sys.executable, "-c", FILL, str(tmp_path), str(k)], env=environment) for k in range(3)]
    assert [process.wait(120) for process in started] == [0, 0, 0]
    compiled = kernel(function)
    assert (compiled(1.5), compiled(1), compiled(1j)) == (2.5, 2, 1 + 1j)


def test_threads_compile_one_function(function, kept):
    compiled, found = kernel(function), []
    threads = [threading.Thread(target=lambda: found.append(compiled(1.5))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert found == [2.5] * 4


def test_a_private_folder_is_ones_own(tmp_path, monkeypatch):
    monkeypatch.setattr(code_places.tempfile, "gettempdir", lambda: str(tmp_path))
    code_places.private_folder.cache_clear()
    try:
        found = code_places.private_folder()
        assert found.stat().st_mode & 0o077 == 0
        found.chmod(0o777)
        code_places.private_folder.cache_clear()
        assert code_places.private_folder() is None, "others may write to it: what they write would be run"
        found.rmdir()
        (tmp_path / "elsewhere").mkdir()
        found.symlink_to(tmp_path / "elsewhere")
        code_places.private_folder.cache_clear()
        assert code_places.private_folder() is None
    finally:
        code_places.private_folder.cache_clear()


@pytest.fixture
def compiling(monkeypatch):
    """What is told, on a clock that is set by hand."""
    now = [0.0]
    monkeypatch.setattr("steerclear.shield.compiled.compiling.time.monotonic", lambda: now[0])
    return Compiling(), now


def test_compiling_is_told_once_it_takes_long(compiling):
    state, now = compiling
    state.listener = heard = Heard()
    for name in ("a", "b", "c"):
        state.knows(name)
    state.begins("a")
    state.begins("b")
    assert heard.told == []
    now[0] = PATIENCE_S + 0.1
    state.ended("b")
    state.ended("a")
    assert heard.told == [(1, 3), (2, 3)]
    assert heard.ended == 1
    assert (state.count, state.compiled) == (2, 2)


def test_without_a_listener_compiling_is_one_line(compiling, caplog):
    state, now = compiling
    for name in ("a", "b"):
        state.begins(name)
        now[0] += PATIENCE_S + 0.1
        state.ended(name)
    (record,) = caplog.records
    assert "steerclear warm-up" in record.getMessage()


def test_a_function_that_cannot_be_compiled_is_forgotten(compiling):
    state, _ = compiling
    state.begins("a")
    state.begins("broken")
    state.ended("a")
    assert state.busy_s == 0.0
