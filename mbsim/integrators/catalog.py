"""The methods by name; a method's module is imported when a run uses it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbsim.integrators.scheme import Scheme

#: Name for --integrator and what it is; the module of the same name in lower case has `SCHEME`.
SCHEMES = {
    "DOPRI5": "explicit, order 5",
    "DOP853": "explicit, order 8",
    "VERLET": "explicit, order 2, one evaluation a step within its stability bound",
    "GALPHA": "implicit, order 2, for stiff contact and mechanisms",
    "RADAU5": "implicit, order 5, for stiff equations and accuracy",
    "MOREAU": "nonsmooth time stepping, order 1, rigid contacts with exact Coulomb friction",
}
#: The method whose contacts are rigid: the problem steps, in `mbsim.stepping`.
RIGID = "MOREAU"

#: Those that solve for the end of a step.
IMPLICIT_METHODS = ("GALPHA", "RADAU5")
#: The methods between which AUTO changes over, and its name.
EXPLICIT, IMPLICIT, AUTO = "DOPRI5", "RADAU5", "AUTO"
#: All names for --integrator, the default first.
METHODS = {
    AUTO: f"{EXPLICIT}, and {IMPLICIT} while a model is stiff",
    **SCHEMES,
}


def load(name: str, fixed: bool = False) -> Scheme:
    """Return the method of that name; of the rigid one that of a `fixed` step, where it is."""
    package = "stepping" if name == RIGID else "integrators"
    module = importlib.import_module(f"mbsim.{package}.{name.lower()}")
    scheme: Scheme = module.FIXED_SCHEME if fixed else module.SCHEME
    return scheme
