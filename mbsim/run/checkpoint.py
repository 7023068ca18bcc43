"""What a checkpoint holds: all arrays that are declared as state, by name; see `core.tags`.

What an implicit method keeps beside (`methods`), sensors and the divergence monitor add their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mbsim.core import tags

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene


def save(scene: Scene, method: Any) -> dict[str, Any]:
    """Return copies of all state of a scene and of what the integrator keeps, `method`."""
    return tags.copies(scene, tags.STATE) | tags.copies(method, tags.STATE, "method/")


def restore(scene: Scene, method: Any, saved: Mapping[str, Any]) -> None:
    """Put the arrays back as `save` found them."""
    tags.put_back(scene, tags.STATE, saved)
    tags.put_back(method, tags.STATE, saved, "method/")
