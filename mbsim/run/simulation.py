"""The main loop: read this first, then `dynamics/pipeline/evaluate.py`.

A model becomes a `System`, the system a `Problem`; compiled code advances it and comes back
to Python only with rows to keep, after a bounded number of evaluations, or to say why not.
"""

from __future__ import annotations

import ctypes
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim import __version__
from mbsim.errors import Interrupted, ModelError
from mbsim.model.elements import Model
from mbsim.run.divergence import Pace
from mbsim.run.failures import fail, give_up
from mbsim.run.settings import Settings, Stage, output_times, settle

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.compile_model.changes import Parameters
    from mbsim.compile_model.timetable import Timetable
    from mbsim.results.audit import Audit
    from mbsim.results.reading import Results
    from mbsim.run.dumping import ContactProblems

#: Compiled code comes back for progress and Ctrl-C about this often [s]; it counts evaluations,
#: which cost from 0.2 us to whatever a user's function takes, so the count is adapted.
RETURN_SECONDS = 0.1
FIRST_BUDGET = 200


def next_budget(budget: int, done: int, elapsed: float) -> int:
    """Return for how many evaluations to call next, after one that did so many in `elapsed` [s].

    At most four times as many as before: the first calls also compile or load code.
    """
    wanted = RETURN_SECONDS * done / max(elapsed, 1e-9)
    return int(min(max(wanted, 1.0), 4.0 * budget))


Progress = Callable[[float, float, float], None]
Notify = Callable[[str], None]


class Active(NamedTuple):
    """The equations in use, which a resumed run needs as they were."""

    active: Any
    skyline: Any
    quality: Any
    size: Any
    kept_at: Any
    kept_a: Any
    kept_power: Any
    released: Any


class Runner:
    """One run: a system, its integrator, its recorder."""

    def __init__(
        self,
        system: System,
        settings: Settings,
        recorder: Any,
        log: Any,
        tell: Notify,
        changes: list[Parameters] | None = None,
    ) -> None:
        from mbsim.arrays.scene import AUDIT_TOL
        from mbsim.compile_model.timetable import follows_time
        from mbsim.core import jit
        from mbsim.integrators import driver, scheme
        from mbsim.run.methods import Methods
        from mbsim.run.sensing import Sensing

        self.system, self.settings, self.recorder, self.log = system, settings, recorder, log
        self.tell = tell
        self.detector = self._make_detector()
        system.scene.audit.plan[AUDIT_TOL] = settings.tol
        start = settings.stages[0].simulation.start_time
        self.methods = Methods(system, settings.integrator, start, follows_time(system.scene))
        self.timetable: Timetable
        self.method, self.problem = self.methods.arrays, self.methods.problem
        self.method.counts[scheme.NEXT_WATCH] = 0
        self._advance = jit.function(driver.advance)
        pointer = ctypes.c_void_p
        self._hook = ctypes.CFUNCTYPE(
            ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
        )
        self.changes = changes or []  # parameters of every Simulate, where some differ
        self.stage = 0  # which Simulate
        self.pace = Pace(start, start)  # of that one
        self.sensing = Sensing(system, self.method, log, tell)
        self.loop_seconds = 0.0
        self.interrupted = False
        self.dump: ContactProblems | None = None

    def _make_detector(self) -> Any:
        """Put FCL behind its hook where a pair may need it."""
        if not self.system.needs_fcl:
            return None
        from mbsim.arrays.hooks import Hook
        from mbsim.geometry.fcl_detector import FclDetector

        graphics = [self.system.model.graphics[g] for g in self.system.graphic_ids]
        detector = FclDetector(self.system.scene, graphics)
        self.system.scene.world.hooks[Hook.FCL] = detector.address
        return detector

    def call(self, hook: int, t: float, h: float, a: Any, b: Any) -> int:
        """Call one of the problem's hooks that act or answer from Python."""
        return int(self._hook(hook)(self.problem.context, t, h, a.ctypes.data, b.ctypes.data))

    def must(self, hook: int, t: float, a: Any, b: Any) -> int:
        """Call one of the problem's hooks from Python; raise what it says where it fails."""
        answer = self.call(hook, t, 0.0, a, b)
        acts = hook not in (self.problem.commit, self.problem.output, self.problem.arrive)
        self._look_at(answer if acts else min(answer, 0), t)
        return answer

    def _look_at(self, code: int, t: float) -> None:
        """Raise what a hook's code says, or its answer that is less a code."""
        if code != 0:
            fail(self.system, self.detector, abs(code), t)

    def assemble(self) -> None:
        """Put the bodies where all constraints hold, and report what had to move."""
        scene = self.system.scene
        if len(scene.tree.body) == 0:
            return
        from mbsim.dynamics.initial.assembly import (
            ContradictionError,
            assemble,
            contradiction,
            describe,
        )

        t = self.settings.stages[0].simulation.start_time
        serve = self._joints(t)

        try:
            self.assembly = assemble(scene, self.method.y, serve, self.system.given_velocities())
        except ContradictionError as error:
            raise ModelError(contradiction(self.system, error)) from None
        lines, warnings = describe(self.system, self.assembly)
        for line in (*lines, *warnings):
            self.log.line(line)
        for line in warnings:
            self.tell(line)

    def _change(self) -> None:
        """Let the elements be as the commands before this stage leave them, and say so once."""
        if not self.changes:
            return
        from mbsim.compile_model.changes import apply

        apply(self.system.scene, self.changes[self.stage])
        if self.system.reader is not None:
            self.system.reader.open(self.system.scene)
        before = self.settings.stages[self.stage - 1].simulation.changes if self.stage else ()
        simulation = self.settings.stages[self.stage].simulation
        for change in simulation.changes[len(before) :]:
            self.log.line(f"from time {simulation.start_time:.9g} on {change.text}")

    def _keeps_end(self) -> bool:
        """Return whether the row at the end is this stage's: the last's, or one rest of several."""
        rest = [stage.is_static for stage in self.settings.stages[self.stage : self.stage + 2]]
        return len(rest) == 1 or all(rest)

    def _interrupts(self, stage: int) -> bool:
        """Return whether motions may not go on as they were: after a rest, and when changed.

        A model is assembled as it is written, before what changes it ahead of its first Simulate.
        """
        before = self.settings.stages[max(0, stage - 1) : stage]
        known = sum(len(one.simulation.changes) for one in before)
        fresh = self.settings.stages[stage].simulation.changes[known:]
        rested = any(one.is_static for one in before)
        return rested or any(c.table in ("motions", "variables") for c in fresh)

    def _joints(self, t: float) -> Any:
        """Return what asks joints at time t, None where there are no joints."""
        scene = self.system.scene
        if len(scene.tree.body) == 0:
            return None

        def serve(what: int, y: Any) -> None:
            self._ask_joints(what, t, y, y)

        return serve

    def _ask_joints(self, what: int, t: float, y: Any, dy: Any) -> None:
        """Ask joints for something."""
        from mbsim.arrays.hooks import Hook

        pointer = ctypes.c_void_p
        hook = ctypes.CFUNCTYPE(
            ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, pointer, pointer
        )(int(self.system.scene.world.hooks[Hook.JOINTS]))
        code = hook(self.problem.context, what, t, y.ctypes.data, dy.ctypes.data)
        self._look_at(code, t)

    def dump_every(self, every: int, resumed: bool) -> None:
        """Write the contact problem of every so many steps from here on."""
        from mbsim.arrays.hooks import Joints
        from mbsim.integrators import scheme
        from mbsim.run.dumping import ContactProblems

        folder = self.recorder.directory
        if folder is None:
            raise ModelError("dump_fclib needs an output folder")
        idle = np.zeros(len(self.method.y))

        def evaluate(t: float, y: Any) -> float:
            return self.call(self.problem.rhs, t, 0.0, y, idle)

        def accelerate(t: float, y: Any, dy: Any) -> None:
            self._ask_joints(Joints.ACCELERATE, t, y, dy)

        self.dump = ContactProblems(
            self.system, every, folder / "fclib", evaluate, accelerate, resumed
        )
        self.dump.next += int(self.method.counts[scheme.STEPS]) // every * every

    def _dump(self) -> None:
        """Write the contact problem of the step taken last, where its turn has come."""
        from mbsim.integrators import scheme

        memory = self.method.memory
        t, h = float(memory[scheme.TIME]), float(memory[scheme.LAST_STEP])
        if self.dump is not None:
            self.dump.watch(int(self.method.counts[scheme.STEPS]), t, h, self.method.y)

    def balance(self, stage: Stage) -> None:
        """Put the bodies into equilibrium."""
        from mbsim.dynamics.initial.equilibrium import Hooks
        from mbsim.run.statics import find

        t, problem, scene = stage.simulation.start_time, self.problem, self.system.scene
        hooks = Hooks(
            lambda y, f: self.call(problem.rhs, t, 0.0, y, f),
            lambda y: self.must(problem.project, t, y, y),
            lambda y, f: self.must(problem.commit, t, y, f),
            self._joints(t),
        )
        groups = (scene.state, scene.pairs, scene.crowds, scene.log, scene.rows)
        before = [[np.array(array) for array in group] for group in groups]

        def say(line: str) -> None:
            self.log.line(line)
            self.tell(line)

        # there are no steps here that could end where friction changes
        scene.state.frozen[0] = 0
        y = self.method.y.copy()
        find(self.system, y, t, hooks, stage.simulation.static, say)
        # turns are counted on the way; all else is as if the bodies had jumped
        turns = scene.state.angle.copy()
        for group, kept in zip(groups, before, strict=True):
            for array, old in zip(group, kept, strict=True):
                array[...] = old
        scene.state.angle[...] = turns
        self.method.y[...] = y
        for _ in range(2):
            # near pairs of crowds are listed first, then looked at
            self.must(problem.rhs, t, self.method.y, self.method.k[0])
            self.must(problem.commit, t, self.method.y, self.method.k[0])

    def assemble_again(self, t: float) -> None:
        """Give the bodies the velocities that motions ask for, after a stage that had none."""
        serve = self._joints(t)
        if serve is None:
            return
        from mbsim.dynamics.initial.assembly import ContradictionError, assemble, contradiction

        try:
            assemble(self.system.scene, self.method.y, serve, {})
        except ContradictionError as error:
            raise ModelError(contradiction(self.system, error)) from None

    def settle_contacts(self, allow_overlap: bool) -> None:
        """Begin with the incidents that exist at the start; refuse those that are too deep."""
        from mbsim.arrays.scene import LIVE, TOLERANCE

        t = self.settings.stages[0].simulation.start_time
        # what begins to stick or slip is told by it
        self.system.scene.world.scale[TOLERANCE] = self.settings.stages[0].tol
        y, f = self.method.y, self.method.k[0]
        self.must(self.problem.rhs, t, y, f)
        scene, model = self.system.scene, self.system.model
        if self.system.plans.crowds:
            # nothing is listed yet: list what is near, then look again
            self.must(self.problem.commit, t, y, f)
            self.must(self.problem.rhs, t, y, f)
        faults = []
        pairs = scene.pairs
        live = pairs.live[: pairs.count[LIVE]]
        slots = [s for pair in live for s in range(pairs.slot[pair], pairs.last[pair])]
        for s in slots:
            # those that are ignored for their depth overlap too
            depth = float(scene.work.points[s, 0])
            if not depth > 0.0:
                continue
            pair = int(scene.slots.pair[s])
            if scene.kinds.whole[pairs.kind[pair]] > 0.0 and s != pairs.slot[pair]:
                continue
            rows = (int(pairs.graphic_i[pair]), int(pairs.graphic_j[pair]))
            graphic_i, graphic_j = (self.system.graphic_ids[row] for row in rows)
            k = int(scene.kinds.contact[pairs.kind[pair]])
            contact = model.contacts[self.system.contact_ids[k]]
            name = f"Force_Contact[{contact.id}]"
            between = f"Post_Graphic[{graphic_i}] and Post_Graphic[{graphic_j}]"
            self.log.line(f"{name}: {between} overlap by {depth:.6g} at the start, slot {s}")
            # half of the smaller shape, across its thinnest side
            half = min(float(scene.graphics.half[row].min()) for row in rows)
            ignored = contact.ignore_penetration_larger_than
            limit = half if ignored is None else min(half, ignored)
            if depth > 0.1 * limit and s == pairs.slot[pair]:
                self.tell(f"{name}: {between} overlap by {depth:.6g} at the start")
            if depth > limit:
                faults.append(
                    f"{model.file}:{contact.source.line}: {name}: {between} overlap by {depth:.6g} "
                    f"at the start, more than {limit:.6g}; move them apart or give --allow-overlap"
                )
        if faults and not allow_overlap:
            raise ModelError("\n".join(dict.fromkeys(faults)))
        self.must(self.problem.commit, t, y, f)

    def _saved(self) -> dict[str, Any]:
        """Return all groups of arrays in which a run goes on."""
        scene = self.system.scene
        return {
            "state": scene.state,
            "pairs": scene.pairs,
            "crowds": scene.crowds,
            "equations": Active(
                scene.equations.active,
                scene.sweep.skyline,
                scene.sweep.quality,
                scene.sweep.size,
                scene.sweep.kept_at,
                scene.sweep.kept_a,
                scene.sweep.kept_power,
                scene.sweep.released,
            ),
            "log": scene.log,
            "audit": scene.audit,
            "method": self.method,
        }

    def checkpoint(self) -> dict[str, Any]:
        """Return everything a run needs to go on: state, log, method, and where it is."""
        groups = self._saved()
        arrays = {
            f"{name}/{field}": np.array(array)
            for name, group in groups.items()
            for field, array in zip(group._fields, group, strict=True)
        }
        arrays["stage"] = np.array(self.stage)
        arrays["time"] = np.array(self.method.memory[0])
        return arrays | self.methods.saved() | self.sensing.saved() | self.pace.saved()

    def restore(self, saved: dict[str, Any]) -> None:
        """Go back to a checkpoint."""
        groups = self._saved()
        for name, group in groups.items():
            for field, array in zip(group._fields, group, strict=True):
                array[...] = saved[f"{name}/{field}"]
        self.methods.restore(saved)
        self.stage = int(saved["stage"])
        self.sensing.restore(saved)
        self.pace = self._pace()
        self.pace.restore(saved)

    def _pace(self) -> Pace:
        """Return what looks whether the current Simulate gets anywhere."""
        simulation = self.settings.stages[self.stage].simulation
        return Pace(simulation.start_time, simulation.end_time)

    def run(self, progress: Progress | None, resumed: bool) -> None:
        """Run all Simulate statements from the current stage on."""
        first = self.stage
        for stage in range(first, len(self.settings.stages)):
            fresh = not (resumed and stage == first)
            self.stage = stage
            self._run_stage(self.settings.stages[stage], fresh, progress)
            if self.sensing.halted_by:
                return

    def _sense(self, end: float, start: bool = False) -> bool:
        """Do what sensors that became true ask for; return whether the Simulate goes on."""
        from mbsim.integrators import scheme
        from mbsim.run.sensing import GO_ON

        t, y, error = float(self.method.memory[scheme.TIME]), self.method.y, self.method.error
        last = self.stage == len(self.settings.stages) - 1
        follows, row = self.sensing.act(t, end, last)
        # the first row of a Simulate is there anyway
        if row and not start:
            self.must(self.problem.output, t, y, error)
            self.recorder.take()
        return follows == GO_ON

    def _begin_stage(self, stage: Stage) -> bool:
        """Begin one Simulate statement with its first row; return whether it goes on."""
        from mbsim.integrators import scheme

        method, simulation = self.method, stage.simulation
        if self.stage > 0:
            # a sensor may have ended the one before early
            now = float(method.memory[scheme.TIME])
            simulation = replace(simulation, start_time=now)
        self.sensing.begin(output_times(simulation, self._keeps_end()), stage.h_max)
        # the statement may have changed what acts: f and the step begin anew
        method.memory[scheme.HAVE_F] = 0.0
        method.memory[scheme.STEP] = 0.0
        method.memory[scheme.FIRST_MAX] = stage.h0_max
        method.memory[scheme.LAST_STEP] = 0.0
        method.counts[scheme.NEXT_OUTPUT] = 1
        t, goes_on = simulation.start_time, True
        if simulation.analysis_type == "STATIC":
            self.balance(stage)
            goes_on = False
        elif self._interrupts(self.stage):
            self.assemble_again(t)
        if (
            goes_on
            and self.problem.arrive
            and self.must(self.problem.arrive, t, method.y, method.error)
        ):
            goes_on = self._sense(simulation.end_time, start=True)
        if len(self.sensing.times):
            self.must(self.problem.output, t, method.y, method.error)
        self.recorder.take()
        return goes_on

    def _look_ahead(self, stage: Stage, fresh: bool) -> None:
        """Find out what of this Simulate follows from the time alone."""
        from mbsim.compile_model.timetable import Timetable
        from mbsim.integrators import scheme

        method, methods = self.method, self.methods
        schemes = [methods.explicit] + ([methods.other] if methods.other else [])
        samples = max(each.samples for each in schemes)
        estimates = methods.explicit.order > 0.0
        span = stage.simulation.end_time - stage.simulation.start_time
        self.timetable = Timetable(self.system, stage.tol, span, estimates, samples)
        if fresh:
            memory = method.memory
            memory[scheme.ROW_ENDS] = -np.inf if self.timetable.timed else np.inf
            memory[scheme.REACH] = np.inf
            method.counts[scheme.ROW] = len(method.timetable)

    def _run_stage(self, stage: Stage, fresh: bool, progress: Progress | None) -> None:
        """Run one Simulate statement."""
        from mbsim.arrays.scene import ANEW, AUDIT_TOL, AUDIT_UNTIL, TOLERANCE
        from mbsim.core import problem
        from mbsim.integrators import scheme

        method, scene, simulation = self.method, self.system.scene, stage.simulation
        # the last change so far holds; a resumed run may have missed an earlier one
        for passed in self.settings.stages[: self.stage + 1]:
            if passed.simulation.gravity is not None:
                pull = self.system.pull(passed.simulation.gravity)
                scene.world.gravity[:], scene.world.weight[0] = pull.constant, pull.program
        scene.world.scale[TOLERANCE] = stage.tol
        self._change()
        plan = scene.audit.plan
        plan[AUDIT_TOL], plan[AUDIT_UNTIL] = stage.tol, simulation.end_time
        budget = FIRST_BUDGET if self.dump is None else 1
        if fresh:
            self.pace = self._pace()
        if fresh or stage.is_static:
            if self.stage > 0:
                # the statement may have changed what acts
                scene.audit.tally[ANEW] = 1.0
            if not self._begin_stage(stage):
                return
        elif not self.system.model.sensors:
            last = self.stage == len(self.settings.stages) - 1
            self.sensing.begin(output_times(simulation, last), stage.h_max)
        self._look_ahead(stage, fresh)
        while True:
            began, before = time.perf_counter(), int(method.counts[scheme.EVALUATIONS])
            outcome = self._advance(
                self.methods.steps,
                simulation.end_time,
                stage.tol,
                min(self.sensing.h_max, self.timetable.longest),
                stage.h_min,
                self.sensing.times,
                budget,
            )
            elapsed = time.perf_counter() - began
            self.loop_seconds += elapsed
            done = int(method.counts[scheme.EVALUATIONS]) - before
            budget = next_budget(budget, done, elapsed)
            self.recorder.take()
            if self.dump is not None and outcome != problem.FAILED:
                # after every step
                budget = 1
                self._dump()
            if outcome == problem.DONE:
                return
            if outcome == problem.HAPPENED and not self._sense(simulation.end_time):
                return
            if outcome == problem.FAILED:
                fail(
                    self.system,
                    self.detector,
                    int(method.counts[scheme.CODE]),
                    method.memory[scheme.TIME],
                )
            now, steps = float(method.memory[scheme.TIME]), int(method.counts[scheme.STEPS])
            if outcome == problem.WATCH_DUE:
                self.pace.watch(self.system, method.y, now, steps)
            if outcome == problem.TABLE_OVER:
                now = float(method.memory[scheme.TIME])
                self.timetable.write(method.timetable, now, simulation.end_time)
                method.counts[scheme.ROW] = 0
            if outcome == problem.CHANGES_OVER:
                self.log.line(self.methods.change_over())
            if outcome == problem.STEP_TOO_SMALL and self.methods.retreat():
                self.log.line(
                    f"time {now:.9g}: the implicit step became too small: explicit from here on"
                )
            elif outcome == problem.STEP_TOO_SMALL:
                give_up(self.system, self.settings, self.method)
            if self.interrupted:
                raise Interrupted(f"interrupted at time {method.memory[scheme.TIME]:.6g}")
            if self.recorder.due():
                self.recorder.flush(self.checkpoint())
            if progress is not None:
                h = float(method.memory[scheme.STEP])
                progress(float(method.memory[scheme.TIME]), h, self.settings.end_time)

    def audit(self) -> Audit | None:
        """Return what the run found out about itself, None where it took no step."""
        from mbsim.integrators import scheme
        from mbsim.results.audit import audit_of

        memory = self.method.memory
        left, when = float(memory[scheme.LEFT_OVER]), float(memory[scheme.LEFT_TIME])
        return audit_of(self.system, left, when)

    def stats(self, wall: float, compiled: float) -> dict[str, float]:
        """Return the counters of the run."""
        from mbsim.arrays import scene as a
        from mbsim.integrators import scheme

        counts, memory = self.method.counts, self.method.memory
        counters = self.system.scene.log.counters
        halted = self.sensing.halted_by
        return {
            "steps": int(counts[scheme.STEPS]),
            "rejected": int(counts[scheme.REJECTED]),
            "rhs_evaluations": int(counts[scheme.EVALUATIONS]),
            "output_evaluations": int(counts[scheme.OUTPUTS]),
            "jacobians": int(counts[scheme.JACOBIANS]),
            "factorizations": int(counts[scheme.FACTORIZATIONS]),
            "method_changes": self.methods.changes,
            "narrowphase_pairs": int(counters[a.NARROWPHASE]),
            "skipped_pairs": int(counters[a.SKIPPED]),
            "pair_listings": int(counters[a.LISTINGS]),
            "fcl_calls": int(counters[a.FCL_CALLS]),
            "normal_calls": int(counters[a.NORMAL_CALLS]),
            "friction_calls": int(counters[a.FRICTION_CALLS]),
            "python_calls": int(counters[a.PYTHON_CALLS]),
            "h_smallest": float(memory[scheme.H_SMALLEST]),
            "h_largest": float(memory[scheme.H_LARGEST]),
            "loop_s": self.loop_seconds,
            "wall_s": wall,
            "compile_s": compiled,
            **({"halted_by_sensor": halted} if halted else {}),
        }


@contextmanager
def _stoppable(runner: Runner) -> Iterator[None]:
    """Let Ctrl-C ask the runner to stop at the next return from compiled code."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(number: int, frame: Any) -> None:
        runner.interrupted = True

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _parameters(system: System, settings: Settings) -> list[Parameters]:
    """Return the parameters of every stage where commands change elements, else nothing."""
    given = [stage.simulation.changes for stage in settings.stages]
    if not any(given):
        return []
    from mbsim.compile_model.changes import make_room, parameters

    stages = [parameters(system, changes) for changes in given]
    system.scene = make_room(system.scene, stages)
    return stages


def simulate(
    model: Model,
    *,
    end_time: float | None = None,
    print_interval: float | None = None,
    integrator: str | None = None,
    tol: float | None = None,
    plugins: Sequence[str | Path] = (),
    output: str | Path | None = None,
    resume: bool = False,
    detector: str = "auto",
    interpret_plugins: bool = False,
    allow_overlap: bool = False,
    dump_fclib: int | None = None,
    progress: Progress | None = None,
    notify: Notify | None = None,
) -> Results:
    """Run a model and return its results.

    Parameters
    ----------
    model : Model
        As `read_model` returns it.
    end_time, print_interval : float, optional
        Instead of the deck's [T]; of an Adams deck both are needed.
    integrator : str, optional
        A name of `integrators.catalog.METHODS`; default: the deck's, else "AUTO", DOPRI5 and RADAU5
        while the model is stiff.
    tol : float, optional
        Local error of a step, dimensionless (README, "Tolerance"); default: the deck's, else 1e-5,
        of Adams decks 1e-8.
    plugins : sequence of path
        Files with user subroutines.
    output : path, optional
        Folder for result files; None keeps results in memory.
    resume : bool
        Go on from the last checkpoint in `output`.
    detector : {"auto", "fcl"}
        "fcl" sends every pair through FCL.
    interpret_plugins, allow_overlap : bool
        Do not compile user subroutines; start although shapes overlap deeply.
    dump_fclib : int, optional
        Write the frictional contact problem of every so many steps into `output`/fclib.
    progress : callable, optional
        Called with time, step and end time [T] now and then.
    notify : callable, optional
        Called with lines for the user.

    Raises
    ------
    ModelError, SolverError, PluginError, ResultsError, Interrupted
        What was recorded up to there is kept.
    """
    from mbsim.compile_model.build import build
    from mbsim.core import jit
    from mbsim.results.log import RunLog
    from mbsim.results.recorder import Recorder

    began = time.perf_counter()
    settings = settle(model, end_time, print_interval, integrator, tol)
    tell = notify or (lambda line: None)
    jit.on_first_compile = lambda: tell(
        "compiling what this model needs (a quarter of a minute to one); later runs load it"
    )
    compiled_before = jit.compile_seconds
    files = [Path(file) for file in plugins]
    for file in files:
        if not file.is_file():
            raise ModelError(f"--plugin {file}: no such file")
    said: list[str] = []
    system = build(model, files, interpret_plugins, detector, said.append)
    for note in said:
        # what a script will probably fail at is for the terminal too
        if ": warning: " in note:
            tell(note)
    changes = _parameters(system, settings)
    for note in settings.notes:
        tell(note)
    for number, user in system.user_laws:
        how = f"{user.how}: {user.reason}" if user.reason else user.how
        tell(f"Force_Contact[{number}]: {user.name} of {user.source.name}, {how}")
    for post in system.posts:
        said.append(
            f"Force_Contact[{post.contact.id}]: {post.user.fnc_name} of "
            f"{post.source.name}, called at output times"
        )
        tell(said[-1])
    for user_subroutine in system.subroutines.values():
        statement, number = user_subroutine.element
        source = user_subroutine.source.name
        said.append(f"{statement}[{number}]: {user_subroutine.name} of {source}, interpreted")
        tell(said[-1])
    attributes: dict[str, str | float | int] = {
        "mbsim_version": __version__,
        "model_file": model.file,
        "model_sha256": model.sha256,
        "units": f"{model.units.force} {model.units.mass} {model.units.length} {model.units.time}",
        "integrator": settings.integrator,
        "tol": settings.tol,
        "tol_from": settings.tolerances,
        "end_time": settings.end_time,
        "print_interval": settings.stages[-1].simulation.print_interval,
        "detector": detector,
        # what `request` needs to make the same forces again
        "overrides": "\n".join(model.overrides),
        "plugins": "\n".join(map(str, files)),
        "interpret_plugins": int(interpret_plugins),
    }
    folder = None if output is None else Path(output)
    recorder = Recorder(system, attributes, folder, resume, settings)
    log = RunLog(system, attributes, recorder.directory, resume)
    for note in (*said, *settings.notes):
        log.line(note)
    if system.user_laws or system.subroutines or system.posts:
        from mbsim.plugins import host

        host.log = log.line
    status = "failed"
    runner = Runner(system, settings, recorder, log, tell, changes)
    try:
        with _stoppable(runner):
            if resume:
                runner.restore(recorder.checkpoint)
            else:
                runner.assemble()
                runner.settle_contacts(allow_overlap)
            if dump_fclib is not None:
                runner.dump_every(dump_fclib, resume)
            runner.run(progress, resume)
            recorder.end()
            if runner.dump is not None:
                tell(f"{runner.dump.written} contact problems in {runner.dump.folder}")
        status = "finished"
    except Interrupted as error:
        status = "interrupted"
        log.line(str(error))
        raise
    except Exception as error:
        log.line(f"{type(error).__name__}: {error}")
        raise
    finally:
        recorder.take()
        stats = runner.stats(time.perf_counter() - began, jit.compile_seconds - compiled_before)
        audit = runner.audit()
        for warning in audit.warnings if audit is not None else ():
            tell(f"warning: {warning}")
        try:
            if recorder.empty and recorder.directory is not None:
                # it ended before its first row: an earlier result in that folder stays
                recorder.abandon()
            else:
                if status != "finished":
                    recorder.flush(runner.checkpoint())
                results = recorder.close(status, stats, system.scene.log.contacts, audit)
        finally:
            log.close(status, stats, recorder.watch, audit)
            if any(user.language == "Octave" for _, user in system.user_laws):
                from mbsim.plugins.subroutine import end_run

                end_run()
    return results
