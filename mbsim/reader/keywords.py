"""Names and keyword spellings: matched without case and `_`, nearest known name suggested."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterable

from mbsim.forces.catalog import FORCES
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.model.request_types import TYPES


# names repeat: a deck of thousands of bodies has a few hundred
@functools.lru_cache(maxsize=1 << 14)
def fold(name: str) -> str:
    """Return `name` without case, `_` and outer blanks, the form in which names are compared."""
    return name.strip().replace("_", "").lower()


def nearest(name: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Return ``; did you mean X?`` with the known name most like `name`, or an empty string.

    `likeness` is twice the letters that both have in order, over all letters of both, at least.
    Where none is so like it, the first name that begins with it, that it begins with (expression
    means expr), or else the only one whose last word it is (x means grav_x).
    """
    by_fold = {fold(word): word for word in known}
    word = fold(name)
    close = difflib.get_close_matches(word, by_fold, n=5, cutoff=likeness)
    # slips are rare in the first letter: cm_id means cg_id rather than wm_id
    close.sort(key=lambda match: match[:1] != word[:1])
    if not close and len(word) > 1:
        close = [match for match in by_fold if match.startswith(word)]
        close = close or [match for match in by_fold if len(match) > 3 and word.startswith(match)]
    if not close:
        ends = [key for key, whole in by_fold.items() if fold(whole.rpartition("_")[2]) == word]
        close = ends if len(ends) == 1 else []
    return f"; did you mean {by_fold[close[0]]}?" if close else ""


def spellings(**canonical: str) -> dict[str, str]:
    """Return folded spelling -> canonical keyword, from ``KEYWORD="other spellings"``."""
    table = {}
    for keyword, others in canonical.items():
        for word in (keyword, *others.split()):
            table[fold(word)] = keyword
    return table


# one keyword, many documented forms; the canonical one is the key
CNF_TYPES = spellings(**dict.fromkeys(NORMAL_LAWS, ""), USERCNF="USER")
#: Laws that need no shapes: those of limits.
CNF_OF_LIMITS = spellings(**{law: "" for law in NORMAL_LAWS if not NORMAL_LAWS[law].of_shapes})
_OTHER_WORDS = {
    "COULOMB_ON": "ON",
    "COULOMB_OFF": "OFF",
    "COULOMB_DYNAMICONLY": "DYNAMICONLY DYNAMICSONLY COULOMB_DYNAMICSONLY",
    "USERCFF": "",
}
CFF_TYPES = spellings(**(dict.fromkeys(FRICTION_LAWS, "") | _OTHER_WORDS))
CFF_OF_JOINTS = {word: name for word, name in CFF_TYPES.items() if name.startswith("COULOMB")}
MASTERS_NOT_BUILT = spellings(I="", J="", I_AND_J="")
FACETS = spellings(FLAT="", SMOOTH="")
ENDS_TYPES = spellings(OPEN="", CLOSED="", TOP_ONLY="", BOTTOM_ONLY="")

REQUEST_TYPES = spellings(**{name: type.spellings for name, type in TYPES.items()})
#: What a request may ask the force of: Adams' statement, with MotionSolve's names for it.
FORCE_ELEMENTS = spellings(
    JOINT="CONSTRAINT_JOINT",
    JPRIM="CONSTRAINT_JPRIM",
    MOTION="MOTION_JOINT MOTION_MARKER",
    PTCV="CONSTRAINT_PTCV",
    CVCV="CONSTRAINT_CVCV",
    PTSF="CONSTRAINT_PTSF",
    **{name: f"{kind.statement} {kind.spellings}" for name in FORCES if (kind := FORCES[name])},
    CONTACT="FORCE_CONTACT",
)

PRIMITIVES = spellings(
    SPHERICAL="ATPOINT",
    INLINE="",
    INPLANE="",
    ORIENTATION="",
    PARALLEL_AXES="",
    PERPENDICULAR="",
)
DIRECTIONS = spellings(R="ROTATION", T="TRANSLATION")
MARKER_DIRECTIONS = spellings(X="", Y="", Z="", B1="", B2="", B3="")
VALUE_TYPES = spellings(D="DISPLACEMENT", V="VELOCITY", A="ACCELERATION")
BY_EXPRESSION = spellings(EXPRESSION="")
BY_USERSUB = spellings(USERSUB="")

ANALYSIS_TYPES = spellings(
    TRANSIENT="", ASSEMBLY="", STATIC="STATICS", KINEMATIC="KINEMATICS", LINEAR=""
)
ANALYSIS_NOT_BUILT = {
    "frequency response": "FREQUENCY_RESPONSE",
    "frequencyresponse": "FREQUENCY_RESPONSE",
}
