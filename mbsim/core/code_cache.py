"""Where compiled code is kept: the user's folder, and folders of code that was shipped.

What is kept there is read by `core.machine_code`, without Numba, and by `core.function_cache`. A
root's code is stored under a digest of *all* project files that it can reach through imports:
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
import importlib.util
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mbsim.core import processors
from mbsim.errors import ModelError

_BEGAN = time.time()
PACKAGE = Path(__file__).resolve().parent.parent
_PACKAGE = str(PACKAGE)
_IMPORT = re.compile(
    r"^\s*(?:from\s+(mbsim[\w.]*)\s+import\s+(\([^)]*\)|.+)|import\s+(mbsim[\w.]*))", re.M
)
#: Versions of Numba whose private methods are as `core.linking` takes them to be.
TESTED = ("0.68.1",)


def numba_version() -> str:
    """Return the version of Numba; it is imported only if it does not say so in a file."""
    if "numba" not in sys.modules:
        found = importlib.util.find_spec("numba")
        for folder in (found.submodule_search_locations or ()) if found is not None else ():
            file = os.path.join(folder, "_version.py")
            spec = importlib.util.spec_from_file_location("_numba_version", file)
            if os.path.isfile(file) and spec is not None and spec.loader is not None:
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                return str(module.get_versions()["version"])
    import numba

    return str(numba.__version__)


#: Part of the name of the cache's folder: code of another policy is not mixed with it.
POLICY = "roots4" if numba_version() in TESTED else "all"
#: Below a folder of code: that of other versions and policies is not mixed with ours.
_VERSION = f"{numba_version()}-{POLICY}"


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


def note_unkept(folder: Path, error: OSError) -> None:
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
        note_unkept(root, error)
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


def changed(file: str) -> bool:
    """Return whether a file of the package was changed since this process began."""
    try:
        found = os.stat(file)
    except OSError:
        return True
    ours = file.startswith(_PACKAGE + os.sep)
    return ours and max(found.st_mtime, found.st_ctime) > _BEGAN


_changed_once = functools.cache(changed)


def is_known(function: Callable[..., Any]) -> bool:
    """Return whether all that a function can reach is seen by the digest of the cache."""
    file = Path(function.__code__.co_filename).resolve()
    return PACKAGE in file.parents or cache_root().resolve() in file.parents


class Sources:
    """The files that a function's code follows from, and the folder of its code.

    Parameters
    ----------
    py_func : callable
    """

    def __init__(self, py_func: Callable[..., Any]) -> None:
        # an adapter closes over the law it adapts: that law's file counts as well
        cells = [cell.cell_contents for cell in py_func.__closure__ or ()]
        codes = [py_func.__code__, *(c.__code__ for c in cells if hasattr(c, "__code__"))]
        reached = _reached([Path(code.co_filename) for code in codes])
        self.files = tuple(reached)
        self.digest = _digest(reached)

    @property
    def folder(self) -> Path:
        """The user's folder."""
        return trusted_root() / _VERSION / self.digest

    def make_folder(self) -> Path:
        """Return the user's folder, made for the user alone.

        Raises
        ------
        ModelError
            If others could put code there.
        """
        folder = self.folder
        for each in (folder.parent, folder):
            each.mkdir(mode=0o700, exist_ok=True)
            check_trusted(each)
        return folder

    def checked_folder(self) -> Path:
        """Return the user's folder, which need not be there; `ModelError` as of `make_folder`."""
        folder = self.folder
        for each in (folder.parent, folder):
            check_trusted(each)
        return folder

    def shipped(self) -> list[tuple[Path, str]]:
        """Return folders of shipped code of these files, and the family of each."""
        return [
            (path, family)
            for folder, family in shipped()
            if (path := folder / self.digest).is_dir()
        ]

    def changed(self) -> bool:
        """Return whether a file was changed since this process began, asked once a file."""
        return any(map(_changed_once, self.files))

    def changed_by_now(self) -> bool:
        """Return whether a file was changed since this process began."""
        return any(map(changed, self.files))
