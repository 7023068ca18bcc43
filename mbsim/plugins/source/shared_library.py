"""User subroutines of shared libraries, by C's or Fortran's calling convention.

The exact name is C; lower case with an underscore behind, as gfortran and others name what
Fortran's CFFSUB is, is Fortran. Where both or neither are there nothing is guessed.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from mbsim.errors import ModelError
from mbsim.plugins.permission import check
from mbsim.plugins.source.symbols import ends_the_process, functions_of

if TYPE_CHECKING:
    from mbsim.plugins.adapters.library import LibraryCall

SUFFIXES = (".so", ".dll", ".dylib", ".sl")
C, FORTRAN = "C", "Fortran"
_SHOWN = 12
# of a friction law's input
_X, _XDOT, _NFORCE = slice(2, 5), slice(5, 8), 10
_MOST_SIZES = 8


def is_library(path: Path) -> bool:
    """Return whether a file is a shared library, by its name (libfriction.so.1 too)."""
    return path.suffix.lower() in SUFFIXES or ".so." in path.name.lower()


@dataclass(frozen=True)
class Library:
    """A shared library: its file, and the functions that it defines, None if not known.

    `element` is who asked for it, for messages.
    """

    path: Path
    functions: frozenset[str] | None
    element: str

    def defines(self, name: str) -> bool:
        """Return whether a function of that name is there, by either convention."""
        return bool(self.conventions(name))

    def conventions(self, name: str) -> dict[str, str]:
        """Return the symbols behind a function's name, by language."""
        symbols = {C: name, FORTRAN: name.lower() + "_"}
        return {language: symbol for language, symbol in symbols.items() if self._has(symbol)}

    def listed(self) -> str:
        """Return the functions that the library defines, for a message."""
        if self.functions is None:
            return "functions that this system does not list"
        names = sorted(self.functions)
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        return ", ".join(names[:_SHOWN]) + more if names else "no function"

    def _has(self, symbol: str) -> bool:
        if self.functions is not None:
            return symbol in self.functions
        return hasattr(self.open(), symbol)

    def open(self) -> ctypes.CDLL:
        """Return the library in this process.

        Raises
        ------
        ModelError
            If the system cannot load it: what it needs is missing, or it is no library.
        """
        check(self.path, self.element)
        try:
            return ctypes.CDLL(str(self.path))
        except OSError as error:
            raise ModelError(
                f"{self.element}: {self.path} cannot be loaded as a shared library: {error}"
            ) from None


def read_library(path: Path, element: str) -> Library:
    """Return a library by what its file says; nothing of it runs.

    Raises
    ------
    ModelError
        If there is no such file; the message names `element`.
    """
    path = path.absolute()
    try:
        functions = functions_of(path)
    except OSError as error:
        raise ModelError(f"{element}: {path}: {error.strerror or error}") from None
    return Library(path, None if functions is None else frozenset(functions), element)


def choose(library: Library, name: str, prefix: str, language: str) -> tuple[str, str]:
    """Return language and symbol of a function; `language` is what the deck says, or empty.

    Raises
    ------
    ModelError
        If it is not there, or is there for both languages and the deck does not say which.
    """
    element, attribute = library.element, f'{prefix}_fnc_name="{name}"'
    found = library.conventions(name)
    c_name, fortran_name = name, name.lower() + "_"
    if language:
        wanted = FORTRAN if language.upper() == "FORTRAN" else C
        # some compilers of Fortran, and bind(C), keep the name as it is written
        for spoken in (FORTRAN, C) if wanted == FORTRAN else (C,):
            if spoken in found:
                return wanted, found[spoken]
        symbols = f"{fortran_name} or {c_name}" if wanted == FORTRAN else c_name
        raise ModelError(
            f"{element}: {library.path} does not define {symbols}, which is {attribute} with "
            f'{prefix}_language="{language.upper()}"; it defines {library.listed()}'
        )
    if len(found) == 1:
        return next(iter(found.items()))
    if found:
        raise ModelError(
            f"{element}: {library.path} defines {c_name} (C) and {fortran_name} (Fortran), "
            f'both of which fit {attribute}; {prefix}_language="C" or "FORTRAN" must say which; '
            f"it defines {library.listed()}"
        )
    raise ModelError(
        f"{element}: {library.path} does not define {attribute}, neither {c_name} (C) nor "
        f"{fortran_name} (Fortran); it defines {library.listed()}"
    )


def address_of(library: Library, symbol: str, say: Callable[[str], None]) -> int:
    """Return where a function lies, after loading its library into this process.

    `say` takes a warning of what would end the process from within, which nobody can catch.
    """
    ending = sorted(ends_the_process(library.path))
    if ending:
        say(
            f"{library.element}: {library.path}: warning: it calls {', '.join(ending)} (Fortran's "
            "STOP is such a call), which ends mbsim without a message, and results since the last "
            "flush are lost: return a result that is no number (NaN) instead"
        )
    function = getattr(library.open(), symbol)
    return int(ctypes.cast(function, ctypes.c_void_p).value or 0)


def friction(
    address: int, language: str, element: int, par: npt.NDArray[np.float64]
) -> tuple[int, float, object]:
    """Return a CFFSUB at `address` as a friction law of `laws.abi`; it has been called once.

    Returns
    -------
    int
        Address behind FRICTION_SIGNATURE, the same for all functions of a language.
    float
        Where the `LibraryCall` lies that the law reads ahead of its parameters.
    object
        What must live as long as that is used.
    """
    from mbsim.core import jit
    from mbsim.core.address import pack
    from mbsim.laws.abi import FRICTION_SIGNATURE
    from mbsim.plugins.adapters.library import LibraryCall, call_c, call_fortran

    call = LibraryCall(
        address=np.array([address], dtype=np.int64),
        whole=np.array([element, len(par), 0, 1], dtype=np.int32),
        par=par.copy(),
        result=np.zeros(8),
    )
    _ask_dependence(call, language)
    table = pack(call)
    law = jit.address(call_fortran if language == FORTRAN else call_c, FRICTION_SIGNATURE)
    return law, float(table.ctypes.data), (call, table)


def sees_x(law: int, element: int, row: npt.NDArray[np.float64], par: Sequence[float]) -> bool:
    """Return whether a friction law's force is seen to change with X.

    It is called as for derivatives, with slips and deformations about its parameters. X is carried
    for a law that nobody can look into, whatever this says: this only decides whether an error of
    X counts in the control of steps.
    """
    from mbsim.laws.abi import DFLAG, FRICTION_INPUTS

    signature = (ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 3)
    entry = ctypes.CFUNCTYPE(*signature)(law)
    given, out = np.zeros(FRICTION_INPUTS), np.zeros(5)
    given[_NFORCE], given[DFLAG] = 1.0, 1.0
    sizes = sorted({abs(float(value)) for value in par if 1e-12 < abs(value) < 1e12})
    sizes = [*sizes[:_MOST_SIZES], 1e-6, 1e-3, 1.0]
    for speed in (0.0, *(part * size for size in sizes for part in (0.5, 1.5))):
        found = set()
        for x in (0.0, *sizes):
            given[_X], given[_XDOT] = (
                (x, -0.5 * x, 0.3 * x),
                (0.8 * speed, 0.6 * speed, 0.1 * speed),
            )
            code = entry(element, given.ctypes.data, row.ctypes.data, out.ctypes.data)
            if code == 0:
                found.add(out.tobytes())
        if len(found) > 1:
            return True
    return False


def _ask_dependence(call: LibraryCall, language: str) -> None:
    """Call a function once with iflag true and zeros; what it returns is not looked at."""
    id, npar, dflag, iflag = (call.whole[k:].ctypes.data for k in range(4))
    time, loci, locj, x, xdot, nforce, area = np.zeros((7, 3))
    places = [loci, locj, x, xdot, nforce] + ([area] if language == FORTRAN else [])
    given = [id, time.ctypes.data, call.par.ctypes.data, npar, *(p.ctypes.data for p in places)]
    given += [dflag, iflag, call.result.ctypes.data]
    ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(given))(int(call.address[0]))(*given)
