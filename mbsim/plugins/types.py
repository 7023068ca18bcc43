"""Users' laws after they are found and compiled: what a run holds and calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.laws import user_normal as at
from mbsim.laws.residual import DIFFERENTIAL, KINDS, SWITCHING
from mbsim.plugins.helpers import host
from mbsim.plugins.returned import force_and_state, only_one, three_numbers


class _Called:
    """What users' functions of contacts have in common."""

    language: str
    compiled: bool
    hidden: tuple[float, ...]
    par: npt.NDArray[np.float64]

    @property
    def how(self) -> str:
        """How it runs, in a word for the user."""
        if self.language != "Python":
            return self.language
        return "compiled" if self.compiled else "interpreted"

    @property
    def row(self) -> npt.NDArray[np.float64]:
        """The parameters as the C function behind `address` reads them."""
        return np.concatenate([self.hidden, self.par])


@dataclass(frozen=True, eq=False)
class UserFriction(_Called):
    """A user's friction function, ready to be called.

    Keep it alive as long as `address` is in use: an interpreted one owns its callback, one of
    a library the memory that `hidden` points to.

    Attributes
    ----------
    address : int
        Of the C function behind `laws.abi.FRICTION_SIGNATURE`.
    par : ndarray, shape (n,)
        The values of cff_param_string; the C function reads them through its `par`.
    compiled : bool
        Whether machine code stands there; else a callback into Python.
    reason : str
        Why it stays interpreted, empty if compiled.
    uses_x : bool
        Whether its text reads the deformation `x`, or might: the host then integrates X.
    reads_time : bool
        Whether its text reads the time, or might.
    reads_x : bool
        Whether an error of X counts; not where a function without text is seen not to read it.
    source : Path
        The user's file.
    name : str
        The function in that file.
    element : int
        The Force_Contact.
    function : callable
        The user's own function object.
    looks : bool
        Whether it is interpreted and its script may ask for the state by `py_sysfnc`.
    language : str
        Python, C, Fortran or Octave.
    hidden : tuple of float
        What the C function behind `address` reads of its parameters before `par`.
    asked : tuple of str
        What an interpreted one asked for by `py_sysfnc` and `py_sysary` under iflag.
    states : int
        How many numbers it keeps: CFFSUB_STATES of its script.
    """

    address: int
    par: npt.NDArray[np.float64]
    compiled: bool
    reason: str
    uses_x: bool
    source: Path
    name: str
    element: int
    function: Callable[..., Any] | None = field(repr=False)
    keep: object = field(default=None, repr=False)
    looks: bool = False
    language: str = "Python"
    hidden: tuple[float, ...] = ()
    asked: tuple[str, ...] = ()
    reads_x: bool = True
    states: int = 0
    reads_time: bool = True

    def call(
        self,
        time: float,
        par: Any,
        loci: Any,
        locj: Any,
        x: Any,
        xdot: Any,
        nforce: float,
        dflag: int = 0,
        state: Any = (),
        area: float = 0.0,
    ) -> list[float]:
        """Return [Fx, Fy, Tz] of the interpreted function, and its new state if it keeps one.

        What it raises comes through. `state` may be longer than what it keeps.
        """
        assert self.function is not None
        lists = [[float(value) for value in given] for given in (par, loci, locj, x, xdot)]
        host.time, host.area = float(time), float(area)
        values, loci, locj, x, xdot = lists
        result = self.function(
            self.element, host.time, values, len(values), loci, locj, x, xdot, float(nforce),
            dflag, 0, *([[float(value) for value in state][: self.states]] if self.states else ()),
        )  # fmt: skip
        if self.states:
            return force_and_state(result, self.states)
        return three_numbers(result)


@dataclass(frozen=True, eq=False)
class UserNormal(_Called):
    """A user's normal law, ready to be called; keep it alive as long as `address` is in use.

    Attributes
    ----------
    address : int
        Of the C function behind `laws.abi.NORMAL_SIGNATURE`.
    par : ndarray, shape (n,)
        The values of cnf_param_string.
    inputs : ndarray, shape (user_normal.NORMAL_INPUTS,)
        What the law is given beside depth and rate.
    hidden : tuple of float
        What the C function reads of its parameters before `par`.
    language, compiled, reason, source, name, element, function, looks, asked, reads_time
        As of `UserFriction`.
    """

    address: int
    par: npt.NDArray[np.float64]
    inputs: npt.NDArray[np.float64]
    hidden: tuple[float, ...]
    source: Path
    name: str
    element: int
    function: Callable[..., Any] | None = field(default=None, repr=False)
    compiled: bool = True
    reason: str = ""
    language: str = "Python"
    keep: object = field(default=None, repr=False)
    looks: bool = False
    asked: tuple[str, ...] = ()
    reads_time: bool = True

    def call(self, depth: float, rate: float, par: list[float] | None = None) -> float:
        """Return the force of the interpreted function at its place; exceptions come through.

        With other parameters than its own where these are given.
        """
        assert self.function is not None
        given = self.inputs.tolist()
        vectors = [given[k : k + 3] for k in (at.LOCI, at.NI, at.LOCJ, at.NJ)]
        dflag, par = int(given[at.MODE] != at.EVALUATE), par or self.par.tolist()
        host.time, host.area = given[at.TIME], given[at.AREA]
        return only_one(
            self.function(
                self.element, given[at.TIME], par, len(par), *vectors, -depth, -rate, 0.0, dflag, 0
            )
        )


@dataclass(frozen=True)
class Unknown:
    """An unknown of a residual; `scale` None: by the model, `kind` None: not known yet."""

    name: str
    initial: float = 0.0
    scale: float | None = None
    kind: int | None = None


@dataclass(frozen=True, eq=False)
class UserResidual:
    """A user's residual, ready to be called; keep it alive as long as its addresses are in use.

    Attributes
    ----------
    address : int
        Of the function (`laws.residual`), compiled or a callback into Python.
    twin : int
        Of the callback into Python, which says what a compiled one raises.
    par : ndarray, shape (n,)
    unknowns : tuple of Unknown
        The first of them, as many as directions, are forces.
    compiled : bool
    reason : str
        Why it stays interpreted, empty if compiled.
    source : Path
    name : str
    element : int
    """

    address: int
    twin: int
    par: npt.NDArray[np.float64]
    unknowns: tuple[Unknown, ...]
    compiled: bool
    reason: str
    source: Path
    name: str
    element: int
    keep: object = field(default=None, repr=False)

    @property
    def how(self) -> str:
        """How it runs, in a word for the user."""
        return "compiled" if self.compiled else "interpreted"

    @property
    def states(self) -> list[int]:
        """Which unknowns are states."""
        return [k for k, u in enumerate(self.unknowns) if u.kind == DIFFERENTIAL]

    @property
    def switches(self) -> bool:
        """Whether an unknown is a state in one mode and not in another."""
        return any(u.kind == SWITCHING for u in self.unknowns)

    def about(self) -> list[str]:
        """Return the unknowns in words."""
        return [f"{u.name}: {KINDS[u.kind or 0].lower()}" for u in self.unknowns]
