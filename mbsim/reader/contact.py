"""Force_Contact: every documented attribute; what is not built is refused by name."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from mbsim.laws.catalog import FRICTION_LAWS, Parameter
from mbsim.model import elements as el
from mbsim.reader.keywords import (
    CFF_TYPES,
    CNF_TYPES,
    MASTERS_NOT_BUILT,
    spellings,
)
from mbsim.reader.kinds import (
    COUNT,
    FLAG,
    ID,
    IDS,
    NOT_NEGATIVE,
    POSITIVE,
    POSITIVE_OR_INFINITE,
    RATIO,
    REAL,
    TEXT,
    UNIT,
    USER,
    Kind,
    keyword,
)
from mbsim.reader.normal_force import DEFAULT_SPEED, check_normal, note_unused, warn_default_speed
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import LANGUAGE, subroutine

_SPEEDS = ("stiction_trans_vel", "friction_trans_vel")
_RADIUS = "patch_radius"
_STIFFNESS = "tangential_stiffness"
#: What STICTION has beside that of the spring that holds.
_OF_SPRINGS = (
    *("tangential_damping", "poisson_ratio", "rotational_stiffness", "torsion_radius"),
    "incremental",
)
_USERS = {
    *("cff_param_string", "cff_fnc_name", "cff_dll_name", "cff_language"),
}
CFF_USES: dict[str, set[str]] = {
    **{
        name: {
            *FRICTION_LAWS[name].parameters,
            *(_USERS if FRICTION_LAWS[name].takes_function else ()),
        }
        for name in FRICTION_LAWS
    },
    "COULOMB_OFF": set(),
    "USERCFF": _USERS,
}
CFF_ALL = set().union(*CFF_USES.values())


def _build_contact(entry: Entry) -> None:
    """Add a contact."""
    for side in "ij":
        _check_count(entry, side)
    cnf_type = entry.get("cnf_type", "IMPACT")
    cff_type = entry.get("cff_type", "COULOMB_OFF")
    if entry.get("cnf_type") is not None:
        check_normal(entry, cnf_type)
    if entry.get("cff_type") is not None or not entry.given("cff_type"):
        note_unused(entry, f"cff_type {cff_type}", CFF_ALL - CFF_USES[cff_type])
    if cff_type in FRICTION_LAWS:
        check_coulomb(entry, cff_type)
    if cff_type == "CONTENSOU" and entry.get("contact_points", "POINTS") != "REGION":
        if not entry.given(_RADIUS):
            message = 'cff_type="CONTENSOU" needs patch_radius, or contact_points="REGION"'
            entry.fault(message, _RADIUS)
    if cff_type == "STICTION" and cnf_type == "USERCNF" and not entry.given(_STIFFNESS):
        message = "missing; a user's normal force does not tell the stiffness it would follow from"
        entry.fault(message, _STIFFNESS)
    if cff_type == "STICTION":
        _check_rigid(entry)
    post_library = entry.get("cpost_dll_name", "NULL").strip().upper() not in ("", "NULL")
    posts = post_library or any(entry.given(name) for name in _POST)
    asks_user = _asks_user(entry, cff_type)
    cff = subroutine(entry, "cff", "CFFSUB") if asks_user else el.Subroutine()
    cnf = subroutine(entry, "cnf", "CNFSUB") if cnf_type == "USERCNF" else el.Subroutine()
    cpost = subroutine(entry, "cpost", "CONTACTPOST") if posts else None
    scripted = (asks_user and not cff.dll_name) or (posts and not post_library)
    if not scripted and not (cnf_type == "USERCNF" and not cnf.dll_name):
        note_unused(entry, "no subroutine in a script", {"script_name", "interpreter"})

    volume = cnf_type == "VOLUME"
    contact = el.Contact(
        **_by_name(entry, {"id", "cnf_type", "cff_type", "contact_depth", "exponent"}),
        id=entry.get("id", 0),
        contact_depth="FIELD" if volume else entry.get("contact_depth", "LARGEST"),
        cnf_type=cnf_type,
        exponent=entry.get("exponent", 1.0 if volume else 1.5),
        cff_type=cff_type,
        friction=_own_attributes(entry, cff_type),
        cff=cff,
        source=entry.source,
        cnf=cnf,
        cpost=cpost,
    )
    entry.register("contacts", contact)


def _by_name(entry: Entry, but: set[str]) -> dict[str, Any]:
    """Return what the contact calls as the statement does, `but` for some; else its own default."""
    return {
        field.name: entry.get(field.name, field.default)
        for field in fields(el.Contact)
        if field.name in FORCE_CONTACT.attributes and field.name not in but
    }


def _asks_user(entry: Entry, cff_type: str) -> bool:
    """Return whether the user's function is to be called."""
    if cff_type in FRICTION_LAWS:
        return FRICTION_LAWS[cff_type].takes_function and entry.given("cff_fnc_name")
    return cff_type == "USERCFF"


def _own_attributes(entry: Entry, cff_type: str) -> tuple[tuple[str, float], ...]:
    """Return the attributes given that only this friction law has; fault what it must have."""
    if cff_type not in FRICTION_LAWS:
        return ()
    given = []
    for own in FRICTION_LAWS[cff_type].own:
        if entry.given(own.name):
            given.append((own.name, float(entry.get(own.name, 0.0))))
            if own.needs and not entry.given(own.needs):
                entry.fault(f"means nothing without {own.needs}", own.name)
        elif own.default is None:
            entry.fault(f'cff_type="{cff_type}" needs {own.name}', own.name)
    return tuple(given)


def _of_laws() -> dict[str, Spec]:
    """Return the attributes that friction laws bring with them."""
    laws = (FRICTION_LAWS[name] for name in FRICTION_LAWS)
    own = [parameter for law in laws for parameter in law.own]
    return {each.name: Spec(_kind_of(each), each.about, each.unit, _usual(each)) for each in own}


def _usual(parameter: Parameter) -> str:
    """Return what is taken where the deck does not give a parameter, as the deck would say it."""
    if parameter.usual or parameter.default is None:
        return parameter.usual
    if parameter.flag:
        return "TRUE" if parameter.default else "FALSE"
    return f"{parameter.default:g}"


def _kind_of(parameter: Parameter) -> Kind:
    """Return what an attribute that a law brings with it may be."""
    if parameter.infinite:
        return POSITIVE_OR_INFINITE
    if parameter.flag:
        return FLAG
    if parameter.ratio:
        return RATIO
    return POSITIVE if parameter.positive else NOT_NEGATIVE


def _check_rigid(entry: Entry) -> None:
    """Fault what means nothing where friction holds without give."""
    if not math.isinf(entry.get(_STIFFNESS, 0.0)):
        return
    for name in _OF_SPRINGS:
        if entry.given(name):
            entry.fault(f"means nothing with {_STIFFNESS}=INFINITE: nothing gives", name)


def _check_count(entry: Entry, side: str) -> None:
    """Compare num_i_graphics with the ids given; an absent count is taken from them."""
    count, ids = entry.get(f"num_{side}_graphics"), entry.get(f"{side}_graphics_id")
    if count is not None and ids is not None and count != len(ids):
        message = f"{side}_graphics_id names {len(ids)}; the two must agree"
        entry.fault(message, f"num_{side}_graphics")


def check_coulomb(entry: Entry, cff_type: str) -> None:
    """Check friction coefficients and transition velocities against each other."""
    for name in _SPEEDS:
        if name in CFF_USES[cff_type]:
            warn_default_speed(entry, name)
    coefficients = sorted({"mu_static", "mu_dynamic"} & CFF_USES[cff_type])
    if coefficients and not any(map(entry.given, coefficients)):
        entry.warn(f"not given: 0, so that {cff_type} gives no friction", coefficients[0])
    if "mu_static" not in CFF_USES[cff_type] or "mu_dynamic" not in CFF_USES[cff_type]:
        return
    check_coefficients(entry)
    if not set(_SPEEDS) <= CFF_USES[cff_type]:
        return
    vs, vd = (entry.get(name, DEFAULT_SPEED) for name in _SPEEDS)
    known = all(entry.get(name) is not None or not entry.given(name) for name in _SPEEDS)
    if known and vd < vs:
        given = "friction_trans_vel" if entry.given("friction_trans_vel") else "stiction_trans_vel"
        entry.fault(
            f"friction_trans_vel ({vd:g}) must not be less than stiction_trans_vel ({vs:g}); "
            "each defaults to 1e-3",
            given,
        )


def check_coefficients(entry: Entry) -> None:
    """Warn where less friction holds than slips."""
    mu_static, mu_dynamic = entry.get("mu_static", 0.0), entry.get("mu_dynamic", 0.0)
    if mu_dynamic > mu_static:
        entry.warn(f"larger than mu_static ({mu_static:g})", "mu_dynamic")


_POST = (
    *("cpost_param_string", "cpost_fnc_name", "cpost_language"),
    *("cpost_script_name", "cpost_interpreter"),
)
_NOT_BUILT = "is documented but not built yet"
FORCE_CONTACT = Statement(
    "Force_Contact",
    {
        **NAMED,
        "num_i_graphics": Spec(COUNT, "number of ids in i_graphics_id, checked"),
        "i_graphics_id": Spec(IDS, "graphics of side I", required=True),
        "num_j_graphics": Spec(COUNT, "number of ids in j_graphics_id, checked"),
        "j_graphics_id": Spec(IDS, "of side J; both lists alike: in itself", required=True),
        "i_flexbody_id": Spec(ID, refused=_NOT_BUILT),
        "i_flip_flex": Spec(FLAG, refused=_NOT_BUILT, harmless="FALSE"),
        "j_flexbody_id": Spec(ID, refused=_NOT_BUILT),
        "j_flip_flex": Spec(FLAG, refused=_NOT_BUILT, harmless="FALSE"),
        "ignore_penetration_larger_than": Spec(POSITIVE, "no force above this depth", "L", "never"),
        "master_surface": Spec(
            keyword(spellings(AUTO=""), MASTERS_NOT_BUILT, "no side is the master"),
            "both sides count alike",
            "",
            "AUTO",
        ),
        "enable_node_mode": Spec(
            keyword(spellings(FALSE="", AUTO=""), spellings(TRUE=""), "surfaces touch, not nodes"),
            "surfaces touch, not their nodes",
            "",
            "AUTO",
        ),
        "enable_analytical": Spec(
            keyword(spellings(TRUE="", AUTO=""), spellings(FALSE=""), "shapes are not tessellated"),
            "closed forms where there are some",
            "",
            "AUTO",
        ),
        "enable_sphere_to_mesh": Spec(
            keyword(
                spellings(TRUE="", AUTO=""), spellings(FALSE=""), "spheres are not tessellated"
            ),
            "spheres touch meshes as spheres",
            "",
            "AUTO",
        ),
        "contact_stability_2d": Spec(REAL, note="is for contact of curves; these are shapes"),
        # ours: an incident a contact point, or one for all that two graphics touch with
        "contact_points": Spec(
            keyword(spellings(POINTS="", REGION="")), "one point each, or one in all", "", "POINTS"
        ),
        "contact_depth": Spec(
            keyword(spellings(LARGEST="", FIELD="")), "which depth of meshes counts", "", "LARGEST"
        ),
        "cnf_type": Spec(keyword(CNF_TYPES), "normal force", required=True),
        "stiffness": Spec(NOT_NEGATIVE, "stiffness k, force = k depth^exponent", "F/L^e", "0"),
        "exponent": Spec(POSITIVE, "exponent e of the depth", "", "1.5; 1 with VOLUME"),
        "damping": Spec(
            NOT_NEGATIVE, "damping; T/L with HUNT_CROSSLEY, HERTZ, VOLUME", "F T/L", "0"
        ),
        "dmax": Spec(POSITIVE, "depth of full damping; IMPACT needs it with damping", "L"),
        "penalty": Spec(NOT_NEGATIVE, "stiffness of POISSON", "F/L", "0.1"),
        "restitution_coef": Spec(
            UNIT, "rebound over approach speed; of POISSON 0", alias="restitution_coeff"
        ),
        # ours
        "ref_velocity": Spec(POSITIVE, "approach speed at which it holds", "L/T"),
        "normal_trans_vel": Spec(POSITIVE, "speed over which POISSON softens", "L/T", "1e-3"),
        "i_elastic_modulus": Spec(
            NOT_NEGATIVE, "Young's modulus of I, HERTZ, VOLUME", "F/L^2", "rigid"
        ),
        "j_elastic_modulus": Spec(
            NOT_NEGATIVE, "Young's modulus of J, HERTZ, VOLUME", "F/L^2", "rigid"
        ),
        # ours: what Hertz's theory needs beside the moduli
        "i_poisson_ratio": Spec(RATIO, "Poisson's ratio of I, HERTZ, VOLUME", "", "0 with VOLUME"),
        "j_poisson_ratio": Spec(RATIO, "Poisson's ratio of J, HERTZ, VOLUME", "", "0 with VOLUME"),
        "i_radius": Spec(POSITIVE, "radius of I where they touch", "L", "the graphic's"),
        "j_radius": Spec(POSITIVE, "radius of J where they touch", "L", "the graphic's"),
        "i_layer_depth": Spec(POSITIVE, "depth of the elastic layer of I, VOLUME", "L"),
        "j_layer_depth": Spec(POSITIVE, "depth of the elastic layer of J, VOLUME", "L"),
        "cnf_param_string": Spec(USER, "par of the user's normal force", "", "USER()"),
        "cnf_fnc_name": Spec(TEXT, "name of the user's normal force", "", "CNFSUB"),
        "cnf_dll_name": Spec(TEXT, "shared library that has it"),
        "cnf_language": Spec(LANGUAGE, "its language, where its name does not tell"),
        "cff_type": Spec(keyword(CFF_TYPES), "law of friction", "", "COULOMB_OFF"),
        "mu_static": Spec(NOT_NEGATIVE, "coefficient of static friction", "", "0"),
        "mu_dynamic": Spec(NOT_NEGATIVE, "coefficient of sliding friction", "", "0"),
        "stiction_trans_vel": Spec(POSITIVE, "slip speed of the static peak", "L/T", "1e-3"),
        "friction_trans_vel": Spec(POSITIVE, "slip speed of full sliding", "L/T", "1e-3"),
        **_of_laws(),
        "cff_param_string": Spec(USER, "par of the user's friction", "", "USER()"),
        "cff_fnc_name": Spec(TEXT, "name of the user's friction", "", "CFFSUB"),
        "cff_dll_name": Spec(TEXT, "shared library that has it"),
        # ours
        "cff_language": Spec(LANGUAGE, "its language, where its name does not tell"),
        "script_name": Spec(TEXT, "file of the user's functions, relative to the deck"),
        "interpreter": Spec(
            keyword(spellings(PYTHON="", MATLAB="", OCTAVE="")), "its language", "", "PYTHON"
        ),
        "cpost_param_string": Spec(USER, "par of CONTACTPOST", "", "USER()"),
        "cpost_fnc_name": Spec(TEXT, "function called at output times", "", "CONTACTPOST"),
        "cpost_dll_name": Spec(TEXT, "its shared library, or NULL", "", "NULL"),
        "cpost_language": Spec(LANGUAGE, "its language, where its name does not tell"),
        "cpost_script_name": Spec(TEXT, "its file", "", "script_name"),
        "cpost_interpreter": Spec(keyword(spellings(PYTHON="")), "its language", "", "PYTHON"),
    },
    _build_contact,
    about="contact between graphics: normal force and friction",
)
