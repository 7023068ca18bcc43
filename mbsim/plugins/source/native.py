"""User subroutines of shared libraries, but for contact laws: functions of Python that call them.

Every argument goes by address, the results last, as C's and Fortran's documented forms have it:
``SFOSUB(id, time, par, npar, dflag, iflag, result)``. What a library may ask (`c_sysfnc` and so on)
stands in its `mbsim_table`, see userfuncs/mbsim_usersub.h.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_char_p, c_double, c_int, c_void_p
from typing import Any

from mbsim.plugins import helpers
from mbsim.plugins.source.shared_library import Library, address_of, choose

#: Room behind the results, for a function that returns too many.
_SPARE = 8
_TABLE = "mbsim_table"
#: What a function of Python raised while a library was calling it: raised when that returns.
_raised: list[BaseException] = []


def _kept(function: Callable[..., None]) -> Callable[..., None]:
    """Return a function that keeps what it raises: nothing goes through a library."""

    def keeping(*arguments: Any) -> None:
        try:
            function(*arguments)
        except BaseException as error:  # what stops the run too
            _raised.append(error)

    return keeping


def _text(value: bytes | None) -> str:
    return (value or b"").decode("utf-8", "replace").strip()


def _ids(at: Any, count: int) -> list[float]:
    return [float(at[k]) for k in range(max(0, count))]


def _sysfnc(name: bytes, ipar: Any, nsize: int, state: Any, errflg: Any) -> None:
    state[0], errflg[0] = 0.0, 1
    value, flag = helpers.py_sysfnc(_text(name), _ids(ipar, nsize))
    state[0], errflg[0] = float(value), int(flag)


def _sysary(name: bytes, ipar: Any, nsize: int, states: Any, nstates: Any, errflg: Any) -> None:
    nstates[0], errflg[0] = 0, 1
    values, flag = helpers.py_sysary(_text(name), _ids(ipar, nsize))
    _put(values, states, nstates)
    errflg[0] = int(flag)


def _put(values: Sequence[float], at: Any, count: Any) -> None:
    for k, value in enumerate(values):
        at[k] = float(value)
    count[0] = len(values)


def _errmes(errflg: int, message: bytes, id: int, endflg: bytes) -> None:
    helpers.py_errmes(errflg, _text(message), id, _text(endflg))


def _usrmes(msgflg: int, message: bytes, id: int, msgtyp: bytes) -> None:
    helpers.py_usrmes(msgflg, _text(message), id, _text(msgtyp))


def _ncontacts(id: int, i: int, j: int, count: Any, errflg: Any) -> None:
    count[0], errflg[0] = helpers.py_get_ncontacts(id, i, j)


def _contact_post(id: int, i: int, j: int, k: int, values: Any, count: Any, errflg: Any) -> None:
    found, errflg[0] = helpers.py_get_contact_post(id, i, j, k)
    _put(found, values, count)


_reals, _wholes = POINTER(c_double), POINTER(c_int)
_ASKED: list[tuple[Callable[..., None], tuple[Any, ...]]] = [
    (_sysfnc, (c_char_p, _wholes, c_int, _reals, _wholes)),
    (_sysary, (c_char_p, _wholes, c_int, _reals, _wholes, _wholes)),
    (_errmes, (c_int, c_char_p, c_int, c_char_p)),
    (_usrmes, (c_int, c_char_p, c_int, c_char_p)),
    (_ncontacts, (c_int, c_int, c_int, _wholes, _wholes)),
    (_contact_post, (c_int, c_int, c_int, c_int, _reals, _wholes, _wholes)),
]
#: They live as long as the process: a library keeps their addresses.
_CALLBACKS = [ctypes.CFUNCTYPE(None, *types)(_kept(function)) for function, types in _ASKED]


def asks(library: Library) -> bool:
    """Return whether a library may ask for the state, having told it how."""
    try:
        table = (c_void_p * len(_CALLBACKS)).in_dll(library.open(), _TABLE)
    except ValueError:
        return False
    for k, callback in enumerate(_CALLBACKS):
        table[k] = ctypes.cast(callback, c_void_p).value
    return True


def native(
    library: Library, name: str, prefix: str, language: str, *results: int
) -> tuple[Callable[..., Any], str]:
    """Return a function of Python that calls one of a library, and its language.

    Parameters
    ----------
    library : Library
    name : str
        The function, as the deck has it.
    prefix, language : str
        As of `choose`.
    results : int
        How many numbers it gives in each array; 0 of one that only looks.

    Raises
    ------
    ModelError
        If the library does not define it.
    """
    spoken, symbol = choose(library, name, prefix, language)
    address = address_of(library, symbol, helpers.host.log)
    rooms = [(c_double * (count + _SPARE))() for count in results if len(results) > 1 or count]

    def call(*given: Any) -> Any:
        arguments = [_argument(each) for each in given]
        for room in rooms:
            for k in range(len(room)):
                room[k] = math.nan
        arguments += rooms
        entry = ctypes.CFUNCTYPE(None, *[c_void_p] * len(arguments))(address)
        entry(*(ctypes.addressof(each) for each in arguments))
        if _raised:
            error = _raised[0]
            _raised.clear()
            raise error
        found = [room[:count] for room, count in zip(rooms, results, strict=False)]
        if len(rooms) != 1:
            return found or None
        return found[0][0] if results[0] == 1 else found[0]

    return call, spoken


def _argument(value: Any) -> Any:
    """Return an argument in memory of C: ids and flags are int, the time double, par an array."""
    if isinstance(value, list):
        return (c_double * max(1, len(value)))(*value)
    return c_double(value) if isinstance(value, float) else c_int(value)
