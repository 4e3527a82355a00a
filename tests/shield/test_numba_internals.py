"""The canary: what of numba's inside `jit` and `shared` of the shield are built on; a new version shows here."""

import inspect

import pytest
from numba import njit, types
from numba.core import codegen, compiler, config, dispatcher, environment, imputils, registry
from numba.core.registry import cpu_target
from numba.core.typing import make_concrete_template, templates
from steerclear.shield.jit import kernel, lean_kernel


def parameters(function):
    return list(inspect.signature(function).parameters)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (dispatcher.Dispatcher.get_call_template, ["self", "args", "kws"]),
        (dispatcher.Dispatcher.get_overload, ["self", "sig"]),
        (dispatcher.Dispatcher.compile, ["self", "sig"]),
        (dispatcher.Dispatcher.add_overload, ["self", "cres"]),
        (compiler.compile_extra, ["typingctx", "targetctx", "func", "args", "return_type", "flags", "locals", "library",
                                  "pipeline_class"]),
        (compiler.CompileResult._rebuild.__func__, None),
        (compiler.CompileResult._reduce, ["self"]),
        (codegen.JITCodeLibrary.finalize, ["self"]),
        (codegen.JITCodeLibrary.add_linking_library, ["self", "library"]),
        (codegen.CPUCodeLibrary._optimize_final_module, ["self"]),
        (environment.lookup_environment if hasattr(environment, "lookup_environment") else len, None),
        (make_concrete_template, ["name", "key", "signatures"]),
    ],
    ids=lambda value: getattr(value, "__qualname__", None),
)  # fmt: skip
def test_what_is_called_and_overridden_has_the_form_it_is_used_in(function, expected):
    assert expected is None or parameters(function) == expected


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


def test_a_callee_is_compiled_once_whatever_constants_it_is_called_with():
    inner = lean_kernel(lambda x, k, deep: x + k if deep else x - k)
    outer = kernel(lambda x: inner(x, 1, True) + inner(x, 2, deep=False))
    assert outer(1.5) == 2.0
    assert len(inner._parts) == 1


def test_targets_templates_and_folders_are_where_they_were():
    assert cpu_target.typing_context is not None
    assert issubclass(registry.CPUDispatcher, dispatcher.Dispatcher)
    assert callable(templates.infer_getattr)
    assert callable(imputils.lower_getattr_generic)
    assert hasattr(config, "CACHE_DIR")
