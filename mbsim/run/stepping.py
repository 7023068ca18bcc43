"""`mbsim.open`: a model that its caller moves on step by step, and looks into between steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import ANEW, USED_EVENTS, USED_INCIDENTS, USED_ROWS
from mbsim.core import problem
from mbsim.errors import ModelError
from mbsim.integrators import scheme
from mbsim.results.identity import KINDS, Identity
from mbsim.run.history import Chain, History
from mbsim.run.inputs import Inputs, with_inputs
from mbsim.run.loop import FIRST_BUDGET, Runner
from mbsim.run.options import Notify
from mbsim.run.preparing import begin_log, prepare
from mbsim.run.settings import Settings, settle
from mbsim.run.signals_now import SignalsNow
from mbsim.run.simulation import end_users

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.compile_model.changes import Parameters
    from mbsim.model.elements import Model
    from mbsim.results.linear import LinearModel
    from mbsim.results.reading import Results

#: Part of a time by which one behind the end is taken for the end: sums of steps round.
_ROUNDED = 1e-9


@dataclass(frozen=True, eq=False)
class State:
    """Where a run is, whole: bodies, contacts, memory of friction, what the method keeps, inputs.

    A run put back to it goes on bit by bit as it did, as far as users' code keeps nothing of
    its own. It belongs to the model and the settings that it was taken from.
    """

    time: float
    inputs: tuple[float, ...]
    arrays: Mapping[str, Any] = field(repr=False)
    halted_by: int = field(repr=False)
    rows: Chain | None = field(repr=False)
    made_of: Any = field(repr=False)  # of `results.identity`: the model, how it is run

    def copy(self) -> State:
        """Return a state with arrays of its own."""
        arrays = {name: np.array(array) for name, array in self.arrays.items()}
        return State(self.time, self.inputs, arrays, self.halted_by, self.rows, self.made_of)


class Stepper(Runner):
    """A run in the hands of its caller.

    Attributes
    ----------
    inputs : mapping
        Variables and motions by label or path; what is set holds from the present time on.
    signals : mapping
        Any signal of a result file, now: ``signals["bodies/2/position"]``.
    """

    def __init__(
        self,
        system: System,
        settings: Settings,
        history: History,
        log: Any,
        tell: Notify,
        changes: list[Parameters],
        names: Mapping[str, int],
    ) -> None:
        super().__init__(system, settings, history, log, tell, changes)
        self._history = history
        self._memory = self.method.memory
        self._identity = Identity(system, settings)
        self._fresh = True  # whether no row holds the present time
        self._budget, self._closed, self._failed = FIRST_BUDGET, False, False
        self._at = np.zeros(len(self.method.y))
        self._write = self.hooks.writer(self._at, self.method.error)
        # numbers are read sooner from a view than from an array
        self._used = system.scene.rows.used.data
        self._numbers = self._memory.data
        self.inputs = Inputs(system.model, system.scene, names, self._input_changed)
        self.moving_inputs = self._moving_inputs()
        self.signals = SignalsNow(system, lambda: self.time, self.method.y, self._row_now)

    # -- what a caller does ---------------------------------------------------------------------

    def step(self, dt: float) -> float:
        """Go on by a time [T], at most to the end; return the time reached.

        A sensor may have ended it early. Steps whose sum is the end but for rounding end there.
        """
        now, end = self._numbers[scheme.TIME], self.settings.end_time
        t = now + float(dt)
        return self.step_to(end if now < end < t + _ROUNDED * dt else t)

    def step_to(self, t: float) -> float:
        """Go on to a time [T]; return the time reached, which a sensor may have ended early.

        Raises
        ------
        ModelError
            If that is behind the present time or after the end, or the run is over.
        SolverError, PluginError
            As `simulate` raises them; a `state` from before can be gone back to.
        """
        t, now = float(t), self._numbers[scheme.TIME]
        if not t > now or self._closed or self._failed or self.sensing.halted_by:
            return self._no_step(t, now)
        t = self._within(t)
        self._fresh = True
        while True:
            stage = self.settings.stages[self.stage]
            end = stage.simulation.end_time
            outcome = self._advance(
                self.methods.steps,
                min(t, end),
                stage.tol,
                min(self.sensing.h_max, self.timetable.longest),
                stage.h_min,
                self.sensing.times,
                self._budget,
            )
            if outcome == problem.DONE:
                if t < end or t == end < self.settings.end_time:
                    return t
                # at the end of all there may be a rest to be found yet
                if not self._next_stage():
                    return self.time
            elif not self._act(outcome, end):
                return self.time

    @property
    def state(self) -> State:
        """Where the run is: to be kept, and set later to go back there."""
        self._open()
        self._history.take()
        arrays, halted = self.checkpoint(), self.sensing.halted_by
        values, rows = self.inputs.values_now, self._history.chain
        return State(self.time, values, arrays, halted, rows, self._identity.packed)

    @state.setter
    def state(self, state: State) -> None:
        self._open()
        self._check_own(state)
        before = self.stage
        self.system.scene.rows.used[:] = 0
        if int(state.arrays["stage"]) != before:
            self.stage, self._begun = int(state.arrays["stage"]), True
            self._enter_stage(self.settings.stages[self.stage], fresh=False)
            self.inputs.look_at(self.system.scene)
        for row, value in enumerate(state.inputs):
            self.inputs.put(row, value)
        if self.inputs.timed:
            self._look_ahead(self.settings.stages[self.stage], fresh=False)
        self.restore(dict(state.arrays))
        self.sensing.halted_by, self._history.chain = state.halted_by, state.rows
        self._fresh, self._failed = True, False

    def results(self, output: str | Path | None = None) -> Results:
        """Return the rows so far, at the deck's output times; in a folder also as files."""
        self._open()
        status = "finished" if self.finished else "running"
        folder = None if output is None else Path(output)
        found = self._history.results(folder, status, self.stats(0.0, 0.0), self.audit())
        return self.linear.kept(found)

    def linearize(
        self, outputs: str | Sequence[str] = (), inputs: str | Sequence[str] | None = None
    ) -> LinearModel:
        """Return the model linearised where it is, see `run.linear_model`.

        Parameters
        ----------
        outputs : str or sequence of str
            Signals, ``requests/1/F2``: rows of C and D.
        inputs : str or sequence of str, optional
            Columns of B and D; default: all inputs.
        """
        from mbsim.run.linear_model import linearize

        self._open()
        return linearize(
            self, _several(outputs), _several(self.inputs if inputs is None else inputs)
        )

    @property
    def end_time(self) -> float:
        """Where the run ends [T]."""
        return self.settings.end_time

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to step over."""
        return bool(self.sensing.halted_by) or self.time >= self.end_time

    def close(self) -> None:
        """Let go of the run; results that were made of it stay."""
        if self._closed:
            return
        self._closed = True
        self._history.take()
        self._history.end()
        end_users(self.system)

    def __enter__(self) -> Stepper:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        file = self.system.model.file
        return f"<Stepper {file}, time {self.time:.9g} of {self.end_time:.9g}>"

    # -- how -------------------------------------------------------------------------------------

    def begin(self, allow_overlap: bool) -> None:
        """Assemble the model, and enter the first stage in which time goes on."""
        self.start(allow_overlap)
        self.stage = -1
        self._next_stage()

    def _open(self) -> None:
        if self._closed:
            raise ModelError(f"{self.system.model.file}: the run is closed")

    def _no_step(self, t: float, now: float) -> float:
        """Return the present time where it is asked for; else raise why there is no step."""
        self._open()
        if self._failed:
            raise ModelError(
                f"the run failed at time {now:.9g}; set `state` to one from before to go on"
            )
        if t == now:
            return now
        if self.sensing.halted_by:
            raise ModelError(f"Sensor_Event[{self.sensing.halted_by}] ended the run at {now:.9g}")
        raise ModelError(f"a step to time {t:.9g} from {now:.9g}: must go forward")

    def _within(self, t: float) -> float:
        """Return a time to step to, the end for one that is behind it by rounding."""
        end = self.end_time
        if t <= end:
            return t
        if not t <= end + _ROUNDED * max(abs(end), abs(t)):
            raise ModelError(
                f"a step to time {t:.9g}: the deck's last Simulate ends at {end:.9g}; "
                "mbsim.open(..., end_time=T) goes on to T"
            )
        return end

    def _check_own(self, state: State) -> None:
        """Raise `ModelError` for what is no state of this model run in this way."""
        file, own = self.system.model.file, self._identity
        if not isinstance(state, State):
            raise ModelError(
                f"{file}: a state is what `sim.state` gives; {type(state).__name__} given"
            )
        if state.made_of is own.packed or np.array_equal(state.made_of, own.packed):
            return
        for kind, about in KINDS.items():
            if found := own.changes(state.made_of, kind):
                raise ModelError(f"{file}: a state of another run: {about.differs}: {found}")
        raise ModelError(f"{file}: a state of another run")

    def _next_stage(self) -> bool:
        """Begin the Simulate that follows; return whether one does in which time goes on."""
        stages = self.settings.stages
        while self.stage + 1 < len(stages):
            self.stage += 1
            self._begun = False
            values = self.inputs.values_now
            goes_on = self._enter_stage(stages[self.stage], fresh=True)
            # a stage has programs of its own, where commands change elements
            self.inputs.look_at(self.system.scene)
            for row, value in enumerate(values):
                self.inputs.put(row, value)
            if self.sensing.halted_by:
                return False
            if goes_on:
                return True
        return False

    def _act(self, outcome: int, end: float) -> bool:
        """Do what a return from compiled code asks for; return whether the run goes on."""
        self._budget = FIRST_BUDGET if outcome != problem.PAUSED else min(4 * self._budget, 10**5)
        try:
            self._take()
            if outcome == problem.HAPPENED and not self._sense(end):
                return not self.sensing.halted_by and self._next_stage()
            self._answer(outcome, end)
        except Exception:
            self._failed = True
            raise
        return True

    def _moving_inputs(self) -> frozenset[int]:
        """Return the inputs that give velocities: bodies jump to these."""
        motions = self.system.model.motions
        return frozenset(
            row
            for row, each in enumerate(self.system.model.inputs)
            if each.table == "motions" and motions[each.id].val_type == "V"
        )

    def _input_changed(self, row: int) -> None:
        """Let nothing be left of what acted before."""
        self._fresh = True
        self._memory[scheme.HAVE_F] = 0.0
        self.system.scene.audit.tally[ANEW] = 1.0
        if row in self.moving_inputs:
            from mbsim.run.start import assemble_again

            assemble_again(self.system, self.hooks, self.time, self.method.y)
        if row in self.inputs.timed:
            self._look_ahead(self.settings.stages[self.stage], fresh=False)
            self._memory[scheme.ROW_ENDS] = -np.inf
            self._memory[scheme.HORIZON] = np.inf
            self.method.counts[scheme.ROW] = len(self.method.timetable)

    def changed(self) -> None:
        """Let signals be evaluated anew: y is another."""
        self._fresh = True

    def _row_now(self) -> int:
        """Return which row of the scene's tables holds the present time; it is not taken."""
        used = self._used
        row: int = used[USED_ROWS]
        if self._fresh:
            self._open()
            incidents, events = used[USED_INCIDENTS], used[USED_EVENTS]
            np.copyto(self._at, self.method.y)
            within = 0.0
            if self.methods.steps.order == 0.0:
                # forces that depend on a fixed step are shown as they acted
                within = self._numbers[scheme.LAST_STEP]
            self._write(self._numbers[scheme.TIME], within)
            used[USED_ROWS], used[USED_INCIDENTS], used[USED_EVENTS] = row, incidents, events
            self._fresh = False
        return row


def _several(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple; one alone may be given as it is."""
    return (names,) if isinstance(names, str) else tuple(names)


def open_model(
    model: Model | str | PathLike[str] | IO[str] | IO[bytes],
    *,
    overrides: Mapping[str, object] | Sequence[str] = (),
    inputs: str | Sequence[str] = (),
    end_time: float | None = None,
    print_interval: float | None = None,
    integrator: str | None = None,
    tol: float | None = None,
    plugins: Sequence[str | Path] = (),
    detector: str = "auto",
    interpret_plugins: bool = False,
    allow_overlap: bool = False,
    scripts: bool = True,
    notify: Notify | None = None,
) -> Stepper:
    """Return a model at its start, to be moved on step by step.

    Many arguments because each option of a run is one, by keyword.

    Parameters
    ----------
    model : Model, path, or XML
        As `read_model` takes it, or what that returned.
    overrides : mapping or sequence of str
        As of `read_model`.
    inputs : sequence of str
        Variables and motions that Python sets, by label or path, beside all variables whose
        expression is a number. One whose expression is none begins with 0.
    end_time, print_interval, integrator, tol, plugins, detector : optional
        As of `simulate`. Rows are recorded at the output times.
    interpret_plugins, allow_overlap, scripts, notify : optional
        As of `simulate`.

    Raises
    ------
    ModelError, PluginError, SolverError
        As `simulate` raises them before its first step.
    """
    from mbsim.reader.xml import as_model
    from mbsim.results.log import RunLog

    tell = notify or (lambda line: None)
    given, names = with_inputs(as_model(model, overrides), _several(inputs))
    settings = settle(given, end_time, print_interval, integrator, tol)
    files = [Path(file) for file in plugins]
    made = prepare(given, settings, files, detector, interpret_plugins, scripts, tell)
    log = RunLog(made.system, made.attributes, None)
    begin_log(log, made.system, (*made.said, *settings.notes))
    history = History(made.system, made.attributes, settings)
    stepper = Stepper(made.system, settings, history, log, tell, made.changes, names)
    stepper.begin(allow_overlap)
    return stepper
