"""Points and curves that stay on curves and surfaces, as equations, and where they begin."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Curves, Surfaces
from mbsim.compile_model.curves import (
    CurveTable,
    Pieces,
    nearest_start,
    pieces_of,
    plane_of,
    samples,
)
from mbsim.compile_model.equation_sums import Sums
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.param_surfaces import (
    UNKNOWN,
    Function,
    SurfaceTable,
    UnfitSurfaceError,
    nearest_corner,
    patches_of,
)
from mbsim.core.prototypes import copies
from mbsim.errors import DeckError, Fault
from mbsim.model.curves import CurveOnCurve, PointOnCurve, PointOnSurface
from mbsim.model.elements import Model
from mbsim.model.names import element_name

Array = np.ndarray
#: Makes a connection: of statement and id, between marker rows.
Connect = Callable[[str, int, int, int], int]

#: Equations of each kind: which it is, and whether it is of a length.
_EQUATIONS = {
    codes.POINT_ON_CURVE: (
        ("first offset across the curve", True),
        ("second offset across it", True),
    ),
    codes.POINT_ON_SURFACE: (("offset off the surface", True),),
    codes.CURVE_ON_CURVE: (
        ("gap of the curves", True),
        ("offset of their planes", True),
        ("tilt of their tangents", False),
    ),
}


def add_higher_pairs(
    model: Model,
    markers: MarkerTable,
    sums: Sums,
    connect: Connect,
    functions: Mapping[int, Function] | None,
) -> tuple[Curves, Surfaces, Array]:
    """Add the equations of higher pairs to `sums`; return curves, surfaces and where they begin."""
    if not (model.points_on_curves or model.curves_on_curves or model.points_on_surfaces):
        return _no_pairs()
    table, surfaces = CurveTable(), SurfaceTable()

    def hold(statement: str, id: int, row: int, kind: int) -> None:
        pair = (surfaces if kind == codes.POINT_ON_SURFACE else table).markers[row]
        connection = connect(statement, id, *pair)
        for which, (name, lengths) in enumerate(_EQUATIONS[kind]):
            sums.terms.append((codes.HIGHER_PAIR, *pair, which, kind, 1.0, row))
            sums.close(connection, name, 0.0, markers.length if lengths else 1.0)

    for point in model.points_on_curves.values():
        row = _add_point_on_curve(model, markers, table, point, len(sums.program))
        hold("PTCV", point.id, row, codes.POINT_ON_CURVE)
    for pair in model.curves_on_curves.values():
        row = _add_curve_on_curve(model, markers, table, pair, len(sums.program))
        hold("CVCV", pair.id, row, codes.CURVE_ON_CURVE)
    for held in model.points_on_surfaces.values():
        row = len(surfaces.patches)
        _add_point_on_surface(model, markers, surfaces, held, functions)
        surfaces.equation.append(len(sums.program))
        hold("PTSF", held.id, row, codes.POINT_ON_SURFACE)
    made, along = table.arrays()
    return made, surfaces.arrays(), np.concatenate([along, np.array(surfaces.along)])


@copies
def _no_pairs() -> tuple[Curves, Surfaces, Array]:
    made, along = CurveTable().arrays()
    return made, SurfaceTable().arrays(), along


def _global(markers: MarkerTable, marker_id: int | None, place: tuple[float, ...]) -> Array:
    """Return a place in the axes of a marker as a global one, (3,)."""
    p, R = markers.frame(markers.row(marker_id))
    found: Array = p + R @ np.array(place)
    return found


def _seen_from(markers: MarkerTable, row: int, place: Array) -> Array:
    """Return a global place in the axes of a marker row, (3,)."""
    p, R = markers.frame(row)
    found: Array = R.T @ (place - p)
    return found


def _near(markers: MarkerTable, point: PointOnCurve | PointOnSurface) -> Array:
    """Return the place next to which a point touches at the start, global: its own unless given."""
    if point.start is not None:
        return _global(markers, point.start_marker_id, point.start)
    return markers.frame(markers.row(point.i_marker_id))[0]


def _add_point_on_curve(
    model: Model, markers: MarkerTable, table: CurveTable, point: PointOnCurve, equation: int
) -> int:
    """Return the row of a curve that holds a point."""
    i, j = markers.row(point.i_marker_id), markers.row(point.j_marker_id)
    near = _near(markers, point)
    curve = model.curves[point.curve_id]
    pieces = pieces_of(curve)
    row = table.add(curve, pieces, (i, j), equation)
    table.along[row] = nearest_start(pieces, _seen_from(markers, j, near))
    return row


def _add_curve_on_curve(
    model: Model, markers: MarkerTable, table: CurveTable, pair: CurveOnCurve, equation: int
) -> int:
    """Return the row of the first of two curves that touch; the second is the next."""
    i, j = markers.row(pair.i_marker_id), markers.row(pair.j_marker_id)
    curves = model.curves[pair.i_curve_id], model.curves[pair.j_curve_id]
    made = [pieces_of(curve) for curve in curves]
    planes = [plane_of(pieces) for pieces in made]
    for plane, attribute in zip(planes, ("i_curve_id", "j_curve_id"), strict=True):
        if not plane.flat:
            id = getattr(pair, attribute)
            raise _fault(model, pair, f'{attribute}="{id}": must lie in a plane, and does not')
    normals = [plane.normal for plane in planes]
    (_, R_i), (_, R_j) = markers.frame(i), markers.frame(j)
    if normals[1] is None and normals[0] is not None:
        normals[1] = R_j.T @ R_i @ normals[0]
    if normals[1] is None:
        raise _fault(model, pair, "both curves are straight: they have no one point in common")
    row = table.add(curves[0], made[0], (i, j), equation)
    table.add(curves[1], made[1], (i, j), equation)
    table.touching[row : row + 2] = 1, 2
    table.normal[row + 1] = normals[1]
    begins = (
        _global(markers, pair.i_start_marker_id, pair.i_start) if pair.i_start else None,
        _global(markers, pair.j_start_marker_id, pair.j_start) if pair.j_start else None,
    )
    frames = markers.frame(i), markers.frame(j)
    table.along[row : row + 2] = _touch_near(made, frames, begins)
    return row


def _add_point_on_surface(
    model: Model,
    markers: MarkerTable,
    table: SurfaceTable,
    point: PointOnSurface,
    functions: Mapping[int, Function] | None,
) -> None:
    """Add a surface that holds a point; where no functions are known it is one that is not used."""
    i, j = markers.row(point.i_marker_id), markers.row(point.j_marker_id)
    near = _near(markers, point)
    surface = model.surfaces[point.surface_id]
    patches = UNKNOWN
    if functions is not None:
        try:
            patches = patches_of(surface, functions[surface.id])
        except UnfitSurfaceError as error:
            name = element_name(model.file, "Reference_ParamSurface", surface.id)
            place = surface.source.file, surface.source.line
            raise DeckError([Fault(*place, name, f"{surface.user.fnc_name} {error}")]) from None
    table.patches.append(patches)
    table.closed.append((surface.is_u_closed, surface.is_v_closed))
    table.markers.append((i, j))
    table.along.extend(nearest_corner(patches, _seen_from(markers, j, near)))


def _fault(model: Model, pair: CurveOnCurve, message: str) -> DeckError:
    """Return an error of two curves that touch."""
    name = element_name(model.file, "Constraint_CVCV", pair.id)
    return DeckError([Fault(pair.source.file, pair.source.line, name, message)])


def _touch_near(
    made: list[Pieces],
    frames: tuple[tuple[Array, Array], tuple[Array, Array]],
    begins: tuple[Array | None, Array | None],
) -> tuple[float, float]:
    """Return the parameters of where two curves nearly touch, as good as samples are.

    Of one whose begin is given it is next to that. Of all pairs of a sample and the nearest one of
    the other curve it is the one with the least distance and angle, that times half the extent.
    """
    from scipy.spatial import cKDTree

    us, places, ways = [], [], []
    for pieces, (p, R), near in zip(made, frames, begins, strict=True):
        u, x, t = samples(pieces)
        x, t = p + x @ R.T, t @ R.T
        if near is not None:
            k = np.argmin(np.linalg.norm(x - near, axis=-1))
            u, x, t = u[k : k + 1], x[k : k + 1], t[k : k + 1]
        us.append(u)
        places.append(x)
        ways.append(t / np.linalg.norm(t, axis=-1)[:, None])
    distance, other = cKDTree(places[1]).query(places[0])
    angle = np.linalg.norm(np.cross(ways[0], ways[1][other]), axis=-1)
    extent = 0.5 * min(float(np.linalg.norm(np.ptp(x, axis=0))) for x in places)
    best = int(np.argmin(distance**2 + (extent * angle) ** 2))
    return float(us[0][best]), float(us[1][other[best]])
