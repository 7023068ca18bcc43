"""The graph of constraints: which joints and equations meet at which bodies, for sparse factors.

A *node* is a connection, a joint of the tree or equations, with at most 6 rows; an *incidence* is a
node at a body that it acts on. Bodies are those of loops: the ones that equations act on, and all
that these hang on. Two matrices have a pattern: one with a block for each pair of nodes that meet
at a body, one with a block for each pair of bodies that a node connects.
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1, I2


@tags.constant
class Pattern(NamedTuple):
    """A symmetric matrix of blocks of at most 6 x 6, and its factor, in order of elimination.

    Blocks 0 to n - 1 are those on the diagonal, block n + p is in row `row[p]`.
    """

    first: I1  # (n + 1,) first block below the diagonal of each column
    row: I1  # (blocks,) ascending in each column
    target: I1  # (updates,) block that each pair of blocks of a column changes, column by column
    meets: I2  # (products, 3) what a block is a sum of: row's and column's incidence, block
    block: tags.Scratch[F3]  # (n + blocks, 6, 6)
    size: tags.Scratch[I1]  # (n,) rows in use of each
    x: tags.Scratch[F2]  # (n, 6) right side, then solution


@tags.constant
class ConstraintGraph(NamedTuple):
    """Nodes in order of elimination, bodies of loops in that of the tree; all empty without."""

    tree: I1  # (n,) tree index of the joint that a node holds, -1 for none
    equation: I1  # (n,) first equation of each
    several: I1  # (n,) their number
    connection: I1  # (n,) row of `Connections`, -1 for friction
    first: I1  # (n + 1,) first incidence of each
    body: I1  # (incidences,) which of `bodies`
    node: I1  # (incidences,) whose it is
    node_of: I1  # (ne,) node of each equation
    # (n, 2) incidence on whose body the reaction acts, and 1, or -1 where it acts on J
    reaction: I2
    term: I2  # (terms, 2) incidence of I and of J of a term, -1 for ground
    bodies: I1  # (bodies,) tree index of each
    body_of: I1  # (nt,) which body it is, -1 for none
    place: I1  # (bodies,) when a body is eliminated
    joints: Pattern  # nodes that meet at a body
    links: Pattern  # bodies that a node connects
    in_use: tags.State[I1]  # (1,) 1 where `joints` is factored, 0 where the equations alone are
    row: tags.Scratch[I1]  # (ne,) row of an equation in use in its node, else -1
    bears: tags.Scratch[I1]  # (ne,) the same of all that have a share in reactions
    rows: tags.Scratch[I1]  # (n,) number of those, with the joint's
    J: tags.Scratch[F3]  # (incidences, 6, 6) gradients by rows
    Y: tags.Scratch[F3]  # (incidences, 6, 6) L^-1 J', by rows, L of the body's inertia
    H: tags.Scratch[F3]  # (bodies, 6, 6) inertia with all that hangs on it and is in no loop; L
    R: tags.Scratch[F3]  # (n, 6, 6) reactions of units, by rows
    u: tags.Scratch[F2]  # (n, 6) what each row carries
    shift: tags.Scratch[F2]  # (bodies, 6) displacements
    cost: F1  # (2,) by how much dearer sparse factors are taken to be than they are; of one of
    # `links`, in products of numbers
