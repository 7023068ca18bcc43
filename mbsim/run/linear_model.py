"""A run's model linearised where it stands: x' = A x + B u, y = C x + D u.

A is that of the linearisation by which implicit methods solve (`dynamics.linearization`). With
R = (c I - J)^-1 as they have it, V a basis of the states that keep to the constraints, and
R V = V r, it is c I - r^-1. It is taken by two c, and held against central differences of f, which
stand in for it where constraints hold bodies that move. B, C and D are central differences: of
forces that are linear in u exact but for rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mbsim.arrays.codes import SCALE_LENGTH, SCALE_SPEED
from mbsim.core.layout import AT_Q, AT_V, BODY_SIZE
from mbsim.errors import ModelError, SolverError
from mbsim.results.linear import LinearModel

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.core.problem import Problem
    from mbsim.run.hook_calls import HookCalls
    from mbsim.run.inputs import Inputs
    from mbsim.run.methods import Methods
    from mbsim.run.signals_now import SignalsNow

Array = np.ndarray[Any, Any]
#: Numbers of a body: position, turn about its own axes, velocity, angular velocity.
_SIZE = 12
_KINDS = ("position", "turn", "velocity", "angular_velocity")
#: Singular values below this part of the largest are none.
_RANK = 1e-6
#: By how much A may differ between two c, and from differences, over its largest number.
_AGREES, _DIFFERS = 1e-6, 1e-3
#: Rates below this part of A's largest number are those of a model at rest.
_AT_REST = 1e-6
#: Half of the step of differences, of lengths and speeds over the model's own.
_STEP = 1e-5
#: A shorter one, as a part of it; what differs to both sides falls by less than that at a kink.
_FINER, _JUMPS = 0.1, 0.5


class Standing(Protocol):
    """A run that stands at a point, with inputs that can be set and signals that can be read."""

    system: System
    method: Any
    methods: Methods
    problem: Problem
    hooks: HookCalls
    inputs: Inputs
    moving_inputs: frozenset[int]
    signals: SignalsNow
    state: Any  # all that a linearisation may change; setting it goes back

    @property
    def time(self) -> float:
        """Where the run is [T]."""
        ...

    def changed(self) -> None:
        """Let signals be evaluated anew: y is another."""
        ...


class _Point:
    """The present state, and f, R and changes about it."""

    def __init__(self, run: Standing) -> None:
        self.run, self.scene, self.t = run, run.system.scene, run.time
        self.y = run.method.y.copy()
        self.nb, self.n = len(self.scene.bodies.mass), len(self.y)
        self.states = np.asarray(self.scene.states.offset, dtype=np.int64)
        size = self.scene.world.scale
        length, speed = float(size[SCALE_LENGTH]), float(size[SCALE_SPEED])
        rows = [length] * 3 + [1.0] * 3 + [speed] * 3 + [speed / length] * 3
        self.scale = np.array(rows * self.nb + [1.0] * len(self.states))
        ids, diffs = run.system.body_ids, list(run.system.model.differentials)
        self.names = [
            f"bodies/{id}/{kind}/{axis}" for id in ids for kind in _KINDS for axis in "xyz"
        ]
        self.names += [f"diffs/{id}/value" for id in diffs]
        self.names += [f"state/{k}" for k in range(len(diffs), len(self.states))]

    def lifted(self, s: Array) -> Array:
        """Return the change of y (n,) for one of positions, turns, velocities and states."""
        d = np.zeros(self.n)
        for b in range(self.nb):
            at, row = BODY_SIZE * b, s[_SIZE * b :]
            d[at : at + 3] = row[:3]
            d[at + AT_Q : at + AT_V] = 0.5 * _times(self.y[at + AT_Q : at + AT_V], row[3:6])
            d[at + AT_V : at + BODY_SIZE] = row[6:12]
        d[self.states] = s[_SIZE * self.nb :]
        return d

    def lowered(self, d: Array) -> Array:
        """Return what `lifted` is given, of a change of y."""
        s = np.zeros(len(self.scale))
        for b in range(self.nb):
            at, row = BODY_SIZE * b, s[_SIZE * b :]
            row[:3] = d[at : at + 3]
            row[3:6] = _turn_of(self.y[at + AT_Q : at + AT_V], d[at + AT_Q : at + AT_V])
            row[6:12] = d[at + AT_V : at + BODY_SIZE]
        s[_SIZE * self.nb :] = d[self.states]
        return s

    def f(self, y: Array) -> Array:
        """Return y'."""
        found = np.zeros(self.n)
        self.run.hooks.must(self.run.problem.rhs, self.t, y.copy(), found)
        return found

    def moved(self, s: Array) -> Array:
        """Return the present y changed, and brought back onto the constraints."""
        y: Array = self.y + self.lifted(s)
        for _ in range(3):
            self.run.hooks.must(self.run.problem.project, self.t, y, y.copy())
        return y

    def free(self) -> Array:
        """Return by columns what becomes of each change on its way back onto the constraints."""
        m = len(self.scale)
        found = np.zeros((m, m))
        for k in range(m):
            change = _STEP * np.eye(m)[k] * self.scale
            d = self.moved(change) - self.moved(-change)
            found[:, k] = self.lowered(d) / self.scale / (2.0 * _STEP)
        return found

    def resolvent(self, c: float, problem: Any) -> Array:
        """Return R = (c I - J)^-1 of changes that `lifted` takes, as far as constraints let it."""
        hooks, f = self.run.hooks, self.f(self.y)
        # the linearisation is taken where f was just evaluated
        hooks.must(problem.linearise, self.t, self.y.copy(), f)
        hooks.must(problem.factor, 0.0, np.array([c, c * c, c, 0.0]), np.zeros(4))
        m = len(self.scale)
        found, d = np.zeros((m, m)), np.zeros(self.n)
        for k in range(m):
            r = self.lifted(np.eye(m)[k] * self.scale)
            hooks.must(problem.solve, 0.0, r, d)
            found[:, k] = self.lowered(d) / self.scale
        return found


def _times(q: Array, v: Array) -> Array:
    """Return the quaternion product q (0, v)."""
    w, u = q[0], q[1:]
    return np.concatenate([[-u @ v], w * v + np.cross(u, v)])


def _turn_of(q: Array, d: Array) -> Array:
    """Return twice the vector part of conj(q) d: the turn in body axes of a change of q."""
    turn: Array = 2.0 * (q[0] * d[1:] - d[0] * q[1:] - np.cross(q[1:], d[1:]))
    return turn


def _independent(free: Array, nb: int) -> tuple[list[int], Array]:
    """Return numbers that fix a state which keeps to the constraints, and all as they follow.

    Positions are chosen first, as far apart as they are, then velocities, then states.
    """
    from scipy.linalg import qr

    u, size, _ = np.linalg.svd(free)
    rank = int(np.count_nonzero(size > _RANK * size[0])) if len(size) else 0
    basis = u[:, :rank]
    of_body = np.arange(len(free)) < _SIZE * nb
    place = np.arange(len(free)) % _SIZE < _SIZE // 2
    chosen: list[int] = []
    left = basis
    for group in (of_body & place, of_body & ~place, ~of_body):
        rows = np.flatnonzero(group)
        if not len(rows) or not left.shape[1]:
            continue
        _, triangle, order = qr(left[rows].T, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangle))
        count = int(np.count_nonzero(diagonal > 1e-6))
        chosen += rows[order[:count]].tolist()
        # what these leave undecided
        _, _, rest = np.linalg.svd(basis[chosen])
        left = basis @ rest[len(chosen) :].T
    return chosen, basis @ np.linalg.inv(basis[chosen])


def linearize(run: Standing, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> LinearModel:
    """Return the model of a run linearised where it stands; the run is left as it is.

    Raises
    ------
    ModelError
        For an input that gives a velocity: u' would stand in the equations.
    SolverError
        Where f has no slope there.
    """
    # the scene's hooks are one: those of a running implicit method stand there
    kept, hooks = run.state, run.system.scene.world.hooks.copy()
    try:
        return _linearized(run, outputs, inputs)
    finally:
        run.system.scene.world.hooks[:] = hooks
        run.state = kept


def _linearized(run: Standing, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> LinearModel:
    from mbsim.dynamics.pipeline.problem import implicit_hooks

    rows_of = {name: run.inputs.row_of(name) for name in inputs}
    moving = [name for name, row in rows_of.items() if row in run.moving_inputs]
    if moving:
        raise ModelError(
            f"linearize: {moving[0]} gives a velocity, whose rate would stand in the equations; "
            'leave it out (inputs=[...]), or let it give an acceleration (val_type="A")'
        )
    if run.methods.explicit.order == 0.0:
        raise ModelError(
            "linearize: VERLET's forces follow from its step; open with another method"
        )
    if run.methods.rigid is not None and len(run.system.scene.contacts.id) > 0:
        raise ModelError(
            "linearize: rigid contacts have no slope; open with another method than MOREAU"
        )
    problem, lives = implicit_hooks(run.system.scene, run.problem, False)
    point = _Point(run)
    scale = point.scale
    chosen, V = _independent(point.free(), point.nb)
    A = _resolved(point, problem, chosen, V)
    slopes, sides, C, rates = _differences(run, point, (chosen, V), outputs)
    size = max(float(np.abs(slopes).max(initial=0.0)), 1e-300)
    if A is None or np.abs(A - slopes).max(initial=0.0) > _DIFFERS * size:
        # implicit methods leave out how constraints turn with bodies that move
        A = slopes
        if sides > _DIFFERS * size:
            # a force that bends does so less within a shorter step, at a kink as much
            A, near, C, rates = _differences(run, point, (chosen, V), outputs, _FINER * _STEP)
            if near > _JUMPS * sides:
                raise SolverError(
                    f"linearize at time {run.time:.9g}: differences to both sides give other "
                    "slopes: a force has a kink here"
                )
    B = np.zeros((len(chosen), len(inputs)))
    D = np.zeros((len(outputs), len(inputs)))
    for k, row in enumerate(rows_of.values()):
        up, down, over, under = _by_input(run, point, row, outputs)
        step = 2.0 * _input_step(run, row)
        B[:, k] = ((up - down) / scale)[chosen] / step
        D[:, k] = (over - under) / step
    unit = scale[chosen]
    del lives
    return LinearModel(
        A * unit[:, None] / unit,
        B * unit[:, None],
        C / unit,
        D,
        tuple(point.names[k] for k in chosen),
        inputs,
        outputs,
        tuple(point.names),
        V * scale[:, None] / unit,
        # what a search for rest has left is no motion
        np.where(np.abs(rates) > _AT_REST * size, rates, 0.0) * unit,
        run.time,
    )


def _resolved(point: _Point, problem: Any, chosen: list[int], V: Array) -> Array | None:
    """Return A by the linearisation of implicit methods, None where it is not that of one A."""
    scales = point.scene.world.scale
    rate = float(scales[SCALE_SPEED] / scales[SCALE_LENGTH])
    unit = np.eye(len(chosen))
    try:
        A = rate * unit - np.linalg.inv((point.resolvent(rate, problem) @ V)[chosen])
        c = 1.5 * max(rate, float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)))
        again = c * unit - np.linalg.inv((point.resolvent(c, problem) @ V)[chosen])
    except np.linalg.LinAlgError:
        return None
    size = max(float(np.abs(A).max(initial=0.0)), 1e-300)
    same = np.abs(A - again).max(initial=0.0) <= _AGREES * size * len(A)
    return again if same else None


def _differences(
    run: Standing,
    point: _Point,
    states: tuple[list[int], Array],
    outputs: tuple[str, ...],
    step: float = _STEP,
) -> tuple[Array, float, Array, Array]:
    """Return A by central differences, how much those to one side differ at most, C, and x'."""
    chosen, V = states
    scale, n = point.scale, len(chosen)
    A, C, sides = np.zeros((n, n)), np.zeros((len(outputs), n)), 0.0
    here = (point.lowered(point.f(point.moved(np.zeros(len(scale))))) / scale)[chosen]
    for k in range(n):
        change = step * V[:, k] * scale
        ends = [point.moved(change), point.moved(-change)]
        up, down = ((point.lowered(point.f(y)) / scale)[chosen] for y in ends)
        A[:, k] = (up - down) / (2.0 * step)
        sides = max(sides, float(np.abs(up + down - 2.0 * here).max(initial=0.0)) / step)
        seen = [_read(run, y, outputs) for y in ends]
        C[:, k] = (seen[0] - seen[1]) / (2.0 * step)
    return A, sides, C, here


def _read(run: Standing, y: Array, outputs: tuple[str, ...]) -> Array:
    """Return signals at another point."""
    if not outputs:
        return np.zeros(0)
    run.method.y[:] = y
    run.changed()
    found = [run.signals[name] for name in outputs]
    for name, value in zip(outputs, found, strict=True):
        if np.size(value) > 1:
            raise ModelError(f"linearize: {name} has {np.size(value)} numbers: name one of them")
    return np.array([float(value) for value in found])


def _input_step(run: Standing, row: int) -> float:
    """Return half of the step of an input's differences; forces are mostly linear in it."""
    return max(1.0, abs(run.inputs.values_now[row])) * 2.0**-10


def _by_input(
    run: Standing, point: _Point, row: int, outputs: tuple[str, ...]
) -> tuple[Array, ...]:
    """Return y' and signals for an input that is a little larger, and a little smaller."""
    value, step = run.inputs.values_now[row], _input_step(run, row)
    found = []
    for sign in (1.0, -1.0):
        run.inputs.put(row, value + sign * step)
        found.append((point.lowered(point.f(point.y)), _read(run, point.y, outputs)))
    run.inputs.put(row, value)
    return found[0][0], found[1][0], found[0][1], found[1][1]
