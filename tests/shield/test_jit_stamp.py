import re
from pathlib import Path

import pytest
import steerclear.shield
from steerclear.shield.jit import COMPILE_NOTHING, _beside, _stamp

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
