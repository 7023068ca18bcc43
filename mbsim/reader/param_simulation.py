"""Param_Simulation: switches of MotionSolve's solver, which say how and not what is solved."""

from __future__ import annotations

from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import COUNT, FLAG, POSITIVE, TEXT, USER, keyword
from mbsim.reader.statement import Spec, Statement

_ON_JOINTS = "positions and velocities are put back onto all constraints, to rounding"
_EXPLICIT = "differential equations are explicit and need no tolerance of their own"
_COORDINATES = "bodies have all their coordinates, so none is chosen again"
_LINEAR = "linear equations are solved by mbsim's own dense and tree solvers"
_NO_FILES = "no model files are written; the result file keeps the state"
_IN_STEPS = "contact forces are evaluated anew in every iteration"
_NOT_BUILT = "is documented but not built yet; give the parameters in the deck"
PARAM_SIMULATION = Statement(
    "Param_Simulation",
    {
        "constr_tol": Spec(POSITIVE, note=_ON_JOINTS),
        "implicit_diff_tol": Spec(POSITIVE, note=_EXPLICIT),
        "nr_converge_ratio": Spec(POSITIVE, note=_COORDINATES, alias="nr_converg_ratio"),
        "linsolver": Spec(
            keyword(
                spellings(HARWELL="MA48", PARDISO="MKL"),
                spellings(USER=""),
                "a solver of the user's own has no door here",
            ),
            note=_LINEAR,
        ),
        "save_increment": Spec(COUNT, note=_NO_FILES),
        "save_inc_overwrite": Spec(FLAG, note=_NO_FILES),
        "contact_iteration": Spec(keyword(spellings(ACTIVE="", INACTIVE="")), note=_IN_STEPS),
        "acusolve_cosim": Spec(
            FLAG, refused="fluid forces are not computed here", harmless="FALSE"
        ),
        "usrsub_param_string": Spec(USER, refused=_NOT_BUILT),
        "usrsub_fnc_name": Spec(TEXT, refused=_NOT_BUILT),
        "usrsub_dll_name": Spec(TEXT, refused=_NOT_BUILT),
        "script_name": Spec(TEXT, refused=_NOT_BUILT),
        "interpreter": Spec(TEXT, refused=_NOT_BUILT),
    },
    in_command=True,
    about="switches of the solver: how, not what, is solved",
)
