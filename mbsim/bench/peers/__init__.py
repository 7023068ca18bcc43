"""Other engines that the scenes are run on, where they are installed.

Only the modules in this folder import an engine, and only when one of them is asked for. Each has
``NAME``, ``version()``, ``settings(scene)`` and ``run(scene, setting, repeats)``.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

#: Module in this folder, and the import name of its engine.
ENGINES = {"mujoco": "mujoco", "exudyn": "exudyn", "pybullet": "pybullet", "drake": "pydrake"}


def available() -> list[str]:
    """Names of the engines that can be imported; none of them is imported to find out."""
    return [name for name, engine in ENGINES.items() if importlib.util.find_spec(engine)]


def load(name: str) -> ModuleType:
    """The module that runs the engine `name`; the engine itself is imported at its first use."""
    if name not in ENGINES:
        raise ValueError(f"peer {name!r}: must be one of {', '.join(ENGINES)}")
    return importlib.import_module(f"mbsim.bench.peers.{name}")
