"""`mbsim run --profile`: which part of the loop each hook of a scene is counted to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsim.arrays.hooks import Hook

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene
    from mbsim.core.problem import Problem
    from mbsim.core.profile import Hooks

#: Parts (`core.profile.LOOP_PARTS`) of the problem's hooks.
PARTS_OF_PROBLEM = {
    "rhs": "evaluation",
    "step": "evaluation",
    "project": "joints",
    "norm": "step_control",
    "check": "step_control",
    "commit": "step_control",
    "look": "step_control",
    "inner": "step_control",
    "limit": "step_control",
    "output": "rows",
    "reject": "step_control",
    "stable": "step_control",
    "happens": "step_control",
    "arrive": "step_control",
    "switching": "step_control",
    "linearise": "linear_algebra",
    "factor": "linear_algebra",
    "solve": "linear_algebra",
    "factor_pair": "linear_algebra",
    "solve_pair": "linear_algebra",
    "retract": "evaluation",
    "difference": "evaluation",
}

#: Of the scene's. One that is no function, or called once a Simulate, has none.
PARTS_OF_SCENE = {
    Hook.CONTACTS: "contacts",
    Hook.FCL: "detect",
    Hook.SLOTS: "contacts",
    Hook.TILTING: "contacts",
    Hook.RECALL: "contacts",
    Hook.SPREAD: "contacts",
    Hook.RIM: "contacts",
    Hook.HOLD_BACK: "contacts",
    Hook.VALUE: "forces",
    Hook.JET: "forces",
    Hook.APPLIED: "forces",
    Hook.WRENCH: "forces",
    Hook.ELEMENT: "forces",
    Hook.JOINTS: "joints",
    Hook.LOOPS: "joints",
    Hook.HIGHER_PAIRS: "joints",
    Hook.RELATIONS: "joints",
    Hook.STICKING: "joints",
    Hook.REACTION_FORCES: "joints",
    Hook.EVALUATE: "evaluation",
    Hook.BEND: "linear_algebra",
    Hook.CONTACT_SLOPES: "linear_algebra",
    Hook.FACE_SLOPES: "linear_algebra",
    Hook.MEMORY: "linear_algebra",
    Hook.SLOPES: "linear_algebra",
    Hook.MEMORY_PAIR: "linear_algebra",
    Hook.GAUGES: "step_control",
    Hook.EFFECTS: "step_control",
    Hook.STABILITY: "step_control",
    Hook.PASSING: "step_control",
    Hook.FCL_POINTS: "detect",
    Hook.DRY: "forces",
    Hook.ANGLES: "step_control",
    Hook.NEAR: "detect",
    Hook.REQUESTS: "rows",
}


def time_scene(scene: Scene, hooks: Hooks) -> None:
    """Let hooks, pairs and laws of a scene be timed, as far as they are there."""
    from mbsim.compile_model.pair_adapter import SIGNATURE
    from mbsim.dynamics.pipeline.hook_table import TABLE
    from mbsim.laws.abi import FRICTION_SIGNATURE, NORMAL_SIGNATURE

    table = scene.world.hooks
    for row in TABLE:
        if row.hook in PARTS_OF_SCENE:
            part = PARTS_OF_SCENE[row.hook]
            table[row.hook] = hooks.timed(int(table[row.hook]), part, row.signature)
    for addresses, part, signature in (
        (scene.kinds.kernel, "detect", SIGNATURE),
        (scene.contacts.normal_law, "forces", NORMAL_SIGNATURE),
        (scene.contacts.friction_law, "forces", FRICTION_SIGNATURE),
        (scene.contacts.sliding_law, "forces", FRICTION_SIGNATURE),
    ):
        addresses[:] = np.array(
            [hooks.timed(int(address), part, signature) for address in addresses], dtype=np.int64
        )


def time_problem(problem: Problem, hooks: Hooks) -> Problem:
    """Return the problem with hooks that are timed."""
    from mbsim.core.problem import HOOK, MEASURE, MEASURES

    timed = {
        name: hooks.timed(getattr(problem, name), part, MEASURE if name in MEASURES else HOOK)
        for name, part in PARTS_OF_PROBLEM.items()
    }
    return problem._replace(**timed)
