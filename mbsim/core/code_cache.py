"""Where compiled code is kept: the user's folder, and folders of code that was shipped.

A root's code is stored under a digest of *all* project files that it can reach through imports:
Numba's own check sees only the file of the function itself, and would go on using an edited
helper's old code. Numba's version, the link policy, Python's minor version, signature and processor
are part of the key as well. A process whose files were changed after it began (an edit, an upgrade)
may run other code than they hold: it neither loads nor stores what they reach.

A shipped folder (`mbsim warm --target`) holds code for families of processors. It is looked into
for what the user's folder has not, and never written.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]

from mbsim.core import linking, processors, profile
from mbsim.errors import ModelError

_BEGAN = time.time()
PACKAGE = Path(__file__).resolve().parent.parent
_PACKAGE = str(PACKAGE)
_IMPORT = re.compile(
    r"^\s*(?:from\s+(mbsim[\w.]*)\s+import\s+(\([^)]*\)|.+)|import\s+(mbsim[\w.]*))", re.M
)
#: Below a folder of code: that of other versions and policies is not mixed with ours.
_VERSION = f"{numba.__version__}-{linking.POLICY}"


def cache_root() -> Path:
    """Return the folder of compiled code: $MBSIM_CACHE_DIR, or the user's cache folder."""
    named = os.environ.get("MBSIM_CACHE_DIR")
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library/Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "mbsim"


def _say_unkept(line: str) -> None:
    """Tell the user that compiled code is not kept."""
    sys.stderr.write(f"mbsim: {line}\n")


#: Called once with why compiled code is not kept.
on_unkept: Callable[[str], None] = _say_unkept
_unkept: set[str] = set()


def _note_unkept(folder: Path, error: OSError) -> None:
    """Say once that a folder does not take compiled code; the run goes on."""
    if not _unkept:
        _unkept.add(str(folder))
        on_unkept(f"{folder}: compiled code is not kept for later runs: {error.strerror or error}")


def is_kept() -> bool:
    """Return whether all code that was compiled by now is kept for later runs."""
    return not _unkept


@functools.cache
def trusted_root() -> Path:
    """Return `cache_root()`, made for the user alone if it is not there.

    Raises
    ------
    ModelError
        If others could put code there, which would run with the user's rights.
    """
    root = cache_root()
    try:
        root.parent.mkdir(parents=True, exist_ok=True)
        root.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        _note_unkept(root, error)
    check_trusted(root)
    return root


def check_trusted(folder: Path) -> None:
    """Raise `ModelError` where somebody else than the user, or root, can write into a folder."""
    if not hasattr(os, "geteuid"):
        return
    try:
        found = folder.stat()
    except OSError:
        return  # what is not there, or cannot be looked into, gives no code
    remedy = "give another folder by MBSIM_CACHE_DIR"
    if found.st_uid not in (0, os.geteuid()):
        raise ModelError(
            f"{folder}: the folder of compiled code belongs to another user, whose code would "
            f"run; {remedy}"
        )
    if found.st_mode & 0o022:
        raise ModelError(
            f"{folder}: the folder of compiled code can be written by others, whose code would "
            f"run; chmod go-w {folder}, or {remedy}"
        )


@functools.cache
def shipped() -> tuple[tuple[Path, str], ...]:
    """Return folders of shipped code that this machine runs, and the family of each.

    $MBSIM_SHIPPED_CODE names them in place of the one within the package.
    """
    named = os.environ.get("MBSIM_SHIPPED_CODE")
    folders = [PACKAGE / "shipped_code"]
    if named is not None:
        folders = [Path(folder) for folder in named.split(os.pathsep) if folder]
    return tuple(
        (found, family)
        for folder in folders
        for family in processors.runnable()
        if (found := folder / processors.folder_of(family) / _VERSION).is_dir()
    )


@functools.cache
def _imports(file: str) -> tuple[bytes, tuple[str, ...]]:
    """Return the digest of a file and the project files that it imports."""
    text = Path(file).read_bytes()
    found = []
    for module, names, plain in _IMPORT.findall(text.decode("utf-8")):
        parts = (module or plain).split(".")[1:]
        for candidate in [parts] + [[*parts, name] for name in re.findall(r"\w+", names)]:
            if candidate and _is_there(other := os.path.join(_PACKAGE, *candidate) + ".py"):
                found.append(other)
    return hashlib.sha256(text).digest(), tuple(found)


_is_there = functools.cache(os.path.isfile)


def _reached(files: list[Path]) -> dict[str, bytes]:
    """Return the digests of `files` and of every project file they reach through imports.

    Names are plain text: a scene asks this of hundreds of files for each of its roots.
    """
    reached: dict[str, bytes] = {}
    waiting = [str(file.resolve()) for file in files]
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached[file], imported = _imports(file)
            waiting.extend(imported)
    return reached


def _digest(reached: dict[str, bytes]) -> str:
    # names too: a file that moves changes what its callers mean
    lines = sorted(os.path.basename(file).encode() + one for file, one in reached.items())
    return hashlib.sha256(b"".join(lines)).hexdigest()[:24]


def source_digest(files: list[Path]) -> str:
    """Return a digest of `files` and of every project file they reach through imports."""
    return _digest(_reached(files))


def _changed(file: str) -> bool:
    """Return whether a file of the package was changed since this process began."""
    try:
        found = os.stat(file)
    except OSError:
        return True
    ours = file.startswith(_PACKAGE + os.sep)
    return ours and max(found.st_mtime, found.st_ctime) > _BEGAN


_changed_once = functools.cache(_changed)


def is_known(function: Callable[..., Any]) -> bool:
    """Return whether all that a function can reach is seen by the digest of the cache."""
    file = Path(function.__code__.co_filename).resolve()
    return PACKAGE in file.parents or cache_root().resolve() in file.parents


class _ContentLocator(_CacheLocator):
    """A folder named by content."""

    def __init__(self, files: list[Path]) -> None:
        reached = _reached(files)
        self.files = tuple(reached)
        self.digest = _digest(reached)

    def get_cache_path(self) -> str:
        return str(trusted_root() / _VERSION / self.digest)

    def ensure_cache_path(self) -> None:
        path = Path(self.get_cache_path())
        for folder in (path.parent, path):
            folder.mkdir(mode=0o700, exist_ok=True)
            check_trusted(folder)

    def get_source_stamp(self) -> str:
        return "content"  # the folder's name already says it

    def get_disambiguator(self) -> str:
        return ""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _ContentLocator:
        # an adapter closes over the law it adapts: that law's file counts as well
        cells = [cell.cell_contents for cell in py_func.__closure__ or ()]
        files = [Path(cell.__code__.co_filename) for cell in cells if hasattr(cell, "__code__")]
        return cls([Path(py_file), *files])


class _ByContent(CompileResultCacheImpl):
    _locator_classes: Any = (_ContentLocator,)


@functools.cache
def _name_runtime() -> None:
    """Name the functions that stored code may call: Numba does so where it compiles its own."""
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class CodeCache(FunctionCache):
    """Numba's cache of one function, in the user's folder and in shipped ones."""

    _impl_class = _ByContent

    def __init__(self, py_func: Callable[..., Any], on_miss: Callable[[str], None]) -> None:
        super().__init__(py_func)  # type: ignore[no-untyped-call]
        self._on_miss = on_miss

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is stored, without what only compiling needs: half a second of imports.

        Stored code is complete but for Numba's reference counts; the compiler loads the rest
        itself. A Numba that this was not tried with is asked as it asks itself.
        """
        if numba.__version__ not in linking.TESTED:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        _name_runtime()
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        with profile.part("load"):
            return self._loaded(sig, target_context)

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        key = self._index_key(sig, target_context.codegen())  # type: ignore[no-untyped-call]
        files = self._impl.locator.files
        data = None if any(map(_changed_once, files)) else self._find(key)
        if data is None:
            self._on_miss(self._py_func.__qualname__)
            return None
        return self._impl.rebuild(target_context, data)

    def _save_overload(self, sig: Any, data: Any) -> None:
        if any(map(_changed, self._impl.locator.files)):
            return
        try:
            super()._save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:  # a folder that cannot be written, or is full
            _note_unkept(cache_root(), error)

    def _find(self, key: Any) -> Any:
        """Return what is stored of a root, None where nothing is."""
        signature, (triple, *_), code = key
        own = Path(self._impl.locator.get_cache_path())
        for folder in (own.parent, own):
            check_trusted(folder)
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
            for folder, family in shipped()
            if (path := folder / locator.digest).is_dir()
        ]

    def is_empty(self) -> bool:
        """Return whether nothing is stored of this function, with any signature."""
        files = [self._cache_file, *(file for file, _ in self._shipped())]
        try:
            return not any(file._load_index() for file in files)
        except OSError:
            return True
