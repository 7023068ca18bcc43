"""A mechanism as a `Problem`: its hooks behind addresses, all given one packed `Scene`.

The linearised mechanism stands behind a hook of the scene, so its arrays are made only where a
method asks for them. What a scene or a method lacks is not imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import WRENCH
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import pack
from mbsim.core.problem import Problem, addresses
from mbsim.dynamics.pipeline.hook_table import Method, fill
from mbsim.dynamics.pipeline.hooks import (
    CONTACT_HOOKS,
    FIXED_STEP_HOOKS,
    HOOKS,
    difference,
    retract,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Depends, Tangent


def mechanism(scene: Scene, fixed_step: bool = False) -> tuple[Problem, np.ndarray]:
    """Return the mechanism as a `Problem`, and the table that must live as long as it is used.

    A method without error estimate, `fixed_step`, has hooks of its own.
    """
    table = pack(scene)
    hooks = HOOKS | FIXED_STEP_HOOKS if fixed_step else dict(HOOKS)
    if len(scene.contacts.id) > 0:
        hooks |= CONTACT_HOOKS
    if len(scene.angles.i) > 0:
        from mbsim.dynamics.pipeline.force_hooks import limit_turn

        hooks["limit"] = limit_turn
    if len(scene.sensors.id) > 0:
        from mbsim.dynamics.events.sensors import arrive_hook, happens_hook

        hooks["arrive"] = arrive_hook
        if scene.sensors.located.any():
            # where none is located, steps need not be looked into
            hooks["happens"] = happens_hook
    if len(scene.switching.program) > 0 and not fixed_step:
        from mbsim.dynamics.events.switching import switching_hook

        hooks["switching"] = switching_hook
    found = {"check": 0, "inner": 0, "look": 0} | addresses(hooks)
    problem = Problem(int(table.ctypes.data), **found)
    fill(scene)
    if "switching" in hooks:
        scene.state.frozen[0] = int(len(scene.work.idle) > 0)
    return problem, table


def _find_slopes(scene: Scene) -> None:
    """Let wrenches have their slopes."""
    from mbsim.forces.abi import slopes_address

    applied = scene.applied
    for f in np.flatnonzero(applied.form == WRENCH):
        applied.slopes[f] = slopes_address(int(applied.formula[f]))


def linear_systems(
    scene: Scene, depends: Depends, only: set[Hook]
) -> tuple[dict[str, int], Tangent, Any]:
    """Return what linearises, factors and solves, by names; and what must live with it.

    Without geometric stiffness: the matrix is positive for any step. Hooks of derivatives are those
    of `only`.
    """
    from mbsim.compile_model.tangent import make_tangent
    from mbsim.dynamics.pipeline import implicit_hooks as of

    tangent = make_tangent(scene, depends, False, stressed=False)
    table = pack(tangent)
    scene.world.hooks[Hook.TANGENT] = int(table.ctypes.data)
    _find_slopes(scene)
    fill(scene, Method(tangent), only)
    return addresses(of.HOOKS), tangent, table


def implicit_hooks(scene: Scene, problem: Problem, pair: bool) -> tuple[Problem, Any]:
    """Return the problem with the hooks of an implicit method, and what must live with it.

    `pair`: the method solves with complex coefficients as well.
    """
    from mbsim.compile_model.program_dependence import find_depends
    from mbsim.compile_model.tangent import make_tangent
    from mbsim.dynamics.pipeline import implicit_hooks as of

    tangent = make_tangent(scene, find_depends(scene), pair)
    table = pack(tangent)
    scene.world.hooks[Hook.TANGENT] = int(table.ctypes.data)
    _find_slopes(scene)
    fill(scene, Method(tangent, pair))
    # with complex coefficients stages are solved for, else accelerations that lead to positions
    more = of.PAIR_HOOKS if pair else {"retract": retract}
    hooks = of.HOOKS | {"difference": difference} | more
    return problem._replace(**addresses(hooks)), (tangent, table)
