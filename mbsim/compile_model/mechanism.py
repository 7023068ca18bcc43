"""Joints, motions and other constraints as a tree of bodies and equations that close its loops.

The tree takes, body by body from ground, the joint that holds most; a joint whose equations
are plain offsets and cosines can hang a body on its parent. All other equations are kept as sums
of terms (`constraints.equations`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Connections, Curves, Equations, Surfaces, Tree
from mbsim.compile_model.equation_sums import Sums
from mbsim.compile_model.higher_pairs import add_higher_pairs
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.param_surfaces import Function
from mbsim.compile_model.programs import ProgramTable
from mbsim.compile_model.tree import (
    AXES,
    TreeJoint,
    empty_tree,
    is_plain,
    nearest_flip,
    tree_joint_of,
)
from mbsim.errors import DeckError, Fault
from mbsim.forces.catalog import ForceKind, Switched
from mbsim.joints.catalog import JOINTS, Row, angle, offset
from mbsim.model.elements import (
    Coupler,
    GeneralConstraint,
    Joint,
    MarkerForce,
    Model,
    Motion,
)
from mbsim.model.forces import rigid_forces
from mbsim.model.frames import quaternion
from mbsim.model.names import element_name

_KINDS = {
    "offset": codes.OFFSET,
    "perp": codes.PERP,
    "angle": codes.ANGLE,
    "spin": codes.ANGLE,
    "distance": codes.DISTANCE,
    "twist": codes.TWIST,
}
#: A joint that holds less than this is cheaper as equations than as a joint of the tree.
_LEAST_ROWS = 3
#: Sine of an angle below which axes are parallel.
_PARALLEL = 1e-6
#: Cosine of half the bend of shafts that are folded back: no twist can be told from it.
_FOLDED = 1e-8
_TABLES = {"JOINT": "joints", "JPRIM": "primitives"}
_LEVELS = {"A": 0, "V": 1, "D": 2}
#: What a motion's direction means.
_DIRECTIONS = {
    "R": angle(),
    "B1": angle(),  # of markers turned by `MarkerTable.turned`
    "B2": angle(),
    "B3": angle(),
    "T": offset("z"),
    "X": offset("x"),
    "Y": offset("y"),
    "Z": offset("z"),
}


@dataclass
class Mechanism:
    """The constraints of a model as arrays; `elements` has (statement, id) of each connection.

    `names` says for each equation which it is, for messages.
    """

    tree: Tree
    equations: Equations
    connections: Connections
    elements: list[tuple[str, int]]
    names: list[str]
    curves: Curves
    surfaces: Surfaces
    along: np.ndarray  # (curves + 2 surfaces,) parameters at the start


class RigidSlot(NamedTuple):
    """A slot whose friction is rigid."""

    contact: int  # id
    slot: int
    i: int  # marker rows on the bodies of the contact's I and J
    j: int


class _Builder:
    """Collects connections, joints of the tree and equations of one model."""

    def __init__(self, model: Model, markers: MarkerTable, programs: ProgramTable) -> None:
        self.model, self.markers, self.programs = model, markers, programs
        self.length = markers.length
        self.sums = Sums()
        self.elements: list[tuple[str, int]] = []
        self.pairs: list[tuple[int, int]] = []
        self.tree_joints: dict[int, TreeJoint] = {}
        self.joints: dict[int, Joint] = {}
        #: What takes no part for a while: the tree does not change, so that it holds none of it.
        self.switched = {one for each in model.simulations for one in each.inactive}

    def row_value(self, row: Row, i: int, j: int) -> float:
        """Return what a row is at the start."""
        (p_i, R_i), (p_j, R_j) = self.markers.frame(i), self.markers.frame(j)
        if row.kind == "offset":
            return float(R_j[:, AXES.index(row.j)] @ (p_i - p_j))
        if row.kind == "perp":
            return float(R_i[:, AXES.index(row.i)] @ R_j[:, AXES.index(row.j)])
        if row.kind == "distance":
            return float(np.linalg.norm(p_i - p_j))
        if row.kind == "twist":
            return 0.0
        return self.markers.start_angle(i, j)

    def aligned(self, i: int, j: int) -> int:
        """Return a new marker row on J's body with I's axes at the start."""
        body_j, _, _ = self.markers.frames[j]
        axes = self.markers.frame(i)[1]
        bodies = list(self.markers.placement.bodies.values())
        R = bodies[body_j].R if body_j < len(bodies) else np.eye(3)
        return self.markers.add(body_j, self.markers.frames[j][1], R.T @ axes)

    def untwisted(self, i: int, j: int) -> int:
        """Return a new marker row on J's body, J turned about its z so that I is only bent."""
        w, _, _, z = quaternion(self.markers.frame(j)[1].T @ self.markers.frame(i)[1])
        twist = 2.0 * math.atan2(z, w) if math.hypot(z, w) > _FOLDED else 0.0
        c, s = math.cos(twist), math.sin(twist)
        body, p, R = self.markers.frames[j]
        return self.markers.add(body, p, R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))

    # connections

    def connect(self, statement: str, id: int, i: int, j: int) -> int:
        """Return the row of a new connection."""
        self.elements.append((statement, id))
        self.pairs.append((i, j))
        return len(self.elements) - 1

    def add_term(self, row: Row, i: int, j: int, factor: float) -> float:
        """Add a term to the equation being made; return what it is at the start."""
        if row.kind == "spin":
            j = self.aligned(i, j)
        elif row.kind == "twist":
            j = self.untwisted(i, j)
        slot = self.markers.angle(i, j) if row.kind in ("angle", "spin") else -1
        axis_i = AXES.index(row.i) if row.i else 0
        axis_j = AXES.index(row.j) if row.j else 0
        self.sums.terms.append((_KINDS[row.kind], i, j, axis_i, axis_j, factor, slot))
        return factor * self.row_value(row, i, j)

    def unit(self, rows: Iterable[Row]) -> float:
        """Return what the residual of a sum is measured by."""
        lengths = any(row.kind in ("offset", "distance") for row in rows)
        return self.length if lengths else 1.0

    def add_equation(
        self, connection: int, joint: Joint, rows: tuple[Row, ...], last: bool
    ) -> None:
        """Add an equation of a joint."""
        i, j = self.pairs[connection]
        total = sum(self.add_term(row, i, j, row.factor(joint)) for row in rows)
        kind = JOINTS[joint.type]
        given = kind.value(joint) if kind.value is not None and last else None
        zero = len(rows) == 1 and rows[0].kind in ("offset", "perp")
        constant = given if given is not None else (0.0 if zero else total)
        self.sums.close(connection, _describe(rows), constant, self.unit(rows))

    def add_joint(self, statement: str, joint: Joint) -> None:
        """Add a joint: note what it may be in the tree, add its other equations."""
        i, j = self.markers.row(joint.i_marker_id), self.markers.row(joint.j_marker_id)
        connection = self.connect(statement, joint.id, i, j)
        self.joints[connection] = joint
        tree_joint = tree_joint_of(connection, i, j, JOINTS[joint.type].equations)
        if tree_joint is not None and tree_joint.turn == codes.TURN_CROSS:
            self.check_cross(statement, joint, tree_joint)
        lasts = (_TABLES[statement], joint.id) not in self.switched
        if tree_joint is not None and tree_joint.held >= _LEAST_ROWS and lasts:
            self.tree_joints[connection] = tree_joint

    def check_cross(self, statement: str, joint: Joint, tree_joint: TreeJoint) -> None:
        """Refuse a cross whose arms start parallel: which way they are to turn is not said."""
        arm_i = self.markers.frame(tree_joint.i)[1][:, tree_joint.axis_i]
        arm_j = self.markers.frame(tree_joint.j)[1][:, tree_joint.axis_j]
        if float(np.linalg.norm(np.cross(arm_i, arm_j))) < _PARALLEL:
            name = f"Constraint_J{'oint' if statement == 'JOINT' else 'prim'}[{joint.id}]"
            message = (
                f"{AXES[tree_joint.axis_i]} of marker {joint.i_marker_id} (I) and "
                f"{AXES[tree_joint.axis_j]} of marker {joint.j_marker_id} (J) are parallel; "
                f"must be at right angles ({joint.type})"
            )
            raise DeckError([Fault(joint.source.file, joint.source.line, name, message)])

    def add_joint_equations(self, in_tree: set[int]) -> None:
        """Add the equations of all joints that the tree does not hold."""
        for connection, joint in self.joints.items():
            equations = JOINTS[joint.type].equations
            for k, rows in enumerate(equations):
                if not (connection in in_tree and is_plain(rows)):
                    self.add_equation(connection, joint, rows, k == len(equations) - 1)

    def joint_markers(self, joint_id: int) -> tuple[int, int]:
        """Return the marker rows of a joint."""
        joint = self.model.joints[joint_id]
        return self.markers.row(joint.i_marker_id), self.markers.row(joint.j_marker_id)

    def add_motion(self, motion: Motion) -> None:
        """Add a motion: one row less a function of TIME, and of the state.

        Of a displacement that depends on the state the gradient acts too. A force along a velocity
        or an acceleration is along the motion alone: there bodies are only named.
        """
        if motion.joint_id is not None:
            i, j = self.joint_markers(motion.joint_id)
        else:
            i, j = self.markers.row(motion.i_marker_id), self.markers.row(motion.j_marker_id)
        connection = self.connect("MOTION", motion.id, i, j)
        row = _DIRECTIONS[motion.direction]
        if motion.direction in ("B1", "B2"):
            axis = int(motion.direction == "B2")
            i, j = self.markers.turned(i, axis), self.markers.turned(j, axis)
        self.add_term(row, i, j, 1.0)
        assert motion.expr is not None
        given = self.programs.input_row("motions", motion.id)
        if given is None:
            program = self.programs.add(
                motion.expr, motion, differentiable=True, velocities=motion.val_type == "A"
            )
        else:
            program = self.programs.add_input(given)
        level = _LEVELS[motion.val_type]
        seen, _ = self.bodies_seen(program)
        for body_row in seen:
            self.sums.terms.append((codes.GENERAL, body_row, 0, 0, 0, -float(level == 2), -1))
        general = codes.OF_STATE if seen else 0
        start = (motion.ic_disp, motion.ic_vel)
        self.sums.close(
            connection, "its motion", 0.0, self.unit([row]), program, level, general, start
        )

    def add_coupler(self, coupler: Coupler) -> None:
        """Add a coupler: a sum of displacements of joints stays what it is, or a relation is 0."""
        connection = self.connect("COUPLER", coupler.id, *self.joint_markers(coupler.joint_ids[0]))
        total, rows, by_user = 0.0, [], coupler.user is not None
        scales = (1.0,) * len(coupler.joint_ids) if by_user else coupler.scales
        for joint_id, kind, scale in zip(
            coupler.joint_ids, coupler.motion_types, scales, strict=True
        ):
            rows.append(_DIRECTIONS[kind])
            total += self.add_term(rows[-1], *self.joint_markers(joint_id), scale)
        if by_user:
            self.sums.close(connection, "its relation", 0.0, self.unit(rows))
            self.sums.user[-1] = 1 + self.programs.users["COUPLER", coupler.id]
        else:
            self.sums.close(connection, "its ratio", total, self.unit(rows))

    def bodies_seen(self, program: int) -> tuple[list[int], int]:
        """Return a marker row for each moving body that a program looks at, and ground's or 0."""
        rows = self.programs.looks_at(program)
        bodies = {self.markers.frames[row][0]: row for row in rows}
        fixed = bodies.pop(self.markers.ground, 0)
        return list(bodies.values()), fixed

    def add_general(self, constraint: GeneralConstraint) -> None:
        """Add an expression that is 0: one term for each body that it looks at."""
        program = self.programs.add(constraint.expr, constraint, differentiable=True)
        seen, fixed = self.bodies_seen(program)
        if not seen:
            name = element_name(self.model.file, "Constraint_General", constraint.id)
            message = f"expr={constraint.expr.text!r}: must depend on where a moving body is"
            raise DeckError([Fault(constraint.source.file, constraint.source.line, name, message)])
        i, j = ([*seen, fixed, 0])[:2]
        connection = self.connect("GCON", constraint.id, i, j)
        for row in seen:
            self.sums.terms.append((codes.GENERAL, row, 0, 0, 0, 1.0, -1))
        self.sums.close(
            connection, "its expression", 0.0, self.length, program, general=codes.WHOLE
        )

    def add_rigid_force(self, kind: ForceKind, force: MarkerForce) -> None:
        """Add the velocity that a rigid force holds while it sticks; it is no connection."""
        i, j = self.markers.row(force.i_marker_id), self.markers.row(force.j_marker_id)
        assert isinstance(kind.form, Switched)  # the only form that can be rigid
        acts = kind.form.acts(force.values)
        axis = acts.axis
        if acts.turns:
            row = angle()
            i, j = self.markers.turned(i, axis), self.markers.turned(j, axis)
        else:
            row = offset(AXES[axis])
        self.add_term(row, i, j, 1.0)
        self.sums.close(-1, f"{kind.statement}[{force.id}]", 0.0, self.unit([row]), level=1)

    def add_rigid_slot(self, sticking: RigidSlot) -> None:
        """Add the two velocities that rigid friction of a slot holds while it sticks."""
        for axis in range(2):
            term = (codes.TOUCHING, sticking.i, sticking.j, axis, sticking.slot, 1.0, -1)
            self.sums.terms.append(term)
            self.sums.close(-1, f"Force_Contact[{sticking.contact}]", 0.0, self.length, level=1)
            self.sums.slot[-1] = sticking.slot

    # the tree

    def bodies_in_equations(self) -> Iterator[int]:
        """Yield the rows of all moving bodies that a constraint holds."""
        for _, i, j, *_ in self.sums.terms:
            yield from (self.markers.frames[row][0] for row in (i, j))
        for i, j in self.pairs:
            yield from (self.markers.frames[row][0] for row in (i, j))

    def grow(self, others: list[int]) -> dict[int, tuple[int, TreeJoint | None, bool]]:
        """Return for each body its parent, its tree joint, and whether I is on the parent.

        From ground, and then from each body that is not reached, the joint of the tree that holds
        most is taken first; of equals the one nearest to the root.
        """
        ground = self.markers.ground
        held = {*self.bodies_in_equations(), *(self._body(row) for row in others)} - {ground}
        hung: dict[int, tuple[int, TreeJoint | None, bool]] = {}
        depth = {ground: 0}
        waiting = sorted(held)
        while True:
            options = []
            for tree_joint in self.tree_joints.values():
                body_i, body_j = self._body(tree_joint.i), self._body(tree_joint.j)
                if body_j in depth and body_i not in depth:
                    options.append((-tree_joint.held, depth[body_j], tree_joint.connection, False))
                elif body_i in depth and body_j not in depth and tree_joint.both_ways:
                    options.append((-tree_joint.held, depth[body_i], tree_joint.connection, True))
            if options:
                _, level, connection, flip = min(options)
                tree_joint = self.tree_joints[connection]
                child, parent = self._body(tree_joint.i), self._body(tree_joint.j)
                if flip:
                    child, parent = parent, child
                hung[child], depth[child] = (parent, tree_joint, flip), level + 1
                continue
            root = next((body for body in waiting if body not in depth), None)
            if root is None:
                return hung
            hung[root], depth[root] = (ground, None, False), 0

    def _body(self, row: int) -> int:
        return self.markers.frames[row][0]

    def tree(self, others: list[int]) -> tuple[Tree, dict[int, tuple[int, bool]]]:
        """Return the tree; for each connection in it its index and whether I is on the parent."""
        ground = self.markers.ground
        hung = self.grow(others)
        children: dict[int, list[int]] = {}
        for child, (parent, tree_joint, _) in hung.items():
            children.setdefault(-1 if tree_joint is None else parent, []).append(child)
        order: list[int] = []
        root_of: dict[int, int] = {}
        for top in [*children.get(ground, []), *children.get(-1, [])]:
            stack = [top]
            while stack:
                body = stack.pop()
                order.append(body)
                root_of[body] = top
                stack.extend(reversed(children.get(body, [])))
        # bodies of one root follow each other
        n, index = len(order), {body: k for k, body in enumerate(order)}
        made = empty_tree(ground, n)
        of_connection: dict[int, tuple[int, bool]] = {}
        for k, body in enumerate(order):
            parent, tree_joint, flip = hung[body]
            made.body[k], made.of_body[body] = body, k
            made.parent[k] = index[parent] if tree_joint is not None and parent != ground else -1
            made.root[k] = index[root_of[body]]
            made.end[made.root[k]] = k + 1
            if tree_joint is None:
                made.turn[k], made.free[k] = codes.TURN_ROOT, 6
                continue
            of_connection[tree_joint.connection] = (k, flip)
            child_row, parent_row = (
                (tree_joint.j, tree_joint.i) if flip else (tree_joint.i, tree_joint.j)
            )
            made.turn[k], made.slide[k] = tree_joint.turn, tree_joint.slide
            made.free[k] = 6 - tree_joint.held
            axes = (tree_joint.axis_i, tree_joint.axis_j)
            made.axis[k] = axes[::-1] if flip else axes
            made.child_p[k] = self.markers.frames[child_row][1]
            made.parent_p[k] = self.markers.frames[parent_row][1]
            made.parent_R[k] = self.markers.frames[parent_row][2]
            relative = self.markers.frame(parent_row)[1].T @ self.markers.frame(child_row)[1]
            made.child_R[k] = self.markers.frames[child_row][2] @ nearest_flip(
                tree_joint.turn, relative
            )
        made.end[:] = made.end[made.root]
        return made, of_connection


def _describe(rows: tuple[Row, ...]) -> str:
    """Return which equation of a joint this is, in words."""
    words = {
        "offset": "offset along J's {j}",
        "perp": "angle of I's {i} and J's {j}",
        "angle": "angle about z",
        "spin": "spin about I's z",
        "distance": "distance",
        "twist": "twist about the shafts",
    }
    return " with ".join(words[row.kind].format(i=row.i, j=row.j) for row in rows)


def constrain(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    rigid_slots: Sequence[RigidSlot] = (),
    surfaces: Mapping[int, Function] | None = None,
) -> Mechanism:
    """Return the constraints of a model; `surfaces`: what gives points of each, if known."""
    builder = _Builder(model, markers, programs)
    for joint in model.joints.values():
        builder.add_joint("JOINT", joint)
    for joint in model.primitives.values():
        builder.add_joint("JPRIM", joint)
    for coupler in model.couplers.values():
        builder.add_coupler(coupler)
    for motion in model.motions.values():
        builder.add_motion(motion)
    for constraint in model.general_constraints.values():
        builder.add_general(constraint)
    pairs_of = add_higher_pairs(model, markers, builder.sums, builder.connect, surfaces)
    # friction is held by none of the tree, and its equations are the last
    rigid = rigid_forces(model)
    held = [marker for _, f in rigid for marker in (f.i_marker_id, f.j_marker_id)]
    others = [markers.row(marker) for marker in held]
    others += [marker for sticking in rigid_slots for marker in (sticking.i, sticking.j)]
    tree, hung = builder.tree(others)
    builder.add_joint_equations(set(hung))
    for kind, force in rigid:
        builder.add_rigid_force(kind, force)
    for sticking in rigid_slots:
        builder.add_rigid_slot(sticking)
    n = len(builder.pairs)
    pairs = np.array(builder.pairs, dtype=np.int64).reshape(-1, 2)
    connections = Connections(
        i=pairs[:, 0].copy(),
        j=pairs[:, 1].copy(),
        tree=np.array([hung.get(c, (-1, False))[0] for c in range(n)], dtype=np.int64),
        flip=np.array([hung.get(c, (-1, False))[1] for c in range(n)], dtype=np.int64),
    )
    return Mechanism(
        tree,
        builder.sums.arrays(),
        connections,
        builder.elements,
        builder.sums.names,
        *pairs_of,
    )
