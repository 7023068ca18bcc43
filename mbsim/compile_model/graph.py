"""The graph of constraints of a mechanism, in the order in which sparse factors eliminate it.

An equation comes after all joints of the tree that its loop runs over: then these are independent
whatever the position, and where the loop folds it shows at the equation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mbsim.arrays.codes import TURN_ROOT
from mbsim.arrays.graph import ConstraintGraph
from mbsim.arrays.model import Connections, Equations, Markers, Tree
from mbsim.compile_model.elimination import (
    Ints,
    Order,
    coupled,
    eliminate,
    ints,
    pattern,
    products,
)
from mbsim.core.prototypes import copies

#: With fewer equations nothing is to be gained.
FEWEST = 20
#: Rows of a node, of which a connection has no more.
MOST_ROWS = 6


@dataclass
class Node:
    """A connection or friction: the joint of the tree, equations, and the bodies they act on."""

    connection: int
    tree: int = -1
    equations: list[int] = field(default_factory=list)
    bodies: list[int] = field(default_factory=list)  # tree indices
    held: int = 0
    after: set[int] = field(default_factory=set)  # tree indices whose joints come first

    def act_on(self, sides: Iterable[int]) -> None:
        """Add bodies that are not there yet; -1 is ground."""
        self.bodies = list(dict.fromkeys([*self.bodies, *(k for k in sides if k >= 0)]))

    @property
    def rows(self) -> int:
        """Number of rows if all equations are in use."""
        return self.held + len(self.equations)


class _Mechanism:
    """What a graph is made of."""

    def __init__(self, tree: Tree, equations: Equations, of: Connections, markers: Markers) -> None:
        self.tree, self.equations, self.connections = tree, equations, of
        self.index_of = tree.of_body[markers.body]  # of a marker

    def gains(self) -> bool:
        """Return whether sparse factors may be faster; friction of contacts needs the other one."""
        return len(self.equations.program) >= FEWEST and not (self.equations.slot >= 0).any()

    def fits(self, node: Node) -> bool:
        """Return whether a node is a block: few rows, in sequence, with a reaction on a body."""
        e = node.equations
        in_sequence = not e or e == list(range(e[0], e[-1] + 1))
        reacts = node.connection < 0 or self.reaction(node)[0] in node.bodies
        return node.rows <= MOST_ROWS and in_sequence and reacts

    def reaction(self, node: Node) -> tuple[int, int]:
        """Return the body that a reaction is told at, and its sign: -1 where I is on ground."""
        row_i, row_j = self.connections.i[node.connection], self.connections.j[node.connection]
        i, j = int(self.index_of[row_i]), int(self.index_of[row_j])
        return (i, 1) if i >= 0 else (j, -1)

    def sides(self, e: int) -> list[int]:
        """Return the tree indices of the bodies of an equation's terms, -1 for ground."""
        eq = self.equations
        terms = slice(int(eq.first[e]), int(eq.first[e + 1]))
        return [int(k) for row in (eq.i, eq.j) for k in self.index_of[row[terms]]]

    def upward(self, k: int) -> list[int]:
        """Return tree index k and all that it hangs on."""
        found = []
        while k >= 0:
            found.append(k)
            k = int(self.tree.parent[k])
        return found

    def loop(self, sides: Sequence[int]) -> set[int]:
        """Return the tree indices whose joints lie between bodies, or between them and ground."""
        ways: list[set[int]] = [set(self.upward(k)) for k in sides if k >= 0]
        roots = {int(self.tree.root[k]) for k in sides if k >= 0}
        whole = set[int]().union(*ways)
        return whole if -1 in sides or len(roots) > 1 else whole - ways[0].intersection(*ways)

    def nodes(self) -> tuple[list[Node], list[int]]:
        """Return the nodes, and the tree indices of the bodies of loops."""
        eq, tree = self.equations, self.tree
        found: dict[tuple[int, int], Node] = {}
        bodies: set[int] = set()
        for e in range(len(eq.program)):
            c, sides = int(eq.connection[e]), self.sides(e)
            node = found.setdefault((c, -1 if c >= 0 else e), Node(c))
            node.equations.append(e)
            node.act_on(sides)
            node.after |= self.loop(sides)
            for k in node.bodies:
                bodies.update(self.upward(k))
        for c, k in enumerate(self.connections.tree.tolist()):
            if k < 0 or k not in bodies or tree.turn[k] == TURN_ROOT:
                continue
            node = found.setdefault((c, -1), Node(c))
            node.tree, node.held = k, 6 - int(tree.free[k])
            node.after.discard(k)
            node.act_on([k, int(tree.parent[k])])
        return list(found.values()), sorted(bodies)


@dataclass
class Incidences:
    """Where nodes, in order of elimination, act on bodies of loops."""

    nodes: list[Node]
    which: dict[int, int]  # body of each tree index
    first: list[int] = field(default_factory=lambda: [0])
    body: list[int] = field(default_factory=list)
    of: list[dict[int, int]] = field(default_factory=list)  # of each node by tree index

    def __post_init__(self) -> None:
        for node in self.nodes:
            self.of.append({k: len(self.body) + at for at, k in enumerate(node.bodies)})
            self.body += [self.which[k] for k in node.bodies]
            self.first.append(len(self.body))

    def meeting(self) -> Iterator[tuple[int, int, int, int]]:
        """Yield pairs of nodes that meet at a body, and the incidence of each."""
        at_body: list[list[tuple[int, int]]] = [[] for _ in self.which]
        for number, those in enumerate(self.of):
            for k, at in those.items():
                at_body[self.which[k]].append((number, at))
        for ends in at_body:
            yield from ((i, j, a, b) for p, (i, a) in enumerate(ends) for j, b in ends[: p + 1])

    def joined(self, place: Mapping[int, int]) -> Iterator[tuple[int, int, int, int]]:
        """Yield places of pairs of bodies that a node connects, and the incidence of each."""
        for those in self.of:
            ends = [(place[self.which[k]], at) for k, at in those.items()]
            yield from ((i, j, a, b) for p, (i, a) in enumerate(ends) for j, b in ends[: p + 1])

    def reactions(self, of: _Mechanism) -> Ints:
        """Return for each node the incidence that its reaction is told at, and its sign."""
        found = []
        for node, those in zip(self.nodes, self.of, strict=True):
            body, sign = of.reaction(node) if node.connection >= 0 else (-1, 1)
            found.append((those.get(body, -1), sign))
        return ints(found, -1, 2)

    def terms(self, of: _Mechanism) -> Ints:
        """Return the incidences of the sides of all terms."""
        eq = of.equations
        found = np.full((len(eq.kind), 2), -1, dtype=np.int64)
        for node, those in zip(self.nodes, self.of, strict=True):
            for e in node.equations:
                for k in range(int(eq.first[e]), int(eq.first[e + 1])):
                    for side, marker in enumerate((eq.i[k], eq.j[k])):
                        found[k, side] = those.get(int(of.index_of[marker]), -1)
        return found


def _orders(nodes: Sequence[Node], which: Mapping[int, int]) -> tuple[Order, Order] | None:
    """Return the orders of nodes that meet at bodies and of bodies that nodes connect, if found."""
    at_body: list[list[int]] = [[] for _ in which]
    for number, node in enumerate(nodes):
        for k in node.bodies:
            at_body[which[k]].append(number)
    of_joint = {node.tree: number for number, node in enumerate(nodes) if node.tree >= 0}
    after = [{of_joint[k] for k in node.after if k in of_joint} for node in nodes]
    joints = eliminate(coupled(at_body, len(nodes)), [node.rows for node in nodes], after)
    touched = [[which[k] for k in node.bodies] for node in nodes]
    links = eliminate(coupled(touched, len(which)), [MOST_ROWS] * len(which))
    return None if joints is None or links is None else (joints, links)


@copies
def _no_graph(bodies: int, terms: int) -> ConstraintGraph:
    """Return the graph of a tree of so many bodies, whose equations are not eliminated by it."""
    none, blocks, rows = ints([]), np.zeros((0, 6, 6)), np.zeros((0, 6))
    return ConstraintGraph(
        tree=none,
        equation=none,
        several=none,
        connection=none,
        first=ints([0]),
        body=none,
        node=none,
        node_of=none,
        reaction=ints([], -1, 2),
        term=np.full((terms, 2), -1, dtype=np.int64),
        bodies=none,
        body_of=np.full(bodies, -1, dtype=np.int64),
        place=none,
        joints=pattern(Order(), ()),
        links=pattern(Order(), ()),
        in_use=ints([0]),
        row=none,
        bears=none,
        rows=none,
        J=blocks,
        Y=blocks,
        H=blocks,
        R=blocks,
        u=rows,
        shift=rows,
        cost=np.array([1.0, 0.0]),
    )


def make_graph(
    tree: Tree, equations: Equations, connections: Connections, markers: Markers
) -> ConstraintGraph:
    """Return the graph of constraints, an empty one where there is little to gain."""
    of = _Mechanism(tree, equations, connections, markers)
    if not of.gains():
        return _no_graph(len(tree.body), len(equations.kind))
    nodes, bodies = of.nodes()
    which = {k: b for b, k in enumerate(bodies)}
    orders = _orders(nodes, which) if all(of.fits(node) for node in nodes) else None
    if orders is None:
        return _no_graph(len(tree.body), len(equations.kind))
    joints, links = orders
    at = Incidences([nodes[k] for k in joints.order], which)
    n, many, place = len(nodes), len(at.body), links.place
    node_of = {e: number for number, node in enumerate(at.nodes) for e in node.equations}
    return ConstraintGraph(
        tree=ints([node.tree for node in at.nodes]),
        equation=ints([node.equations[0] if node.equations else 0 for node in at.nodes]),
        several=ints([len(node.equations) for node in at.nodes]),
        connection=ints([node.connection for node in at.nodes]),
        first=ints(at.first),
        body=ints(at.body),
        node=ints([number for number, node in enumerate(at.nodes) for _ in node.bodies]),
        node_of=ints([node_of[e] for e in range(len(node_of))]),
        reaction=at.reactions(of),
        term=at.terms(of),
        bodies=ints(bodies),
        body_of=ints([which.get(k, -1) for k in range(len(tree.body))]),
        place=ints([place[b] for b in range(len(bodies))]),
        joints=pattern(joints, at.meeting()),
        links=pattern(links, at.joined(place)),
        in_use=ints([0]),
        row=ints([-1] * len(node_of)),
        bears=ints([-1] * len(node_of)),
        rows=ints([0] * n),
        J=np.zeros((many, 6, 6)),
        Y=np.zeros((many, 6, 6)),
        H=np.zeros((len(bodies), 6, 6)),
        R=np.zeros((n, 6, 6)),
        u=np.zeros((n, 6)),
        shift=np.zeros((len(bodies), 6)),
        cost=np.array([1.0, products(links, [MOST_ROWS] * len(bodies))]),
    )
