"""The one compile policy: what is compiled, where it is kept, when it is stale.

Two ways into compiled code, and only these:

* `function(f)`: a Numba dispatcher, for the few functions that Python calls;
* `address(f, signature)`: a C function behind an address, for everything that a
  scene chooses (laws, pairs) and for what an integrator calls without knowing it.

Everything these call is a plain function marked `jitable`. The result is cached
on disk under a digest of *all* project files that the function can reach through
imports: Numba's own check sees only the file of the function itself, and would go
on using an edited helper's old code.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import CacheImpl, _CacheLocator
from numba.extending import register_jitable

import mbsim.core.address  # noqa: F401  (compiled forms of core.memory)
from mbsim.core import linking
from mbsim.core.jitable import take_marked

PACKAGE = Path(__file__).resolve().parent.parent
_IMPORT = re.compile(
    r"^\s*(?:from\s+(mbsim[\w.]*)\s+import\s+(\([^)]*\)|.+)|import\s+(mbsim[\w.]*))", re.M
)

#: Seconds spent compiling in this process, and the hook that is told before the first compilation.
compile_seconds = 0.0
on_first_compile: Callable[[], None] | None = None


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


@functools.cache
def _imports(path: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return the digest of a file and the project files that it imports."""
    text = path.read_bytes()
    found = []
    for module, names, plain in _IMPORT.findall(text.decode("utf-8")):
        parts = (module or plain).split(".")[1:]
        candidates = [parts] + [[*parts, name] for name in re.findall(r"\w+", names)]
        for candidate in candidates:
            file = PACKAGE.joinpath(*candidate).with_suffix(".py") if candidate else None
            if file is not None and file.is_file():
                found.append(file)
    return hashlib.sha256(text).digest(), tuple(found)


def source_digest(files: list[Path]) -> str:
    """Return a digest of `files` and of every project file they reach through imports."""
    reached: dict[Path, bytes] = {}
    waiting = [file.resolve() for file in files]
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached[file], imported = _imports(file)
            waiting.extend(imported)
    # names too: a file that moves changes what its callers mean
    lines = sorted(file.name.encode() + digest for file, digest in reached.items())
    return hashlib.sha256(b"".join(lines)).hexdigest()[:24]


def _is_known(file: Path) -> bool:
    """Return whether all that a file can reach is seen by the digest of the cache."""
    return PACKAGE in file.parents or cache_root().resolve() in file.parents


class _ContentLocator(_CacheLocator):
    """Numba's cache for functions of this project, in a folder named by content."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def get_cache_path(self) -> str:
        return str(self._path)

    def get_source_stamp(self) -> str:
        return "content"  # the folder's name already says it

    def get_disambiguator(self) -> str:
        return ""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _ContentLocator | None:
        root = cache_root()
        file = Path(py_file).resolve()
        if not _is_known(file):
            return None
        # an adapter closes over the law it adapts: that law's file counts as well
        cells = [cell.cell_contents for cell in py_func.__closure__ or ()]
        files = [Path(cell.__code__.co_filename) for cell in cells if hasattr(cell, "__code__")]
        locator = cls(
            root / f"{numba.__version__}-{linking.POLICY}" / source_digest([file, *files])
        )
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator


if _ContentLocator not in CacheImpl._locator_classes:
    CacheImpl._locator_classes.insert(0, _ContentLocator)


def _register() -> None:
    """Tell Numba of the functions marked since the last compilation."""
    linking.install()
    for function in take_marked():
        register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)


class _Watch(event.Listener):
    """Counts the time that Numba compiles (loading from the cache is not compiling)."""

    def __init__(self) -> None:
        self._depth = 0
        self._began = 0.0
        self._collects = False

    def on_start(self, happened: Any) -> None:
        global on_first_compile
        if self._depth == 0:
            self._began = time.perf_counter()
            self._collects = gc.isenabled()
            gc.disable()  # the compiler's million small objects are looked through again and again
            if on_first_compile is not None:
                tell, on_first_compile = on_first_compile, None
                tell()
        self._depth += 1

    def on_end(self, happened: Any) -> None:
        global compile_seconds
        self._depth -= 1
        if self._depth == 0:
            if self._collects:
                gc.enable()
            compile_seconds += time.perf_counter() - self._began


event.register("numba:run_pass", _Watch())


@functools.cache
def function(py_func: Callable[..., Any]) -> Callable[..., Any]:
    """Return `py_func` compiled at its first call (or loaded from the cache), once a process.

    What stands elsewhere is not cached: Numba would keep it while the arrays that it looks at
    change.
    """
    _register()
    known = _is_known(Path(py_func.__code__.co_filename).resolve())
    return numba.njit(cache=known, error_model="numpy")(py_func)


_kept: list[Any] = []


@functools.cache
def address(py_func: Callable[..., Any], signature: Any) -> int:
    """Return the address of `py_func` compiled as a C function; it lives as long as the process."""
    _register()
    compiled = numba.cfunc(signature, cache=True, error_model="numpy")(py_func)
    _kept.append(compiled)
    return int(compiled.address)
