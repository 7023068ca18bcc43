"""Families of processors: what code for one needs, and whether this machine has it."""

from __future__ import annotations

import functools
from typing import Any

from numba.core import config as _declared
from numba.core.codegen import get_host_cpu_features

from mbsim.errors import ModelError

_config: Any = _declared  # Numba fills it when it is imported

_V2 = ("cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3")
_V3 = (*_V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
_V4 = (*_V3, "avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl")

#: LLVM's name of a family -> what its processors have beside the architecture's least (System V
#: psABI for x86-64, section 3.1.1), the most first. "generic" is the least of any architecture.
FAMILIES: dict[str, tuple[str, ...]] = {
    "x86-64-v4": _V4,
    "x86-64-v3": _V3,
    "x86-64-v2": _V2,
    "x86-64": (),
    "generic": (),
}


def features(family: str) -> str:
    """Return the features of a family as LLVM takes them, e.g. ``+avx,+avx2``."""
    return ",".join(f"+{name}" for name in FAMILIES[family])


@functools.cache
def runnable() -> tuple[str, ...]:
    """Return the families whose code this machine runs, the best first.

    None where NUMBA_CPU_NAME or NUMBA_CPU_FEATURES asks for code of a certain processor.
    """
    if _config.CPU_NAME is not None or _config.CPU_FEATURES is not None:
        return ()
    here = set(get_host_cpu_features().split(","))
    return tuple(
        family for family in FAMILIES if here.issuperset(f"+{name}" for name in FAMILIES[family])
    )


def folder_of(family: str) -> str:
    """Return the folder's name for a family's code, which may call Intel's SVML where that is."""
    return f"{family}-svml" if _config.USING_SVML else family


def settings(family: str) -> dict[str, str]:
    """Return the environment of a process that compiles for a family.

    Raises
    ------
    ModelError
        If there is no such family, or this machine does not run its code.
    """
    if family not in FAMILIES:
        raise ModelError(f"--target {family}: there are {', '.join(FAMILIES)}")
    if family not in runnable():
        here = set(get_host_cpu_features().split(","))
        lacking = ", ".join(name for name in FAMILIES[family] if f"+{name}" not in here)
        why = f"it has no {lacking}" if lacking else "NUMBA_CPU_* is set"
        raise ModelError(f"--target {family}: this machine does not run that code: {why}")
    return {"NUMBA_CPU_NAME": family, "NUMBA_CPU_FEATURES": features(family)}
