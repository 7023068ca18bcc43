"""The problem's hooks, called from Python: a few times a run, never in the loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mbsim.run.failures import fail

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.core.problem import Problem

_POINTER = ctypes.c_void_p
_HOOK = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, _POINTER, _POINTER
)
_JOINTS = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, _POINTER, _POINTER
)


def make_detector(system: System) -> Any:
    """Put FCL behind its hook where a pair may need it; None where none does."""
    if not system.needs_fcl:
        return None
    from mbsim.arrays.hooks import Hook
    from mbsim.geometry.fcl_detector import FclDetector

    graphics = [system.model.graphics[g] for g in system.graphic_ids]
    detector = FclDetector(system.scene, graphics)
    system.scene.world.hooks[Hook.FCL] = detector.address
    return detector


class HookCalls:
    """The hooks of one system that act or answer; `detector` says why FCL failed."""

    def __init__(self, system: System, problem: Problem, detector: Any) -> None:
        self.system, self.problem, self.detector = system, problem, detector
        self._output = _HOOK(problem.output)

    def call(self, hook: int, t: float, h: float, a: Any, b: Any) -> int:
        """Call one of the problem's hooks; return its code or answer."""
        return int(_HOOK(hook)(self.problem.context, t, h, a.ctypes.data, b.ctypes.data))

    def must(self, hook: int, t: float, a: Any, b: Any) -> int:
        """Call one of the problem's hooks; raise what it says where it fails."""
        answer = self.call(hook, t, 0.0, a, b)
        acts = hook not in (self.problem.commit, self.problem.output, self.problem.arrive)
        self._look_at(answer if acts else min(answer, 0), t)
        return answer

    def writer(self, y: Any, error: Any) -> Callable[[float, float], None]:
        """Return what lets a row be written of y as it is then; it raises what fails.

        It is called between steps, as often as a controller reads a signal, so it is kept short.
        """
        output, context = self._output, self.problem.context
        at, other = y.ctypes.data, error.ctypes.data

        def write(t: float, h: float) -> None:
            answer = output(context, t, h, at, other)
            if answer < 0:
                self._look_at(answer, t)

        return write

    def _look_at(self, code: int, t: float) -> None:
        """Raise what a hook's code says, or its answer that is less a code."""
        if code != 0:
            fail(self.system, self.detector, abs(code), t)

    def ask_joints(self, what: int, t: float, y: Any, dy: Any) -> None:
        """Ask joints for something, one of `arrays.hooks.Joints`; raise what fails."""
        from mbsim.arrays.hooks import Hook

        hook = _JOINTS(int(self.system.scene.world.hooks[Hook.JOINTS]))
        code = hook(self.problem.context, what, t, y.ctypes.data, dy.ctypes.data)
        failed = self.system.scene.users.failed
        if failed[0] != 0:
            # a motion's subroutine, whose code cannot be returned
            code, failed[0] = int(failed[0]), 0
        self._look_at(code, t)

    def joints_at(self, t: float) -> Callable[[int, Any], None] | None:
        """Return what asks the joints at time t, None where there are none."""
        if len(self.system.scene.tree.body) == 0:
            return None

        def serve(what: int, y: Any) -> None:
            self.ask_joints(what, t, y, y)

        return serve
