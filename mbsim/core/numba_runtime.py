"""The functions of Numba's runtime that stored code calls, named without importing Numba.

Code that makes arrays, as of pairs of boxes and of MOREAU, or that may raise, as of users, calls
functions of three small libraries of Numba's. Python loads them in some milliseconds, and all of
Numba in 0.2 s. They are named as Numba does it in `core.base` and `core.runtime.nrt`; of a Numba
that this was not tried with nothing is named. One that is imported later finds them loaded.
"""

from __future__ import annotations

import builtins
import functools
import importlib.util
import os
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from types import ModuleType

import llvmlite.binding as llvm

from mbsim.core.code_cache import TESTED, numba_version

#: Libraries below Numba's folder, and what its own code calls their functions.
LIBRARIES = {"_helperlib": "numba_", "_dynfunc": "numba_", "core/runtime/_nrt_python": "NRT_"}


def _loaded(folder: str, path: str) -> ModuleType:
    """Return a library of Numba's; Python does not take its package for imported."""
    name = "numba." + path.replace("/", ".")
    if name in sys.modules:
        return sys.modules[name]
    files = (os.path.join(folder, *path.split("/")) + suffix for suffix in EXTENSION_SUFFIXES)
    file = next(file for file in files if os.path.isfile(file))
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    try:
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.modules.pop(name, None)
    return module


def found() -> dict[str, int]:
    """Return the addresses of the runtime's functions and objects by name.

    Raises
    ------
    ImportError, StopIteration
        If a library is not there, or cannot be loaded.
    """
    spec = importlib.util.find_spec("numba")
    folders = spec.submodule_search_locations if spec is not None else None
    if not folders:
        raise ImportError("numba has no folder")
    # of Python's own
    names = {"_Py_NoneStruct": id(None)}
    for value in vars(builtins).values():
        if isinstance(value, type) and issubclass(value, BaseException):
            names[f"PyExc_{value.__name__}"] = id(value)
    for path, prefix in LIBRARIES.items():
        for name, address in _loaded(folders[0], path).c_helpers.items():
            inner = prefix == "NRT_" and name.startswith("_")
            names[name if inner else prefix + name] = address
    return names


@functools.cache
def name_functions() -> None:
    """Name them for LLVM; where that cannot be, nothing is named, and Numba itself is to do it."""
    if numba_version() not in TESTED:
        return
    try:
        names = found()
    except (ImportError, StopIteration, AttributeError):
        return
    for name, address in names.items():
        llvm.add_symbol(name, address)
