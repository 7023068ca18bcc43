"""Body_Rigid, Reference_Marker and Param_Unit."""

from __future__ import annotations

import math

import numpy as np

from mbsim.model import elements as el
from mbsim.model.frames import orthonormalise, rotation_313
from mbsim.reader import units
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import FLAG, ID, POSITIVE, REAL, TEXT, keyword
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

_INERTIAS = ("inertia_xx", "inertia_yy", "inertia_zz", "inertia_xy", "inertia_yz", "inertia_xz")
#: Of v and w, the names of the components and of their flags.
_COMPONENTS = {
    kind: tuple((f"{kind}_ic_{axis}", f"{kind}_ic_{axis}_flag") for axis in "xyz") for kind in "vw"
}
_VELOCITIES = tuple(name for kind in "vw" for name, _ in _COMPONENTS[kind])
_COSINES = tuple(f"a{row}{column}" for row in range(3) for column in range(3))
_ANGLES = ("psi", "theta", "phi")
_POSITIONS = ("pos_x", "pos_y", "pos_z")

_COSINE_LIMIT = 1e-4  # |R'R - 1| beyond which cosines are no rotation at all
_COSINE_WARN = 1e-9


def _build_units(entry: Entry) -> None:
    """Set the draft's units, once."""
    if entry.draft.units is not None:
        entry.fault("a second Param_Unit; a model has one")
        return
    by_name = {key: entry.get(f"{key}_unit") for key in ("force", "mass", "length", "time")}
    factor = entry.get("mass_mult_factor")
    if factor is not None and any(by_name.values()):
        entry.fault("give unit names or mass_mult_factor, not both", "mass_mult_factor")
    chosen = {key: name for key, name in by_name.items() if name is not None}
    entry.draft.units = units.make_units(**chosen, mass_mult_factor=factor)


def start_velocity(entry: Entry, kind: str) -> tuple[float, float, float]:
    """Return the initial velocity; a value whose flag is not TRUE counts as zero."""
    parts = []
    for name, flag in _COMPONENTS[kind]:
        value = entry.get(name, 0.0)
        if value != 0.0 and not entry.get(flag, False):
            entry.warn(f"ignored, because {flag} is not TRUE", name)
            value = 0.0
        parts.append(value)
    if any(parts) and entry.get("isground", False):
        entry.warn(f"{kind}_ic is ignored: the ground does not move")
    return (parts[0], parts[1], parts[2])


def start_given(entry: Entry, kind: str) -> tuple[bool, bool, bool]:
    """Return which components of the initial velocity count: a flag without a value gives 0."""
    x, y, z = (bool(entry.get(flag, False)) for _, flag in _COMPONENTS[kind])
    return x, y, z


def _inertia(entry: Entry) -> tuple[float, float, float, float, float, float] | None:
    """Return the six inertias, or None where the deck gives none; products default to 0."""
    if not entry.those(_INERTIAS):
        return None
    for name in _INERTIAS[:3]:
        if not entry.given(name):
            entry.fault(f"{name}: missing; give inertia_xx, inertia_yy and inertia_zz together")
    values = [entry.get(name, 0.0) for name in _INERTIAS]
    return (values[0], values[1], values[2], values[3], values[4], values[5])


def _build_body(entry: Entry) -> None:
    """Add a body."""
    body = el.Body(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        is_ground=entry.get("isground", False),
        mass=entry.get("mass"),
        inertia=_inertia(entry),
        cg_id=entry.get("cg_id"),
        im_id=entry.get("im_id"),
        lprf_id=entry.get("lprf_id"),
        v_ic=start_velocity(entry, "v"),
        w_ic=start_velocity(entry, "w"),
        v_given=start_given(entry, "v"),
        w_given=start_given(entry, "w"),
        vm_id=entry.get("vm_id"),
        wm_id=entry.get("wm_id"),
        density=entry.get("density"),
        source=entry.source,
    )
    if body.density is not None and body.mass is not None:
        what = "" if body.cg_id is not None else ", but lets the graphics give the centre of mass"
        entry.note(f"has no effect on the mass where mass is given{what}", "density")
    entry.register("bodies", body)


def _from_cosines(entry: Entry) -> el.Array:
    """Return the rotation that the direction cosines mean, made orthonormal."""
    identity = np.eye(3)
    given = [
        [entry.get(f"a{row}{column}", identity[row, column]) for column in range(3)]
        for row in range(3)
    ]
    matrix = np.array(given, dtype=np.float64)
    R, error = orthonormalise(matrix)
    quoted = " ".join(f"{name}={entry.get(name):g}" for name in _COSINES if entry.given(name))
    if error > _COSINE_LIMIT or np.linalg.det(matrix) < 0.0:
        why = "left-handed" if error <= _COSINE_LIMIT else f"|R'R - 1| = {error:.3g}"
        entry.fault(
            f"cosines {quoted} are no rotation ({why}); columns a00 a10 a20, a01 a11 a21, "
            f"a02 a12 a22 must be right-handed unit axes with |R'R - 1| < {_COSINE_LIMIT:g}"
        )
        return identity
    if error > _COSINE_WARN:
        entry.warn(f"cosines are off a rotation by {error:.1e} and were made orthonormal")
    return R


def _orientation(entry: Entry) -> el.Array:
    """Return the marker's axes as columns, from cosines or from 3-1-3 angles."""
    cosines, angles = entry.those(_COSINES), entry.those(_ANGLES)
    if cosines and angles:
        both = f"{', '.join(cosines)} and {', '.join(angles)}"
        entry.fault(f"give direction cosines or angles, not both ({both})")
        return np.eye(3)
    if cosines:
        if any(entry.get(name) is None for name in cosines):
            return np.eye(3)
        return _from_cosines(entry)
    if not angles:
        return np.eye(3)
    for name in angles:
        if abs(entry.get(name, 0.0)) > 2.0 * math.pi:
            entry.warn("more than a full turn; angles are in radians", name)
    return rotation_313(*(entry.get(name, 0.0) for name in _ANGLES))


def _build_marker(entry: Entry) -> None:
    """Add a marker."""
    x, y, z = (entry.get(name, 0.0) for name in _POSITIONS)
    marker = el.Marker(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        body_id=entry.get("body_id", 0),
        rm_id=entry.get("rm_id"),
        pos=(x, y, z),
        R=_orientation(entry),
        source=entry.source,
    )
    entry.register("markers", marker)


def _about_inertia(name: str) -> str:
    a, b = name[-2], name[-1]
    if a == b:
        return f"moment of inertia about the centre of mass, along {a} of im_id"
    return f"integral of {a} {b} dm"


def _no(name: str) -> str:
    """Return the default of an inertia: products are 0, moments must be given with mass."""
    return "" if name[-1] == name[-2] else "0"


def _about_velocity(name: str) -> str:
    what = "angular velocity" if name[0] == "w" else "velocity of the centre of mass"
    return f"{what} at the start, along {name[-1]} of {name[0]}m_id"


def _speed(name: str) -> str:
    return "rad/T" if name[0] == "w" else "L/T"


PARAM_UNIT = Statement(
    "Param_Unit",
    {
        "force_unit": Spec(keyword(units.names(units.FORCE)), "unit F", "", "NEWTON"),
        "mass_unit": Spec(keyword(units.names(units.MASS)), "unit M", "", "KILOGRAM"),
        "length_unit": Spec(keyword(units.names(units.LENGTH)), "unit L", "", "METER"),
        "time_unit": Spec(keyword(units.names(units.TIME)), "unit T", "", "SECOND"),
        "mass_mult_factor": Spec(POSITIVE, "M L/T^2 in F, in place of unit names", "", "by names"),
    },
    _build_units,
    about="the units of all numbers of the deck and of the results",
)

BODY_RIGID = Statement(
    "Body_Rigid",
    {
        **NAMED,
        "isground": Spec(FLAG, "TRUE: the body that does not move", "", "FALSE"),
        "cg_id": Spec(
            ID, "marker of the body at its centre of mass", "", "with density, that of its graphics"
        ),
        "im_id": Spec(ID, "marker of the body along whose axes inertias are", "", "cg_id"),
        "lprf_id": Spec(ID, "marker in which the body's markers are given", "", "global frame"),
        "mass": Spec(POSITIVE, "mass; moving bodies need it or density", "M"),
        # ours
        "is_wet_body": Spec(FLAG, refused="AcuSolve is not coupled", harmless="false"),
        "cp_inp_id": Spec(TEXT, refused="AcuSolve is not coupled"),
        "density": Spec(POSITIVE, "gives mass and inertia from the body's graphics", "M/L^3"),
        **{name: Spec(REAL, _about_inertia(name), "M L^2", _no(name)) for name in _INERTIAS},
        **{name: Spec(REAL, _about_velocity(name), _speed(name), "0") for name in _VELOCITIES},
        **{
            f"{name}_flag": Spec(FLAG, f"whether {name} counts", "", "FALSE")
            for name in _VELOCITIES
        },
        "vm_id": Spec(ID, "marker along whose axes v_ic are", "", "global frame"),
        "wm_id": Spec(ID, "marker along whose axes w_ic are", "", "global frame"),
    },
    _build_body,
    about="a rigid body, or the ground",
    call="body",
)

_ABOUT_ANGLES = {
    "psi": "first turn, about z",
    "theta": "second turn, about x after the first",
    "phi": "third turn, about z after both",
}


def _about_cosine(name: str) -> str:
    row, column = (int(digit) for digit in name[1:])
    return f"{'xyz'[row]} of the marker's {'xyz'[column]}-axis, a direction cosine"


def _unity(name: str) -> str:
    return "1" if name[1] == name[2] else "0"


_NOT_BUILT = "is documented but not built yet"
REFERENCE_MARKER = Statement(
    "Reference_Marker",
    {
        **NAMED,
        "body_id": Spec(ID, "body that carries the marker", required=True),
        "body_type": Spec(
            keyword(spellings(RIGIDBODY="", POINTBODY=""), spellings(FLEXBODY="")),
            "sort of that body",
            "",
            "RIGIDBODY",
        ),
        "rm_id": Spec(ID, "marker in which it is given", "", "lprf_id, else global"),
        "node_id": Spec(ID, refused=_NOT_BUILT),
        **{name: Spec(REAL, f"position along {name[-1]}", "L", "0") for name in _POSITIONS},
        **{name: Spec(REAL, _about_cosine(name), "", _unity(name)) for name in _COSINES},
        **{name: Spec(REAL, about, "rad", "0") for name, about in _ABOUT_ANGLES.items()},
        "usrsub_param_string": Spec(refused=_NOT_BUILT),
        "usrsub_fnc_name": Spec(refused=_NOT_BUILT),
        "usrsub_dll_name": Spec(refused=_NOT_BUILT),
        "script_name": Spec(refused=_NOT_BUILT),
        "interpreter": Spec(refused=_NOT_BUILT),
    },
    _build_marker,
    about="a point with axes on a body",
)
