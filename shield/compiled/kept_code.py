"""Machine code kept on disk: found again whole, or compiled anew; never a reason to stop.

numba's own cache raises when no folder can be written to, when a file was cut off (a power cut leaves it empty), and
when the disk is full; two processes that fill it at once may give one file to two functions. Here every file is sealed
with a digest and says what it is for. What does not fit is compiled again, and said in one line.
"""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core import config
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
    UserWideCacheLocator,
    _Cache,
)

from .code_places import private_folder
from .compile_turns import Turns
from .compiling import COMPILING

LOG = logging.getLogger(__name__)
ANEW = "a minute or two at every start; set NUMBA_CACHE_DIR to a folder that can be written to"
_MARK = b"steerclear 1\n"
_SEAL = hashlib.sha256().digest_size
_PICKLED = b"\x80"
"""How files of numba's own cache begin."""
_said: set[str] = set()


class Damaged(Exception):
    """A kept file is not what was written."""


class KeptCode(_Cache):
    """What numba asks for a function's machine code and gives it to.

    Args:
        function: the Python function.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.name = f"{function.__module__}.{function.__qualname__}"
        self._own, self._remark = _own_cache(function)
        self._beside = _cache_beside(function, self._own)
        self._turns = Turns(None if self._own is None else self._own._cache_file._index_path)
        COMPILING.knows(self.name)

    @property
    def _all(self) -> list[Any]:
        return [cache for cache in (self._own, self._beside) if cache is not None]

    @property
    def cache_path(self) -> str | None:
        """The folder in which code is kept; None when it is kept nowhere."""
        return None if self._own is None else str(self._own.cache_path)

    @property
    def stamp(self) -> Any:
        """What kept code must have been compiled from, or it is not used."""
        return self._all[0]._cache_file._source_stamp if self._all else ()

    @stamp.setter
    def stamp(self, stamp: Any) -> None:
        for cache in self._all:
            cache._cache_file._source_stamp = stamp

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code of a signature, None when it must be compiled; what another process compiles is waited for."""
        found = self._found(sig, target_context)
        if found is None:
            self._turns.take(sig)
            found = self._found(sig, target_context)
            if found is not None:
                self._turns.give(sig)
        if found is not None:
            COMPILING.loaded(self.name)
            return found
        if self._remark:
            _say("place", self._remark)
        COMPILING.begins(self.name)
        return None

    def _found(self, sig: Any, target_context: Any) -> Any:
        """The code of a signature, None when none is kept."""
        for cache in self._all:
            try:
                found = cache.load_overload(sig, target_context)
            except Exception as error:  # what damage leads to is anything
                _say(
                    "damaged", f"compiled code in {cache.cache_path} cannot be read, it is made anew ({_words(error)})"
                )
                continue
            if found is not None:
                return found
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code of a signature."""
        COMPILING.ended(self.name)
        try:
            if self._own is not None:
                self._own.save_overload(sig, data)
        except Exception as error:  # the code itself is there and right
            _say("full", f"compiled code cannot be kept in {self._own.cache_path} ({_words(error)}): {ANEW}")
        finally:
            self._turns.give(sig)

    def enable(self) -> None:
        """Use what is kept."""
        for cache in self._all:
            cache.enable()

    def disable(self) -> None:
        """Use nothing and keep nothing."""
        for cache in self._all:
            cache.disable()

    def flush(self) -> None:
        """Forget what is kept."""
        if self._own is not None:
            self._own.flush()


class SealedFile(IndexDataCacheFile):
    """Index and files of one function, each with a digest over what it holds."""

    def save(self, key: Any, data: Any) -> None:
        """Keep data with what it is for; a damaged index is begun anew."""
        try:
            self._load_index()
        except Exception:  # told when it was read
            self.flush()
        super().save(key, (key, data))

    def load(self, key: Any) -> Any:
        """The data of a key; None when there is none, or when another process gave its file to another key."""
        found = super().load(key)
        return found[1] if found is not None and found[0] == key else None

    def _load_index(self) -> dict[Any, str]:
        try:
            text = Path(self._index_path).read_bytes()
        except FileNotFoundError:
            return {}
        if text.startswith(_PICKLED):  # numba's own, of an earlier version
            return {}
        version, rest = pickle.loads(_opened(text, self._index_path))
        if version != self._version:  # the rest may not be read by this version
            return {}
        stamp, overloads = pickle.loads(rest)
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        rest = self._dump((self._source_stamp, overloads))
        with self._open_for_write(self._index_path) as file:
            file.write(_sealed(pickle.dumps((self._version, rest))))

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        return pickle.loads(_opened(Path(path).read_bytes(), path))

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as file:
            file.write(_sealed(self._dump(data)))


def _sealed(content: bytes) -> bytes:
    return _MARK + hashlib.sha256(content).digest() + content


def _opened(text: bytes, path: str) -> bytes:
    """Content of a sealed file.

    Raises:
        Damaged: it is not what was sealed.
    """
    start = len(_MARK) + _SEAL
    content = text[start:]
    if not text.startswith(_MARK) or text[len(_MARK) : start] != hashlib.sha256(content).digest():
        raise Damaged(Path(path).name)
    return content


class _PrivateLocator(UserWideCacheLocator):
    """Keeps code in `private_folder`."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        self._cache_path = str(Path(str(private_folder())) / self.get_suitable_cache_subpath(file))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        return None if private_folder() is None else super().from_function(function, file)


class _BesideLocator(InTreeCacheLocator):
    """Reads code beside the source, whether or not it can be written there."""

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        return cls(function, file)


def _own_cache(function: Callable[..., Any]) -> tuple[Any, str]:
    """Where numba keeps code of a function, else a temporary folder, else None; and what is to be said of it."""
    try:
        return _sealed_cache(function), ""
    except (RuntimeError, OSError):  # numba found no folder that can be written to
        pass
    try:
        place = private_folder()
        words = f"compiled code is kept in {place}, a temporary folder: set NUMBA_CACHE_DIR to a lasting one"
        return _sealed_cache(function, _PrivateLocator), words
    except (RuntimeError, OSError):
        return None, f"compiled code can be kept nowhere, and compiling takes {ANEW}"


def _cache_beside(function: Callable[..., Any], own: Any) -> Any:
    """Code beside the source that was put there by whoever installed it, where this user can only read it."""
    beside = Path(function.__code__.co_filename).parent / "__pycache__"
    if getattr(config, "CACHE_DIR", "") or not beside.is_dir() or (own is not None and Path(own.cache_path) == beside):
        return None
    try:
        return _sealed_cache(function, _BesideLocator)
    except (RuntimeError, OSError):
        return None


def _sealed_cache(function: Callable[..., Any], *locators: type) -> Any:
    """The cache numba has of a function, with sealed files: in the place of a locator, or else where numba would.

    Raises:
        RuntimeError: there is no such place.
    """
    impl = type("_Impl", (CompileResultCacheImpl,), {"_locator_classes": list(locators)} if locators else {})
    made = type("_Cache", (FunctionCache,), {"_impl_class": impl})(function)
    file = made._cache_file
    made._cache_file = SealedFile(file._cache_path, made._impl.filename_base, file._source_stamp)
    return made


def _words(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _say(about: str, words: str) -> None:
    """Say something once in a process; workers leave it to those who started them."""
    if about not in _said and multiprocessing.parent_process() is None:
        LOG.warning("%s", words)
    _said.add(about)
