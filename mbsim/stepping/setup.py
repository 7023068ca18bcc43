"""A mechanism as the problem of a method whose contacts are rigid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import (
    MULTI_POINT,
    OF_POINTS,
    POINTS,
    ROW_OF,
)
from mbsim.arrays.hooks import Hook
from mbsim.compile_model.program_dependence import find_depends
from mbsim.compile_model.tangent import MOST_BODIES
from mbsim.core import jit
from mbsim.core.address import pack
from mbsim.core.problem import Problem, addresses
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.dynamics.linearization.stiffness import sides_of
from mbsim.errors import ModelError
from mbsim.forces.catalog import FORCES
from mbsim.geometry.catalog import NEARS, PAIRS, REGION_ROWS
from mbsim.model.names import element_name
from mbsim.stepping.arrays import (
    ALL_ANSWERS,
    ALL_BODIES,
    ALL_POINTS,
    ALL_STEPS,
    ALL_SWEEPS,
    FIXED,
    LEFT,
    LEFT_PART,
    LEFT_SPEED,
    LENGTH,
    MAY_SLEEP,
    NEAR,
    NEWTONS,
    NOISE,
    OF_I,
    OF_J,
    OWN_TIME,
    PLAN_NUMBERS,
    PLAN_SCALES,
    PROJECTED,
    SLEEPERS,
    SLOP,
    SOME_AHEAD,
    SPEED,
    TOL,
    UNSOLVED,
    Plan,
    Stepping,
    make,
)
from mbsim.stepping.coefficients import Coefficients

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene
    from mbsim.arrays.state import Broadphase
    from mbsim.compile_model.build import System
    from mbsim.compile_model.tangent import Depends
    from mbsim.core.arrays import F2 as Numbers
    from mbsim.core.arrays import I1 as Indices
    from mbsim.core.arrays import I2 as Table

_CONTACTS = INT(INT, INT, FLOAT, FLOAT, POINTER, POINTER)
#: Hooks of compliant contact, which rigid contact has no use for.
COMPLIANT = frozenset(
    {
        Hook.TILTING,
        Hook.RECALL,
        Hook.SPREAD,
        Hook.RIM,
        Hook.HOLD_BACK,
        Hook.STICKING,
        Hook.CONTACT_SLOPES,
        Hook.FACE_SLOPES,
        Hook.MEMORY,
        Hook.MEMORY_PAIR,
        Hook.GAUGES,
        Hook.EFFECTS,
        Hook.STABILITY,
        Hook.PASSING,
        Hook.FCL_POINTS,
    }
)
#: Hooks that rigid contact has in place of those of compliant contact.
OWN = frozenset({Hook.CONTACTS, Hook.NEAR})
#: Pairs whose rows are features that may meet where the shapes are apart too.
APART = frozenset(
    {
        "SPHERE-PLANE",
        "SPHERE-SPHERE",
        "SPHERE-BOX",
        "SPHERE-CYLINDER",
        "SPHERE-FRUSTUM",
        "SPHERE-MESH",
        "BOX-PLANE",
        "CYLINDER-PLANE",
        "FRUSTUM-PLANE",
        "ELLIPSOID-PLANE",
        "MESH-PLANE",
        "SURFACE-PLANE",
    }
)
#: Contact points of a body at most, in the mean.
POINTS_EACH = 64
#: Velocities of bodies that joints hold, by impulses of all points, are at most so many.
MOST_WIDE = 200_000
#: A gap, or what a position changes by, counts from this part of tol L on; what the solver may
#: leave of a velocity is that part of tol L / h; closing and slipping by a part of tol L in a step
#: are none.
COUNTS, LEAVES, NONE_BELOW = 0.1, 3e-3, 0.09
#: Part of what an impact changes of a velocity that the solver may leave, over tol, and at most.
JUMPS, MOST_JUMPS = 10.0, 0.05


class Made(NamedTuple):
    """A problem, its arrays, and the tables that must live as long as it is used."""

    problem: Problem
    stepping: Stepping
    tables: tuple[Any, ...]
    said: tuple[str, ...]

    def counters(self) -> dict[str, float]:
        """Return what was counted, under the names that results give it."""
        count = self.stepping.tally.count
        return {
            "contact_solves": int(count[ALL_STEPS]),
            "contact_sweeps": int(count[ALL_SWEEPS]),
            "contact_newtons": int(count[NEWTONS]),
            "contact_answers": int(count[ALL_ANSWERS]),
            "contact_unsolved": int(count[UNSOLVED]),
            "contact_projections": int(count[PROJECTED]),
            "contact_points": int(count[ALL_POINTS]),
            "bodies_in_steps": int(count[ALL_BODIES]),
            "asleep_at_end": int(self.stepping.rest.count[SLEEPERS]),
        }


def _changing_forces(scene: Scene, depends: Depends) -> list[set[int]]:
    """Return, for each force that changes as bodies move, the moving bodies that it couples."""
    applied, found = scene.applied, []
    nb = len(scene.bodies.mass)
    for f in range(len(applied.form)):
        programs = [k for k in (applied.program[f], *applied.components[f]) if k >= 0]
        looks = {b for k in programs for b in _listed(depends.body_start, depends.body, k)}
        states = any(len(_listed(depends.state_start, depends.state, k)) > 0 for k in programs)
        if (
            applied.formula[f] == 0
            and not looks
            and not states
            and not depends.user[programs].any()
        ):
            continue
        points = [f]
        if applied.form[f] == MULTI_POINT:
            count = int(applied.par[f, POINTS])
            points += applied.par[f, OF_POINTS : OF_POINTS + count].astype(int).tolist()
        bodies = {b for k in points for b in sides_of(scene, k)}
        bodies.add(int(scene.markers.body[applied.axes[f]]))
        found.append({int(b) for b in bodies | looks if b < nb})
    return found


def _listed(start: Indices, items: Indices, k: int) -> list[int]:
    """Return the items of row k of a list of lists."""
    return [int(b) for b in items[start[k] : start[k + 1]]]


def _plan(system: System, fixed: bool, tol: float, coupled: list[set[int]], force: Indices) -> Plan:
    """Return what holds for the run, and let pairs be measured where they are apart too."""
    from mbsim.compile_model.contacts import near_address, pair_address

    kinds, scene, model = system.plans.kinds, system.scene, system.model
    near, rows = (np.zeros(len(kinds), dtype=np.int64) for _ in range(2))
    for k, kind in enumerate(kinds):
        rows[k] = kind.slots - (REGION_ROWS if kind.region else 0)
        near[k] = kind.closed_form in APART or kind.closed_form in NEARS
        if kind.closed_form in NEARS:
            scene.kinds.kernel[k] = near_address(kind.closed_form, int(rows[k]))
        elif kind.region:
            scene.kinds.kernel[k] = pair_address(PAIRS[kind.closed_form])
    number = np.zeros(PLAN_NUMBERS)
    number[FIXED], number[TOL] = float(fixed), tol
    group, members, first = _groups(system, coupled)
    number[SOME_AHEAD] = float(not near.all())
    number[LEFT_PART] = min(JUMPS * tol, MOST_JUMPS)
    sources = [model.transient, *(simulation.transient for simulation in model.simulations)]
    awake = any(source is not None and source.sleep is False for source in sources)
    number[MAY_SLEEP] = float(not awake)
    place = np.zeros(len(group), dtype=np.int64)
    place[members] = np.arange(len(members)) - first[group[members]]
    connected = np.append(scene.scales.group, 0)
    scale = _scales(system, tol)
    of_contact = scene.scales.of_contact
    return Plan(
        number, scale, connected, of_contact, near, rows, group, members, place, first, force
    )


def _scales(system: System, tol: float) -> Numbers:
    """Return by what each group of connected bodies is judged (groups, PLAN_SCALES)."""
    scales = system.scene.scales
    scale = np.zeros((len(scales.length), PLAN_SCALES))
    for row, length, speed in zip(scale, scales.length, system.speeds, strict=True):
        row[LENGTH], row[SPEED], row[OWN_TIME] = length, speed, length / speed
        row[SLOP], row[NOISE] = COUNTS * tol * length, NONE_BELOW * tol * length
        row[LEFT], row[LEFT_SPEED] = LEAVES * tol * length, tol * speed
        row[NEAR] = tol * row[OWN_TIME]
    return scale


def _groups(system: System, coupled: list[set[int]]) -> tuple[Indices, Indices, Indices]:
    """Return the group of each body that joints or forces hold, -1 for others; members and firsts.

    Each of the sets `coupled` is of bodies that implicit forces couple.
    """
    scene = system.scene
    tree, eq, nb = scene.tree, scene.equations, len(scene.bodies.mass)
    # by bodies: roots of trees, which equations and forces join
    root = dict(enumerate(range(nb)))

    def top(b: int) -> int:
        while root[b] != b:
            b = root[b]
        return b

    def join(bodies: list[int]) -> None:
        for other in bodies[1:]:
            root[top(other)] = top(bodies[0])

    for k, body in enumerate(tree.body):
        join([int(tree.body[tree.root[k]]), int(body)])
    for e in range(len(eq.program)):
        held = []
        for k in range(eq.first[e], eq.first[e + 1]):
            for marker in (eq.i[k], eq.j[k]):
                body = int(scene.markers.body[marker]) if marker >= 0 else nb
                if body < nb and tree.of_body[body] >= 0:
                    held.append(body)
        join(held)
    for bodies in coupled:
        join(sorted(bodies))
    groups: dict[int, list[int]] = {}
    for body in sorted({int(b) for b in tree.body}.union(*coupled)):
        groups.setdefault(top(body), []).append(body)
    group = np.full(nb + 1, -1, dtype=np.int64)
    for g, held_bodies in enumerate(groups.values()):
        group[held_bodies] = g
    members = np.array([b for held in groups.values() for b in held], dtype=np.int64)
    sizes = [len(held) for held in groups.values()]
    return group, members, np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _sides(broadphase: Broadphase, graphics: int) -> Table:
    """Return which graphics are members of large contacts, and of which side of each."""
    side = np.zeros((graphics, 1 + len(broadphase.contact)), dtype=np.int64)
    for c, (i, i_end, j, j_end) in enumerate(broadphase.first.tolist()):
        side[broadphase.member[i:i_end], 1 + c] |= OF_I
        side[broadphase.member[j:j_end], 1 + c] |= OF_J
    side[:, 0] = side[:, 1:].any(axis=1)
    return side


def _refuse_reactions(system: System) -> None:
    """Raise if a force looks at reactions while there are contacts, whose impulses do not show."""
    scene, model = system.scene, system.model
    if len(scene.contacts.id) > 0 and len(scene.applied.by_reactions) > 0:
        kind, number = system.applied[int(scene.applied.by_reactions[0, ROW_OF])]
        name = element_name(model.file, FORCES[kind].statement, number)
        raise ModelError(
            f"{model.file}:{model.table(kind)[number].source.line}: {name}: integrator MOREAU "
            "cannot run this: it looks at reactions, which do not have the impulses of contacts; "
            "take AUTO"
        )


def rigid_mechanism(system: System, fixed: bool, tol: float) -> Made:
    """Return a system as a problem that steps with rigid contacts of its own."""
    from mbsim.dynamics.pipeline import hooks as shared
    from mbsim.dynamics.pipeline.hook_table import fill

    scene = system.scene
    for kind in system.plans.kinds:
        if not kind.closed_form:
            why = "are measured by FCL, which says nothing of how far they are apart"
            contact = system.model.contacts[kind.contact]
            raise ModelError(
                f"{system.model.file}:{contact.source.line}: Force_Contact[{contact.id}]: "
                f"integrator MOREAU cannot run this: {kind.shape_i} on {kind.shape_j} {why}; "
                "take AUTO"
            )
    _refuse_reactions(system)
    found = Coefficients(system)
    depends = find_depends(scene)
    coupled = _changing_forces(scene, depends)
    nb = len(scene.bodies.mass)
    tables: list[Any] = []
    force = np.zeros(3, dtype=np.int64)
    if coupled or len(scene.states.program) > 0:
        if nb > MOST_BODIES:
            found.said.append(
                f"forces are explicit, and stiff ones bound the step: {nb} bodies are more than "
                f"the {MOST_BODIES} whose forces may be implicit"
            )
            coupled = []
        else:
            from mbsim.dynamics.pipeline.problem import linear_systems

            of_forces, *tables = linear_systems(scene, depends, set(Hook) - COMPLIANT - OWN)
            force[:] = [of_forces[name] for name in ("linearise", "factor", "solve")]
    plan = _plan(system, fixed, tol, coupled, force)
    capacity = min(len(scene.slots.pair), POINTS_EACH * (nb + 4))
    largest = int(np.diff(plan.first).max(initial=0))
    wide = min(capacity * 2 * largest, MOST_WIDE) if largest > 0 else 1
    ng, ny = len(scene.graphics.body), scene.rows.y.shape[1]
    groups, nz = len(scene.audit.sums), len(scene.states.program)
    sizes = nb, ng, ny, capacity, len(scene.pairs.kind), wide, groups, nz
    stepping = make(found.rules, plan, _sides(scene.broadphase, ng), sizes)
    inner, outer = pack(stepping), pack(scene)
    scene.world.hooks[Hook.STEPPING] = int(inner.ctypes.data)

    from mbsim.stepping import hooks as own
    from mbsim.stepping.near_pairs import list_near

    if len(scene.contacts.id) > 0:
        scene.world.hooks[Hook.CONTACTS] = jit.address(own.serve_contacts, _CONTACTS)
    if len(scene.broadphase.contact) > 0:
        scene.world.hooks[Hook.NEAR] = jit.address(list_near, INT(INT, POINTER))
    fill(scene, only=set(Hook) - COMPLIANT - OWN)
    hooks = {**shared.HOOKS, **own.HOOKS}
    if len(scene.sensors.id) > 0:
        from mbsim.dynamics.events.sensors import arrive_hook, happens_hook

        hooks["arrive"] = arrive_hook
        if scene.sensors.located.any():
            hooks["happens"] = happens_hook
    absent = {"check": 0, "inner": 0, "look": 0}
    problem = Problem(int(outer.ctypes.data), **(absent | addresses(hooks)))
    return Made(problem, stepping, (inner, outer, *tables), tuple(found.said))
