"""Parameters of a deck as directions in a run's arrays: which numbers they change, and how fast.

The deck is read and built a few times with the parameter a little changed, and what differs is
what it changes: whatever attribute it is, no list of them is kept anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core import tags
from mbsim.errors import MbsimError, ModelError

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Array = np.ndarray[Any, Any]
#: Builds are made at so many parts of a parameter's size to either side; differences of order 4.
_CHANGE = 1e-3
_PARTS = (1.0, -1.0, 0.5, -0.5)
#: By what errors are judged, what bounds steps and what is only room: it does not move anything.
_ASIDES = (
    "world/scale", "world/hooks", "scales/", "audit/", "states/scale", "residuals/scale",
    "applied/bound", "sensors/", "programs/quick",
)  # fmt: skip
#: Numbers that differ by less, over their size, differ by rounding.
_ROUNDING = 1e-13
#: Differences over the whole change and over half of it may differ by this part of the largest.
_SMOOTH = 1e-2
#: Columns of `Graphics.size` that may be where a polyhedron and a surface are in memory.
POLYHEDRON, SURFACE = 0, 3
#: Polyhedra of meshes, which a run keeps beside its arrays.
_POLYHEDRA = "polyhedra/"
#: Methods of which derivatives are known.
_METHODS = ("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA")
#: Scratch that nothing fills but the build: shapes that stand still.
_FILLED_ONCE = "work/frames"


@dataclass(frozen=True)
class Direction:
    """How a parameter changes a run.

    Attributes
    ----------
    name : str
        As of ``--set``.
    value, size : float
        Of the parameter; its usual size, which is 1 where it is 0.
    arrays : dict
        Derivatives of the arrays that it changes, by path in `Scene`.
    systems : tuple of System
        Built with the parameter at value + change * part of `PARTS`.
    change : float
    """

    name: str
    value: float
    size: float
    arrays: dict[str, Array]
    systems: tuple[System, ...]
    change: float


def weighed(found: list[Array], change: float) -> Array:
    """Return the derivative of what was found at the four changed values."""
    whole = (found[0] - found[1]) / (2.0 * change)
    half = (found[2] - found[3]) / change
    slope: Array = (4.0 * half - whole) / 3.0
    return slope


def value_in(name: str, text: str | None) -> float:
    """Return the number that an attribute of the deck is.

    Raises
    ------
    ModelError
        If it is none.
    """
    if text is None:
        raise ModelError(
            f"sensitivity: {name} is not given in the deck; give its value there, or by --set"
        )
    try:
        value = float(text.replace("D", "E").replace("d", "e"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ModelError(
            f"sensitivity: {name}={text} is no number; one of USER(...) is {name}[1] and so on, "
            "one in an expression that of a Reference_Variable that it looks at"
        )
    return value


def direction(
    name: str, value: float, build: Callable[[str, float], System], base: System
) -> Direction:
    """Return how a parameter changes a run.

    Parameters
    ----------
    name : str
    value : float
    build : callable
        Returns the system with the parameter at another value.
    base : System
        That of the run.

    Raises
    ------
    ModelError
        If the deck is none with the parameter a little changed, or it changes what is there.
    """
    size = abs(value) or 1.0
    change = _CHANGE * size
    try:
        systems = tuple(build(name, value + part * change) for part in _PARTS)
    except MbsimError as error:
        raise ModelError(
            f"sensitivity: {name} cannot be changed to either side of {value:.9g}: {error}"
        ) from None
    tables = [_tables(system) for system in systems]
    own = _tables(base)
    names = {key for table in tables for key in table} | set(own)
    arrays: dict[str, Array] = {}
    for key in sorted(names):
        found = [table.get(key) for table in tables]
        if key.startswith(_ASIDES):
            continue
        there = [each for each in found if each is not None]
        if len({each.shape for each in there}) != 1 or len(there) != len(found):
            raise ModelError(f"sensitivity: {name} changes what the model is made of: {key}")
        if not _is_like(own.get(key), there[0]):
            raise ModelError(
                f"sensitivity: at {name}={value:.9g} the model is another one than beside it: {key}"
            )
        if there[0].dtype.kind == "i":
            if any(not np.array_equal(there[0], each) for each in there[1:]):
                raise ModelError(f"sensitivity: {name} changes what the model is made of: {key}")
            continue
        if all(np.array_equal(there[0], each, equal_nan=True) for each in there[1:]):
            continue
        with np.errstate(invalid="ignore"):
            slope = weighed(there, change)
        level = _ROUNDING / _CHANGE * np.maximum(np.abs(there[0]), np.abs(there[1])) / size
        if key.startswith(_POLYHEDRA) and np.any(np.abs(slope) > level):
            raise ModelError(f"sensitivity: {name} changes corners of a mesh, which is not built")
        if not _is_smooth(there, change, size):
            raise ModelError(f"sensitivity: {name} does not change the model smoothly: {key}")
        slope = np.where(np.isfinite(slope) & (np.abs(slope) > level), slope, 0.0)
        if slope.any():
            arrays[key] = slope
    if name.endswith("]") and not arrays:
        raise ModelError(
            f"sensitivity: {name} is a number that a user's subroutine keeps to itself; those of "
            "contacts and of Force_Element are known"
        )
    return Direction(name, value, size, arrays, systems, change)


def _is_like(own: Array | None, beside: Array) -> bool:
    """Return whether an array of the run is made as one with the parameter changed is."""
    if own is None or own.shape != beside.shape:
        return False
    return own.dtype.kind != "i" or np.array_equal(own, beside)


def _is_smooth(found: list[Array], change: float, size: float) -> bool:
    """Return whether differences over the whole change and half of it are alike.

    What is sorted, or chosen among others, is not: its slope would be that of another thing.
    """
    with np.errstate(invalid="ignore"):
        whole = (found[0] - found[1]) / (2.0 * change)
        half = (found[2] - found[3]) / change
        finite = np.isfinite(whole) & np.isfinite(half)
        off = np.where(finite, np.abs(whole - half), 0.0).max(initial=0.0)
        slope = np.where(finite, np.maximum(np.abs(whole), np.abs(half)), 0.0).max(initial=0.0)
        value = np.where(np.isfinite(found[0]), np.abs(found[0]), 0.0).max(initial=0.0)
    return bool(off <= _SMOOTH * slope + 8.0 * _ROUNDING / _CHANGE * value / size)


def _tables(system: System) -> dict[str, Array]:
    """Return the arrays that a parameter may change, by path; without places in memory."""
    found = dict(tags.arrays(system.scene, tags.CONSTANT))
    size = system.scene.graphics.size.copy()
    size[:, SURFACE] = 0.0
    for g, graphic_id in enumerate(system.graphic_ids):
        hull = system.model.graphics[graphic_id].hull
        if hull is not None:
            size[g, POLYHEDRON] = 0.0
            found[f"{_POLYHEDRA}{graphic_id}"] = hull
    found["graphics/size"] = size
    found |= _without_users(system)
    fixed = system.scene.graphics.body == len(system.body_ids)
    found[_FILLED_ONCE] = np.where(fixed[:, None], system.scene.work.frames, 0.0)
    return found


def _without_users(system: System) -> dict[str, Array]:
    """Return the arrays that say where users' functions are, or what these read, without that.

    These are made anew with every build.
    """
    scene, contacts = system.scene, system.scene.contacts
    laws = {
        "normal": (contacts.normal_law.copy(), contacts.normal_par.copy()),
        "friction": (contacts.friction_law.copy(), contacts.friction_par.copy()),
        "sliding": (contacts.sliding_law.copy(), contacts.sliding_par.copy()),
    }
    for id, user in system.user_laws:
        k = system.contact_ids.index(id)
        for law, par in laws.values():
            if law[k] == user.address:
                law[k] = 1
                par[k, : len(user.hidden)] = 0.0
    found = {}
    for kind, (law, par) in laws.items():
        found[f"contacts/{kind}_law"], found[f"contacts/{kind}_par"] = law, par
    found["contacts/user_normal"] = np.sign(contacts.user_normal)
    found["users/address"] = np.sign(scene.users.address)
    for name in ("address", "twin"):
        found[f"residuals/{name}"] = np.sign(getattr(scene.residuals, name))
    return found


def replaced(whole: Any, made: Mapping[str, Array], path: str = "") -> Any:
    """Return a group of groups with other arrays, by path."""
    fields = {}
    for name in whole._fields:
        value, at = getattr(whole, name), f"{path}{name}"
        if isinstance(value, tuple):
            fields[name] = replaced(value, made, f"{at}/")
        elif at in made:
            fields[name] = made[at]
    return whole._replace(**fields)


def refused(system: System, settings: Any) -> str | None:
    """Return why sensitivities are not for a run, None where they are."""
    model = system.model
    if settings.integrator not in _METHODS:
        return f"integrator {settings.integrator} has none; take one of {', '.join(_METHODS)}"
    if system.needs_fcl:
        return "FCL finds contacts of this model, whose normals scatter by 2e-6"
    stages = [stage.simulation for stage in settings.stages]
    if any(stage.analysis_type == "STATIC" for stage in stages):
        return "a static equilibrium in <Command> is not built"
    if any(stage.analysis_type == "LINEAR" for stage in stages):
        return "a linear analysis in <Command> is not built"
    if any(stage.changes or stage.inactive for stage in stages):
        return "changes of elements in <Command> are not built"
    if model.sensors:
        return "Sensor_Event is not built"
    if system.reader is not None:
        return "subroutines that look at the model by py_sysfnc are not built"
    return None
