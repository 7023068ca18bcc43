"""Simulate analysis_type="Linear": the model linearised where a run stands."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import USED_EVENTS, USED_INCIDENTS, USED_ROWS
from mbsim.reader.units import symbol
from mbsim.results.linear import GROUP, LinearModel, from_tables
from mbsim.run import checkpoint
from mbsim.run.inputs import Inputs

if TYPE_CHECKING:
    from mbsim.model.elements import Linear, Model
    from mbsim.results.reading import Results
    from mbsim.run.loop import Runner

_SAVED = "linear/"


class _OutputsNow(Mapping[str, Any]):
    """Values of variables at the present time, from a row that is not taken."""

    def __init__(self, run: Runner) -> None:
        self._run = run
        scene = run.system.scene
        self._rows = scene.rows
        self._at = np.zeros(len(run.method.y))
        self._write = run.hooks.writer(self._at, run.method.error)
        self._columns = {
            f"variables/{-id}": k for k, (id, _) in enumerate(run.system.values) if id < 0
        }

    def __getitem__(self, name: str) -> float:
        used, kept = self._rows.used, self._rows.used.copy()
        np.copyto(self._at, self._run.method.y)
        self._write(self._run.time, 0.0)
        row = int(kept[USED_ROWS])
        for what in (USED_ROWS, USED_INCIDENTS, USED_EVENTS):
            used[what] = kept[what]
        return float(self._rows.value[row, self._columns[name]])

    def __iter__(self) -> Any:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


class _Here:
    """A run where it stands, as `linearize` takes it."""

    def __init__(self, run: Runner) -> None:
        self._run, self.system, self.method = run, run.system, run.method
        self.methods, self.problem, self.hooks = run.methods, run.problem, run.hooks
        model = run.system.model
        # what is added to a variable is called as the variable
        named = {added: id for id, added in model.added.items()}
        rows = {
            f"{each.table}/{named.get(each.id, each.id)}": k
            for k, each in enumerate(model.inputs)
            if each.table == "variables"
        }
        self.inputs = Inputs(model, run.system.scene, rows, lambda row: None)
        self.moving_inputs = frozenset[int]()
        self.signals: Any = _OutputsNow(run)

    @property
    def time(self) -> float:
        """Where the run is [T]."""
        return self._run.time

    def changed(self) -> None:
        """Do nothing: every signal is evaluated when it is asked for."""

    @property
    def state(self) -> dict[str, Any]:
        """All arrays of the run."""
        return checkpoint.save(self.system.scene, self.method) | self.methods.saved()

    @state.setter
    def state(self, saved: dict[str, Any]) -> None:
        checkpoint.restore(self.system.scene, self.method, saved)
        self.methods.restore(saved)


class LinearAnalyses:
    """The linearised models of a run so far."""

    def __init__(self, model: Model) -> None:
        self.found: list[LinearModel] = []
        self._unit = symbol(model.units.time)

    def analyse(
        self, run: Runner, asked: Linear, rested: bool, tell: Callable[[str], None]
    ) -> None:
        """Linearise the model where the run stands, and say what modes it has.

        Where bodies `rested`, motions hold them as they do in a static analysis.
        """
        # what most runs do not ask for
        from mbsim.run.linear_model import linearize
        from mbsim.run.statics import standing_still

        here = _Here(run)
        still = standing_still(run.system, run.time) if rested else nullcontext()
        with still:
            model = linearize(
                here,
                tuple(f"variables/{id}" for id in asked.outputs),
                tuple(f"variables/{id}" for id in asked.inputs),
            )
        self.found.append(model)
        tell(
            f"linear at time {run.time:.9g}: {len(model.states)} states, "
            f"{len(model.inputs)} inputs, {len(model.outputs)} outputs"
        )
        if model.rates.any():
            tell("linear: the model moves here: eigenvalues are those of the states in /linear")
        if asked.eigen_analysis:
            for line in model.table(self._unit):
                tell(line)

    def saved(self) -> dict[str, Any]:
        """Return what a checkpoint keeps."""
        kept: dict[str, Any] = {}
        for k, model in enumerate(self.found, 1):
            kept |= model.tables(f"{_SAVED}{k}")
            facts = json.dumps(model.facts("")[""]).encode()
            kept[f"{_SAVED}{k}/facts"] = np.frombuffer(facts, dtype=np.uint8)
        return kept

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go back to what a checkpoint kept."""
        self.found = []
        while (path := f"{_SAVED}{len(self.found) + 1}/") + "facts" in saved:
            facts = json.loads(np.asarray(saved[path + "facts"]).tobytes())
            tables = {
                name.removeprefix(path): table
                for name, table in saved.items()
                if name.startswith(path)
            }
            self.found.append(from_tables(tables, facts))

    def kept(self, results: Results) -> Results:
        """Write the models into the file of results; return it as it is then."""
        from mbsim.results.error_bar_file import with_tables

        if not self.found:
            return results
        tables: dict[str, Any] = {}
        facts: dict[str, Any] = {}
        for k, model in enumerate(self.found, 1):
            tables |= model.tables(f"{GROUP}/{k}")
            facts |= model.facts(f"{GROUP}/{k}", self._unit)
        return with_tables(results, tables, facts)
