"""Other engines that the scenes are run on, where they are installed.

Only the modules in this folder use an engine, and only when one of them is asked for. Each has
``NAME``, ``version()``, ``settings(scene)`` and ``run(scene, setting, repeats)``.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

#: Module in this folder, and the import name of its engine.
PACKAGES = {"mujoco": "mujoco", "exudyn": "exudyn", "pybullet": "pybullet", "drake": "pydrake"}
#: All engines: ODE is a library of the system.
ENGINES = (*PACKAGES, "ode")


def available() -> list[str]:
    """Names of the engines that are installed; none of them is imported to find out."""
    found = [name for name, engine in PACKAGES.items() if importlib.util.find_spec(engine)]
    return [*found, "ode"] if load("ode").is_installed() else found


def load(name: str) -> ModuleType:
    """The module that runs the engine `name`; the engine itself is imported at its first use."""
    if name not in ENGINES:
        raise ValueError(f"peer {name!r}: must be one of {', '.join(ENGINES)}")
    return importlib.import_module(f"mbsim.bench.peers.{name}")
