"""Pictures of the gallery page: each deck is run, shown by `mbsim view` and photographed.

    python -m mbsim.manual.make gallery [NAME]...

It needs a Chromium, as `mbsim view --png` does.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import mbsim
from mbsim.manual.pictures import FOLDER, LARGEST

#: Width and height of a picture [pixel], and how many colours it has.
SIZE, COLOURS = (640, 400), 64


class Photograph(NamedTuple):
    """A deck of `models/`, at a part of its run from 0 to 1, and how far it is run [T]."""

    deck: str
    part: float = 0.5
    end_time: float | None = None

    @property
    def name(self) -> str:
        """Return the picture's file."""
        return f"gallery-{self.deck}.png"


GALLERY = (
    Photograph("bowling_ball", 0.3),
    Photograph("pendulum_wheel", 0.6, 0.5),
    Photograph("mixed_pile", 1.0),
    Photograph("balls_in_bowl", 0.12),
    Photograph("bolt_on_plate", 1.0, 0.02),
    Photograph("gear_pair", 1.0, 0.02),
    Photograph("geneva", 1.0, 0.6),
    Photograph("cam_roller", 0.5, 0.1),
    Photograph("ratchet", 0.6),
    Photograph("slider_crank_clearance", 0.5),
    Photograph("chain_on_box", 1.0),
    Photograph("flyball_governor", 1.0, 1.0),
)


def take(photograph: Photograph, folder: Path = FOLDER) -> Path:
    """Run a deck and make its picture; return the file."""
    from PIL import Image

    from mbsim.manual.drawings.runs import MODELS
    from mbsim.view.page import packs_of, page
    from mbsim.view.pictures import make
    from mbsim.view.scene import read_scene

    target = folder / photograph.name
    with tempfile.TemporaryDirectory(prefix="mbsim-gallery-") as runs:
        settings: dict[str, Any] = {"end_time": photograph.end_time, "output": runs}
        with mbsim.simulate(MODELS / f"{photograph.deck}.xml", **settings) as results:
            scene = read_scene(results)
            text = page(photograph.deck, {"theme": "light"}, packs_of([scene]))
            first, last = scene.time[0], scene.time[-1]
        at = first + photograph.part * (last - first)
        make(text, SIZE, png=target, time=float(at))
    with Image.open(target) as image:
        image.convert("RGB").quantize(COLOURS).save(target, optimize=True)
    if target.stat().st_size > LARGEST:
        raise ValueError(f"{target.name}: {target.stat().st_size} bytes, {LARGEST} at most")
    return target
