"""Before a run: bodies are put where all constraints hold, and implied equations are found.

Positions first, by Newton steps of least (inertia-weighted) motion, then velocities. What moved,
which equations others imply and how many degrees of freedom remain is reported; constraints that
contradict each other are an error that names them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsim.arrays.codes import ANGLE, SCALE_LENGTH, SCALE_SPEED, START_SUM
from mbsim.arrays.hooks import Joints
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import System
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.constraints.equations import lasting
from mbsim.dynamics.initial.start import MOST_DIRECTIONS, start_velocities

Array = np.ndarray[Any, Any]
#: Asks joints: what (`arrays.hooks.Joints`), y.
Serve = Callable[[int, Array], None]

#: Newton ends below the first, fails above the second: residuals over their units.
_CLOSED, _OPEN = 1e-13, 1e-8
_MOST_ROUNDS = 100
#: Singular values (of the scaled matrix) below this part are those of implied equations.
_RANK = 1e-9
_RESIDUAL, _MISMATCH = 0, 1


class ContradictionError(ValueError):
    """Constraints that cannot all hold: rows of `Equations`, residuals over their units."""

    def __init__(self, equations: list[int], residuals: list[float], velocities: bool) -> None:
        super().__init__("constraints contradict each other")
        self.equations, self.residuals, self.velocities = equations, residuals, velocities


@dataclass
class Assembly:
    """What assembly did.

    `moved` has (body row, translation, rotation), `sped` (body row, velocity, angular velocity,
    global) of bodies whose velocity is another than the deck's, `lost` (body row, component, what
    the deck gives, what it is) of velocities that the joints do not allow.
    """

    moved: list[tuple[int, float, float]] = field(default_factory=list)
    sped: list[tuple[int, Array, Array]] = field(default_factory=list)
    lost: list[tuple[int, str, float, float]] = field(default_factory=list)
    implied: list[int] = field(default_factory=list)
    freedom: int = 0


def assemble(scene: Scene, y: Array, serve: Serve, given: dict[int, Array]) -> Assembly:
    """Bring y onto all constraints and choose the equations to be used.

    `given` are the velocities that the deck gives, see `start.start_velocities`.

    Raises
    ------
    ContradictionError
        If positions or velocities cannot satisfy all equations.
    """
    before = y.copy()
    equations = scene.equations
    n = len(equations.program)
    if n > 0:
        scene.sweep.multiplier[:] = 0.0
        serve(Joints.MATRIX, y)
        serve(Joints.DISPLACE, y)
        _count_turns(scene, y, serve)
        _close(scene, y, serve, Joints.DISPLACE, 2, _RESIDUAL)
    else:
        serve(Joints.PROJECT, positions := y.copy())
        for b in scene.tree.body:
            at = BODY_SIZE * b
            y[at : at + 7] = positions[at : at + 7]
    if given and int(scene.tree.free.sum()) <= MOST_DIRECTIONS:
        serve(Joints.MATRIX, y)
        start_velocities(scene, y, given)
    if n > 0:
        _close(scene, y, serve, Joints.SPEED_UP, 1, _MISMATCH)
        serve(Joints.MATRIX, y)
        serve(Joints.CHOOSE, y)
    chosen = [int(e) for e in equations.active[: equations.active[-1]]]
    serve(Joints.PROJECT, y)
    moved, sped = _changes(scene, before, y)
    lasts = lasting(scene)
    return Assembly(
        moved,
        sped,
        _lost(scene, y, given),
        [e for e in range(n) if e not in set(chosen) and lasts[e]],
        int(scene.tree.free.sum()) - len(chosen),
    )


def _scaled(scene: Scene) -> tuple[Array, Array]:
    """Return the whole matrix, and the scale of each equation by which it has been divided."""
    n = int(scene.equations.active[-1])
    A = np.zeros((n, n))
    for r in range(n):
        first = int(scene.sweep.skyline[r])
        A[r, first : r + 1] = scene.sweep.A[r, first : r + 1]
    A = A + np.tril(A, -1).T
    size = scene.sweep.size[scene.equations.active[:n]]
    return A / np.outer(size, size), size


def _count_turns(scene: Scene, y: Array, serve: Serve) -> None:
    """Begin the angles that motions give with as many whole turns as the motions say."""
    equations = scene.equations
    serve(Joints.MATRIX, y)
    for e in range(len(equations.program)):
        k = int(equations.first[e])
        if equations.program[e] < 0 or equations.off[e] == 1 or equations.kind[k] != ANGLE:
            continue
        given = 0.0 if equations.level[e] == 2 else float(equations.start[e, START_SUM])
        turns = (float(scene.sweep.rate[e, _RESIDUAL]) - given) / (2.0 * np.pi)
        if np.isfinite(turns):
            scene.state.angle[equations.angle[k]] -= 2.0 * np.pi * np.round(turns)


def _close(scene: Scene, y: Array, serve: Serve, move: int, level: int, column: int) -> None:
    """Take the residuals of a column away, for the equations that hold at that level."""
    # friction holds nothing yet
    those, unit = np.flatnonzero(lasting(scene)), scene.equations.unit
    given, levels = scene.equations.start[those, column], scene.equations.level[those]
    starts = (levels < level) & np.isfinite(given)
    held = (levels >= level) | starts
    if not held.any():
        return
    best, stuck = np.inf, 0
    for _ in range(_MOST_ROUNDS):
        serve(Joints.MATRIX, y)
        residual = np.where(held, scene.sweep.rate[those, column], 0.0)
        residual[starts] -= given[starts]
        worst = float(np.max(np.abs(residual) / unit[those]))
        stuck = stuck + 1 if worst > 0.5 * best else 0
        best = min(best, worst)
        if worst <= _CLOSED or (stuck >= 3 and best < 1e-10) or stuck >= 20:
            break
        A, size = _scaled(scene)
        if not (np.isfinite(A).all() and np.isfinite(residual).all()):
            worst = np.nan  # numbers are too large
            break
        # the equations that are not held at this level must not move
        solution = np.linalg.lstsq(A, -residual / size, rcond=_RANK)[0]
        scene.sweep.multiplier[: len(those)] = solution / size
        serve(move, y)
    parts = np.abs(residual) / unit[those]
    if not worst <= _OPEN:
        order = [int(k) for k in np.argsort(-parts) if not parts[k] <= _OPEN or np.isnan(worst)]
        wrong, sizes = [int(those[k]) for k in order], [float(parts[k]) for k in order]
        raise ContradictionError(wrong, sizes, column == _MISMATCH)


def _lost(scene: Scene, y: Array, given: dict[int, Array]) -> list[tuple[int, str, float, float]]:
    """Return the given velocities that do not hold."""
    found = []
    speed, length = float(scene.world.scale[SCALE_SPEED]), float(scene.world.scale[SCALE_LENGTH])
    for b, rows in given.items():
        if scene.tree.of_body[b] < 0:
            continue
        v = y[BODY_SIZE * b + 7 : BODY_SIZE * b + 10]
        w = scene.work.R[b] @ y[BODY_SIZE * b + 10 : BODY_SIZE * b + 13]
        for row in rows:
            turning = bool(row[3:6].any())
            axis = row[3:6] if turning else row[:3]
            is_ = float(axis @ (w if turning else v))
            if abs(is_ - row[6]) > 1e-6 * (speed / length if turning else speed):
                along = np.flatnonzero(np.abs(np.abs(axis) - 1.0) < 1e-9)
                name = "xyz"[along[0]] if len(along) else f"along {np.round(axis, 4).tolist()}"
                found.append((b, f"{'w' if turning else 'v'} {name}", float(row[6]), is_))
    return found


def _changes(
    scene: Scene, before: Array, after: Array
) -> tuple[list[tuple[int, float, float]], list[tuple[int, Array, Array]]]:
    """Return which bodies moved and which changed velocity, beyond rounding."""
    moved, sped = [], []
    length, speed = scene.world.scale[SCALE_LENGTH], scene.world.scale[SCALE_SPEED]
    for b in scene.tree.body:
        old, new = (v[BODY_SIZE * b : BODY_SIZE * (b + 1)] for v in (before, after))
        shift = float(np.linalg.norm(new[0:3] - old[0:3]))
        along = min(1.0, abs(float(old[3:7] @ new[3:7])))
        turn = 2.0 * float(np.arccos(along)) if along < 1.0 - 1e-14 else 0.0
        if shift > 1e-7 * length or turn > 1e-6:
            moved.append((int(b), shift, turn))
        dv = float(np.linalg.norm(new[7:10] - old[7:10]))
        dw = float(np.linalg.norm(new[10:13] - old[10:13]))
        if dv > 1e-7 * speed or dw > 1e-7 * speed / length:
            sped.append((int(b), new[7:10].copy(), scene.work.R[b] @ new[10:13]))
    return moved, sped


def equation_name(system: System, e: int) -> str:
    """Return the element and which of its equations row e is."""
    connection = int(system.scene.equations.connection[e])
    return f"{system.connection_name(connection)} ({system.equation_names[e]})"


def _vector(values: Array, scale: float) -> str:
    """Return three numbers, those that are rounding as 0."""
    kept = np.where(np.abs(values) > 1e-9 * scale, values, 0.0)
    return "(" + ", ".join(f"{value:.6g}" for value in kept) + ")"


def describe(system: System, assembly: Assembly) -> tuple[list[str], list[str]]:
    """Return lines for the log, and those that the user should see at once."""
    lines, warnings = [], []
    freedom = assembly.freedom
    lines.append(f"degrees of freedom of the bodies that joints hold: {freedom}")
    if freedom == 0:
        lines.append("kinematically determined: no force changes the motion of these bodies")
    if assembly.implied:
        names = ", ".join(equation_name(system, e) for e in assembly.implied)
        lines.append(
            f"{len(assembly.implied)} equations follow from others (redundant): {names}; "
            "reactions are those of least norm"
        )
    for b, shift, turn in assembly.moved:
        warnings.append(f"assembly: {system.body_name(b)} moved by {shift:.6g} and {turn:.6g} rad")
    length, speed = system.scene.world.scale[:2]
    for b, v, w in assembly.sped:
        lines.append(
            f"assembly: {system.body_name(b)} starts with velocity {_vector(v, speed)} "
            f"and angular velocity {_vector(w, speed / length)}"
        )
    for b, name, given, is_ in assembly.lost:
        warnings.append(
            f"assembly: {system.body_name(b)}: velocity {name} = {given:.6g} of the "
            f"deck cannot hold with the joints and the other velocities: it is {is_:.6g}"
        )
    return lines, warnings


def contradiction(system: System, error: ContradictionError) -> str:
    """Return what to tell the user of constraints that cannot all hold."""
    what = "velocities" if error.velocities else "positions"
    if not np.isfinite(error.residuals).all():
        names = ", ".join(equation_name(system, e) for e in error.equations[:10])
        return (
            f"{system.model.file}: the model cannot be assembled: {what} get no finite numbers, "
            f"the deck's are too large or too small for {names}"
        )
    parts = zip(error.equations[:10], error.residuals[:10], strict=True)
    names = ", ".join(f"{equation_name(system, e)} by {size:.3g}" for e, size in parts)
    return (
        f"{system.model.file}: the model cannot be assembled: {what} miss {names} "
        "(of the model's size, or in radians)"
    )
