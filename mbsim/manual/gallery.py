"""Photographs of runs: each deck is run, shown by `mbsim view` or a report, and photographed.

    python -m mbsim.manual.make gallery [NAME]...

It needs a Chromium, as `mbsim view --png` does.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import mbsim
from mbsim.manual.pictures import FOLDER, LARGEST

if TYPE_CHECKING:
    from mbsim.results.reading import Results

#: Width and height of a picture [pixel], and how many colours it has: a scene, a whole page.
SIZE, COLOURS = (640, 400), (64, 160)
#: Of the window whose whole page is shown.
WINDOW = (960, 600)


class Photograph(NamedTuple):
    """A deck of `models/`, at a part of its run from 0 to 1, and how far it is run [T]."""

    deck: str
    part: float = 0.5
    end_time: float | None = None
    page: str = ""  # view or report: the whole page as a reader sees it

    @property
    def name(self) -> str:
        """Return the picture's file."""
        return f"{self.page or 'gallery'}-{self.deck}.png"


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
    Photograph("bowling_ball", 0.3, page="view"),
    Photograph("bowling_ball", page="report"),
)


def take(photograph: Photograph, folder: Path = FOLDER) -> Path:
    """Run a deck and make its picture; return the file."""
    from PIL import Image

    from mbsim.manual.drawings.runs import MODELS

    target = folder / photograph.name
    with tempfile.TemporaryDirectory(prefix="mbsim-gallery-") as runs:
        settings: dict[str, Any] = {"end_time": photograph.end_time, "output": runs}
        deck = os.path.relpath(MODELS / f"{photograph.deck}.xml")  # as a reader would say it
        with mbsim.simulate(deck, **settings) as results:
            _shoot(photograph, results, Path(runs), target)
    with Image.open(target) as image:
        image.convert("RGB").quantize(COLOURS[bool(photograph.page)]).save(target, optimize=True)
    if target.stat().st_size > LARGEST:
        raise ValueError(f"{target.name}: {target.stat().st_size} bytes, {LARGEST} at most")
    return target


def _shoot(photograph: Photograph, results: Results, folder: Path, target: Path) -> None:
    """Show results in a browser and write what is seen."""
    from mbsim.view.browser import opened_page
    from mbsim.view.page import packs_of, page
    from mbsim.view.pictures import make
    from mbsim.view.report import report
    from mbsim.view.scene import read_scene

    scene = read_scene(results)
    at = float(scene.time[0] + photograph.part * (scene.time[-1] - scene.time[0]))
    text = page(photograph.deck, {"theme": "light"}, packs_of([scene]))
    if not photograph.page:
        make(text, SIZE, png=target, time=at)
        return
    file = folder / "page.html"
    file.write_text(report(results) if photograph.page == "report" else text, encoding="utf-8")
    with opened_page(*WINDOW) as window:
        window.open(file.as_uri() + "#picture")
        window.run(f"mbsimReady.then(() => {{ mbsimView.setTime({at!r}); mbsimView.draw(); }})")
        target.write_bytes(window.picture())
