"""What a checkpoint holds: all arrays in which a run goes on, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene


class Active(NamedTuple):
    """The equations in use, which a resumed run needs as they were."""

    active: Any
    skyline: Any
    quality: Any
    size: Any
    kept_at: Any
    kept_a: Any
    kept_power: Any
    released: Any


def groups(scene: Scene, method: Any) -> dict[str, Any]:
    """Return all groups of arrays in which a run goes on; `method` is what the integrator keeps."""
    return {
        "state": scene.state,
        "pairs": scene.pairs,
        "crowds": scene.crowds,
        "equations": Active(
            scene.equations.active,
            scene.sweep.skyline,
            scene.sweep.quality,
            scene.sweep.size,
            scene.sweep.kept_at,
            scene.sweep.kept_a,
            scene.sweep.kept_power,
            scene.sweep.released,
        ),
        "log": scene.log,
        "audit": scene.audit,
        "method": method,
    }


def save(scene: Scene, method: Any) -> dict[str, Any]:
    """Return copies of these arrays, by group and field."""
    return {
        f"{name}/{field}": np.array(array)
        for name, group in groups(scene, method).items()
        for field, array in zip(group._fields, group, strict=True)
    }


def restore(scene: Scene, method: Any, saved: dict[str, Any]) -> None:
    """Put the arrays back as `save` found them."""
    for name, group in groups(scene, method).items():
        for field, array in zip(group._fields, group, strict=True):
            array[...] = saved[f"{name}/{field}"]
