"""The py_ functions that a user's script finds without importing them."""

from __future__ import annotations

import builtins
import functools
import math
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mbsim.plugins import kernels


class StopRun(BaseException):
    """py_errmes asked to stop; not an Exception, so that `except Exception` lets it through."""


def _to_stderr(line: str) -> None:
    sys.stderr.write(line + "\n")


Look = Callable[[str, Sequence[float]], list[Any]]


def _nothing(name: str, ids: Sequence[float]) -> list[Any]:
    return [0.0, 1]


Pair = tuple[int, int]


@dataclass(frozen=True)
class Shown:
    """What the results of one contact at one output time are, for `py_get_contact_post`.

    Attributes
    ----------
    net : sequence of float, shape (8,)
        Force (3), torque about I's cg (3), largest depth and largest slip speed of the element.
    incidents : mapping
        By pair of graphics I, J: rows of depth, point (3), normal (3), X (3).
    """

    net: Sequence[float]
    incidents: Mapping[Pair, Sequence[Sequence[float]]]


class Host:
    """What the scripts see of the run: the time, the trial state, and where messages go."""

    def __init__(self) -> None:
        self.time = 0.0
        #: Of the contact whose subroutine runs: its area.
        self.area = 0.0
        self.log: Callable[[str], None] = _to_stderr
        #: While a subroutine that may look at it runs: scene, time, and where y lies.
        self.state: tuple[int, float, int] | None = None
        #: While one of a request runs: forces and accelerations are known too.
        self.at_row = False
        #: Scene and y of friction subroutines that may look, where there are some.
        self.seen: tuple[int, int] | None = None
        #: What looks at it: (name, ids) -> [value, errflg] and -> [values, errflg].
        self.sysfnc: Look = _nothing
        self.sysary: Look = _nothing
        self.warned: set[str] = set()
        #: While CONTACTPOST runs: the results of contacts at an output time, by id.
        self.shown: dict[int, Shown] = {}
        #: In a call with iflag true: what it asks for, as `plugins.dependence` lists it.
        self.asked: list[str] | None = None
        #: While `mbsim request` evaluates a subroutine again: what it names by `espy`.
        self.signals: dict[str, Any] | None = None

    def forget(self) -> None:
        """Look at nothing, before a new run."""
        self.state, self.sysfnc, self.sysary = None, _nothing, _nothing
        self.seen = None
        self.warned.clear()
        self.shown.clear()


#: The one run of this process. The simulation sets `host.log`; the guard sets `host.time`.
host = Host()


def py_step(x: float, x0: float, h0: float, x1: float, h1: float, iord: int) -> list[Any]:
    """Return [value, errflg] of STEP (iord 0) or its derivative; errflg 1: bad iord or x1 <= x0."""
    return list(kernels.mbsim_step(x, x0, h0, x1, h1, iord))


def py_step5(x: float, x0: float, h0: float, x1: float, h1: float, iord: int) -> list[Any]:
    """Return [value, errflg] of STEP5 (iord 0) or its derivative; errflg as `py_step`."""
    return list(kernels.mbsim_step5(x, x0, h0, x1, h1, iord))


def stops(endflg: Any) -> bool:
    """Return whether an end flag asks to stop: "STOP", "TRUE" in any case, or a true number."""
    if isinstance(endflg, str):
        return endflg.strip().upper() in ("STOP", "TRUE")
    return bool(endflg)


def py_errmes(errflg: Any, message: Any = "", id: Any = 0, endflg: Any = "") -> None:
    """Log an error if `errflg` is true, and stop the run if `endflg` says so."""
    if not errflg:
        return
    host.log(f"ERRMES:USER [{id}] ERROR: {message}")
    if stops(endflg):
        raise StopRun(str(message))


def py_usrmes(msgflg: Any, message: Any = "", id: Any = 0, msgtyp: Any = "INFO") -> None:
    """Log a message if `msgflg` is true; `msgtyp` is INFO, WARN, ..."""
    if msgflg:
        # INFO_NOPAD and INFO_LOG say where and how it is laid out; the kind is INFO
        kind = str(msgtyp).strip().upper().split("_")[0] or "INFO"
        host.log(f"USRMES:USER [{id}] {kind}: {message}")


def py_sysfnc(name: str, ids: Sequence[float]) -> list[Any]:
    """Return [value, errflg] of a function of the language, DX for example, at the trial state.

    errflg is 1 and the value 0 where the function or a marker is not known, forces and
    accelerations among them except in a REQSUB, and outside subroutines.
    """
    if host.asked is not None:
        host.asked.append(_question(name, ids))
        return [0.0, 0]
    if host.state is None:
        _no_state("py_sysfnc")
        return [0.0, 1]
    return host.sysfnc(name, ids)


def py_sysary(name: str, ids: Sequence[float]) -> list[Any]:
    """Return [values, errflg] of DISP, TDISP, RDISP, VEL, TVEL or RVEL at the trial state.

    In a REQSUB also of ACC, TACC, RACC, FORCE, TFORCE and RFORCE.
    """
    if host.asked is not None:
        host.asked.append(_question(name, ids))
        whole = str(name).strip().upper() in ("DISP", "VEL", "ACC", "FORCE")
        return [[0.0] * (6 if whole else 3), 0]
    if host.state is None:
        _no_state("py_sysary")
        return [[], 1]
    return host.sysary(name, ids)


def _question(name: str, ids: Sequence[float]) -> str:
    """Return a function and its ids as `mbsim info` shows them."""
    return " ".join([str(name).strip().upper(), *(f"{id:g}" for id in ids)])


def _no_state(name: str) -> None:
    """Say once that a subroutine cannot look at the state."""
    if name not in host.warned:
        host.warned.add(name)
        host.log(f"warning: {name} is called where there is no state to look at: errflg is 1")


def espy(**signals: Any) -> None:
    """Name signals of a subroutine, espy(mu=mu, mode="stick"), for `mbsim request`.

    While a model is integrated nothing happens.
    """
    if host.signals is not None:
        host.signals.update(signals)


def py_getstm() -> float:
    """Return the simulation time of the present call."""
    return host.time


def py_get_contact_area() -> float:
    """Return the area of contact of the present call [L^2], 0 for a point."""
    return host.area


def _incidents(id: int, i_gra_id: int, j_gra_id: int) -> Any:
    """Return the incidents of two graphics of a contact, in either order, None if not known."""
    shown = host.shown.get(int(id))
    if shown is None:
        return None
    pair = int(i_gra_id), int(j_gra_id)
    return shown.incidents.get(pair, shown.incidents.get(pair[::-1]))


def py_get_ncontacts(id: int, i_gra_id: int, j_gra_id: int) -> list[Any]:
    """Return [n, errflg]: how many incidents two graphics of a contact have at an output time.

    errflg is 1 and n 0 outside CONTACTPOST, and for what is not in its contact.
    """
    found = _incidents(id, i_gra_id, j_gra_id)
    return [0, 1] if found is None else [len(found), 0]


def py_get_contact_post(id: int, i_gra_id: int, j_gra_id: int, index: int) -> list[Any]:
    """Return [values, errflg] of an incident, 1 to n, or with index 0 of the whole element.

    Of an incident: depth, contact point (3) and normal (3) in the global frame, X (3), area. Of the
    element: force (3) and torque about its cg (3) on I's body, in the global frame, largest
    depth, largest slip speed.
    """
    found = _incidents(id, i_gra_id, j_gra_id)
    if found is None or not 0 <= int(index) <= len(found):
        return [[], 1]
    values = host.shown[int(id)].net if int(index) == 0 else found[int(index) - 1]
    return [list(values), 0]


def print_to_stderr(*args: Any, file: Any = None, **options: Any) -> None:
    """Print as Python does, but on standard error: --json owns standard output."""
    builtins.print(*args, file=sys.stderr if file is None else file, **options)


@functools.cache
def namespace() -> Mapping[str, Any]:
    """Return the names that a script starts with: all of `math`, and the helpers."""
    names = {name: value for name, value in vars(math).items() if not name.startswith("_")}
    for helper in (
        py_step, py_step5, py_errmes, py_usrmes, py_getstm, py_get_contact_area,
        py_sysfnc, py_sysary, py_get_ncontacts, py_get_contact_post, espy,
    ):  # fmt: skip
        names[helper.__name__] = helper
    names["print"] = print_to_stderr
    return types.MappingProxyType(names)
