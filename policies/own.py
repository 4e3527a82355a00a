"""Policies of your own by the name of a file or module: ``mypol.py``, ``mypol.py:act``, ``mypol:act``.

Your own code runs in this process. Code of others is a submission.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import describe_error

from .adapters import from_agents, from_callable
from .protocol import TeamPolicy
from .submissions.stage import ENTRY_FILE, near_files

DEFAULT = "act"
"""Name that is used if none is given."""
FORMS = (
    f"a function {DEFAULT}(observation) -> action, a class with reset and act, or one with compute_action(obs, info)"
)


def own_code(text: str) -> tuple[str, str] | None:
    """Return file or module, and the name in it, for a policy's name; None if it is no such name."""
    where, colon, name = text.rpartition(":")
    if colon and name.isidentifier() and (where.endswith(".py") or all(map(str.isidentifier, where.split(".")))):
        return (where, name) if where not in ("sb3", "weights") else None
    return (text, DEFAULT) if text.endswith(".py") and Path(text).name != ENTRY_FILE else None


def file_of(where: str) -> Path | None:
    """Return the file of the code; None for an installed module."""
    path = Path(where).expanduser() if where.endswith(".py") else Path(*where.split(".")).with_suffix(".py")
    return path.absolute() if where.endswith(".py") or path.is_file() else None


def check_own(where: str, name: str) -> None:
    """Check that the file or module exists and that the file is Python, without running it."""
    path = file_of(where)
    try:
        there = path.is_file() if path is not None else importlib.util.find_spec(where) is not None
    except (ImportError, ValueError):
        there = False
    if not there:
        hint = near_files(where if where.endswith(".py") else f"{where}.py")
        file = path or f"{where}.py"
        raise PolicyError(f"there is no policy {where}:{name}: no file {file}; {hint}give FILE.py:NAME")
    if path is not None:
        _check_syntax(path)


def _check_syntax(path: Path) -> None:
    """Refuse a file that Python cannot read."""
    try:
        ast.parse(path.read_bytes(), path.name)
    except SyntaxError as error:
        raise PolicyError(f"{path}, line {error.lineno}: {error.msg}; correct the Python there") from None
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        raise PolicyError(f"{path} cannot be read as Python ({describe_error(error)}); correct it") from None


def load_own(where: str, name: str) -> TeamPolicy:
    """Return the team policy of that name in a file or module."""
    try:
        found = getattr(_module(where), name, None)
        if found is None:
            raise PolicyError(f"{where} has no {name!r}; define there {FORMS}, or give {where}:NAME")
        if isinstance(found, type) and not hasattr(found, "compute_action"):
            found = found()
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        raise PolicyError(f"policy {where}:{name} cannot be built: {describe_error(error)}") from error
    if hasattr(found, "reset") and hasattr(found, "act"):
        if not hasattr(found, "name"):
            found.name = f"{Path(where).stem}:{name}"
        team: TeamPolicy = found  # recognised by its attributes
        return team
    if hasattr(found, "compute_action") and isinstance(found, type):
        return from_agents(found, Path(where).stem)
    if callable(found):
        return from_callable(found, Path(where).stem)
    raise PolicyError(f"{where}:{name} is a {type(found).__name__}; give {FORMS}")


def _module(where: str) -> ModuleType:
    """Return the module; run it anew if it is a file, with its folder importable."""
    path = file_of(where)
    if path is None:
        return importlib.import_module(where)
    if not path.is_file():
        raise PolicyError(f"there is no policy at {path}; {near_files(where)}give a Python file with {FORMS}")
    if str(path.parent) not in sys.path:
        sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(f"steerclear_own_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise PolicyError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
