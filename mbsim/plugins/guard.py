"""The guard: a user's Python function as a C function that never lets an exception through.

A Python exception cannot cross a C callback. The callback keeps it in `failure` and
returns a code; the compiled loop stops on the code, and the host calls `raise_failure`.
"""

from __future__ import annotations

import ctypes
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from mbsim.errors import PluginError
from mbsim.plugins.helpers import StopRun, host
from mbsim.plugins.source.octave import OctaveError

if TYPE_CHECKING:
    from mbsim.model.subroutines import Wanted
    from mbsim.plugins.types import UserFriction
from mbsim.plugins.permission import watched
from mbsim.plugins.returned import NotAForce, force_and_state, numbers, one_number, three_numbers

_PACKAGE = str(Path(__file__).resolve().parent.parent)
C_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p
)

STATE_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_int64, ctypes.c_int64
)


class PassedOn(BaseException):
    """Another subroutine, which this one needed, failed; `failure` already holds why."""


class Failure:
    """The last exception of a user function that the run has not yet raised."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget what happened, before a new run."""
        self.error: BaseException | None = None
        self.element = ""
        self.time = 0.0
        self.name = ""
        self.source = ""

    def store(
        self, error: BaseException, element: str, time: float, name: str, source: str
    ) -> None:
        """Keep an exception and what it belongs to, `element` as messages name it.

        The integrator comes nearer before it gives up, so the last one is nearest to where
        the run stands.
        """
        self.error, self.element, self.time = error, element, time
        self.name, self.source = name, source


failure = Failure()


def code_of(error: BaseException) -> int:
    """Return the code for an exception of a user's function; what was meant is not tried again."""
    from mbsim.core.codes import Code

    at_once = isinstance(error, (StopRun, KeyboardInterrupt))
    return Code.STOPPED_BY_USER if at_once else Code.RAISED_INTERPRETED


def raise_failure() -> NoReturn:
    """Raise what a user function raised inside a callback, as a `PluginError`.

    Raises
    ------
    PluginError
        With the element, the time and the user's own frames.
    KeyboardInterrupt
        If Ctrl-C arrived while the user's function ran.
    """
    error = failure.error
    if error is None:
        raise PluginError("a user subroutine failed, but the guard holds no exception")
    text = _report(error, failure.element, failure.time, failure.name, failure.source)
    failure.clear()
    if isinstance(error, KeyboardInterrupt):
        raise error
    raise PluginError(text) from error


def _report(error: BaseException, element: str, time: float, name: str, source: str) -> str:
    """Return the message: who, when, what, and the user's frames with their lines."""
    head = f"{element}: {name} failed at time {time:.12g}: "
    if isinstance(error, NotAForce):
        return f"{head}{error} ({source})"
    if isinstance(error, OctaveError):
        return f"{head}{' '.join(str(error).split())}\n  at {error.place or source}"
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith((_PACKAGE, "<frozen"))
    ]
    what = (
        f"py_errmes stopped the run: {error}"
        if isinstance(error, StopRun)
        else "".join(traceback.format_exception_only(type(error), error)).strip()
    )
    own = [frame for frame in frames if frame.filename == source] or frames
    place = f"{own[-1].filename}:{own[-1].lineno}: " if own else f"{source}: "
    lines = [f"{head}{what}", f"  at {place.rstrip(': ')}"]
    lines += [f"  {line}" for line in "".join(traceback.format_list(frames)).splitlines()]
    return "\n".join(lines)


class Views(dict[int, Any]):
    """Memory of a fixed number of doubles by address; the host's buffers seldom move."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self._array = ctypes.c_double * count

    def __missing__(self, address: int) -> Any:
        if len(self) > 4096:
            self.clear()
        view = memoryview(self._array.from_address(address)).cast("B").cast("d")
        self[address] = view
        return view


def _put_force(room: Any, result: Any) -> None:
    """Write what a function of forces alone returned."""
    try:
        fx, fy, tz = result
        if type(result) is not list or fx - fx + fy - fy + tz - tz != 0.0:
            fx, fy, tz = three_numbers(result)
        room[0] = fx
        room[1] = fy
        room[4] = tz
    except Exception:  # not three plain numbers: say what it is, or take what converts
        room[0], room[1], room[4] = three_numbers(result)
    room[2] = room[3] = 0.0


def _put_force_and_state(room: Any, result: Any, states: int, first: int) -> None:
    """Write what (..., state) -> (force, new state) returned, the state from `first` on."""
    found = force_and_state(result, states)
    room[0], room[1], room[4] = found[:3]
    # neither torque across, nor what is stored, nor whether it sticks
    room[2] = room[3] = room[5] = room[6] = 0.0
    for k in range(states):
        room[first + k] = found[3 + k]


def callback(
    function: Callable[..., Any], name: str, source: str, par_count: int, states: int = 0
) -> tuple[int, object]:
    """Return the address of `function` behind FRICTION_SIGNATURE, and what keeps it alive.

    With `states` it keeps so many numbers of its own.
    """
    from mbsim.core.codes import Code
    from mbsim.laws.abi import DFLAG, FRICTION_INPUTS, MEMORY_OUT

    # plain locals and memoryviews are the cheapest way in: see tests/bench/test_speed.py
    function = watched(function, f"{name} ({source})")
    inputs_at, par_at = Views(FRICTION_INPUTS + states), Views(par_count)
    out_at = Views(MEMORY_OUT + states if states else 5)

    def guarded(element: int, inputs: int, par: int, out: int) -> int:
        time, outer = 0.0, host.state
        try:
            given = inputs_at[inputs].tolist()
            host.time, host.area = given[0], given[11]
            time = given[0]
            if host.seen is not None:
                host.state = (host.seen[0], time, host.seen[1])
            result = function(
                element,
                time,
                par_at[par].tolist() if par_count else [],
                par_count,
                given[13:16],
                given[16:19],
                given[2:5],
                given[5:8],
                given[10],
                int(given[DFLAG]),
                0,
                *((given[FRICTION_INPUTS:],) if states else ()),
            )
            if states:
                _put_force_and_state(out_at[out], result, states, MEMORY_OUT)
            else:
                _put_force(out_at[out], result)
            return 0
        except PassedOn:
            return Code.RAISED_INTERPRETED
        except BaseException as error:
            failure.store(error, f"Force_Contact[{element}]", time, name, source)
            return code_of(error)
        finally:
            host.state = outer

    entry = C_FUNCTION(guarded)
    return int(ctypes.cast(entry, ctypes.c_void_p).value or 0), entry


def state_callback(
    function: Callable[..., Any], title: str, place: tuple[str, str], each: Wanted
) -> tuple[int, object]:
    """Return the address of a subroutine that may look at the trial state, and its keeper.

    Parameters
    ----------
    function : callable
    title : str
        How messages name its element.
    place : (str, str)
        Name of the function, and its file.
    each : Wanted
        How it is called, and how many numbers it gives. A motion's gives one a call, and is not
        given a state to look at: it is of the time alone. A relation's finds displacements in the
        results, and looks at nothing else.

    Returns
    -------
    int
        Of a C function of (scene, time, y, results) that returns 0 or a code. Before its first
        call the subroutine is called once with iflag 1, and what it returns is not looked at.
    object
        What must live as long as the address is used.
    """
    from mbsim.core.codes import Code
    from mbsim.model.subroutines import Call, asking, calls

    count, id = each.results, each.id
    results_at, related = Views(count), each.call is Call.RELATION
    name, source = place
    function = watched(function, f"{title}: {name} ({source})")
    values, npar = [float(value) for value in each.user.par], len(each.user.par)
    first, (flags, *others) = asking(each), calls(each)
    moves, at_rows = each.call is Call.MOTION, each.kind == "REQUEST"
    blind = moves or related
    started = False

    def guarded(scene: int, time: float, y: int, results: int) -> int:
        nonlocal started
        outer, outer_row, host.time = host.state, host.at_row, time
        host.state, host.at_row = None if blind else (scene, time, y), at_rows
        try:
            if not started:
                started = True
                function(id, time, values.copy(), npar, *first)
            found = (results_at[results].tolist(),) if related else ()
            result = function(id, time, values.copy(), npar, *found, *flags)
            if moves:
                room = results_at[results]
                room[0] = one_number(result)[0]
                for k, more in enumerate(others, 1):
                    room[k] = one_number(function(id, time, values.copy(), npar, *more))[0]
            elif count == 1:
                if type(result) is not float or result - result != 0.0:
                    result = one_number(result)[0]
                results_at[results][0] = result
            else:
                room = results_at[results]
                for k, number in enumerate(numbers(result, count)):
                    room[k] = number
            return 0
        except PassedOn:
            return Code.RAISED_INTERPRETED
        except BaseException as error:
            failure.store(error, title, time, name, source)
            return code_of(error)
        finally:
            host.state, host.at_row = outer, outer_row

    entry = STATE_FUNCTION(guarded)
    return int(ctypes.cast(entry, ctypes.c_void_p).value or 0), entry


def reproduce(
    user: UserFriction, inputs: Sequence[float] | Any, element_id: int | None = None
) -> NoReturn:
    """Run the interpreted function where the compiled one failed, and raise what it raises.

    Parameters
    ----------
    user : UserFriction
        The compiled function that returned RAISED_COMPILED or a force that is not finite.
    inputs : sequence of float, shape (24 + states,)
        What the function was given, as `laws.abi` has it.
    element_id : int, optional
        The Force_Contact; `user.element` if left out.

    Raises
    ------
    PluginError
        Always.
    """
    given = [float(value) for value in inputs]
    element = user.element if element_id is None else int(element_id)
    name, source = user.name, str(user.source)
    try:
        result = user.call(
            given[0], user.par, given[13:16], given[16:19], given[2:5], given[5:8], given[10],
            int(given[19]),
            state=given[24:],
            area=given[11],
        )  # fmt: skip
    except BaseException as error:
        failure.clear()
        failure.store(error, f"Force_Contact[{element}]", given[0], name, source)
        raise_failure()
    raise PluginError(
        f"Force_Contact[{element}]: {name} ({source}) failed at time {given[0]:.12g} when "
        f"compiled, but gives {result} when interpreted; run it with --interpret-plugins"
    )
