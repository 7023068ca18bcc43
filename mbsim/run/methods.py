"""Which method runs: the one that was asked for, or those between which AUTO changes over."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import AUDIT_EVERY
from mbsim.compile_model import tangent
from mbsim.compile_model.tangent import MOST_BODIES as MOST_LINEARISED
from mbsim.core import jit, profile, tags
from mbsim.dynamics.bodies import configuration
from mbsim.errors import ModelError
from mbsim.integrators import catalog, scheme
from mbsim.integrators.binding import bind
from mbsim.integrators.changing import (
    BEGIN_STEPS,
    EVALUATIONS_A_STEP,
    FIRST_PATIENCE,
    IMPLICIT_START,
    IMPLICIT_WORK,
    SHORT_STAY,
    is_since_begin,
)

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.core.problem import Problem
    from mbsim.sensitivity.setup import Sensitivities

#: Bodies of the largest model for which AUTO looks whether it is stiff.
MOST_BODIES = 300
#: Steps from one sample of `pipeline.audit` to the next, of explicit methods, those with more than
#: FEW bodies, and implicit ones: what samples cost is then about 1 % of the steps, or less.
EVERY, EVERY_OF_MANY, EVERY_IMPLICIT = 8.0, 16.0, 1.0
FEW = 16
#: By how much AUTO is slower to change after what did not pay, at most.
MOST_LEARNT = 16.0
#: The part of a step's error that Newton's iteration may leave where friction holds without give.
#: What that decides by are forces, over their limits: a few 1e-9 m of a stiff contact, far less
#: than the error of a step, made it slip.
LEFT_OF_STICKING = 3e-4
#: And by which the error of a step of order 2 is bounded then, as at tol 1e-5: how far a body that
#: is put down slips follows from its first milliseconds, 1e-5 m of which an error of 1e-6 m, far
#: less than a loose tol, makes a tenth.
HELD_BY_STICKING = 2e-6


class Methods:
    """The arrays of a run's method, and its functions bound to the mechanism.

    AUTO's two methods have their arrays in common, so that one goes on where the other ends.
    """

    def __init__(
        self,
        system: System,
        name: str,
        start: float,
        timed: bool = False,
        fixed: bool = False,
        tol: float = 1e-5,
    ) -> None:
        from mbsim.compile_model.timetable import ROWS

        self.system = system
        changing = name == catalog.AUTO
        self.explicit = catalog.load(catalog.EXPLICIT if changing else name, fixed)
        self.other = catalog.load(catalog.IMPLICIT) if changing else None
        bodies = len(system.body_ids)
        alone = self.explicit.watched > 0 and bodies <= MOST_BODIES and not changing
        held = scheme.looked_at(self.explicit) if alone else self.explicit
        if self.other:
            held = scheme.both(self.explicit, self.other)
        kinds = configuration.kinds(bodies, len(system.y0))
        self.arrays = scheme.make(held, system.y0, start, kinds, ROWS if timed else 1)
        # where a contact may close or stick, Newton's iteration that fails with what held at the
        # step's begin is what finds it
        touches = len(system.scene.contacts.id) > 0
        self.arrays.memory[scheme.WHERE] = 0.0 if touches else 0.5
        dry = bool((system.scene.applied.equation >= 0).any())
        if touches or dry:
            self.arrays.memory[scheme.JUDGED] = self.explicit.judged
        length, speed = system.scene.world.scale[:2]
        self.arrays.memory[scheme.OWN_TIME] = length / speed
        if system.scene.contacts.rigid.any() or dry:
            self.arrays.memory[scheme.LEFT_PART] = LEFT_OF_STICKING
            self.arrays.memory[scheme.HELD] = HELD_BY_STICKING
        self.problem: Problem
        self.rigid: Any = None  # what a method with rigid contacts has of its own
        self._table: Any
        if name == catalog.RIGID:
            from mbsim.stepping.setup import rigid_mechanism

            self.rigid = rigid_mechanism(system, fixed, tol)
            awake = system.scene.awake
            self.arrays = self.arrays._replace(whole=awake.whole, part=awake.part)
            self.problem = self.rigid.problem
        else:
            from mbsim.dynamics.pipeline.problem import mechanism

            # a method without error estimate
            bounded = self.explicit.order == 0.0
            system.scene.world.fixed_step[0] = int(bounded)
            self.problem, self._table = mechanism(system.scene, bounded)
        self._tangent: Any = None
        self.steps: scheme.Steps
        if self.explicit.implicit and bodies > MOST_LINEARISED:
            raise ModelError(
                f"{system.model.file}: integrator={name}: {bodies} bodies are more than the "
                f"{MOST_LINEARISED} that implicit methods take; take VERLET or DOPRI5"
            )
        if changing and bodies <= MOST_BODIES:
            self.arrays.memory[scheme.WATCH] = 1.0
            self.arrays.memory[scheme.PATIENCE] = FIRST_PATIENCE
            self.arrays.memory[scheme.RELUCTANCE] = 1.0
            self.arrays.memory[scheme.BEGUN] = start
        if alone:
            self.arrays.memory[scheme.KEEPS_TO_BOUND] = 1.0
        self.sensitivities: Sensitivities | None = None
        self.changes = 0
        #: When AUTO changed over last, and the work by then.
        self._since = (start, 0.0)
        #: Evaluations by AUTO's implicit method before that, and all of them by then.
        self._spent = (0, 0)
        self.bind()

    def tell(self, say: Callable[[str], None]) -> None:
        """Say what a method with rigid contacts reads of them."""
        for line in self.rigid.said if self.rigid is not None else ():
            say(line)

    @property
    def is_stiff(self) -> bool:
        """Whether AUTO's implicit method runs."""
        return bool(self.arrays.memory[scheme.STIFF] == 1.0)

    @property
    def implicit_evaluations(self) -> int:
        """How many of the evaluations so far an implicit method took."""
        before, since = self._spent
        now = int(self.arrays.counts[scheme.EVALUATIONS])
        return before + (now - since if self.steps.implicit else 0)

    def bind(self) -> None:
        """Bind the method that memory names."""
        with profile.part("build"):
            self.problem, self._tangent, (self.steps, self._workspace) = jit.planned(self._bound)

    def _bound(self) -> tuple[Problem, Any, tuple[scheme.Steps, Any]]:
        """Return the problem, what its linearisation lives in, and the method bound to it."""
        running, problem, linearised = self.explicit, self.problem, self._tangent
        if self.other is not None and self.is_stiff:
            running = self.other
        if running.implicit and linearised is None:
            from mbsim.dynamics.pipeline.problem import implicit_hooks

            problem, linearised = implicit_hooks(self.system.scene, problem, running.pair)
        self.time_scene()
        if profile.running is not None:
            from mbsim.run.hook_profile import time_problem

            problem = time_problem(problem, profile.running.hooks)
        every = EVERY if len(self.system.body_ids) <= FEW else EVERY_OF_MANY
        self.system.scene.audit.plan[AUDIT_EVERY] = EVERY_IMPLICIT if running.implicit else every
        probe = self.explicit if running is self.other else None
        steps, (table, workspace) = bind(running, problem, self.arrays, probe)
        if self.sensitivities is not None:
            self.sensitivities.bind(running, problem, table)
        return problem, linearised, (steps, (table, workspace))

    def follow(self, sensitivities: Sensitivities) -> None:
        """Let derivatives be carried along with every step from here on."""
        self.sensitivities = sensitivities
        self.problem = sensitivities.hooked(self.problem)
        self.bind()

    def time_scene(self) -> None:
        """Let the scene's hooks and laws be timed where a profile runs."""
        if profile.running is not None:
            from mbsim.run.hook_profile import time_scene

            time_scene(self.system.scene, profile.running.hooks)

    def saved(self) -> dict[str, Any]:
        """Return what a running implicit method keeps beside its arrays, by name."""
        kept: dict[str, Any] = {
            "changes": np.array(self.changes),
            "since": np.array(self._since),
            "spent": np.array(self._spent),
        }
        if self.steps.implicit:
            kept |= tangent.saved(self._tangent[0])
        if self.rigid is not None:
            kept |= tags.copies(self.rigid.stepping, tags.STATE, "stepping/")
        return kept

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Bind the method that ran, whose arrays are as they were, to what it kept."""
        self.changes = int(kept["changes"])
        self._since = (float(kept["since"][0]), float(kept["since"][1]))
        self._spent = (int(kept["spent"][0]), int(kept["spent"][1]))
        self.bind()
        if self.steps.implicit:
            tangent.restore(self._tangent[0], kept)
        if self.rigid is not None:
            tags.put_back(self.rigid.stepping, tags.STATE, kept, "stepping/")

    def _forget(self) -> None:
        """Leave nothing of a linearisation to what comes later: only a running one is saved."""
        self.arrays.memory[scheme.HAVE_JACOBIAN] = 0.0
        self.system.scene.work.friction_slope[...] = 0.0
        if self._tangent is not None:
            # no couplings: they are found anew
            self._tangent[0].pattern.count[...] = (0, 0, 1)

    def _learn(self, stiff: bool) -> None:
        """Let AUTO be slower to change as it did last where that did not pay, else faster.

        The implicit method pays where it takes less work than as many explicit steps a time as when
        the model was found stiff, the explicit one where stability bounds few of its steps.
        """
        memory, counts = self.arrays.memory, self.arrays.counts
        now = memory[scheme.TIME]
        work = float(counts[scheme.EVALUATIONS] + counts[scheme.JACOBIANS])
        if not stiff:
            took = IMPLICIT_START + IMPLICIT_WORK * (work - self._since[1])
            instead = EVALUATIONS_A_STEP * memory[scheme.COSTLY] * (now - self._since[0])
            # a stay that took no time says nothing
            over = took / instead if instead > 0.0 else 1.0
            factor = min(MOST_LEARNT, max(1.0 / 1.5, over**2))
            # with fewer explicit steps a time it does not pay
            memory[scheme.COSTLY] *= max(1.0, over)
            memory[scheme.PATIENCE] = max(FIRST_PATIENCE, factor * memory[scheme.PATIENCE])
        elif self.changes > 0:
            free = memory[scheme.EXPLICIT_STEPS] - memory[scheme.STIFF_STEPS]
            factor = 2.0 if free < SHORT_STAY else 0.5
            memory[scheme.RELUCTANCE] = max(1.0, factor * memory[scheme.RELUCTANCE])
        self._since = (now, work)

    def change_over(self) -> str:
        """Let AUTO's other method go on from the committed point; return what is to be said."""
        memory, counts = self.arrays.memory, self.arrays.counts
        stiff = not self.is_stiff
        self._spent = (self.implicit_evaluations, int(counts[scheme.EVALUATIONS]))
        if stiff:
            said = self._why("here")
        else:
            now = memory[scheme.TIME]
            said = f"time {now:.9g}: not stiff any more: {catalog.EXPLICIT} from here on"
        memory[scheme.STIFF] = float(stiff)
        # what was stiff may be so again: what explicit steps amplify beyond their bound is felt
        memory[scheme.BOUNDED] = 1.0
        memory[scheme.FRESH] = 1.0
        memory[scheme.ERROR_BEFORE] = 1.0
        memory[scheme.GROWTH] = memory[scheme.EASE] = math.inf
        memory[scheme.BEGUN] = memory[scheme.TIME]
        work = counts[scheme.EVALUATIONS] + (counts[scheme.JACOBIANS] if stiff else 0)
        memory[scheme.BEGUN_WORK] = float(work)
        self._learn(stiff)
        if stiff and memory[scheme.PACE] > 0.0:
            # else there was no window of steps since the last change: it is as costly as before
            memory[scheme.COSTLY] = memory[scheme.PACE]
        # one over the length of the steps that were too short
        often = max(memory[scheme.PACE], 1.0 / memory[scheme.STEP])
        memory[scheme.PACE] = often if stiff else 0.0
        memory[scheme.STIFF_STEPS] = memory[scheme.CALM_STEPS] = 0.0
        memory[scheme.EXPLICIT_STEPS] = memory[scheme.IMPLICIT_STEPS] = 0.0
        self.arrays.dense[...] = 0.0
        self._forget()
        self.changes += 1
        self.bind()
        return said

    def _why(self, since: str) -> str:
        """Return what is to be said where AUTO leaves its explicit method."""
        memory = self.arrays.memory
        bound = memory[scheme.STIFF_STEPS] >= memory[scheme.PATIENCE]
        why = "stability bounds the step of" if bound else "too many steps are ahead, of"
        now, h = memory[scheme.TIME], memory[scheme.STEP]
        return f"time {now:.9g}: {why} {h:.3g}: {catalog.IMPLICIT} from {since} on"

    @property
    def may_begin_anew(self) -> bool:
        """Whether a run of AUTO has not gone farther than `begin_anew` goes back.

        What users' code remembers would not go back.
        """
        system = self.system
        if self.other is None or system.user_laws or system.subroutines or system.posts:
            return False
        short = self.arrays.counts[scheme.STEPS] <= BEGIN_STEPS
        return bool(self.arrays.memory[scheme.WATCH] == 1.0 and self.changes == 0 and short)

    @property
    def is_since_begin(self) -> bool:
        """Whether AUTO's implicit method is to run from the begin."""
        return is_since_begin(self.arrays)

    def begin_anew(self, restore: Callable[[], None]) -> str:
        """Let AUTO's implicit method run from the begin, to which `restore` goes back.

        Explicit steps at the bound of stability shake what rests, within the tolerance; from there
        the implicit method takes more, and finds a motion that is not the model's.
        """
        memory, counts = self.arrays.memory, self.arrays.counts
        said = self._why("the begin")
        kept = {k: float(memory[k]) for k in (scheme.PACE, scheme.STEP)}
        spent = int(counts[scheme.EVALUATIONS])
        restore()
        for k, value in kept.items():
            memory[k] = value
        # what was tried is work all the same
        counts[scheme.EVALUATIONS] = spent
        self.change_over()
        memory[scheme.STEP] = 0.0
        return said

    def retreat(self) -> bool:
        """Let AUTO's explicit method try where the implicit one cannot; return whether it can."""
        if self.other is None or not self.is_stiff:
            return False
        self.change_over()
        memory = self.arrays.memory
        memory[scheme.WATCH] = 0.0
        memory[scheme.STEP] = 0.0
        memory[scheme.HAVE_F] = 0.0
        return True
