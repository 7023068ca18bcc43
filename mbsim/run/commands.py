"""What commands between Simulates change, as a run comes to each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.layout import AT_V, AT_W, BODY_SIZE
from mbsim.model.names import element_name
from mbsim.reader.activity import statement_of
from mbsim.run.settings import Settings

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.compile_model.changes import Parameters
    from mbsim.run.hook_calls import HookCalls
    from mbsim.run.methods import Methods

Tell = Callable[[str], None]


class Commands:
    """Changes of numbers, and elements that take part or not, Simulate by Simulate."""

    def __init__(self, system: System, settings: Settings, changes: list[Parameters]) -> None:
        from mbsim.run.activity import Activity

        self.system, self.settings = system, settings
        self.changes = changes  # parameters of every Simulate, where some differ
        switches = any(stage.simulation.inactive for stage in settings.stages)
        self.activity = Activity(system) if switches else None

    def switched(self, stage: int) -> bool:
        """Return whether elements come into use, or go out of it, as a Simulate begins."""
        stages = self.settings.stages
        before = stages[stage - 1].simulation.inactive if stage else ()
        return stages[stage].simulation.inactive != before

    def apply(self, stage: int, fresh: bool, methods: Methods, log: Tell) -> None:
        """Let the elements be as the commands before a Simulate leave them, and say so once."""
        stages, scene = self.settings.stages, self.system.scene
        earlier = stages[stage - 1].simulation if stage else None
        simulation = stages[stage].simulation
        when = f"from time {simulation.start_time:.9g} on"
        if self.changes:
            from mbsim.compile_model.changes import apply

            apply(scene, self.changes[stage])
            for change in simulation.changes[len(earlier.changes) if earlier else 0 :]:
                log(f"{when} {change.text}")
        if self.activity is not None:
            before = earlier.inactive if earlier and fresh else ()
            self.activity.apply(simulation.inactive, before)
            for line in self._told(stage):
                log(f"{when} {line}")
        if self.changes or self.activity is not None:
            methods.time_scene()
            if self.system.reader is not None:
                self.system.reader.open(scene)

    def _told(self, stage: int) -> Iterator[str]:
        """Yield what to say of each element that a Simulate finds switched."""
        stages = self.settings.stages
        now = stages[stage].simulation.inactive
        before = stages[stage - 1].simulation.inactive if stage else ()
        for table, id in sorted({*now} ^ {*before}):
            name = self._name(table, id)
            yield f"{name} is {'inactive' if (table, id) in now else 'active'}"

    def _name(self, table: str, id: int) -> str:
        """Return an element as its deck has it."""
        model = self.system.model
        return element_name(model.file, statement_of(table, model.motions.get(id)), id)

    def interrupts(self, stage: int) -> bool:
        """Return whether motions may not go on as they were: after a rest, and when changed.

        A model is assembled as it is written, before what changes it ahead of its first Simulate.
        What is switched is switched before it is assembled; before a search for rest it counts too.
        """
        if stage and self.switched(stage):
            return True
        if self.settings.stages[stage].simulation.analysis_type == "STATIC":
            return False
        before = self.settings.stages[max(0, stage - 1) : stage]
        known = sum(len(one.simulation.changes) for one in before)
        fresh = self.settings.stages[stage].simulation.changes[known:]
        changed = any(c.table in ("motions", "variables") for c in fresh)
        return changed or (not self.settings.stages[stage].is_linear and self.rested(stage))

    def rested(self, stage: int) -> bool:
        """Return whether bodies rest when a Simulate begins: a linear analysis moves none."""
        before = [one for one in self.settings.stages[:stage] if not one.is_linear]
        return bool(before) and before[-1].is_static

    def assemble(
        self, stage: int, hooks: HookCalls, t: float, y: Any, log: Tell, say: Tell
    ) -> None:
        """Bring bodies onto what holds from a Simulate on; say what moved, and what energy jumps.

        Raises
        ------
        ModelError
            Where constraints contradict each other.
        """
        from mbsim.dynamics.initial.assembly import describe
        from mbsim.run.start import assemble_again

        switched = stage > 0 and self.switched(stage)
        if switched:
            # how near a fold was goes by equations of before
            self.system.scene.sweep.quality[:] = 0.0
        before = self._kinetic(y)
        found = assemble_again(self.system, hooks, t, y)
        if not switched or found is None:
            return
        lines, warnings = describe(self.system, found)
        for line in lines:
            log(line)
        for line in warnings:
            say(line)
        after = self._kinetic(y)
        if abs(after - before) > _ROUNDED * max(before, after):
            say(
                f"time {t:.9g}: what is active from here on changes velocities at once: the "
                f"kinetic energy goes from {before:.6g} to {after:.6g}"
            )

    def _kinetic(self, y: Any) -> float:
        """Return the kinetic energy of all bodies [F L]."""
        bodies = self.system.scene.bodies
        rows = y[: BODY_SIZE * len(bodies.mass)].reshape(-1, BODY_SIZE)
        v, w = rows[:, AT_V:AT_W], rows[:, AT_W : AT_W + 3]
        turning = np.einsum("bi,bij,bj->", w, bodies.inertia, w)
        return 0.5 * float(bodies.mass @ (v * v).sum(axis=1) + turning)


#: Parts of the kinetic energy that rounding changes.
_ROUNDED = 1e-9
