"""The files of `tests/templates`: where each goes, and what it touches."""

from __future__ import annotations

from typing import NamedTuple


class Template(NamedTuple):
    """A file of `tests/templates`: where it goes, and how many files it may touch."""

    place: str  # in the package; none where it holds lines for files that are there
    files: int
    lines: tuple[tuple[str, ...], ...] = ()  # file, what stands there, what shall, and so on
    #: File and line by which the package registers one of this name already; it is not counted.
    instead_of: tuple[str, str] | None = None


TEMPLATES = {
    "friction_law": Template("laws/friction/viscous.py", 1),
    "normal_law": Template("laws/normal/kelvin_voigt.py", 1),
    "joint": Template("joints/kinds/pin_in_slot.py", 1),
    "force": Template("forces/kinds/tether.py", 1),
    "scalar_force": Template("forces/kinds/cubic_spring.py", 1),
    "pair": Template(
        "geometry/pairs/ellipsoid_mesh.py",
        1,
        instead_of=("geometry/pairs/round_mesh.py", '@pair("ELLIPSOID", "MESH", slots=1)\n'),
    ),
    "integrator": Template(
        "integrators/heun.py",
        2,
        (
            (
                "integrators/catalog.py",
                "SCHEMES = {\n",
                'SCHEMES = {\n    "HEUN": "explicit, order 2",\n',
            ),
        ),
    ),
    "statement": Template(
        "reader/lift.py",
        2,
        (
            (
                "reader/statements.py",
                "from mbsim.reader.forces import",
                "from mbsim.reader.lift import FORCE_LIFT\nfrom mbsim.reader.forces import",
                "STATEMENTS = (\n",
                "STATEMENTS = (\n    FORCE_LIFT,\n",
            ),
        ),
    ),
    "request": Template("", 2),
    "attribute": Template("", 3),
    "contact_attribute": Template("", 3),
}
