"""Flat sides of meshes that lie or lean: contact points whose force has a potential.

The largest depth of a flat side has none that is smooth: it is at one edge, then at another one.
What holds a rigid body on its side are the corners of the side's convex hull, of two sides those of
what they have in common. With psi_i their depths and c_i their shares (the exterior angle of the
hull over a whole turn, so their sum is 1) the energy of a law U is U(D) with

    D^4 = sum c_i psi_i^4     force = law(D) sum g_i n_i     g_i = c_i (psi_i / D)^3

over corners with psi_i > 0, at their centre sum g_i x_i / sum g_i. Lying, D is the depth and the
force that of the law; on an edge of a square it is 0.71 of that of the depth there, on a corner
0.5. With squares it would be a half and a quarter; with a higher power bodies rock faster. How a
face is cut into triangles, or its border into edges, has no part in it.

A side lies by how little it is tilted (`model.flat_sides`). From there on it leans: on its corners
with

    D^16 = 4 sum c_i psi_i^16

which is about the depth of the deepest one: of a square on a corner it is that, on an edge 1.04 of
it. Where it is tilted more, peaks of depth (`merging`) take over. Each of the three has its part of
the law's force. Parts change as the body turns, by what each one stores: the couples of energy.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, V3
from mbsim.core.blend import step, step_derivative
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.merging import (
    COUPLE,
    GAIN,
    LEAN,
    MOMENTS,
    NORMAL,
    PEAK_NUMBERS,
    PLACE,
    STIFF,
    TURNS,
)
from mbsim.geometry.mesh.record import (
    MOMENT,
    PATCH_NUMBERS,
    PRESSURE,
    SPREAD,
    add_patch,
)
from mbsim.model.flat_sides import (
    AS_SIDE,
    AT_HULL,
    AT_LEANING,
    AT_LEAVING,
    DEEP,
    HULL_CORNER,
    HULL_COUNT,
    ROOM,
    SHALLOW,
    SHARE,
    SIDE_ROW,
)
from mbsim.model.flat_sides import NORMAL as SIDE_NORMAL
from mbsim.model.surface import AT_SIDES, AT_TRIANGLES, SIDE, SIDES, TRIANGLE

#: Columns of a corner of what lies: depth, share, place half way between both surfaces, normal, and
#: the force along the side where shares change as I moves (for a law's force, times the power of
#: depths less 1 of D over the deepest corner).
CORNER = 11
DEPTH, PART, WHERE, ALONG, ASIDE = 0, 1, 2, 5, 8
#: The powers of depths, and the sums of shares, of a side that lies and of one that leans.
LYING, LEANING = (4, 1.0), (16, 4.0)


@jitable
def side_at(mesh: F1, side: int) -> int:
    """Return where the numbers of a side begin."""
    return int(mesh[AT_SIDES]) + SIDE_ROW * side


@jitable
def side_of(mesh: F1, triangle: int) -> int:
    """Return the side of a triangle, -1 for none."""
    return int(mesh[int(mesh[AT_TRIANGLES]) + TRIANGLE * triangle + SIDE])


@jitable
def how_far(mesh: F1, at: int, limits: int, cosine: float) -> tuple[float, float]:
    """Return how far a side that is so tilted is within its limits, and how the cosine changes it.

    With `AT_LEANING` how far it lies: 1 flat, 0 where it leans. With `AT_LEAVING` how far its
    corners hold, as it lies or leans.
    """
    low, high, whole = mesh[at + limits], mesh[at + limits + 1], mesh[at + AS_SIDE]
    slope = whole * step_derivative(cosine, low, 0.0, high, 1.0, 1)
    return whole * step(cosine, low, 0.0, high, 1.0), slope


@jitable
def shallow(mesh: F1, at: int, deepest: float) -> float:
    """Return 1 where no more than a side is in touch, 0 where it is a facet of what is round."""
    room = mesh[at + ROOM]
    return step(deepest, SHALLOW * room, 1.0, DEEP * room, 0.0) if room < math.inf else 1.0


@jitable
def write_side(
    corners: F2, lies: float, way: tuple[V3, V3], of: tuple[int, float], pieces: F1, peak: F1
) -> None:
    """Write what a side does as a peak, which has no weight where no corner is below.

    Parameters
    ----------
    corners : ndarray, shape (n, CORNER)
    lies : float
        Its part of the law's force.
    way : tuple
        How depth changes along the side, and its part of the force as I turns.
    of : tuple
        The power of depths, and the sum of shares.
    pieces : ndarray, shape (PATCH_NUMBERS,)
        What its pieces of surface add up to: how pressure is spread for friction.
    peak : ndarray, shape (PEAK_NUMBERS,)
    """
    (lean, turns), (power, shares), deepest = way, of, 0.0
    for k in range(PEAK_NUMBERS):
        peak[k] = 0.0
    for k in range(len(corners)):
        deepest = max(deepest, corners[k, DEPTH])
    # where it has no part this does not change either
    if not deepest > 0.0 or not lies > 0.0:
        return
    powers, total, p, push = 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(len(corners)):
        over = corners[k, DEPTH] / deepest
        if over > 0.0:
            pressing = shares * corners[k, PART] * over ** (power - 1)
            powers, total = powers + pressing * over, total + pressing
            p = add(p, scale(pressing, vector(corners[k, WHERE:])))
            push = add(push, scale(pressing, vector(corners[k, ALONG:])))
        push = add(push, scale(shares, vector(corners[k, ASIDE:])))
    if not norm(push) > 0.0:
        return
    # depth over that of the deepest corner
    part = powers ** (1.0 / power)
    depth, unit = part * deepest, 1.0 / part ** (power - 1)
    p, push = scale(1.0 / total, p), scale(unit, push)
    gain, couple, spread = norm(push), (0.0, 0.0, 0.0), 0.0
    for k in range(len(corners)):
        r, over = sub(vector(corners[k, WHERE:]), p), corners[k, DEPTH] / depth
        couple = add(couple, cross(r, scale(shares * unit, vector(corners[k, ASIDE:]))))
        if over > 0.0:
            part = shares * corners[k, PART] * over ** (power - 2)
            couple = add(couple, cross(r, scale(part * over, vector(corners[k, ALONG:]))))
            spread += part * over / gain * dot(r, r)
            for c in range(6):
                a, b = c if c < 3 else c - 3, c if c < 3 else (c - 2 if c < 5 else 0)
                peak[STIFF + c] += (power - 1) * part / (depth * gain) * r[a] * r[b]
    peak[0], peak[1], peak[GAIN] = depth, lies, gain
    # the depth at the centre is depth / gain
    over = gain / depth
    for k in range(3):
        peak[PLACE + k], peak[NORMAL + k] = p[k], push[k]
        peak[LEAN + k], peak[TURNS + k] = over * lean[k], turns[k]
        peak[COUPLE + k] = lies * couple[k]
    spread_pieces(pieces, p, spread, peak)


@jitable
def spread_pieces(pieces: F1, p: V3, most: float, peak: F1) -> None:
    """Write the moments of the pieces' pressure about its centre as if that was p.

    Together they are no more than `most`: the corners' own.
    """
    pressure, c = pieces[PRESSURE], vector(pieces, MOMENT)
    if not pressure > 0.0:
        return
    c = scale(1.0 / pressure, c)
    own = 0.0
    for k in range(3):
        own += pieces[SPREAD + k] / pressure - c[k] * c[k]
    part = min(1.0, most / own) if own > 0.0 else 0.0
    for k in range(6):
        a, b = k if k < 3 else k - 3, k if k < 3 else (k - 2 if k < 5 else 0)
        central = pieces[SPREAD + k] / pressure - c[a] * c[b]
        peak[MOMENTS + k] = part * central + p[a] * p[b]


@jitable
def lean_of(side: V3, n: V3) -> V3:
    """Return how the depth of a side below a plane of normal n changes along that plane."""
    along = dot(side, n)
    return scale(1.0 / along, sub(side, scale(along, n)))


@jitable
def no_sides() -> F2:
    """Return no peaks."""
    return np.empty((0, PEAK_NUMBERS))


@jitable
def sides_below(mesh: F1, found: I1, n: V3, height: float, origin: V3, nodes: F2, on: I1) -> F2:
    """Return the sides that hold on the plane x.n = height, each as two peaks: lying and leaning.

    `found` are the triangles below it, `nodes` their pieces from `origin`; `on` gets the number of
    the side of each one among these, -1 for none.
    """
    on[:] = -1
    if int(mesh[SIDES]) == 0:
        return no_sides()
    row, count = np.full(int(mesh[SIDES]), -1), 0
    for k in range(len(found)):
        side = side_of(mesh, found[k])
        if side < 0:
            continue
        if row[side] == -1:
            at = side_at(mesh, side)
            holds, _ = how_far(mesh, at, AT_LEAVING, -dot(vector(mesh, at + SIDE_NORMAL), n))
            row[side] = count if holds > 0.0 else -2
            count += int(holds > 0.0)
    if count == 0:
        return no_sides()
    peaks, pieces = np.zeros((2 * count, PEAK_NUMBERS)), np.zeros((count, PATCH_NUMBERS))
    for k in range(len(found)):
        side = side_of(mesh, found[k])
        if side >= 0 and row[side] >= 0:
            on[k] = row[side]
            add_patch(pieces[on[k]], nodes[k])
    for side in range(len(row)):
        k = row[side]
        if k >= 0:
            lay_on_plane(mesh, side, n, height, origin, pieces[k], peaks[2 * k : 2 * k + 2])
    return peaks


@jitable
def lay_on_plane(
    mesh: F1, side: int, n: V3, height: float, origin: V3, pieces: F1, peaks: F2
) -> None:
    """Write what a side does on a plane as it lies and as it leans."""
    at = side_at(mesh, side)
    normal = vector(mesh, at + SIDE_NORMAL)
    first = int(mesh[AT_SIDES]) + int(mesh[at + AT_HULL])
    corners, deepest = np.empty((int(mesh[at + HULL_COUNT]), CORNER)), 0.0
    for k in range(len(corners)):
        p = vector(mesh, first + HULL_CORNER * k)
        corners[k, DEPTH] = height - dot(p, n)
        deepest = max(deepest, corners[k, DEPTH])
        corners[k, PART] = mesh[first + HULL_CORNER * k + SHARE]
        p = sub(p, origin)
        for c in range(3):
            corners[k, WHERE + c], corners[k, ALONG + c], corners[k, ASIDE + c] = p[c], n[c], 0.0
    cosine, part = -dot(normal, n), shallow(mesh, at, deepest)
    lies = how_far(mesh, at, AT_LEANING, cosine)
    holds = how_far(mesh, at, AT_LEAVING, cosine)
    steeper, lean = scale(part, cross(n, normal)), lean_of(normal, n)
    turns = scale(lies[1], steeper)
    write_side(corners, part * lies[0], (lean, turns), LYING, pieces, peaks[0])
    turns = scale(holds[1] - lies[1], steeper)
    write_side(corners, part * (holds[0] - lies[0]), (lean, turns), LEANING, pieces, peaks[1])


@jitable
def join_sides(peaks: F2, count: int, sides: F2) -> int:
    """Add the sides that hold to the first `count` peaks; return how many there are then."""
    for k in range(len(sides)):
        if sides[k, 1] > 0.0:
            for c in range(PEAK_NUMBERS):
                peaks[count, c] = sides[k, c]
            count += 1
    return count
