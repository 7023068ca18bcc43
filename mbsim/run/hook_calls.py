"""The problem's hooks, called from Python: a few times a run, never in the loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.core.problem import Problem

_POINTER = ctypes.c_void_p
_HOOK = ctypes.CFUNCTYPE(
    ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double, _POINTER, _POINTER
)
_JOINTS = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, _POINTER, _POINTER
)


class HookCalls:
    """The hooks of one system; `problem` may be exchanged for that of another method."""

    def __init__(self, system: System, problem: Problem) -> None:
        self.scene, self.problem = system.scene, problem

    def call(self, hook: int, t: float, h: float, a: Any, b: Any) -> float:
        """Call one of the problem's hooks."""
        return float(_HOOK(hook)(self.problem.context, t, h, a.ctypes.data, b.ctypes.data))

    def ask_joints(self, what: int, t: float, y: Any, dy: Any) -> None:
        """Ask something of the joints: one of the requests at JOINTS_DOOR."""
        from mbsim.arrays.scene import JOINTS_DOOR

        door = _JOINTS(int(self.scene.world.doors[JOINTS_DOOR]))
        door(self.problem.context, what, t, y.ctypes.data, dy.ctypes.data)

    def joints_at(self, t: float) -> Callable[[int, Any], None] | None:
        """Return what asks the joints at time t, None where there are none."""
        if len(self.scene.tree.body) == 0:
            return None

        def serve(what: int, y: Any) -> None:
            self.ask_joints(what, t, y, y)

        return serve
