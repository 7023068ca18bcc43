"""Families of processors: what code for one needs, and whether this machine has it."""

from __future__ import annotations

import functools
import os

import llvmlite.binding as llvm

from mbsim.errors import ModelError

#: Variables by which Numba is told to compile for another processor.
_SETTINGS = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX")

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


def get_host_cpu_features() -> str:
    """Return the features of this processor as LLVM names them, empty where it does not know."""
    try:
        return str(llvm.get_host_cpu_features().flatten())
    except RuntimeError:
        return ""


def here() -> str:
    """Return what code that is compiled in this process is for, as a text."""
    name, features, avx = (os.environ.get(setting) for setting in _SETTINGS)
    if name is None:
        name = llvm.get_host_cpu_name()
    if features is None:
        features = get_host_cpu_features() + ("" if avx is None else f" {avx}")
    return f"{llvm.get_process_triple()} {name} {features}"


def of_family(family: str) -> str:
    """Return the same of code for a family."""
    return f"{llvm.get_process_triple()} {family} {features(family)}"


@functools.cache
def runnable() -> tuple[str, ...]:
    """Return the families whose code this machine runs, the best first.

    None where NUMBA_CPU_NAME or NUMBA_CPU_FEATURES asks for code of a certain processor.
    """
    if any(setting in os.environ for setting in _SETTINGS[:2]):
        return ()
    here = set(get_host_cpu_features().split(","))
    return tuple(
        family for family in FAMILIES if here.issuperset(f"+{name}" for name in FAMILIES[family])
    )


def folder_of(family: str) -> str:
    """Return the folder's name for a family's code, which may call Intel's SVML where that is."""
    if not llvm.targets.has_svml():
        return family
    # whether the library is there as well Numba finds out
    from numba.core import config

    using: bool = vars(config)["USING_SVML"]
    return f"{family}-svml" if using else family


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
