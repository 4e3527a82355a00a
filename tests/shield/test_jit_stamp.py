import re
from pathlib import Path

import steerclear.shield
from steerclear.shield.jit import _tree_stamp


def test_the_bridge_compiles_nothing():
    """Its sources are left out of the stamp of compiled code, so none of them may come into it."""
    for path in (Path(steerclear.shield.__file__).parent / "bridge").rglob("*.py"):
        text = path.read_text()
        assert "import njit" not in text, path
        assert not re.search(r"^@\w*kernel\b", text, re.MULTILINE), path
        assert not re.search(r"jit import .*kernel\b", text), path


def test_the_stamp_is_of_all_other_sources():
    here = Path(steerclear.shield.__file__).parent
    files = [path for name in ("shield", "env", "policies") for path in (here.parent / name).rglob("*.py")]
    assert _tree_stamp()[1] == sum("bridge" not in path.relative_to(here.parent).parts for path in files)
