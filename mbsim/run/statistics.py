"""The counters of a run, under the names that results give them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene
    from mbsim.run.methods import Methods


def counters(scene: Scene, methods: Methods) -> dict[str, float]:
    """Return what was counted."""
    from mbsim.arrays import codes
    from mbsim.integrators import scheme

    counts, memory = methods.arrays.counts, methods.arrays.memory
    counters = scene.log.counters
    return {
        "steps": int(counts[scheme.STEPS]),
        "rejected": int(counts[scheme.REJECTED]),
        "rhs_evaluations": int(counts[scheme.EVALUATIONS]),
        "implicit_evaluations": methods.implicit_evaluations,
        "output_evaluations": int(counts[scheme.OUTPUTS]),
        "jacobians": int(counts[scheme.JACOBIANS]),
        "factorizations": int(counts[scheme.FACTORIZATIONS]),
        "method_changes": methods.changes,
        "narrowphase_pairs": int(counters[codes.NARROWPHASE]),
        "skipped_pairs": int(counters[codes.SKIPPED]),
        "pair_listings": int(counters[codes.LISTINGS]),
        "fcl_calls": int(counters[codes.FCL_CALLS]),
        "too_deep": int(counters[codes.TOO_DEEP]),
        "normal_calls": int(counters[codes.NORMAL_CALLS]),
        "friction_calls": int(counters[codes.FRICTION_CALLS]),
        "python_calls": int(counters[codes.PYTHON_CALLS]),
        "h_smallest": float(memory[scheme.H_SMALLEST]),
        "h_largest": float(memory[scheme.H_LARGEST]),
    } | (methods.rigid.counters() if methods.rigid is not None else {})
