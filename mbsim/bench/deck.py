"""Decks of the benchmark scenes as readable XML text; numbers are written so that none is lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mbsim.bench.parameters import GRAVITY, SAMPLE

GROUND = '<Body_Rigid id="1" isground="TRUE"/>'
FLOOR = """<Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>"""


def attributes(**values: object) -> str:
    """Return ``name="value"`` for every value; floats by `repr`, which is exact."""
    return " ".join(
        f'{name}="{float(value)!r}"' if isinstance(value, float) else f'{name}="{value}"'
        for name, value in values.items()
    )


def deck(comment: str, statements: Sequence[str], end_time: float, sample: float = SAMPLE) -> str:
    """Return a whole deck in SI units with a row every `sample` seconds."""
    body = "\n".join(statements)
    simulate = attributes(analysis_type="Transient", end_time=end_time, print_interval=sample)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- {comment} (units N, kg, m, s) -->
<MotionSolve>
<Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
{body}
</Model>
<Command>
<Simulate {simulate}/>
</Command>
</MotionSolve>
"""


def body(
    number: int,
    mass: float,
    inertia: Sequence[float],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    spin: Sequence[float] = (0.0, 0.0, 0.0),
    axes: Sequence[Sequence[float]] | None = None,
) -> str:
    """Return a body and its cg marker `10 number`; principal `inertia`, global velocities.

    `axes` are those of the marker, a rotation matrix (3, 3); None means the global ones.
    """
    mass_text = attributes(
        mass=float(mass),
        inertia_xx=float(inertia[0]),
        inertia_yy=float(inertia[1]),
        inertia_zz=float(inertia[2]),
    )
    initial = {
        name: text
        for kind, vector in (("v", velocity), ("w", spin))
        for axis, value in zip("xyz", vector, strict=True)
        if value != 0.0
        for name, text in (
            (f"{kind}_ic_{axis}", float(value)),
            (f"{kind}_ic_{axis}_flag", "TRUE"),
        )
    }
    start = f"\n  {attributes(**initial)}" if initial else ""
    return (
        f'<Body_Rigid id="{number}" cg_id="{10 * number}" {mass_text}{start}/>\n'
        f"{marker(10 * number, number, position, axes)}"
    )


def marker(
    number: int,
    body_number: int,
    position: Sequence[float],
    axes: Sequence[Sequence[float]] | None = None,
) -> str:
    """Return a marker of a body; place and axes (3, 3) in the global frame at t = 0."""
    placed = {
        f"pos_{axis}": float(value)
        for axis, value in zip("xyz", position, strict=True)
        if value != 0.0
    }
    turned = {
        f"a{row}{column}": float(value)
        for row, values in enumerate(axes or ())
        for column, value in enumerate(values)
    }
    return f"<Reference_Marker {attributes(id=number, body_id=body_number, **placed, **turned)}/>"


def joint(number: int, kind: str, i: int, j: int) -> str:
    """Return a Constraint_Joint between two markers."""
    return f"<Constraint_Joint {attributes(id=number, type=kind, i_marker_id=i, j_marker_id=j)}/>"


def sphere(
    number: int,
    mass: float,
    radius: float,
    position: Sequence[float],
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    spin: Sequence[float] = (0.0, 0.0, 0.0),
) -> str:
    """Return a solid sphere: a body with graphic `100 number`."""
    inertia = 0.4 * mass * radius**2
    graphic = attributes(
        id=100 * number, type="Sphere", center_marker_id=10 * number, radius=float(radius)
    )
    whole = body(number, mass, (inertia, inertia, inertia), position, velocity, spin)
    return f"{whole}\n<Post_Graphic {graphic}/>"


def cuboid(
    number: int,
    mass: float,
    edges: Sequence[float],
    position: Sequence[float],
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    axes: Sequence[Sequence[float]] | None = None,
) -> str:
    """Return a solid box about its centre: a body with graphic `100 number`; see `body`."""
    a, b, c = (float(edge) for edge in edges)
    inertia = [mass * (u * u + v * v) / 12.0 for u, v in ((b, c), (a, c), (a, b))]
    graphic = attributes(
        id=100 * number,
        type="BoxDefinedFromCenter",
        center_marker_id=10 * number,
        length_x=a,
        length_y=b,
        length_z=c,
    )
    whole = body(number, mass, inertia, position, velocity, axes=axes)
    return f"{whole}\n<Post_Graphic {graphic}/>"


def contact(number: int, i: Sequence[int], j: Sequence[int], **law: object) -> str:
    """Return a Force_Contact between the graphics `i` and `j`."""
    sides = attributes(
        id=number,
        num_i_graphics=len(i),
        i_graphics_id=" ".join(map(str, i)),
        num_j_graphics=len(j),
        j_graphics_id=" ".join(map(str, j)),
    )
    return f"<Force_Contact {sides}\n  {attributes(**law)}/>"


def impact(k: float, e: float, c: float, dmax: float) -> dict[str, object]:
    """Return the attributes of an IMPACT law."""
    law: dict[str, object] = {"cnf_type": "IMPACT", "stiffness": k, "exponent": e}
    return law | ({"damping": c, "dmax": dmax} if c > 0.0 else {})


def coulomb(mu: float, vs: float) -> dict[str, object]:
    """Return the attributes of COULOMB_ON with one coefficient and one transition velocity."""
    return {
        "cff_type": "COULOMB_ON",
        "mu_static": mu,
        "mu_dynamic": mu,
        "stiction_trans_vel": vs,
        "friction_trans_vel": vs,
    }


def fixed_step(variation: Mapping[str, float]) -> list[str]:
    """Return the statement that fixes the step, where the variation has one (`h`, s)."""
    if "h" not in variation:
        return []
    return [f"<Param_Transient {attributes(h_max=variation['h'], h_min=variation['h'])}/>"]


def gravity(x: float = 0.0, z: float = -GRAVITY) -> str:
    """Return the Force_Gravity statement, m/s^2."""
    return f"<Force_Gravity {attributes(grav_x=float(x), grav_z=float(z))}/>"
