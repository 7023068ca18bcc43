"""The scenes: every module here lists its own in `SCENES`; a new one needs no other entry."""

from __future__ import annotations

import pkgutil
from importlib import import_module

from mbsim.bench.scene import Scene


def all_scenes() -> dict[str, Scene]:
    """Return every scene by name, in the order of their modules."""
    modules = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found = (scene for name in modules for scene in import_module(f"{__name__}.{name}").SCENES)
    return {scene.name: scene for scene in found}
