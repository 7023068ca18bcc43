"""The loop of a run: read this first, then `dynamics/pipeline/evaluate.py`.

A model has become a `System`, the system a `Problem`; compiled code advances it and comes back
to Python only with rows to keep, after a bounded number of evaluations, or to say why not.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core import profile
from mbsim.errors import Interrupted, ModelError
from mbsim.run import checkpoint, statistics
from mbsim.run.commands import Commands
from mbsim.run.divergence import Pace, next_budget
from mbsim.run.failures import fail, give_up
from mbsim.run.hook_calls import HookCalls, make_detector
from mbsim.run.linear_analysis import LinearAnalyses
from mbsim.run.options import Notify, Progress, TooMuchWork
from mbsim.run.settings import Settings, Stage, output_times

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.compile_model.changes import Parameters
    from mbsim.compile_model.timetable import Timetable
    from mbsim.results.audit import Audit
    from mbsim.run.dumping import ContactProblems
    from mbsim.sensitivity.setup import Sensitivities

#: Evaluations of the first call of compiled code, see `next_budget`.
FIRST_BUDGET = 200


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
        from mbsim.arrays.codes import AUDIT_TOL
        from mbsim.compile_model.timetable import follows_time
        from mbsim.core import jit
        from mbsim.integrators import scheme
        from mbsim.integrators.binding import advancing
        from mbsim.run.methods import Methods
        from mbsim.run.sensing import Sensing

        self.system, self.settings, self.recorder, self.log = system, settings, recorder, log
        self.tell = tell
        self.detector = make_detector(system)
        system.scene.audit.plan[AUDIT_TOL] = settings.tol
        start = settings.stages[0].simulation.start_time
        timed = follows_time(system.scene)
        self._advance, self.methods = jit.planned(
            lambda: (
                advancing(),
                Methods(system, settings.integrator, start, timed, settings.fixed, settings.tol),
            )
        )
        if profile.running is not None:
            self._advance = profile.running.loop(self._advance)
        self._warn_of_states()
        self.methods.tell(self.log.line)
        self.timetable: Timetable
        self.method, self.problem = self.methods.arrays, self.methods.problem
        self.hooks = HookCalls(system, self.problem, self.detector)
        self.method.counts[scheme.NEXT_WATCH] = 0
        self.commands = Commands(system, settings, changes or [])
        self.stage = 0  # which Simulate
        self.pace = Pace(start, start, 0.0)  # of that one
        self.sensing = Sensing(system, self.method, log, tell)
        self.loop_seconds = 0.0
        self.most_evaluations: int | None = None  # of a rerun that verifies
        self.interrupted = 0  # number of the signal that asks for an end
        self.storing = False  # nothing may be left half written
        self.torn = False  # a second signal came in the midst of something: no checkpoint of that
        self._begun = False  # whether the current Simulate has
        self._before: dict[str, Any] | None = None  # checkpoint to go on from while it begins
        self._first: dict[str, Any] | None = None  # that of the run's begin, while AUTO goes back
        self.dump: ContactProblems | None = None
        self.sensitivities: Sensitivities | None = None
        self.linear = LinearAnalyses(system.model)

    def _warn_of_states(self) -> None:
        """Say of subroutines with states that VERLET holds their friction back."""
        contacts = self.system.scene.contacts
        for id, numbers in zip(self.system.contact_ids, contacts.memory, strict=True):
            if numbers > 0 and self.settings.integrator == "VERLET":
                self.say(
                    f"Force_Contact[{id}]: VERLET holds friction back to a quarter of what would "
                    "stop the slip in a step: what its subroutine holds by states creeps"
                )

    def start(self, allow_overlap: bool) -> None:
        """Assemble the model and begin with the incidents that exist."""
        from mbsim.run.start import assemble_model, settle_contacts

        t, method, log = self._first_time(), self.method, self.log.line
        with profile.part("start"):
            if self.commands.activity is not None:
                self.commands.activity.apply(self.settings.stages[0].simulation.inactive)
            assemble_model(self.system, self.hooks, t, method.y, log, self.tell)
            given = method.y, method.k[0], allow_overlap, log, self.tell
            settle_contacts(self.system, self.hooks, self.settings, *given)

    def _first_time(self) -> float:
        """Return when the first Simulate begins."""
        return self.settings.stages[0].simulation.start_time

    def say(self, line: str) -> None:
        """Tell something in the log and to the user."""
        self.log.line(line)
        self.tell(line)

    def _keeps_end(self) -> bool:
        """Return whether the row at the end is this stage's: the last's, or one rest of several."""
        stages = self.settings.stages[self.stage : self.stage + 2]
        # one that follows and moves nothing has the same row at its begin
        return len(stages) == 1 or (not any(s.takes_time for s in stages) and stages[1].is_static)

    def dump_every(self, every: int, resumed: bool, hardest: int | None) -> None:
        """Write the contact problem of every so many steps from here on, or the hardest of them."""
        from mbsim.integrators import scheme
        from mbsim.run.dumping import ContactProblems, problems_of

        folder = self.recorder.directory
        if folder is None:
            raise ModelError("dump_fclib needs an output folder")
        self.dump = ContactProblems(
            self.system.model.name, every, folder / "fclib", problems_of(self), resumed, hardest
        )
        self.dump.next += int(self.method.counts[scheme.STEPS]) // every * every

    def _dump(self) -> None:
        """Write the contact problem of the step taken last, where its turn has come."""
        from mbsim.integrators import scheme

        memory = self.method.memory
        t, h = float(memory[scheme.TIME]), float(memory[scheme.LAST_STEP])
        if self.dump is not None:
            self.dump.watch(int(self.method.counts[scheme.STEPS]), t, h, self.method.y)

    def checkpoint(self) -> dict[str, Any]:
        """Return everything a run needs to go on: state, log, method, and where it is."""
        if self._before is not None:
            return self._before
        if self._first is not None:
            # a run that goes on from there decides as this one would have
            self._go_back()
        arrays = checkpoint.save(self.system.scene, self.method)
        arrays["stage"] = np.array(self.stage)
        arrays["begun"] = np.array(int(self._begun))
        arrays["time"] = np.array(self.method.memory[0])
        arrays |= self.methods.saved() | self.linear.saved()
        return arrays | self.sensing.saved() | self.pace.saved()

    def restore(self, saved: dict[str, Any]) -> None:
        """Go back to a checkpoint."""
        from mbsim.integrators import scheme

        checkpoint.restore(self.system.scene, self.method, saved)
        # what failed when the checkpoint was written is tried anew
        self.method.counts[scheme.CODE] = 0
        self.methods.restore(saved)
        self.stage, self._begun = int(saved["stage"]), bool(saved["begun"])
        self.sensing.restore(saved)
        self.linear.restore(saved)
        self.pace = self._pace()
        self.pace.restore(saved)

    @property
    def time(self) -> float:
        """Where the run is [T]."""
        from mbsim.integrators import scheme

        return float(self.method.memory[scheme.TIME])

    def _pace(self) -> Pace:
        """Return what looks whether the current Simulate gets anywhere."""
        simulation = self.settings.stages[self.stage].simulation
        return Pace(simulation.start_time, simulation.end_time, simulation.print_interval)

    def run(self, progress: Progress | None, resumed: bool) -> None:
        """Run all Simulate statements from the current stage on."""
        first = self.stage
        for stage in range(first, len(self.settings.stages)):
            fresh = not (resumed and stage == first and self._begun)
            self.stage, self._begun = stage, not fresh
            self._stop_if_asked()
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
            self.hooks.must(self.problem.output, t, y, error)
            self._take()
        return follows == GO_ON

    @contextmanager
    def _undisturbed(self) -> Iterator[None]:
        """Let signals wait while something is written."""
        self.storing = True
        try:
            with profile.part("storing"):
                yield
        finally:
            self.storing = False

    def _take(self) -> None:
        """Let the recorder have the rows that there are."""
        with self._undisturbed():
            if self.sensitivities is not None:
                self.sensitivities.take()
            self.recorder.take()

    def ask_to_stop(self, number: int) -> None:
        """Do what a signal asks for: the first ends the run in order, a second one at once."""
        if not self.interrupted:
            self.interrupted = number
        elif not self.storing:
            self.torn = True
            raise KeyboardInterrupt

    def stopped(self) -> Interrupted:
        """Return what says that a signal ended the run, and when."""
        where = ", in the midst of a step" if self.torn else ""
        line = f"interrupted at time {self.time:.6g}{where}"
        return Interrupted(line, self.interrupted or signal.SIGINT)

    def _stop_if_asked(self) -> None:
        """Raise `Interrupted` where a signal has asked for it."""
        if self.interrupted:
            raise self.stopped()
        if self.most_evaluations is not None:
            from mbsim.integrators import scheme

            if self.method.counts[scheme.EVALUATIONS] > self.most_evaluations:
                raise TooMuchWork(f"more than {self.most_evaluations} evaluations")

    def _allowed(self, budget: int) -> int:
        """Return for how many evaluations to call: one more than the run may have is too many."""
        if self.most_evaluations is None:
            return budget
        from mbsim.integrators import scheme

        left = self.most_evaluations - int(self.method.counts[scheme.EVALUATIONS])
        return max(1, min(budget, left + 1))

    def _begin_stage(self, stage: Stage) -> bool:
        """Begin one Simulate statement with its first row; return whether it goes on."""
        from mbsim.integrators import scheme
        from mbsim.run.start import check_kinematic, limit_first

        method, simulation = self.method, stage.simulation
        if self.stage > 0:
            # a sensor may have ended the one before early
            if simulation.later:
                method.memory[scheme.TIME] = simulation.start_time
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
        if self.commands.interrupts(self.stage):
            self.commands.assemble(self.stage, self.hooks, t, method.y, self.log.line, self.say)
        if simulation.analysis_type == "KINEMATIC":
            check_kinematic(self.system, simulation)
        if stage.is_static:
            from mbsim.run.statics import balance_bodies

            balance_bodies(self.system, self.hooks, simulation, method.y, method.k[0], self.say)
        if stage.is_linear:
            rested = self.commands.rested(self.stage)
            self.linear.analyse(self, simulation.linear, rested, self.say)
        goes_on = stage.takes_time
        if goes_on and self.methods.explicit.order > 0.0:
            limit_first(self.system, self.hooks, t, method, self.say)
        if (
            goes_on
            and self.problem.arrive
            and self.hooks.must(self.problem.arrive, t, method.y, method.error)
        ):
            goes_on = self._sense(simulation.end_time, start=True)
        if len(self.sensing.times):
            self.hooks.must(self.problem.output, t, method.y, method.error)
        self._take()
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
        self.timetable = Timetable(self.system, stage.tol, span, estimates, samples, stage.h_min)
        if fresh:
            memory = method.memory
            memory[scheme.ROW_ENDS] = -np.inf if self.timetable.timed else np.inf
            memory[scheme.HORIZON] = np.inf
            method.counts[scheme.ROW] = len(method.timetable)

    def _enter_stage(self, stage: Stage, fresh: bool) -> bool:
        """Let one Simulate statement hold, and begin it where it is `fresh`.

        Returns
        -------
        bool
            Whether there is anything to integrate.
        """
        from mbsim.arrays.codes import ANEW, AUDIT_TOL, AUDIT_UNTIL, TOLERANCE
        from mbsim.integrators.scheme import RUN_END

        scene, simulation = self.system.scene, stage.simulation
        # the last change so far holds; a resumed run may have missed an earlier one
        for passed in self.settings.stages[: self.stage + 1]:
            if passed.simulation.gravity is not None:
                pull = self.system.pull(passed.simulation.gravity)
                scene.world.gravity[:], scene.world.weight[0] = pull.constant, pull.program
        scene.world.scale[TOLERANCE] = stage.tol
        self.method.memory[RUN_END] = simulation.end_time
        self.commands.apply(self.stage, fresh, self.methods, self.log.line)
        plan = scene.audit.plan
        plan[AUDIT_TOL], plan[AUDIT_UNTIL] = stage.tol, simulation.end_time
        if fresh:
            self.pace = self._pace()
        if fresh or not stage.takes_time:
            if self.stage > 0:
                self._before = self.checkpoint()
                # the statement may have changed what acts
                scene.audit.tally[ANEW] = 1.0
            goes_on = self._begin_stage(stage)
            self._begun, self._before = True, None
            if not goes_on:
                return False
        elif not self.system.model.sensors:
            last = self.stage == len(self.settings.stages) - 1
            self.sensing.begin(output_times(simulation, last), stage.h_max)
        self._look_ahead(stage, fresh)
        return True

    def _run_stage(self, stage: Stage, fresh: bool, progress: Progress | None) -> None:
        """Run one Simulate statement."""
        from mbsim.core import problem
        from mbsim.integrators import scheme

        method, simulation = self.method, stage.simulation
        budget, flushes = FIRST_BUDGET if self.dump is None else 1, self.recorder.flushes
        if not self._enter_stage(stage, fresh):
            return
        # a resumed run stands there too, where the one before it had not gone on for good
        if self.stage == 0 and not method.counts[scheme.STEPS] and self.methods.may_begin_anew:
            self._first = self.checkpoint()
            self.recorder.mark()
            if self.sensitivities is not None:
                self.sensitivities.mark()
        while True:
            began, before = time.perf_counter(), int(method.counts[scheme.EVALUATIONS])
            outcome = self._advance(
                self.methods.steps,
                simulation.end_time,
                stage.tol,
                min(self.sensing.h_max, self.timetable.longest),
                stage.h_min,
                self.sensing.times,
                self._allowed(budget),
            )
            elapsed = time.perf_counter() - began
            self.loop_seconds += elapsed
            done = int(method.counts[scheme.EVALUATIONS]) - before
            budget = next_budget(budget, done, elapsed)
            self._settle(outcome)
            self._take()
            if self.dump is not None and outcome != problem.FAILED:
                # after every step
                budget = 1
                with self._undisturbed():
                    self._dump()
            if outcome == problem.DONE:
                return
            if outcome == problem.HAPPENED and not self._sense(simulation.end_time):
                return
            self._answer(outcome, simulation.end_time)
            self._stop_if_asked()
            if self._first is None and self.recorder.due():
                with self._undisturbed():
                    self.recorder.flush(self.checkpoint(), beside=True)
            if self.recorder.flushes > flushes:
                flushes = self.recorder.flushes
                self.log.show()
            if progress is not None:
                h = float(method.memory[scheme.STEP])
                progress(float(method.memory[scheme.TIME]), h, self.settings.end_time)

    def _settle(self, outcome: int) -> None:
        """Let the begin be as it was, once AUTO does not go back there any more."""
        from mbsim.core import problem

        may_go_back = outcome in (
            problem.PAUSED,
            problem.WATCH_DUE,
            problem.TABLE_OVER,
            problem.ROWS_FULL,
            problem.CHANGES_OVER,
        )
        if outcome == problem.CHANGES_OVER and not self.methods.is_since_begin:
            may_go_back = False
        if self._first is not None and not (may_go_back and self.methods.may_begin_anew):
            self._first = None
            self.recorder.settle()

    def _go_back(self) -> None:
        """Go back to the begin of the run."""
        assert self._first is not None
        first, self._first = self._first, None
        self.restore(first)
        self.recorder.go_back()
        if self.sensitivities is not None:
            self.sensitivities.go_back()
        if self.dump is not None:
            self.dump.begin_anew()

    def _answer(self, outcome: int, end: float) -> None:
        """Do what a return from compiled code asks for, or raise why the run cannot go on."""
        from mbsim.core import problem
        from mbsim.integrators import scheme

        memory, counts = self.method.memory, self.method.counts
        if outcome == problem.FAILED:
            fail(
                self.system,
                self.detector,
                int(counts[scheme.CODE]),
                memory[scheme.TIME],
            )
        now, steps = float(memory[scheme.TIME]), int(counts[scheme.STEPS])
        if outcome == problem.WATCH_DUE:
            self.pace.watch(self.system, self.method.y, now, steps, self.sensing.h_max)
        if outcome == problem.TABLE_OVER:
            self.timetable.write(self.method.timetable, now, end)
            counts[scheme.ROW] = 0
        if outcome == problem.CHANGES_OVER and self._first is not None:
            self.log.line(self.methods.begin_anew(self._go_back))
        elif outcome == problem.CHANGES_OVER:
            self.log.line(self.methods.change_over())
        jumped = outcome == problem.STEP_TOO_SMALL and counts[scheme.LAST_REASON] == problem.BY_JUMP
        if outcome == problem.STEP_TOO_SMALL and not jumped and self.methods.retreat():
            self.log.line(
                f"time {now:.9g}: the implicit step became too small: explicit from here on"
            )
        elif outcome == problem.STEP_TOO_SMALL:
            give_up(self.system, self.settings, self.method)

    def audit(self) -> Audit | None:
        """Return what the run found out about itself, None where it took no step."""
        from mbsim.integrators import scheme
        from mbsim.results.audit import audit_of

        memory = self.method.memory
        left, when = float(memory[scheme.LEFT_OVER]), float(memory[scheme.LEFT_TIME])
        return audit_of(self.system, left, when)

    def stats(self, wall: float, compiled: float) -> dict[str, float]:
        """Return the counters of the run; seconds in all, and of these for compiling."""
        found = statistics.counters(self.system.scene, self.methods)
        halted = self.sensing.halted_by
        seconds = {"loop_s": self.loop_seconds, "wall_s": wall, "compile_s": compiled}
        return {**found, **seconds, **({"halted_by_sensor": halted} if halted else {})}
