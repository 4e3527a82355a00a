"""Machine code made once, of the whole call tree; it relies on the numba internals listed in `USED`.

numba makes machine code of every function with all it calls linked in, and again in each of its callers. Here,
functions that compiled code calls are only typed and lowered; machine code is made of the whole, for functions that
Python calls. If a version of numba differs from what is used (`unlike`), `jit` compiles in numba's own way.
"""

# mypy: disable-error-code="attr-defined,assignment,misc,untyped-decorator,unused-ignore"

from __future__ import annotations

import gc
import inspect
from typing import Any

from numba.core import compiler, sigutils, types, typing
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher

USED = {
    "get_call_template": (CPUDispatcher, ("self", "args", "kws")),
    "get_overload": (CPUDispatcher, ("self", "sig")),
    "compile": (CPUDispatcher, ("self", "sig")),
    "add_overload": (CPUDispatcher, ("self", "cres")),
    "compile_extra": (
        compiler,
        ("typingctx", "targetctx", "func", "args", "return_type", "flags", "locals", "library", "pipeline_class"),
    ),
    "_reduce": (compiler.CompileResult, ("self",)),
    "finalize": (JITCodeLibrary, ("self",)),
    "add_linking_library": (JITCodeLibrary, ("self", "library")),
    "_optimize_final_module": (JITCodeLibrary, ("self",)),
    "make_concrete_template": (typing, ("name", "key", "signatures")),
}
"""Numba functions called and overridden here: name, owner and parameters."""


def unlike() -> str:
    """Return which numba internal differs from what is used here; empty: none."""
    for name, (owner, expected) in USED.items():
        found = getattr(owner, name, None)
        if found is None:
            return f"{owner.__name__} has no {name}"
        parameters = tuple(inspect.signature(found).parameters)
        if parameters != expected:
            return f"{owner.__name__}.{name} takes {', '.join(parameters)}"
    return ""


class _Flags(compiler.Flags):
    """numba's options; its own class hashes them one by one at every step of typing."""

    __slots__ = ()

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return type(other) is _Flags and self._values == other._values


class _Part(JITCodeLibrary):
    """A lowered function and the libraries of everything it calls; no machine code is made of it."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._linking_libraries: dict[Any, None] = {}

    def finalize(self) -> None:
        """Mark as final; `_Whole` makes the machine code."""
        self._finalized = True

    def add_linking_library(self, library: Any) -> None:
        """Note a called library, and those that it calls."""
        library._ensure_finalized()
        self._linking_libraries |= {library: None} | (library._linking_libraries if isinstance(library, _Part) else {})


class _Whole(JITCodeLibrary):
    """All parts of a function that Python calls."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage.name == "linkonce_odr" and not function.is_declaration:
                function.linkage = "internal"
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class Kernel(CPUDispatcher):
    """A function compiled for each kind of arguments: as a part for compiled callers, as a whole for Python."""

    def __init__(self, *args: Any, kept: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._parts: dict[Any, Any] = {}
        self._cache = kept

    @global_compiler_lock
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
        """Return what a compiled caller needs for typing; values of constants are not told apart."""
        kws = {name: types.unliteral(kind) for name, kind in kws.items()}
        python_signature, args = self._compiler.fold_argument_types(tuple(map(types.unliteral, args)), kws)
        signatures = [self._part(tuple(args)).signature]
        return typing.make_concrete_template("Call", self.py_func.__name__, signatures), python_signature, args, {}

    def get_overload(self, sig: Any) -> Any:
        """Return what a compiled caller finds the code by."""
        return self._part(tuple(sigutils.normalize_signature(sig)[0])).fndesc

    @global_compiler_lock
    def compile(self, sig: Any) -> Any:
        """Return the entry point that Python calls."""
        args = tuple(sigutils.normalize_signature(sig)[0])
        if args not in self.overloads:
            self.add_overload(self._cache.load_overload(args, self.targetctx) or self._whole(args))
        return self.overloads[args].entry_point

    def _whole(self, args: Any) -> Any:
        collecting = gc.isenabled()
        context = self.targetctx.subtarget(enable_nrt=self.targetoptions.get("_nrt", True))  # boxes arrays it returns
        gc.disable()  # collecting takes a sixth of the time and frees almost nothing
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
            gc.unfreeze()  # new objects count as old: the next collection skips them
            if collecting:
                gc.enable()
        for name in (variable.name for variable in library._final_module.global_variables):
            if name.startswith("_ZN08NumbaEnv") and lookup_environment(name) is not None:
                library.codegen.set_env(name, lookup_environment(name))
        whole = part._replace(library=library, entry_point=entry, target_context=context)
        self._cache.save_overload(args, whole)
        return whole
