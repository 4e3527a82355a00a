"""What of numba's inside is built on (`shield.kept_code`, `shield.shared`, `shield.jit`): a new version shows here."""

import inspect

import pytest
from numba import njit, types
from numba.core import caching, cgutils, config, dispatcher, imputils
from numba.core.registry import cpu_target
from numba.core.typing import templates
from steerclear.shield.compiled.kept_code import KeptCode, SealedFile
from steerclear.shield.jit import copy_row, lean_kernel


def parameters(function):
    return list(inspect.signature(function).parameters)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (caching._Cache.load_overload, ["self", "sig", "target_context"]),
        (caching._Cache.save_overload, ["self", "sig", "data"]),
        (caching.IndexDataCacheFile.__init__, ["self", "cache_path", "filename_base", "source_stamp"]),
        (caching.IndexDataCacheFile.save, ["self", "key", "data"]),
        (caching.IndexDataCacheFile.load, ["self", "key"]),
        (caching.IndexDataCacheFile._load_index, ["self"]),
        (caching.IndexDataCacheFile._save_index, ["self", "overloads"]),
        (caching.IndexDataCacheFile._load_data, ["self", "name"]),
        (caching.IndexDataCacheFile._save_data, ["self", "name", "data"]),
        (caching.InTreeCacheLocator.from_function, ["py_func", "py_file"]),
        (caching.UserWideCacheLocator.__init__, ["self", "py_func", "py_file"]),
        (dispatcher.Dispatcher.get_call_template, ["self", "args", "kws"]),
    ],
    ids=lambda value: getattr(value, "__qualname__", None),
)
def test_what_is_overridden_has_the_form_it_is_overridden_in(function, expected):
    assert parameters(function) == expected


def test_a_dispatcher_asks_the_cache_that_stands_in_its_place():
    asked = []

    class Listening(KeptCode):
        def load_overload(self, sig, target_context):
            asked.append(sig)

        def save_overload(self, sig, data):
            asked.append(data)

    compiled = njit(lambda x: x + 1)
    compiled._cache = Listening(test_a_dispatcher_asks_the_cache_that_stands_in_its_place)
    assert compiled(1.5) == 2.5
    assert len(asked) == 2


def test_compiling_for_types_gives_what_can_be_called_at_once():
    """As `shared.Called` does, also where the function has machine code already."""
    compiled = njit(lambda x: x + 1)
    entry = compiled.compile((types.float64,))
    assert entry(1.5) == 2.5
    assert compiled.compile((types.float64,)) is entry


def test_a_cache_has_the_attributes_that_are_replaced():
    file = copy_row._cache._own._cache_file
    assert isinstance(file, SealedFile)
    assert {"_source_stamp", "_index_path", "_cache_path", "_version"} <= set(vars(file))
    assert hasattr(config, "CACHE_DIR")


def test_lean_kernels_are_compiled_without_counting():
    assert lean_kernel(lambda x: x).targetoptions["_nrt"] is False


def test_a_callee_is_compiled_once_whatever_constants_it_is_called_with():
    inner = lean_kernel(lambda x, k, deep: x + k if deep else x - k)
    outer = njit(lambda x: inner(x, 1, True) + inner(x, 2, deep=False))
    assert outer(1.5) == 2.0
    assert len(inner.signatures) == 1


@pytest.mark.parametrize(
    "name", ["cgutils.alloca_once_value", "imputils.impl_ret_borrowed", "imputils.lower_getattr_generic"]
)
def test_helpers_of_shared_tuples_are_there(name):
    module, _, function = name.partition(".")
    assert callable(getattr({"cgutils": cgutils, "imputils": imputils}[module], function))


def test_targets_and_templates_are_where_they_were():
    assert cpu_target.typing_context is not None
    assert callable(templates.infer_getattr)
    assert issubclass(templates.AttributeTemplate, object)
