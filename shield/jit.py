"""The one way compiled functions are made here.

numba makes machine code of every function with all it calls linked in, and again in each of its callers. Here what
compiled code calls is typed and lowered only; machine code is made of the whole, for what Python calls, and kept on
disk. Fast-math stays off: results must be the same bits everywhere, and NaN tests must work.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import compiler, config, sigutils, types, typing
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numpy.typing import NDArray

LOG = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., Any])
Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

COMPILE_NOTHING = ("shield/bridge", "shield/wrappers", "env/render", "policies/submissions", "policies/entrants")
"""Folders that hold no compiled function, nor anything that one uses: changes there leave machine code as it is."""


class _Flags(compiler.Flags):  # type: ignore[misc]
    """numba's options; theirs are hashed one by one at every step of typing."""

    __slots__ = ()

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return type(other) is _Flags and self._values == other._values


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """What a function is lowered to, and the libraries of all it calls; no machine code is made of it."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._linking_libraries: dict[Any, None] = {}

    def finalize(self) -> None:
        """Leave it to the whole."""
        self._finalized = True

    def add_linking_library(self, library: Any) -> None:
        """Note what is called, and what that calls."""
        library._ensure_finalized()
        self._linking_libraries |= {library: None} | (library._linking_libraries if isinstance(library, _Part) else {})


class _Whole(JITCodeLibrary):  # type: ignore[misc]
    """All parts of what Python calls."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage.name == "linkonce_odr" and not function.is_declaration:
                function.linkage = "internal"
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A function that is compiled for each kind of arguments: as a part for compiled code, as a whole for Python."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._parts: dict[Any, Any] = {}
        self._cache = _Kept(f"{self.py_func.__module__}.{self.py_func.__qualname__}", self.py_func.__code__.co_filename)

    @global_compiler_lock  # type: ignore[untyped-decorator]
    def _part(self, args: Any) -> Any:
        if args not in self._parts:
            flags, library = _Flags(), _Part(self.targetctx.codegen(), self.py_func.__qualname__)
            self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
            flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
            contexts = self.typingctx, self.targetctx
            part = compiler.compile_extra(*contexts, self.py_func, args, None, flags, {}, library)
            self.targetctx.insert_user_function(part.fndesc, part.fndesc, (library, *library._linking_libraries))
            self._parts[args] = part
        return self._parts[args]

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a compiled caller asks for; not for each value of a constant anew."""
        kws = {name: types.unliteral(kind) for name, kind in kws.items()}
        python_signature, args = self._compiler.fold_argument_types(tuple(map(types.unliteral, args)), kws)
        signatures = [self._part(tuple(args)).signature]
        return typing.make_concrete_template("Call", self.py_func.__name__, signatures), python_signature, args, {}

    def get_overload(self, sig: Any) -> Any:
        """What a compiled caller's code is found by."""
        return self._part(tuple(sigutils.normalize_signature(sig)[0])).fndesc

    @global_compiler_lock  # type: ignore[untyped-decorator]
    def compile(self, sig: Any) -> Any:
        """What Python calls."""
        args = tuple(sigutils.normalize_signature(sig)[0])
        if args not in self.overloads:
            self.add_overload(self._cache.load_overload(args, self.targetctx) or self._whole(args))
        return self.overloads[args].entry_point

    def _whole(self, args: Any) -> Any:
        collecting, context = gc.isenabled(), self.targetctx
        gc.disable()  # a sixth of the time, and next to nothing to collect
        try:
            part = self._part(args)
            library = _Whole(context.codegen(), part.library.name)
            library.enable_object_caching()
            context.create_cpython_wrapper(library, part.fndesc, part.environment, part.call_helper, release_gil=True)
            for each in (part.library, *part.library._linking_libraries):
                library.add_linking_library(each)
            entry = context.get_executable(library, part.fndesc, part.environment)
        finally:
            gc.freeze()
            gc.unfreeze()  # what was made is old, and not looked through at the next turn
            if collecting:
                gc.enable()
        for name in (variable.name for variable in library._final_module.global_variables):
            if name.startswith("_ZN08NumbaEnv") and lookup_environment(name) is not None:
                library.codegen.set_env(name, lookup_environment(name))
        whole = part._replace(library=library, entry_point=entry, target_context=context)
        self._cache.save_overload(args, whole)
        return whole


def kernel(function: F) -> F:
    """Compile a function with numba: cached on disk, without the GIL, IEEE division (no ZeroDivisionError)."""
    return _compiled(function, counted=True)


def lean_kernel(function: F) -> F:
    """The same for a function that makes no array: those it is handed stay its caller's, and are not counted."""
    return _compiled(function, counted=False)


def _compiled(function: F, counted: bool) -> F:
    if config.DISABLE_JIT:
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy", "_nrt": counted}
    return cast(F, Kernel(function, targetoptions=options))


@cache
def _stamp(file: str) -> str:
    """Digest of all that machine code may hang on: the sources, those beside a function, numba, the machine."""
    root, digest = Path(__file__).parent.parent, hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    paths = {path for name in ("shield", "env", "policies") for path in (root / name).rglob("*.py")}
    paths = {path for path in paths if not path.relative_to(root).as_posix().startswith(COMPILE_NOTHING)}
    if Path(file).is_relative_to(root / "experiments"):
        paths |= set((root / "experiments").rglob("*.py"))
    elif not Path(file).is_relative_to(root):  # somebody's barrier
        paths |= set(Path(file).parent.rglob("*.py"))
    for path in sorted(paths):
        name = path.relative_to(root) if path.is_relative_to(root) else path
        digest.update(str(name).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def kept_in() -> Path | None:
    """Where machine code is kept; None: nowhere."""
    given = getattr(config, "CACHE_DIR", "")
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "steerclear"
    for place in [Path(given)] if given else [Path(__file__).parent / "__pycache__", home]:
        try:
            place.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
        except OSError:
            continue
        return place
    _say("compiled code can be kept nowhere: a minute at every start; set NUMBA_CACHE_DIR to a folder for it")
    return None


class _Kept(NullCache):  # type: ignore[misc]
    """Machine code on disk, a sealed file each; never a reason to stop."""

    def __init__(self, name: str, file: str) -> None:
        self._name, self._file = name, file

    def _path(self, args: Any, context: Any) -> Path | None:
        about = repr((self._name, args, context.codegen().magic_tuple(), _stamp(self._file)))
        place = kept_in()
        return None if place is None else place / f"{self._name}.{hashlib.sha256(about.encode()).hexdigest()[:32]}.code"

    def load_overload(self, args: Any, context: Any) -> Any:
        """The code for some arguments; None where there is none."""
        try:
            path = self._path(args, context)
            sealed = b"" if path is None else path.read_bytes()
            if sealed and hashlib.sha256(sealed[32:]).digest() == sealed[:32]:
                context.refresh()  # installs the C functions that the code calls by name
                return compiler.CompileResult._rebuild(context, *pickle.loads(sealed[32:]))
            if path is not None:
                _say(f"compiled code in {path.parent} cannot be read, it is made anew")
        except FileNotFoundError:
            _say("steerclear compiles its machine code, once: about a minute (steerclear warm-up does it beforehand)")
        except Exception as error:  # what damage leads to is anything
            _say(f"compiled code cannot be read, it is made anew ({error!r})")
        return None

    def save_overload(self, args: Any, made: Any) -> None:
        """Keep it; written beside and put in place at once."""
        try:
            path, content = self._path(args, made.target_context), dumps(made._reduce())
            if path is not None:
                with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(file.name, path)
        except Exception as error:  # the code itself is there and right
            _say(f"compiled code cannot be kept ({error!r}): a minute at every start")


@cache
def _say(words: str) -> None:
    LOG.warning("%s", words)


@lean_kernel
def copy_row(to: Array, source: Array) -> None:
    """Copy a row of numbers, as long as ``source``."""
    for k in range(source.shape[0]):
        to[k] = source[k]
