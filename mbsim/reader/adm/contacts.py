"""GRAPHICS and CONTACT of an Adams deck: shapes, and what happens where they touch."""

from __future__ import annotations

import re

from mbsim.reader.adm.declare import ANY, IDS_BY_COMMAS, ROUTINE, AdmStatement
from mbsim.reader.adm.draft import require
from mbsim.reader.adm.subroutine import as_attributes, routine
from mbsim.reader.adm.translate import read_as
from mbsim.reader.contact import FORCE_CONTACT
from mbsim.reader.graphics import POST_GRAPHIC
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import ID, NOT_NEGATIVE, POSITIVE, REAL, TEXT, UNIT, USER, keyword
from mbsim.reader.statement import Entry, Spec

#: Type of graphic -> the XML type and what its arguments are there.
SHAPES: dict[str, tuple[str, dict[str, str]]] = {
    "BOX": (
        "BoxDefinedFromCorner",
        {"CORNER": "corner_marker_id", "X": "length_x", "Y": "length_y", "Z": "length_z"},
    ),
    "CYLINDER": (
        "Cylinder",
        {"CM": "center_marker_id", "LENGTH": "length", "RADIUS": "radius"},
    ),
    "ELLIPSOID": ("Ellipsoid", {"CM": "center_marker_id"}),
    "FRUSTUM": (
        "Frustum",
        {
            "CM": "center_marker_id",
            "LENGTH": "length",
            "TOP": "top_radius",
            "BOTTOM": "bottom_radius",
        },
    ),
    "PLANE": ("Plane", {"RM": "rm_id"}),
    "EXTERNAL": ("TriaMesh", {"RM": "rm_id", "FILE": "file"}),
}
_SCALES = ("XSCALE", "YSCALE", "ZSCALE")
_MESHES = (".stl", ".obj", ".off", ".ply", ".glb", ".gltf", ".3mf")
_SOLID = re.compile(r"[,/\s](" + "|".join(SHAPES) + r")\s*(?:[,\n]|$)", re.IGNORECASE)
_PICTURE = "pictures are not written"


def is_picture(text: str) -> bool:
    """Return whether a GRAPHICS is of a type that is only drawn: its arguments are not read."""
    return _SOLID.search(text) is None


def build_graphic(entry: Entry) -> None:
    """Add a shape; of what is only drawn the id is kept, for a CONTACT that would name it."""
    type = entry.get("TYPE")
    if type == "EXTERNAL" and not entry.get("FILE", "").lower().endswith(_MESHES):
        entry.note(f"is no mesh ({' '.join(_MESHES)}) and is a picture only", "FILE")
        type = None
    if type is None:
        if entry.get("id") is not None:
            entry.draft.display_graphics[entry.get("id")] = "other than a solid"
        entry.note("is no solid and is not drawn")
        return
    xml, names = SHAPES[type]
    for name in entry.statement.attributes:
        ours = (*names, "id", "TYPE", *(_SCALES if type == "ELLIPSOID" else ()))
        if entry.given(name) and name not in ours and not entry.statement.attributes[name].note:
            entry.fault(f"{type} has no such argument; it has {', '.join(ours[:-2])}", name)
    fixed = {"type": xml}
    if type == "ELLIPSOID":
        for name in _SCALES:
            require(entry, name)
        # the scales are diameters
        half = [0.5 * entry.get(name, 2.0) for name in _SCALES]
        if half[0] == half[1] == half[2]:
            fixed = {"type": "Sphere", "radius": repr(half[0])}
        else:
            axes = dict(zip("xyz", half, strict=True))
            fixed |= {f"{axis}_scale": repr(size) for axis, size in axes.items()}
    read_as(entry, POST_GRAPHIC, names, fixed)


GRAPHICS = AdmStatement(
    "GRAPHICS",
    {
        "id": Spec(ID, required=True),
        "TYPE": Spec(keyword(spellings(**dict.fromkeys(SHAPES, "")))),
        **{name: Spec(ID) for name in ("CM", "CORNER", "RM")},
        **{name: Spec(POSITIVE) for name in ("X", "Y", "Z", "LENGTH", "RADIUS", *_SCALES)},
        **{name: Spec(NOT_NEGATIVE) for name in ("TOP", "BOTTOM")},
        "FILE": Spec(TEXT),
        **{name: Spec(ANY, note=_PICTURE) for name in ("SIDES", "SEG", "RANGLE", "ELEMENT")},
        **{name: Spec(REAL, note="a plane has no end") for name in ("XMIN", "XMAX")},
        **{name: Spec(REAL, note="a plane has no end") for name in ("YMIN", "YMAX")},
    },
    build_graphic,
    words={name: ("TYPE", name) for name in SHAPES},
    xml="Post_Graphic",
    opaque=is_picture,
)

_NORMAL = {
    "IMPACT": ("STIFFNESS", "EXPONENT", "DAMPING", "DMAX"),
    "POISSON": ("PENALTY", "RESTITUTION_COEFFICIENT"),
}
_FRICTION = (
    *("MU_STATIC", "MU_DYNAMIC"),
    *("STICTION_TRANSITION_VELOCITY", "FRICTION_TRANSITION_VELOCITY"),
)
_NAMES = {
    "IGEOM": "i_graphics_id",
    "JGEOM": "j_graphics_id",
    **{name: name.lower() for name in (*_NORMAL["IMPACT"], "PENALTY", "MU_STATIC", "MU_DYNAMIC")},
    "RESTITUTION_COEFFICIENT": "restitution_coef",
    "COULOMB_FRICTION": "cff_type",
    "STICTION_TRANSITION_VELOCITY": "stiction_trans_vel",
    "FRICTION_TRANSITION_VELOCITY": "friction_trans_vel",
}


def build_contact(entry: Entry) -> None:
    """Add a contact."""
    normal = routine(entry, "CNFSUB", "NORMAL_")
    friction = routine(entry, "CFFSUB", "FRICTION_")
    by_user = {"cnf": (normal, "MODEL"), "cff": (friction, "COULOMB_FRICTION")}
    fixed: dict[str, str] = {}
    for prefix, (user, other) in by_user.items():
        if user is None:
            continue
        if entry.given(other):
            entry.fault("goes without a function of your own for it", other)
        attributes = as_attributes(user, prefix)
        if attributes.get("script_name", "") != fixed.get(
            "script_name", attributes.get("script_name", "")
        ):
            entry.fault("must be in the file of NORMAL_ROUTINE", "FRICTION_ROUTINE")
        fixed |= attributes | {f"{prefix}_type": f"USER{prefix.upper()}"}
    model = "USERCNF" if normal else entry.get("MODEL")
    if model is None:
        require(entry, "MODEL")
    if model is None or entry.get("IGEOM") is None or entry.get("JGEOM") is None:
        return
    for name in _NORMAL.get(model, ()):
        if name != "DAMPING" and name != "DMAX":
            require(entry, name)
    for other in _NORMAL:
        for name in _NORMAL[other] if other != model else ():
            if entry.given(name):
                what = "by NORMAL_FUNCTION" if normal else model
                entry.fault(f"belongs to {other}; this is {what}", name)
    if entry.get("COULOMB_FRICTION", "COULOMB_OFF") != "COULOMB_OFF":
        only = entry.get("COULOMB_FRICTION") == "COULOMB_DYNAMICONLY"
        for name in _FRICTION[1::2] if only else _FRICTION:
            require(entry, name)
    read_as(entry, FORCE_CONTACT, _NAMES, fixed | {"cnf_type": model})


_BRISTLES = (
    "stiction by bristles is not built in .adm decks; write an XML deck with "
    'cff_type="STICTION", or OFF: friction then creeps below STICTION_TRANSITION_VELOCITY'
)
_FLAT = "contact of curves is documented but not built yet"
_FLEXIBLE = "flexible bodies are documented but not built yet"
_ONOFF = keyword(spellings(ON="YES TRUE", OFF="NO FALSE"))
CONTACT = AdmStatement(
    "CONTACT",
    {
        "id": Spec(ID, required=True),
        "IGEOM": Spec(IDS_BY_COMMAS, required=True),
        "JGEOM": Spec(IDS_BY_COMMAS, required=True),
        "MODEL": Spec(keyword(spellings(**dict.fromkeys(_NORMAL, "")))),
        "STIFFNESS": Spec(NOT_NEGATIVE),
        "EXPONENT": Spec(POSITIVE),
        "DAMPING": Spec(NOT_NEGATIVE),
        "DMAX": Spec(POSITIVE),
        "PENALTY": Spec(NOT_NEGATIVE),
        "RESTITUTION_COEFFICIENT": Spec(UNIT),
        "COULOMB_FRICTION": Spec(
            keyword(
                spellings(COULOMB_ON="ON", COULOMB_OFF="OFF", COULOMB_DYNAMICONLY="DYNAMICS_ONLY")
            )
        ),
        **{name: Spec(NOT_NEGATIVE) for name in _FRICTION[:2]},
        **{name: Spec(POSITIVE) for name in _FRICTION[2:]},
        "STICTION": Spec(_ONOFF, refused=_BRISTLES, harmless="OFF"),
        "MAX_STICTION_DEFORMATION": Spec(POSITIVE, note="belongs to STICTION=ON"),
        "AUGMENTED_LAGRANGIAN_FORMULATION": Spec(
            _ONOFF, refused="is documented but not built yet", harmless="OFF"
        ),
        **{name: Spec(ANY, refused=_FLAT) for name in ("ICURVE", "JCURVE", "IFLIP", "JFLIP")},
        **{name: Spec(ANY, refused=_FLEXIBLE) for name in ("IFLEX", "JFLEX")},
        **{name: Spec(USER) for name in ("NORMAL_FUNCTION", "FRICTION_FUNCTION")},
        **{name: Spec(ROUTINE) for name in ("NORMAL_ROUTINE", "FRICTION_ROUTINE")},
    },
    build_contact,
    words={name: ("MODEL", name) for name in _NORMAL},
    xml="Force_Contact",
)
