"""What functions a shared library defines, read from the file: nothing of it runs."""

from __future__ import annotations

import struct
from pathlib import Path

from mbsim.core.stored import read_regular

_DYNAMIC_SYMBOLS = 11  # SHT_DYNSYM
_FUNCTION, _INDIRECT_FUNCTION = 2, 10  # STT_FUNC, STT_GNU_IFUNC
_RUNTIME = {"_init", "_fini"}
#: What ends the whole process: C's, and STOP and ERROR STOP of Fortran (gfortran, ifx, flang).
_ENDING = {
    "exit", "_exit", "_Exit", "quick_exit", "abort", "for_stop_core", "for_stop_core_quiet",
    "_gfortran_stop_numeric", "_gfortran_stop_string", "_gfortran_error_stop_numeric",
    "_gfortran_error_stop_string", "_FortranAStopStatement", "_FortranAStopStatementText",
}  # fmt: skip


def functions_of(path: Path) -> set[str] | None:
    """Return the names of the functions that a library defines for others.

    None where the file is no 64-bit ELF library (System V ABI, chapters 4 and 5), as on
    Windows and macOS: whoever opens the library can still ask for a name.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    found = _symbols(read_regular(path))
    return None if found is None else found[0]


def ends_the_process(path: Path) -> set[str]:
    """Return what a library asks others for that would end the whole process, as `exit` does.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    found = _symbols(read_regular(path))
    return set() if found is None else found[1] & _ENDING


def _symbols(data: bytes) -> tuple[set[str], set[str]] | None:
    """Return the functions that a 64-bit ELF file defines, and what it asks others for."""
    if data[:4] != b"\x7fELF" or len(data) < 64 or data[4] != 2:
        return None
    order = "<" if data[5] == 1 else ">"
    try:
        return _listed(data, order)
    except (struct.error, IndexError, ValueError, OverflowError):
        return None


def _listed(data: bytes, order: str) -> tuple[set[str], set[str]]:
    """Return the defined functions and the undefined names of an ELF64 file's dynamic symbols."""
    (at,) = struct.unpack_from(f"{order}Q", data, 40)
    size, count = struct.unpack_from(f"{order}HH", data, 58)
    # name, type, flags, address, offset, size, link, info, alignment, size of an entry
    sections = [struct.unpack_from(f"{order}IIQQQQIIQQ", data, at + k * size) for k in range(count)]
    found: set[str] = set()
    asked: set[str] = set()
    for section in sections:
        if section[1] != _DYNAMIC_SYMBOLS:
            continue
        names = sections[section[6]][4]
        for start in range(section[4], section[4] + section[5], 24):
            name, info, _, home, _, _ = struct.unpack_from(f"{order}IBBHQQ", data, start)
            function = info >> 4 != 0 and info & 15 in (_FUNCTION, _INDIRECT_FUNCTION)
            if home == 0 or function:
                first = names + name
                (asked if home == 0 else found).add(data[first : data.index(b"\0", first)].decode())
    return found - _RUNTIME, asked
