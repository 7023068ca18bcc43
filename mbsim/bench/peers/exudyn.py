"""Exudyn: Lie group integrators, penalty contact, user laws in Python or as symbolic expressions.

Its fast build (no range checks) is used. Rows are internal sensors, so no Python runs between
them; with automatic steps every step is stored, which costs nothing measurable, and rows of the
drops are read off the cubic through the steps around them, outside the timed loop.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any

import numpy as np

from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.peers.exudyn_parts import Case
from mbsim.bench.peers.exudyn_scenes import cases

NAME = "exudyn"


def _engine() -> Any:
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]  # its switch to the build without range checks
        with common.silence():
            import exudyn
    import exudyn

    exudyn.config.printToConsole = False
    return exudyn


def version() -> str:
    """The engine's version."""
    return str(_engine().__version__)


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the scene is not known."""
    return list(cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    case = cases(scene)[setting]()
    with common.silence(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Exudyn's own notices of renamed parameters
        return _run(case, repeats)


def _run(case: Case, repeats: int) -> Outcome:
    exu = _engine()
    options = _options(exu, case)
    implicit = case.solver.implicit
    kind = exu.MainSolverImplicitSecondOrder if implicit else exu.MainSolverExplicit

    def once() -> tuple[float, Any]:
        # a system of its own each time: GeneralContact remembers the run before
        container = exu.SystemContainer()
        system = container.AddSystem()
        nodes = case.build(exu, system)
        store = _Steps(system, case) if case.many else _Sensors(exu, system, nodes)
        system.Assemble()
        solver = kind()
        solver.InitializeSolver(system, options)
        start = time.perf_counter()
        store.start = start
        solver.SolveSteps(system, options)
        wall = time.perf_counter() - start
        solver.FinalizeSolver(system, options)
        if case.rows is not None:
            rows = case.rows(*_coordinates(store, case))
        else:
            rows = _rows(*store.coordinates(len(nodes)), _places(exu, system, nodes))
        return wall, (rows, solver.it.currentStepIndex - 1)  # it counts from 1

    wall, (rows, steps) = common.measure(once, repeats)
    if case.solver.tol and case.grid and case.rows is None:
        rows = _on_grid(rows, case)
    extra = {"steps": float(steps)}
    if case.many:
        extra |= common.s7_measures(rows.position)
    return common.outcome(wall, rows, case.note, case.end_time, extra)


def _places(exu: Any, system: Any, nodes: list[Any]) -> np.ndarray:
    """Places of the nodes in the reference configuration (m), from which coordinates count."""
    position, reference = exu.OutputVariableType.Position, exu.ConfigurationType.Reference
    return np.array([system.GetNodeOutput(node, position, reference) for node in nodes])


def _coordinates(store: Any, case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and all coordinates and their rates, at multiples of the sample time."""
    at_steps, x, v = store.all_coordinates()
    if not case.solver.tol:
        return at_steps, x, v
    at = np.arange(round(case.end_time / case.sample) + 1) * case.sample
    return at, *common.through_four(at_steps, x, v, at)


def _options(exu: Any, case: Case) -> Any:
    options, solver = exu.SimulationSettings(), case.solver
    options.solution.file.write = False
    # a hair less than the sample time: the sum of the steps may fall short of it
    options.solution.sensors.writePeriod = 1e-12 if solver.tol else case.sample * (1 - 1e-9)
    steps = options.timeIntegration
    steps.solverType = getattr(exu.DynamicSolverType, solver.name)
    steps.endTime = case.end_time
    steps.numberOfSteps = round(case.end_time / solver.step)
    steps.automaticStepSize = solver.tol > 0
    if solver.tol:
        steps.relativeTolerance = steps.absoluteTolerance = solver.tol
        steps.initialStepSize = min(1e-4, solver.step)
        steps.minimumStepSize = 1e-13
    steps.verboseMode = 0
    if solver.name == "TrapezoidalIndex2":  # as Exudyn's own SolveDynamic sets it
        steps.generalizedAlpha.useIndex2Constraints = steps.generalizedAlpha.useNewmark = True
    steps.newton.modifiedNewtonJacUpdatePerStep = solver.fresh
    steps.generalizedAlpha.spectralRadius = solver.rho
    steps.explicit.computeEndOfStepAccelerations = False
    if case.many:
        steps.explicit.computeMassMatrixInversePerBody = True
        options.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    return options


# ---------------------------------------------------------------------------------------------
# Rows


class _Sensors:
    """Two internal sensors a body: the node's coordinates and their rates."""

    def __init__(self, exu: Any, system: Any, nodes: list[Any]) -> None:
        from exudyn.itemInterface import SensorNode

        kinds = (exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t)
        self.start = 0.0  # s, of the clock
        self._system = system
        self._sensors = [
            [
                system.AddSensor(
                    SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
                )
                for kind in kinds
            ]
            for node in nodes
        ]

    def coordinates(self, bodies: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, bodies, 3 or 6)."""
        stored = [[self._system.GetSensorStoredData(s) for s in pair] for pair in self._sensors]
        x = np.stack([pair[0][:, 1:] for pair in stored], axis=1)
        v = np.stack([pair[1][:, 1:] for pair in stored], axis=1)
        return stored[0][0][:, 0], x, v

    def all_coordinates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, all) of nodes of any size."""
        stored = [[self._system.GetSensorStoredData(s) for s in pair] for pair in self._sensors]
        x, v = (np.hstack([pair[k][:, 1:] for pair in stored]) for k in range(2))
        return stored[0][0][:, 0], x, v


class _Steps:
    """Rows of many bodies at once, copied by a function that runs after every step."""

    def __init__(self, system: Any, case: Case) -> None:
        self.start = 0.0  # s, of the clock
        self._times = [-case.sample]
        self._x: list[np.ndarray] = []
        self._v: list[np.ndarray] = []
        every = case.sample - case.solver.step / 2
        data = system.systemData

        def after_step(_: Any, t: float) -> bool:
            if t - self._times[-1] < every:
                return True
            self._times.append(t)
            self._x.append(np.array(data.GetODE2Coordinates()))
            self._v.append(np.array(data.GetODE2Coordinates_t()))
            # stops at a row only, so that wall time and reached time belong together
            return time.perf_counter() - self.start < common.WALL_CAP

        system.SetPostStepUserFunction(after_step)
        self._data = data

    def coordinates(self, bodies: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, bodies, 6)."""
        shape = (len(self._x), bodies, 6)
        return np.array(self._times[1:]), np.reshape(self._x, shape), np.reshape(self._v, shape)


def _rows(time: np.ndarray, x: np.ndarray, v: np.ndarray, places: np.ndarray) -> common.Rows:
    """Rows of point nodes (3) or rigid nodes (and a rotation vector; spin in body axes)."""
    shape = x.shape[:2]
    if x.shape[2] == 3:
        quaternion = np.zeros((*shape, 4))
        quaternion[..., 0] = 1.0
        return common.Rows(time, x + places, quaternion, v, np.zeros((*shape, 3)))
    quaternion = common.quaternion_of(x[..., 3:])
    spin = common.rotate(quaternion, v[..., 3:])
    return common.Rows(time, x[..., :3] + places, quaternion, v[..., :3], spin)


def _on_grid(rows: common.Rows, case: Case) -> common.Rows:
    """Bodies that do not turn, at multiples of the sample time instead of at the steps."""
    at = np.arange(round(case.end_time / case.sample) + 1) * case.sample
    position = np.empty((len(at), *rows.position.shape[1:]))
    velocity = np.empty_like(position)
    for body, axis in np.ndindex(*position.shape[1:]):
        x, v = rows.position[:, body, axis], rows.velocity[:, body, axis]
        position[:, body, axis] = common.hermite(rows.time, x, v, at)
        velocity[:, body, axis] = np.interp(at, rows.time, v)
    bodies = position.shape[1]
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(at), bodies, 1))
    return common.Rows(at, position, upright, velocity, np.zeros_like(velocity))
