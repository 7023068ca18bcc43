"""Size of the page of result files, seconds until it shows, milliseconds of script a frame.

    python tests/view_cost.py RESULT.h5...

It needs a Chromium. Positions are compared with the file's at every row, over the scene's size.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mbsim.results.reading import open_results
from mbsim.view.browser import opened_page
from mbsim.view.page import packs_of, page
from mbsim.view.scene import read_scene

#: Frames that are drawn; the first ones compile shaders.
FRAMES, FIRST = 60, 10
#: A pixel can be read when the first frame is finished, also by a graphics process.
_SHOWN = """
mbsimReady.then((view) => {
  const gl = view.stage.renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
})
"""
_DRAW = """
(async () => {
  const found = [];
  for (let k = 0; k < %d; k += 1) {
    const began = performance.now();
    mbsimView.setTime(mbsimView.span[0] + (k + 0.5) / %d * (mbsimView.span[1] - mbsimView.span[0]));
    mbsimView.draw();
    mbsimView.curves.cursor(mbsimView.time);
    found.push(performance.now() - began);
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  }
  return found;
})()
"""
_POSITIONS = """
%s.map((time) => { mbsimView.setTime(time); const run = mbsimView.runs[0];
  return Array.from(run.p, (x, c) => x + run.about.centre[c %% 3]); })
"""


def measure(file: Path, folder: Path) -> str:
    """Return a line of figures."""
    with open_results(file) as results:
        scene = read_scene(results)
        target = folder / f"{file.stem}.html"
        target.write_text(page(file.stem, {}, packs_of([scene])), encoding="utf-8")
        with opened_page(1280, 800) as window:
            began = time.perf_counter()
            window.open(target.as_uri())
            window.run(_SHOWN)
            loaded = time.perf_counter() - began
            frames = np.sort(window.run(_DRAW % (FRAMES, FRAMES))[FIRST:])
            rows = np.unique(np.linspace(0, len(scene.time) - 1, 400).astype(int))
            shown = np.array(window.run(_POSITIONS % scene.time[rows].tolist()))
        off = np.abs(shown.reshape(len(rows), -1, 3) - scene.poses.p[rows]).max() / scene.size
    median, high = frames[len(frames) // 2], frames[int(0.9 * len(frames))]
    return (
        f"{file.stem:<26} {target.stat().st_size / 1e6:5.2f} MB  load {loaded:5.2f} s  "
        f"frame {median:5.1f} ms, nine in ten {high:5.1f}  off {off:.1e}"
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        for name in sys.argv[1:]:
            print(measure(Path(name), Path(made)))
