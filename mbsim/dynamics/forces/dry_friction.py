"""Force_DryFriction between two markers: along an axis of J, or about one.

With n the axis, P the origin of I, and velocities of both bodies at P:

| kind      | on I, and the opposite on J at P  | x          | x'                |
|-----------|-----------------------------------|------------|-------------------|
| DRY_SLIDE | -f n                              | r . n      | (v_I - v_J) . n   |
| DRY_TURN  | torque -f n                       | angle      | (w_I - w_J) . n   |

so that -f x' is what f does to the bodies. Rigid friction that sticks is an equation of velocity 0,
its multiplier the force (`stiction.rigid_friction`); what slides is a force as any other. What
friction remembers is in `State.dry`; what f is, in `laws.dry`. Steps end where it begins to slide
or to stick (`events.switching`).
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    DRY_SLIDE,
    DRY_TURN,
    LOST_POWER,
    SCALE_LENGTH,
    SCALE_SPEED,
    SLIDER,
    SLIDER_BEFORE,
    SLIDES,
    SLIDES_BEFORE,
    SLIP,
    STICK,
    STORED_ENERGY,
)
from mbsim.arrays.hooks import Dry
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, scale, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.forces.wrenches import push_at, velocity_at
from mbsim.laws.dry import dry_commit, dry_force, dry_mode, rigid_mode

# entries of `Applied.par`
STIFFNESS, LIMIT, STATIC = range(3)

#: Part of the model's speed that is rounding.
ROUNDING = 1e-13
#: What something else holds counts as at rest below so many times that: assembly leaves it.
AT_REST = 1e4


@jitable
def is_dry(kind: int) -> bool:
    """Return whether a kind of applied force is dry friction."""
    return kind == DRY_SLIDE or kind == DRY_TURN


@jitable
def dry_motion(scene: Scene, y: F1, f: int) -> tuple[V3, float, float]:
    """Return the axis of dry friction f, x and its rate; the bodies have been placed."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    n, w = marker_axis(scene, scene.applied.axes[f], 2), scene.work.w
    bi, bj = scene.markers.body[i], scene.markers.body[j]
    if scene.applied.kind[f] == DRY_TURN:
        spin = sub(vector(w[bi]), vector(w[bj]))
        return n, followed_angle(scene, scene.applied.angle[f]), dot(n, spin)
    p = marker_point(scene, y, i)
    v = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    return n, dot(n, sub(p, marker_point(scene, y, j))), dot(n, v)


@jitable
def dry_memory(scene: Scene, f: int) -> V2:
    """Return slider and mode that hold for the point being evaluated."""
    kept = scene.state.dry[f]
    if scene.world.past[0] == 1:
        return kept[SLIDER_BEFORE], kept[SLIDES_BEFORE]
    return kept[SLIDER], kept[SLIDES]


@jitable
def dry_now(scene: Scene, f: int, x: float) -> V2:
    """Return the force of dry friction f at x, and whether it gives way to x."""
    par = scene.applied.par[f]
    slider, slides = dry_memory(scene, f)
    if scene.applied.equation[f] >= 0:
        return slides * par[LIMIT], 1.0
    return dry_force(
        x, slider, slides, par[STIFFNESS], par[LIMIT], par[STATIC], scene.state.frozen[0]
    )


@jitable
def add_dry(scene: Scene, y: F1, f: int) -> float:
    """Add dry friction f to its bodies, fill its row of `Work.applied`; return what is lost."""
    applied, row = scene.applied, scene.work.applied[f]
    n, x, rate = dry_motion(scene, y, f)
    size, gives = dry_now(scene, f, x)
    load, none = scale(-size, n), (0.0, 0.0, 0.0)
    turns = applied.kind[f] == DRY_TURN
    force, torque = (none, load) if turns else (load, none)
    p = marker_point(scene, y, applied.i[f])
    push_at(scene, y, scene.markers.body[applied.i[f]], p, force, torque)
    bj = scene.markers.body[applied.j[f]]
    push_at(scene, y, bj, p, scale(-1.0, force), scale(-1.0, torque))
    for k in range(3):
        row[k] = force[k]
        row[3 + k] = torque[k]
    k = applied.par[f, STIFFNESS]
    row[STORED_ENERGY] = 0.5 * size * size / k if k > 0.0 else 0.0
    row[LOST_POWER] = gives * size * rate
    return row[LOST_POWER]


@jitable
def rest_of(scene: Scene, f: int) -> float:
    """Return what is no velocity of rigid dry friction f but rounding."""
    speed, turns = scene.world.scale[SCALE_SPEED], scene.applied.kind[f] == DRY_TURN
    return ROUNDING * (speed / scene.world.scale[SCALE_LENGTH] if turns else speed)


@jitable
def holding_force(scene: Scene, f: int) -> float:
    """Return the force against x that holds rigid dry friction f, no number where it need not."""
    active = scene.equations.active
    for r in range(active[len(active) - 1]):
        if active[r] == scene.applied.equation[f]:
            return -scene.sweep.multiplier[r]
    return math.nan


@jitable
def show_sticking(scene: Scene) -> None:
    """Fill `Work.applied` of rigid dry frictions that are held; multipliers have been found."""
    active = scene.equations.active
    for r in range(active[len(active) - 1]):
        f = scene.equations.dry[active[r]]
        if f < 0:
            continue
        n, row = marker_axis(scene, scene.applied.axes[f], 2), scene.work.applied[f]
        first = 3 if scene.applied.kind[f] == DRY_TURN else 0
        for k in range(3):
            row[first + k] = scene.sweep.multiplier[r] * n[k]


@jitable
def side_of_dry(scene: Scene, y: F1, f: int) -> float:
    """Return what dry friction f does from here on: 0 to stick, or the sign in which it slides."""
    par, kept = scene.applied.par[f], scene.state.dry[f]
    _, x, rate = dry_motion(scene, y, f)
    if scene.applied.equation[f] >= 0:
        if math.isnan(kept[SLIDER]):
            return 0.0
        force, rest = holding_force(scene, f), rest_of(scene, f)
        if kept[SLIDES] == 0.0 and math.isnan(force):
            # joints or motions hold it, or move it
            return math.copysign(1.0, rate) if abs(rate) > AT_REST * rest else 0.0
        return rigid_mode(force, rate, kept[SLIDES], par[STATIC], rest)
    return dry_mode(x, rate, kept[SLIDER], kept[SLIDES], par[STIFFNESS], par[LIMIT], par[STATIC], 1)


@jitable
def record_dry(scene: Scene, t: float, kind: int, f: int) -> None:
    """Append an event of dry friction f; it has no slot."""
    rows = scene.rows
    k = rows.used[2]
    if k < len(rows.events):
        rows.events[k, 0], rows.events[k, 1] = t, kind
        rows.events[k, 2], rows.events[k, 3] = scene.applied.id[f], -1.0
        rows.used[2] = k + 1


@jitable
def commit_dry(scene: Scene, t: float, y: F1) -> int:
    """Keep what all dry frictions with a spring make of the point evaluated last; return 0.

    What the spring loses as it snaps from the force that began to slide is lost by the model.
    """
    for f in range(len(scene.applied.kind)):
        if not is_dry(scene.applied.kind[f]) or scene.applied.equation[f] >= 0:
            continue
        par, kept = scene.applied.par[f], scene.state.dry[f]
        k, before = par[STIFFNESS], kept[SLIDES]
        _, x, rate = dry_motion(scene, y, f)
        frozen = scene.state.frozen[0]
        stored, _ = dry_force(x, kept[SLIDER], before, k, par[LIMIT], par[STATIC], frozen)
        slider, slides, force = dry_commit(
            x, rate, kept[SLIDER], before, k, par[LIMIT], par[STATIC], frozen
        )
        kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], before
        kept[SLIDER], kept[SLIDES] = slider, slides
        if scene.world.accumulators[1] >= 0:
            y[scene.world.accumulators[1]] += 0.5 * (stored * stored - force * force) / k
        if slides != before:
            record_dry(scene, t, STICK if slides == 0.0 else SLIP, f)
    return 0


@jitable
def serve_dry(scene: Scene, what: int, t: float, y: F1) -> int:
    """Do what dry friction is asked for (`Dry`) where none is rigid; return 0."""
    return commit_dry(scene, t, y) if what == Dry.KEEP else 0
