"""Arrays of the linearised mechanism, made only for implicit methods.

Unknown are displacements xi of bodies, spatial vectors (angular, linear) about O: the cg of the
root of a body's tree, or the body's own cg. Blocks are 6 x 6, rows and columns by body. A body
that hangs on a joint is not an unknown of its own: xi = xi of its parent + S' dq. Where loops are
many, multipliers of equations are unknowns like these, up to six of one connection in a node that
follows the bodies; else they are the border, which is dense.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import TURN_ROOT
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core import tags
from mbsim.core.arrays import C2, C3, F1, F2, F3, F4, I1, I2

#: Blocks that are made room for beside those of a model whose bodies are all coupled.
_ALL_COUPLED, _BLOCKS_A_BODY = 100, 300
#: Equations from which on multipliers are nodes: the border grows with the cube of their number.
_MANY_EQUATIONS, _ROWS = 20, 6
#: Bodies of the largest model that implicit methods take: a table of their pairs is kept.
MOST_BODIES = 4000
#: Fields with one entry a block: room is made for more than are in use.
_BY_BLOCK = {"pair", "neighbour", "K", "D", "A"}
#: Of this table of pairs the entries in use are kept as a list.
_TABLE = "tangent/pattern/block"


@tags.state
class Pattern(NamedTuple):
    """Which nodes are coupled, and in what order they are eliminated: bodies, then multipliers."""

    block: I2  # (nodes, nodes) block of a pair, -1 for none
    pair: I2  # (couplings, 2) bodies of the blocks that forces fill
    order: I1  # (nodes,)
    start: I1  # (nodes + 1,) first neighbour of each step
    neighbour: I1  # (blocks,) nodes that are eliminated later
    count: I1  # type: ignore[assignment]  # (3,) couplings, blocks, 1 where the order is to be found anew
    joint: tags.Constant[I1]  # (nodes,) tree index of what hangs, -1 for roots and free bodies
    parent: tags.Constant[I1]  # (nodes,) body row, -1 for ground
    children: tags.Constant[I1]  # (nodes,) that hang on it, or bodies that its equations hold
    waiting: tags.Scratch[I1]  # (nodes,) of these not yet eliminated, -1 when done itself
    degree: tags.Scratch[I1]  # (nodes,)
    rows: I1  # (nodes,) unknowns of each body, 6, or equations in use of each other node
    node: tags.Constant[I1]  # (equations,) -1 for those of the border
    held: tags.Constant[I1]  # (pairs,) bodies that equations of a node hold, node by node
    first: tags.Constant[I1]  # (nodes - nb + 1,) first of these
    at: I1  # (equations,) row in its node of each equation in use


@tags.state
class Linear(NamedTuple):
    """The mechanism linearised at one state: what does not depend on the step."""

    R: F3  # (nb, 3, 3)
    q: F2  # (nb, 4)
    w: F2  # (nb, 3) angular velocity, body axes
    r: F2  # (nb, 3) cg from O
    spin: F2  # (nb, 3) angular velocity, global
    torque: F2  # (nb, 3) of inertia about the cg, global: J alpha + w x J w
    force: F2  # (nb, 3) of joints and equations
    S: F3  # (nt, 6, 6) free directions of joints by rows
    U: F3  # (nt, 12, 6) how S'f changes with xi of the child and of the parent, f the joint's force
    f: F2  # (nt, 6) joint forces about O
    K: F3  # (couplings, 6, 6) of forces by xi
    D: F3  # (couplings, 6, 6) of forces by their rates
    column: F3  # (border, nb, 6) force of a unit multiplier, or of a unit of a state
    row: F3  # (border, nb, 6) gradient of an equation, or of a state's slope by xi
    row_rate: F3  # (border, nb, 6) of a state's slope by the rates
    # (1,) 1 where forces and joint forces, as they stand, count as they turn with bodies
    stressed: tags.Constant[I1]
    released: I1  # (border,) rows of equations that do not hold while a loop passes a fold
    slopes: F2  # (states, states) of states by states
    basis: tags.Scratch[F3]  # (2, 9, 6)
    law: tags.Scratch[F2]  # (6, 12)
    rise: tags.Scratch[F1]  # (13,)
    rates: tags.Scratch[F1]  # (3,)


@tags.state
class Real(NamedTuple):
    """A factorisation with real coefficients."""

    A: F3  # (blocks, 6, 6)
    pivot: F3  # (nodes, 6, 6)
    swap: I2  # (nodes, 6)
    seen: F2  # (nodes, 6) largest that the diagonal of a node of multipliers was
    rows: I1  # (nodes,) unknowns of each; none where the border has its equations
    dense: I1  # (border + 1,) equations in use that the border has, their number last
    B: F3  # (nb, 3, 3) d(spin)/d(turn), body axes
    answer: F3  # (border, nodes, 6)
    border: F2  # (border, border)
    border_swap: I1  # (border,)
    g: tags.Scratch[F2]  # (nodes + 1, 6) right side, then solution
    rate: tags.Scratch[F2]  # (nb, 6) change of velocities that residuals alone ask for
    extra: tags.Scratch[F2]  # (2, border) right side and solution
    work: tags.Scratch[F3]  # (4, 6, 6)
    c: F2  # (1, 4) coefficients c1, c2, c3, form
    r: tags.Scratch[F2]  # (2, n) residual and answer in the layout of y
    keep: F3  # (slots + 1, carried, carried) Z of `linearization.memory_slopes`, scratch last
    hook: tags.Constant[I1]  # (1,) entry of `World.hooks` by which that is asked for


@tags.state
class Pair(NamedTuple):
    """The same with complex coefficients."""

    A: C3
    pivot: C3
    swap: I2
    seen: F2
    rows: I1
    dense: I1
    B: C3
    answer: C3
    border: C2
    border_swap: I1
    g: tags.Scratch[C2]
    rate: tags.Scratch[C2]
    extra: tags.Scratch[C2]
    work: tags.Scratch[C3]
    c: C2
    r: tags.Scratch[C2]
    keep: C3
    hook: tags.Constant[I1]


@tags.state
class Keeps(NamedTuple):
    """Friction that looks at X or integrates memory, see `linearization.memory_slopes`."""

    held: I1  # (slots + 1,) slots in contact, their number last
    body: I2  # (slots, 2) I's and J's, as lists of pairs may have changed since
    carries: I2  # (slots, carried) where what is carried stands in y, -1 behind the last
    table: F3  # (slots, 5 + carried, 6 + carried) forces, then rates of what is carried; by slip,
    # spin and normal force, then by what is carried
    lever: F4  # (slots, 2, 6, 6) wrenches on I's and on J's body of units along n, x, y, and about
    # x, y, n
    press: F2  # (slots, 2) of the normal force by depth and by its rate
    scratch: tags.Scratch[F2]  # (2, 5 + carried)


@tags.constant
class Depends(NamedTuple):
    """What programs depend on."""

    body_start: I1  # (programs + 1,)
    body: I1
    state_start: I1  # (programs + 1,)
    state: I1  # rows of states
    user: I1  # (programs,) 1 where a subroutine is called


class Tangent(NamedTuple):
    """All of it; `Pair` is of length zero where no method asks for it."""

    pattern: Pattern
    linear: Linear
    keeps: Keeps
    depends: Depends
    real: Real
    pair: Pair


def border_size(scene: Scene) -> int:
    """Return the number of equations and states."""
    return len(scene.equations.program) + len(scene.states.program)


def _nodes(scene: Scene) -> tuple[np.ndarray, list[list[int]]]:
    """Return the node of each equation, -1 for the border, and the bodies that each node holds.

    Equations of one connection that hold the same bodies share a node. Those of contacts that stick
    stay in the border: which bodies they hold changes.
    """
    eq, nb = scene.equations, len(scene.bodies.mass)
    node, held = np.full(len(eq.program), -1, dtype=np.int64), list[list[int]]()
    able = [e for e in range(len(node)) if eq.slot[e] < 0]
    if len(able) < _MANY_EQUATIONS:
        return node, held
    last: tuple[int, tuple[int, ...]] = (-1, ())
    rows = 0
    for e in able:
        terms = slice(int(eq.first[e]), int(eq.first[e + 1]))
        bodies = scene.markers.body[np.concatenate((eq.i[terms], eq.j[terms]))]
        those = sorted({int(b) for b in bodies if b < nb})
        key = (int(eq.connection[e]), tuple(those))
        if not held or key != last or rows == _ROWS:
            held.append(those)
            last, rows = key, 0
        node[e] = nb + len(held) - 1
        rows += 1
    return node, held


def make_tangent(scene: Scene, depends: Depends, pair: bool, stressed: bool = True) -> Tangent:
    """Return empty arrays for a scene.

    `pair`: for complex coefficients as well. `stressed`: with the geometric stiffness of forces,
    which is exact; without it matrices of springs and dampers are positive definite.
    """
    nb, nt, m = len(scene.bodies.mass), len(scene.tree.body), border_size(scene)
    nz, n = len(scene.states.program), scene.rows.y.shape[1]
    node, held = _nodes(scene)
    many = nb + len(held)
    blocks = many * many if many <= _ALL_COUPLED else min(many * many, _BLOCKS_A_BODY * many)
    joint, parent = np.full(many, -1, dtype=np.int64), np.full(many, -1, dtype=np.int64)
    children = np.array([0] * nb + [len(those) for those in held], dtype=np.int64)
    for k in range(nt):
        if scene.tree.turn[k] != TURN_ROOT:
            joint[scene.tree.body[k]] = k
            if scene.tree.parent[k] >= 0:
                parent[scene.tree.body[k]] = scene.tree.body[scene.tree.parent[k]]
                children[parent[scene.tree.body[k]]] += 1

    def whole(*shape: int) -> np.ndarray:
        return np.zeros(shape, dtype=np.int64)

    pattern = Pattern(
        np.full((many, many), -1, dtype=np.int64),
        whole(blocks, 2),
        whole(many),
        whole(many + 1),
        whole(blocks),
        np.array([0, 0, 1], dtype=np.int64),
        joint,
        parent,
        children,
        whole(many),
        whole(many),
        np.array([6] * nb + [0] * len(held), dtype=np.int64),
        node,
        np.array([b for those in held for b in those], dtype=np.int64),
        np.cumsum([0, *map(len, held)], dtype=np.int64),
        whole(len(node)),
    )
    linear = Linear(
        np.zeros((nb, 3, 3)),
        np.zeros((nb, 4)),
        np.zeros((nb, 3)),
        np.zeros((nb, 3)),
        np.zeros((nb, 3)),
        np.zeros((nb, 3)),
        np.zeros((nb, 3)),
        np.zeros((nt, 6, 6)),
        np.zeros((nt, 12, 6)),
        np.zeros((nt, 6)),
        np.zeros((blocks, 6, 6)),
        np.zeros((blocks, 6, 6)),
        np.zeros((m, nb, 6)),
        np.zeros((m, nb, 6)),
        np.zeros((m, nb, 6)),
        np.array([stressed], dtype=np.int64),
        np.zeros(m, dtype=np.int64),
        np.zeros((nz, nz)),
        np.zeros((2, 9, 6)),
        np.zeros((6, 12)),
        np.zeros(13),
        np.zeros(3),
    )
    slots, wide = _carried(scene)
    keeps = Keeps(
        whole(slots + 1),
        whole(slots, 2),
        whole(slots, wide),
        np.zeros((slots, 5 + wide, 6 + wide)),
        np.zeros((slots, 2, 6, 6)),
        np.zeros((slots, 2)),
        np.zeros((2, 5 + wide)),
    )
    sizes = nb, many, m, n, blocks, slots + 1, wide
    real = Real(*_factor_arrays(sizes, np.float64, Hook.MEMORY))
    sizes = sizes if pair else (0, 0, 0, 0, 0, 0, 0)
    both = Pair(*_factor_arrays(sizes, np.complex128, Hook.MEMORY_PAIR))
    return Tangent(pattern, linear, keeps, depends, real, both)


def _carried(scene: Scene) -> tuple[int, int]:
    """Return how many slots carry X or memory in y, and the most numbers that one carries."""
    x, z = scene.slots.x >= 0, scene.slots.z >= 0
    any_slot = int(np.count_nonzero(x | z))
    most = 3 * int(x.any()) + int(scene.contacts.carried.max(initial=0))
    return any_slot, most


def _factor_arrays(
    sizes: tuple[int, int, int, int, int, int, int], kind: type, hook: Hook
) -> tuple[np.ndarray, ...]:
    """Return the arrays of a factorisation."""
    nb, many, m, n, blocks, slots, wide = sizes
    return (
        np.zeros((blocks, 6, 6), dtype=kind),
        np.zeros((many, 6, 6), dtype=kind),
        np.zeros((many, 6), dtype=np.int64),
        np.zeros((many, 6)),
        np.zeros(many, dtype=np.int64),
        np.zeros(m + 1, dtype=np.int64),
        np.zeros((nb, 3, 3), dtype=kind),
        np.zeros((m, many, 6), dtype=kind),
        np.zeros((m, m), dtype=kind),
        np.zeros(m, dtype=np.int64),
        np.zeros((many + 1, 6), dtype=kind),
        np.zeros((nb, 6), dtype=kind),
        np.zeros((2, m), dtype=kind),
        np.zeros((4, 6, 6), dtype=kind),
        np.zeros((1, 4), dtype=kind),
        np.zeros((2, n), dtype=kind),
        np.zeros((slots, wide, wide), dtype=kind),
        np.array([hook]),
    )


def _in_use(tangent: Tangent) -> Iterator[tuple[str, np.ndarray]]:
    """Yield paths and arrays of all that a linearisation and its factors consist of."""
    blocks = int(tangent.pattern.count[:2].max())
    for path, array in tags.arrays(tangent, tags.STATE, "tangent/"):
        if path != _TABLE:
            yield path, array[:blocks] if path.rpartition("/")[2] in _BY_BLOCK else array


def saved(tangent: Tangent) -> dict[str, Any]:
    """Return what a run needs to go on with the same linearisation and factors, by name."""
    block = tangent.pattern.block.ravel()
    found = {name: np.array(array) for name, array in _in_use(tangent)}
    found["tangent/where"] = np.flatnonzero(block >= 0)
    found["tangent/block"] = block[found["tangent/where"]]
    return found


def restore(tangent: Tangent, kept: Mapping[str, Any]) -> None:
    """Fill the arrays with what `saved` returned."""
    tangent.pattern.count[...] = kept["tangent/pattern/count"]
    for name, array in _in_use(tangent):
        array[...] = kept[name]
    tangent.pattern.block[...] = -1
    tangent.pattern.block.ravel()[kept["tangent/where"]] = kept["tangent/block"]
