"""FRICTION of an Adams deck: friction in a joint, read as Force_JointFriction is.

With R the radius of the pin or ball the friction torque of a revolute joint is
mu (R |F across| + R |T across|/BENDING_REACTION_ARM + FRICTION_ARM |F along|), the friction force
of a translational one mu (|F across| + |T across|/INITIAL_OVERLAP + |T along|/REACTION_ARM).
"""

from __future__ import annotations

from mbsim.reader.adm.declare import ANY, LIST, AdmStatement
from mbsim.reader.adm.translate import read_as
from mbsim.reader.forces import force_statements
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import ID, NOT_NEGATIVE, POSITIVE, BadValueError, Kind, keyword, real
from mbsim.reader.statement import Entry, Spec

_NOT_BUILT = "is documented but not built yet"
_INPUTS = ("PRELOAD", "REACTION_FORCE", "BENDING_MOMENT", "TORSIONAL_MOMENT")
#: Joint -> input -> argument that gives its arm, and the attribute that takes it.
_ARMS = {
    "REVOLUTE": {
        "REACTION_FORCE": ("FRICTION_ARM", "friction_arm"),
        "BENDING_MOMENT": ("BENDING_REACTION_ARM", "bending_reaction_arm"),
    },
    "TRANSLATIONAL": {
        "BENDING_MOMENT": ("INITIAL_OVERLAP", "bending_reaction_arm"),
        "TORSIONAL_MOMENT": ("REACTION_ARM", "reaction_arm"),
    },
    "SPHERICAL": {},
}
_RADII = {"REVOLUTE": ("PIN_RADIUS", "pin_radius"), "SPHERICAL": ("BALL_RADIUS", "ball_radius")}
_DEFAULT = 1.0  # of Adams' radii and arms, in model units
_DEFAULT_SPEED = 0.1
_STATEMENT = next(s for s in force_statements() if s.name == "Force_JointFriction")


def _parse_inputs(text: str) -> tuple[str, ...]:
    """Return what presses, of ``ALL``, ``NONE`` or ``(PRELOAD, REACTION_FORCE)``."""
    words = [word.strip().upper() for word in text.strip("() ").replace(":", ",").split(",")]
    if words == ["ALL"]:
        return _INPUTS
    if words == ["NONE"]:
        return ()
    found = [[name for name in _INPUTS if name.startswith(word)] for word in words if word]
    if not found or any(len(names) != 1 for names in found):
        raise BadValueError
    return tuple(names[0] for names in found)


def build_friction(entry: Entry) -> None:
    """Add the friction of a joint."""
    joint = entry.draft.joints.get(entry.get("JOINT", 0))
    if joint is None:
        entry.fault("there is no such JOINT in the deck", "JOINT")
        return
    if joint.type not in _ARMS:
        built = ", ".join(_ARMS)
        entry.fault(f"is {joint.type}: its friction {_NOT_BUILT}; built: {built}", "JOINT")
        return
    inputs = entry.get("INPUTS", _INPUTS)
    if "REACTION_FORCE" not in inputs:
        entry.fault("friction without REACTION_FORCE is not built; must have it", "INPUTS")
        return
    names = {"JOINT": "joint_id"}
    fixed: dict[str, str] = {}
    for source, (argument, attribute) in _ARMS[joint.type].items():
        if source in inputs:
            fixed[attribute] = _value(entry, argument)
    if joint.type in _RADII:
        argument, attribute = _RADII[joint.type]
        fixed[attribute] = _value(entry, argument)
    speed = entry.get("STICTION_TRANSITION_VELOCITY", _DEFAULT_SPEED)
    faster = speed * entry.get("TRANSITION_VELOCITY_COEFFICIENT", 1.5)
    names["MU_DYNAMIC"] = "mu_dynamic"
    if entry.get("EFFECT", "ALL") == "SLIDING":
        fixed |= {"cff_type": "COULOMB_DYNAMICONLY", "friction_trans_vel": repr(speed)}
    else:
        names["MU_STATIC"] = "mu_static"
        fixed |= {
            "cff_type": "COULOMB_ON",
            "stiction_trans_vel": repr(speed),
            "friction_trans_vel": repr(faster),
        }
    if "PRELOAD" in inputs:
        fixed |= _preload(entry, joint.type)
    entry.note("below STICTION_TRANSITION_VELOCITY it creeps by its speed, and does not stick")
    read_as(entry, _STATEMENT, names, fixed)


def _value(entry: Entry, argument: str) -> str:
    if not entry.given(argument):
        entry.note(f"not given; taken as {_DEFAULT:g}, Adams' default, in model units", argument)
    return repr(entry.get(argument, _DEFAULT))


def _preload(entry: Entry, type: str) -> dict[str, str]:
    """Return what presses as much as a friction force or torque that is there without load."""
    name = "FRICTION_FORCE_PRELOAD" if type == "TRANSLATIONAL" else "FRICTION_TORQUE_PRELOAD"
    size = entry.get(name, 0.0)
    if size == 0.0:
        return {}
    mu = entry.get("MU_DYNAMIC", 0.0)
    if mu == 0.0 or entry.get("MU_STATIC", mu) != mu:
        entry.fault(
            f"is built where MU_STATIC and MU_DYNAMIC are one number > 0; {mu:g} here", name
        )
        return {}
    radius = entry.get(_RADII[type][0], _DEFAULT) if type in _RADII else 1.0
    return {"preload": repr(size / (mu * radius))}


FRICTION = AdmStatement(
    "FRICTION",
    {
        "id": Spec(ID, required=True),
        "JOINT": Spec(ID, required=True),
        "MU_STATIC": Spec(NOT_NEGATIVE, required=True),
        "MU_DYNAMIC": Spec(NOT_NEGATIVE, required=True),
        "STICTION_TRANSITION_VELOCITY": Spec(POSITIVE),
        "TRANSITION_VELOCITY_COEFFICIENT": Spec(real("a number >= 1", least=1.0)),
        "MAX_STICTION_DEFORMATION": Spec(POSITIVE, note="there is no deformation in stiction"),
        "EFFECT": Spec(
            keyword(spellings(ALL="", SLIDING=""), spellings(STICTION=""), "it slips as well")
        ),
        "INPUTS": Spec(Kind(f"ALL, NONE or {', '.join(_INPUTS)} {LIST}", _parse_inputs)),
        **{
            name: Spec(POSITIVE)
            for name in (
                *("PIN_RADIUS", "BALL_RADIUS", "FRICTION_ARM", "BENDING_REACTION_ARM"),
                *("REACTION_ARM", "INITIAL_OVERLAP"),
            )
        },
        **{
            name: Spec(NOT_NEGATIVE)
            for name in ("FRICTION_FORCE_PRELOAD", "FRICTION_TORQUE_PRELOAD")
        },
        "OVERLAP_DELTA": Spec(
            keyword(spellings(CONSTANT=""), spellings(INCREASE="", DECREASE="")), note="is so"
        ),
        "INACTIVE": Spec(keyword(spellings(STATIC="")), note="friction does nothing in equilibria"),
        "FORMULATION": Spec(
            keyword(spellings(ORIGINAL=""), spellings(LUGRE="")), note="is so but for stiction"
        ),
        **{
            name: Spec(ANY, refused=_NOT_BUILT)
            for name in ("MAX_FRICTION_FORCE", "MAX_FRICTION_TORQUE", "YOKE")
        },
    },
    build_friction,
    xml="Force_JointFriction",
)
