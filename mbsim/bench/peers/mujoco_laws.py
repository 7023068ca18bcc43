"""A case of MuJoCo, and a law of ours in it, in Python or compiled."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.peers import common
from mbsim.bench.peers.laws import Law

RowsOf = Callable[[np.ndarray, np.ndarray, np.ndarray], common.Rows]


class Case(NamedTuple):
    """A scene under one setting: free bodies in the order of the scene, or what `rows` knows."""

    xml: str
    dt: float  # s
    end_time: float  # s
    velocity: np.ndarray  # of free bodies (n, 6): linear global, angular in the body's frame
    note: str = ""
    law: Law | None = None  # force (N) of penetration (m) and its rate, through mjcb_passive
    compiled: bool = False
    gap: str = "plane"  # what the law acts on: the "plane" z = 0 or "balls" in a row along x
    radius: float = 0.0  # m
    sample: float = p.SAMPLE  # s
    cap: float = float("inf")  # s of wall time
    settle: bool = False  # start at the rest that gravity's part along z leads to
    position: np.ndarray | None = None  # qpos at the start, where it is not the model's own
    rows: RowsOf | None = None  # from times, qpos and qvel; None: free bodies
    control: Callable[[np.ndarray], np.ndarray] | None = None  # of times (n,), (n, drives)


def callback(case: Case, data: Any) -> Any:
    """What ``mjcb_passive`` calls: a Python function, a compiled one, or nothing."""
    if case.law is None:
        return None
    if case.compiled:
        return _compiled(case, data)
    law, radius = case.law, case.radius
    position, velocity, force = data.qpos, data.qvel, data.qfrc_passive

    def passive(model: Any, data: Any) -> None:
        depth = radius - position[2]
        if depth > 0.0:
            force[2] += law(depth, -velocity[2])

    return passive


def _compiled(case: Case, data: Any) -> Any:
    """The law as a C function on the addresses of qpos, qvel and qfrc_passive."""
    import numba

    compiler: Any = numba  # its types know no call of what they compile
    law = compiler.njit(case.law)
    pointer = _pointer()
    q, v, f = (int(a.ctypes.data) for a in (data.qpos, data.qvel, data.qfrc_passive))
    radius, balls = case.radius, len(case.velocity)

    def on_plane(model: Any, data: Any) -> None:
        position, velocity, force = pointer(q), pointer(v), pointer(f)
        depth = radius - position[2]
        if depth > 0.0:
            force[2] += law(depth, -velocity[2])

    def on_balls(model: Any, data: Any) -> None:
        position, velocity, force = pointer(q), pointer(v), pointer(f)
        for i in range(balls - 1):
            depth = 2 * radius - (position[7 * i + 7] - position[7 * i])
            if depth > 0.0:
                push = law(depth, velocity[6 * i] - velocity[6 * i + 6])
                force[6 * i] -= push
                force[6 * i + 6] += push

    body = on_plane if case.gap == "plane" else on_balls
    signature = numba.types.void(numba.types.voidptr, numba.types.voidptr)
    return _keep(compiler.cfunc(signature)(body))


#: Machine code must not be freed while MuJoCo may call it.
_kept: list[Any] = []


def _keep(compiled: Any) -> Any:
    """A compiled callback as the ctypes function that MuJoCo takes."""
    function = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(compiled.address)
    _kept.append((compiled, function))
    return function


@functools.cache
def _pointer() -> Any:
    """A compiled function from an address to a pointer to float64."""
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def pointer(context: Any, address: Any) -> Any:
        result = types.CPointer(types.float64)

        def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(result))

        return result(types.int64), make

    return pointer
