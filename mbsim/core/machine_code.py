"""Stored machine code of C functions: written where they are compiled, loaded without Numba.

A file holds what one function was compiled to, as LLVM emitted it, its name in there, and what it
calls. Code that raises or makes arrays calls Numba's runtime (`core.numba_runtime`). Each
is loaded by an engine of its own: names are unique within a process that compiles, and what is
loaded comes from many.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import pickle
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from mbsim.core import processors
from mbsim.core.code_cache import Sources, cache_root, note_unkept

#: First bytes of a file; what follows are a check sum, and in a line of JSON how long the code is.
_MAGIC = b"mbsim machine code 1\n"
_PLAIN = (int, float, str, bytes, type(None))


class Code(NamedTuple):
    """What a C function was compiled to."""

    symbol: str  # its name in there
    calls: tuple[str, ...]  # names of others, of the system and of Numba's runtime
    data: bytes  # an object file


class Loaded(NamedTuple):
    """A C function of stored code."""

    address: int
    engine: Any  # lives as long as it may be called


def _described(value: Any) -> Iterator[str]:
    """Yield what tells an object that a function closes over from others, in every process alike.

    Of functions that is what they close over themselves: their files are known.
    """
    if isinstance(value, _PLAIN):
        yield repr(value)
    elif hasattr(value, "__code__"):
        code = value.__code__
        yield f"{value.__module__} {value.__qualname__} {code.co_firstlineno}"
        yield hashlib.sha256(code.co_code).hexdigest()
        for cell in value.__closure__ or ():
            yield from _described(cell.cell_contents)
    else:
        yield hashlib.sha256(pickle.dumps(value)).hexdigest()


class Place:
    """Where a function's code is kept.

    Parameters
    ----------
    py_func : callable
    signature : Signature
    allocates : bool
        Whether it may make arrays.
    """

    def __init__(self, py_func: Callable[..., Any], signature: Any, allocates: bool) -> None:
        self.sources = Sources(py_func)
        self._name = py_func.__name__.strip("<>")
        python = f"{sys.implementation.cache_tag} {allocates}"
        self._key = "\n".join((python, str(signature), *_described(py_func)))

    def _file(self, folder: Path, processor: str) -> Path:
        key = hashlib.sha256(f"{processor}\n{self._key}".encode()).hexdigest()[:24]
        return folder / f"{self._name}-{key}.code"

    def find(self) -> Code | None:
        """Return what is stored, in the user's folder or a shipped one; None where nothing is."""
        if self.sources.changed():
            return None
        own = self._file(self.sources.checked_folder(), processors.here())
        there = [
            self._file(folder, processors.of_family(family))
            for folder, family in self.sources.shipped()
        ]
        return next((code for file in (own, *there) if (code := _read(file)) is not None), None)

    def keep(self, code: Code) -> None:
        """Store a function's code in the user's folder, unless its files have changed meanwhile."""
        if self.sources.changed_by_now():
            return
        try:
            file = self._file(self.sources.make_folder(), processors.here())
            beside = file.with_suffix(f".{os.getpid()}")
            beside.write_bytes(_packed(code))
            beside.replace(file)
        except OSError as error:  # a folder that cannot be written, or is full
            note_unkept(cache_root(), error)


def _packed(code: Code) -> bytes:
    """Return the bytes of a file."""
    head = json.dumps([code.symbol, code.calls, len(code.data)]).encode() + b"\n"
    return b"%s%08x\n%s%s" % (_MAGIC, zlib.crc32(code.data, zlib.crc32(head)), head, code.data)


def _read(file: Path) -> Code | None:
    """Return what a file holds; None where there is none, it cannot be read, or is damaged."""
    try:
        found = file.read_bytes()
    except OSError:
        return None
    begin = len(_MAGIC) + 9
    try:
        if found[: len(_MAGIC)] != _MAGIC or zlib.crc32(found[begin:]) != int(
            found[len(_MAGIC) : begin], 16
        ):
            return None
    except ValueError:
        return None
    end = found.index(b"\n", begin) + 1
    symbol, calls, _ = json.loads(found[begin:end])
    return Code(symbol, tuple(calls), found[end:])


@functools.cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple()


def _name_by_numba() -> None:
    """Let Numba name its runtime, where that could not be done without it."""
    from mbsim.core.function_cache import name_runtime

    name_runtime()


def _name_without_numba() -> None:
    from mbsim.core.numba_runtime import name_functions

    name_functions()


#: What names functions that stored code calls and that are not there yet, one after the other.
_RUNTIME = (_name_without_numba, _name_by_numba)


def load(code: Code) -> Loaded | None:
    """Return a function of stored code; None where what it calls is not there."""
    machine = _target().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)  # names of the system
    for name_runtime in _RUNTIME:
        if not all(map(llvm.address_of_symbol, code.calls)):
            name_runtime()
    if not all(map(llvm.address_of_symbol, code.calls)):
        return None
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.data))
    engine.finalize_object()
    return Loaded(int(engine.get_function_address(code.symbol)), engine)
