"""Decks whose contacts are rigid, for nonsmooth time stepping."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from mbsim.bench import deck as text
from mbsim.model.elements import Model
from mbsim.reader.xml import read_model

#: Steps are as long as the deck says where h_min is h_max.
FIXED = '<Param_Transient h_max="{h}" h_min="{h}"/>'
PUSH = {"cnf_type": "POISSON", "penalty": 1e6}


def rubbed(mu: float, restitution: float = 0.0) -> dict[str, Any]:
    """Return the attributes of a contact with Coulomb friction and restitution."""
    law = {**PUSH, "restitution_coef": restitution}
    return law | text.coulomb(mu, 1e-3) if mu > 0.0 else law


def cube(id: int, mass: float, edge: float, centre: tuple[float, float, float]) -> str:
    """Return a homogeneous cube with its shape, `id` times 100."""
    shape = text.attributes(
        id=100 * id,
        type="BoxDefinedFromCenter",
        center_marker_id=10 * id,
        length_x=edge,
        length_y=edge,
        length_z=edge,
    )
    inertia = [mass * edge * edge / 6.0] * 3
    return text.body(id, mass, inertia, centre) + f"\n<Post_Graphic {shape}/>"


def model(
    folder: Path, parts: list[str], end_time: float, h: float | None = None, dt: float = 0.01
) -> Model:
    """Return the model of these parts on a floor, with a step of h or by error."""
    fixed = [FIXED.format(h=h)] if h is not None else []
    whole = text.deck("rigid", [text.GROUND, text.FLOOR, *parts, *fixed], end_time, dt)
    path = folder / "rigid.xml"
    path.write_text(whole, encoding="utf-8")
    return read_model(path)


def ball(folder: Path, height: float, e: float, end_time: float, h: float | None = None) -> Model:
    """Return a sphere of 1 kg dropped from a height above the floor."""
    parts = [
        text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.1 + height)),
        text.contact(301, [200], [100], **rubbed(0.0, e)),
        text.gravity(),
    ]
    return model(folder, parts, end_time, h)


def balls(
    folder: Path,
    places: list[Any],
    e: float,
    mu: float,
    end_time: float,
    h: float | None = None,
    dt: float = 0.01,
) -> Model:
    """Return spheres of 1 kg and radius 0.1 at these centres, over the floor."""
    ids = [100 * (2 + k) for k in range(len(places))]
    spheres = [text.sphere(2 + k, 1.0, 0.1, place) for k, place in enumerate(places)]
    parts = [
        *spheres,
        text.contact(301, ids, [100], **rubbed(mu, e)),
        text.contact(302, ids, ids, **rubbed(mu, e)),
        text.gravity(),
    ]
    return model(folder, parts, end_time, h, dt)


def slope(folder: Path, mu: float, tangent: float, end_time: float, h: float | None) -> Model:
    """Return a cube at rest on a plane that gravity is tilted against."""
    g, size = 9.81, (1.0 + tangent * tangent) ** 0.5
    parts = [
        cube(2, 1.0, 0.2, (0.0, 0.0, 0.1)),
        text.contact(301, [200], [100], **rubbed(mu)),
        text.gravity(g * tangent / size, -g / size),
    ]
    return model(folder, parts, end_time, h)


def stack(
    folder: Path,
    masses: list[float],
    end_time: float,
    h: float | None,
    dt: float = 0.01,
    restitution: float = 0.0,
) -> Model:
    """Return touching cubes on each other."""
    ids = [100 * (2 + k) for k in range(len(masses))]
    parts = [cube(2 + k, m, 0.2, (0.0, 0.0, 0.2 * k + 0.1)) for k, m in enumerate(masses)]
    parts += [
        text.contact(301, ids, ids, **rubbed(0.5, restitution)),
        text.contact(302, ids, [100], **rubbed(0.5, restitution)),
        text.gravity(),
    ]
    return model(folder, parts, end_time, h, dt)


def rod(folder: Path, mu: float, angle: float, speed: float, end_time: float, h: float) -> Model:
    """Return a thin rod of 1 m and 1 kg on its end at an angle, with a speed along x."""
    c, s, a = math.cos(angle), math.sin(angle), 0.01
    given = text.attributes(inertia_xx=a * a / 6.0, inertia_yy=1.0 / 12.0, inertia_zz=1.0 / 12.0)
    axes = text.attributes(a00=c, a01=0.0, a02=-s, a10=0.0, a11=1.0, a12=0.0, a20=s, a21=0.0, a22=c)
    shape = text.attributes(length_x=1.0, length_y=a, length_z=a)
    parts = [
        f'<Body_Rigid id="2" cg_id="20" mass="1.0" {given} v_ic_x="{speed}" v_ic_x_flag="TRUE"/>',
        f'<Reference_Marker id="20" body_id="2" pos_z="{0.5 * s + 0.5 * a * c}" {axes}/>',
        f'<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20" {shape}/>',
        text.contact(301, [200], [100], **rubbed(mu)),
        text.gravity(),
    ]
    return model(folder, parts, end_time, h)
