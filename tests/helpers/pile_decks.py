"""Decks of many graphics, for tests and measurements of near pairs."""

from __future__ import annotations

import numpy as np

from helpers.decks import GROUND, contact

#: of every contact
LAW = {"stiffness": 1e5, "exponent": 1.5, "damping": 100.0, "dmax": 1e-4}
#: shape attributes, a mesh's text, and points of its surface in shape axes
SHAPES = ("SPHERE", "BOX", "ELLIPSOID", "CYLINDER", "FRUSTUM", "MESH")
_OCTAHEDRON = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float
)
_FACES = "0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5"


def random_axes(random):
    """Return a random rotation (3, 3)."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q


def shape_graphic(shape, id, marker, size):
    """Return the statement of a shape that fits into a ball of twice `size`."""
    at = f'<Post_Graphic id="{id}" center_marker_id="{marker}"'
    s = repr(float(size))
    if shape == "SPHERE":
        return f'{at} type="Sphere" radius="{s}"/>'
    if shape == "BOX":
        return (
            f'{at} type="BoxDefinedFromCenter" length_x="{s}" '
            f'length_y="{1.5 * size!r}" length_z="{0.5 * size!r}"/>'
        )
    if shape == "ELLIPSOID":
        return (
            f'{at} type="Ellipsoid" x_scale="{s}" y_scale="{0.5 * size!r}" '
            f'z_scale="{0.7 * size!r}"/>'
        )
    if shape == "CYLINDER":
        return f'{at} type="Cylinder" radius="{0.5 * size!r}" length="{2.0 * size!r}"/>'
    if shape == "FRUSTUM":
        return (
            f'{at} type="Frustum" bottom_radius="{0.8 * size!r}" top_radius="{0.3 * size!r}" '
            f'length="{size!r}"/>'
        )
    nodes = " ".join(repr(float(x)) for x in (size * _OCTAHEDRON).ravel())
    return (
        f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}">'
        f"<Nodes>{nodes}</Nodes><Faces>{_FACES}</Faces></Post_Graphic>"
    )


def surface(graphic, count, random):
    """Return points of a graphic's surface (n, 3) in shape axes, a few more than `count`."""
    size, shape = graphic.size, graphic.shape
    d = random.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    if shape == "SPHERE":
        return size[0] * d
    if shape == "ELLIPSOID":
        return d * np.array(size)
    if shape == "BOX":
        box = d / abs(d).max(axis=1)[:, None]
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return np.vstack([box, corners]) * 0.5 * np.array(size)
    if shape in ("CYLINDER", "FRUSTUM"):
        bottom, top = (size[0], size[0]) if shape == "CYLINDER" else size[:2]
        half = 0.5 * (size[1] if shape == "CYLINDER" else size[2])
        z = random.choice([-1.0, 1.0, 0.0], size=count) + 0.0
        z = np.where(z == 0.0, random.uniform(-1, 1, size=count), z)
        radius = 0.5 * (bottom + top) + 0.5 * z * (top - bottom)
        angle = random.uniform(0.0, 2.0 * np.pi, size=count)
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), half * z])
    weights = random.dirichlet([0.5, 0.5, 0.5], size=count)
    corners = graphic.vertices[graphic.faces[random.integers(len(graphic.faces), size=count)]]
    return np.vstack([(weights[:, :, None] * corners).sum(axis=1), graphic.vertices])


def solid(body, graphic, place, axes=None, v=(0.0, 0.0, 0.0), mass=1.0, inertia=0.004):
    """Return a body with one graphic at its cg; `graphic` takes id and marker."""
    flags = " ".join(
        f'v_ic_{axis}="{float(number)!r}" v_ic_{axis}_flag="TRUE"'
        for axis, number in zip("xyz", v, strict=True)
    )
    turn = ""
    if axes is not None:
        turn = " ".join(f'a{r}{c}="{float(axes[r, c])!r}"' for r in range(3) for c in range(3))
    at = " ".join(f'pos_{axis}="{float(x)!r}"' for axis, x in zip("xyz", place, strict=True))
    return (
        f'<Body_Rigid id="{body}" cg_id="{10 * body}" mass="{mass!r}" inertia_xx="{inertia!r}" '
        f'inertia_yy="{inertia!r}" inertia_zz="{inertia!r}" {flags}/>'
        f'<Reference_Marker id="{10 * body}" body_id="{body}" {at} {turn}/>'
        + graphic(100 * body, 10 * body)
    )


def balls(places, radius=0.1, v=None, mass=1.0, first=2):
    """Return solid spheres; row k of `places` (n, 3) is body `first` + k."""
    v = np.zeros_like(places) if v is None else v
    return "".join(
        solid(
            first + k,
            lambda id, marker: shape_graphic("SPHERE", id, marker, radius),
            place,
            v=v[k],
            mass=mass,
            inertia=0.4 * mass * radius**2,
        )
        for k, place in enumerate(places)
    )


def sets(i, j, id=301, **attributes):
    """Return a contact of two sets of graphics."""
    text = contact(id=id, i="I", j="J", **attributes)
    text = text.replace('num_i_graphics="1" i_graphics_id="I"', _ids("i", i))
    return text.replace('num_j_graphics="1" j_graphics_id="J"', _ids("j", j))


def _ids(side, ids):
    """Return one side of a contact."""
    ids = list(ids)
    return f'num_{side}_graphics="{len(ids)}" {side}_graphics_id="{" ".join(map(str, ids))}"'


def pile(places, radius=0.1, v=None, mass=1.0, **law):
    """Return balls over the ground that touch each other (contact 302) and it (301)."""
    ids = [100 * (2 + k) for k in range(len(places))]
    return (
        GROUND
        + balls(places, radius, v, mass)
        + sets(ids, [100], id=301, **law)
        + sets(ids, ids, id=302, **law)
    )


def block(n, pitch, z=0.1, jitter=0.0, seed=0):
    """Return centres (n^3, 3) of a cubic arrangement that stands on z."""
    random = np.random.default_rng(seed)
    k = np.arange(n)
    grid = np.stack(np.meshgrid(k, k, k, indexing="ij"), axis=-1).reshape(-1, 3) * pitch
    return grid + [0.0, 0.0, z] + jitter * random.uniform(-1.0, 1.0, size=grid.shape)
