"""Numba's cache of a function that Python calls, in the folders of `core.code_cache`."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]

from mbsim.core import processors, profile
from mbsim.core.code_cache import TESTED, Sources, cache_root, note_unkept


class _ContentLocator(_CacheLocator):
    """A folder named by content."""

    def __init__(self, sources: Sources) -> None:
        self.sources = sources

    def get_cache_path(self) -> str:
        return str(self.sources.folder)

    def ensure_cache_path(self) -> None:
        self.sources.make_folder()

    def get_source_stamp(self) -> str:
        return "content"  # the folder's name already says it

    def get_disambiguator(self) -> str:
        return ""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _ContentLocator:
        return cls(Sources(py_func))


class _ByContent(CompileResultCacheImpl):
    _locator_classes: Any = (_ContentLocator,)


@functools.cache
def name_runtime() -> None:
    """Name the functions that stored code may call: Numba does so where it compiles its own."""
    _ = cpu_target.target_context  # names all others when it is made
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class CodeCache(FunctionCache):
    """Numba's cache of one function, in the user's folder and in shipped ones."""

    _impl_class = _ByContent

    def __init__(self, py_func: Callable[..., Any], on_miss: Callable[[str], None]) -> None:
        super().__init__(py_func)  # type: ignore[no-untyped-call]
        self._on_miss = on_miss
        self._sources: Sources = self._impl.locator.sources

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is stored, without what only compiling needs: half a second of imports.

        Stored code is complete but for Numba's reference counts; the compiler loads the rest
        itself. A Numba that this was not tried with is asked as it asks itself.
        """
        if numba.__version__ not in TESTED:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        name_runtime()
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        with profile.part("load"):
            return self._loaded(sig, target_context)

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        key = self._index_key(sig, target_context.codegen())  # type: ignore[no-untyped-call]
        data = None if self._sources.changed() else self._find(key)
        if data is None:
            self._on_miss(self._py_func.__qualname__)
            return None
        return self._impl.rebuild(target_context, data)

    def _save_overload(self, sig: Any, data: Any) -> None:
        if self._sources.changed_by_now():
            return
        try:
            super()._save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:  # a folder that cannot be written, or is full
            note_unkept(cache_root(), error)

    def _find(self, key: Any) -> Any:
        """Return what is stored of a root, None where nothing is."""
        signature, (triple, *_), code = key
        self._sources.checked_folder()
        for file, family in [(self._cache_file, ""), *self._shipped()]:
            wanted = key
            if family:
                wanted = signature, (triple, family, processors.features(family)), code
            try:
                data = file.load(wanted)
            except OSError:  # a folder that cannot be read holds nothing
                continue
            if data is not None:
                return data
        return None

    def _shipped(self) -> list[tuple[IndexDataCacheFile, str]]:
        """Return this function's files in the folders of shipped code, and their families."""
        locator, name = self._impl.locator, self._impl.filename_base
        return [
            (IndexDataCacheFile(str(path), name, locator.get_source_stamp()), family)
            for path, family in self._sources.shipped()
        ]

    def is_empty(self) -> bool:
        """Return whether nothing is stored of this function, with any signature."""
        files = [self._cache_file, *(file for file, _ in self._shipped())]
        try:
            return not any(file._load_index() for file in files)
        except OSError:
            return True
