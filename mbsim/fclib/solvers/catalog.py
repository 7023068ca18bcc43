"""Solvers by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

from mbsim.errors import ModelError

if TYPE_CHECKING:
    from mbsim.fclib.solvers.task import Task

#: Name -> (module, function, whether it takes rolling friction).
SOLVERS = {
    "AUTO": ("auto", "run", True),
    "NSGS": ("sweeps", "run", True),
    "ADMM": ("splitting", "run", True),
    "PROX": ("newton", "run", False),
    "NSN": ("newton", "run_newton", False),
}


def solver(name: str, *, rolling: bool = False) -> Callable[[Task], None]:
    """Return a solver by name; refuse names that are not there and laws it cannot take."""
    if name.upper() not in SOLVERS:
        raise ModelError(f"{name}: no such solver; there are {', '.join(SOLVERS)}")
    module, function, takes_rolling = SOLVERS[name.upper()]
    if rolling and not takes_rolling:
        able = ", ".join(known for known, entry in SOLVERS.items() if entry[2])
        raise ModelError(f"{name}: not for rolling friction; {able} are")
    found: Callable[[Task], None] = getattr(
        import_module(f"mbsim.fclib.solvers.{module}"), function
    )
    return found
