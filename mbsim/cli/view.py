"""`mbsim view`: the motion of result files in 3D, as a page for a browser."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import counted, echo
from mbsim.cli.options import RESULT_SUFFIXES

if TYPE_CHECKING:
    from mbsim.results.reading import Results
    from mbsim.view.run_data import RunData
    from mbsim.view.scene import Scene

#: Largest side of a picture [pixels].
_LARGEST = 8192
#: What --gltf writes.
_GLTF = "glTF model", "--gltf"


@click.command("view")
@click.argument(
    "files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULT.h5..."
)
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE.html",
    help="The page.  [default: <result>.html, where no other file is asked for]",
)
@click.option(
    "--signals",
    multiple=True,
    metavar="NAME",
    help="Show these curves first, e.g. contacts/301/force; may be repeated.",
)
@click.option("--serve", is_flag=True, help="Serve the page on this machine while runs go on.")
@click.option(
    "--port", type=click.IntRange(0, 65535), metavar="N", help="For --serve.  [default: a free one]"
)
@click.option("--png", type=click.Path(path_type=Path), metavar="FILE", help="Write a picture.")
@click.option(
    "--gif", type=click.Path(path_type=Path), metavar="FILE", help="Write an animated picture."
)
@click.option("--mp4", type=click.Path(path_type=Path), metavar="FILE", help="Write a film.")
@click.option(
    "--gltf",
    type=click.Path(path_type=Path),
    metavar="FILE.glb",
    help="Write the motion for other programs (one result file).",
)
@click.option(
    "--mode",
    type=click.IntRange(min=1),
    metavar="N",
    help="Show a mode of the last linear analysis, by its number in the table.",
)
@click.option("--time", type=float, metavar="T", help="Of --png.  [default: half of the run]")
@click.option(
    "--speed",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="X",
    help="Of --gif and --mp4, in times real time.  [default: for 2.5 to 20 s]",
)
@click.option(
    "--size",
    default="1280x720",
    show_default=True,
    metavar="WxH",
    help="Of pictures, in pixels.",
)
@click.option(
    "--theme", type=click.Choice(["light", "dark"]), help="Of the page.  [default: the reader's]"
)
def command(
    files: tuple[Path, ...], output: Path | None, serve: bool, size: str, **options: object
) -> None:
    """Write the motion of RESULT.h5 as one HTML page that any browser shows, without a network.

    Two result files are shown over each other, in the units of the first.
    """
    from mbsim.errors import ModelError

    if len(files) > 2:
        raise ModelError("one or two result files are shown, the second over the first")
    asked = _Asked(files, output, size=_size(size), **options)  # type: ignore[arg-type]
    if serve:
        asked.serve()
    else:
        asked.write()


@dataclass
class _Asked:
    """What the options ask for."""

    files: tuple[Path, ...]
    output: Path | None
    signals: tuple[str, ...]
    port: int | None
    png: Path | None
    gif: Path | None
    mp4: Path | None
    gltf: Path | None
    #: Number of a mode of a linear analysis to show instead of the run.
    mode: int | None
    #: Width and height of pictures [pixels].
    size: tuple[int, int]
    #: Of the picture [time units of the result].
    time: float | None
    #: Times real time.
    speed: float | None
    theme: str | None

    def serve(self) -> None:
        """Serve the page until Ctrl-C."""
        from mbsim.errors import ModelError
        from mbsim.view.serve import HOST, Served, server

        if self.mode is not None:
            raise ModelError("--serve shows runs that go on, and no --mode")
        if any((self.output, self.png, self.gif, self.mp4, self.gltf)):
            raise ModelError("--serve writes no files: leave out -o, --png, --gif, --mp4, --gltf")
        for file in self.files:
            if not file.is_file():
                if file.suffix.lower() not in RESULT_SUFFIXES:
                    raise ModelError(f"{file}: no such file; a result file is named <model>.h5")
                echo(f"{file} is not there yet; it is shown once a run writes it", err=True)
        served = Served(self.files, self.signals)
        with server(served, self.port or 0) as made:
            echo(f"http://{HOST}:{made.server_port}/ shows {', '.join(map(str, self.files))}")
            echo("Ctrl-C ends it", err=True)
            try:
                made.serve_forever()
            except KeyboardInterrupt:
                echo("", err=True)

    def write(self) -> None:
        """Write the files that are asked for."""
        from mbsim.cli.count_bar import CountBar
        from mbsim.cli.messages import warn
        from mbsim.errors import ModelError
        from mbsim.results.curves import names_of
        from mbsim.results.opening import read_apart
        from mbsim.results.products import check_product, said_size, write_product
        from mbsim.view.pictures import check_tools, make

        pictures = {"png": self.png, "gif": self.gif, "mp4": self.mp4}
        check_tools(**pictures)
        for given, option in ((self.gltf, "--gltf"), (self.mode, "--mode")):
            if given is not None and len(self.files) > 1:
                raise ModelError(f"{option} takes one result file")
        page = self.output
        if page is None and not any((*pictures.values(), self.gltf)):
            mode = "" if self.mode is None else f"-mode-{self.mode}"
            page = Path("-over-".join(names_of(list(self.files))) + f"{mode}.html")
        if page is not None:
            check_product(page, "page")
        if self.gltf is not None:
            check_product(self.gltf, *_GLTF)
        text, packs, model = read_apart(self._read, *self.files)
        warn(line for pack in packs for line in pack.warnings)
        if self.gltf is not None:
            write_product(self.gltf, model, *_GLTF)
            echo(f"{self.gltf}: {said_size(self.gltf)}")
        if any(pictures.values()):
            bar = CountBar("pictures") if sys.stderr.isatty() and (self.gif or self.mp4) else None
            update = bar.update if bar else None
            try:
                make(text, self.size, **pictures, time=self.time, speed=self.speed, progress=update)
            finally:
                if bar is not None:
                    bar.stop()
            for file in filter(None, pictures.values()):
                echo(f"{file}: {said_size(file)}")
        if page is not None:
            write_product(page, text, "page")
            echo(f"{page}: {_rows(packs)}, {said_size(page)}")

    def _read(self) -> tuple[str, list[RunData], bytes]:
        """Return the page, its packs, and the glTF model where one is asked for."""
        from mbsim.results.reading import open_results
        from mbsim.view.gltf import glb
        from mbsim.view.page import packs_of, page, title_of

        with ExitStack() as stack:
            scenes = [
                self._scene(stack.enter_context(open_results(file)), file) for file in self.files
            ]
            model = glb(scenes[0]) if self.gltf is not None else b""
            packs = packs_of(scenes, self.signals)
            settings = {"theme": self.theme} if self.theme else {}
            return page(title_of(scenes), settings, packs), packs, model

    def _scene(self, results: Results, file: Path) -> Scene:
        """Return what is shown of a result file."""
        from dataclasses import replace

        from mbsim.results.mode_motion import motion_of_mode
        from mbsim.view.scene import read_scene

        if self.mode is None:
            return read_scene(results)
        scene = read_scene(motion_of_mode(results, self.mode))
        return replace(scene, name=f"{file.stem}, mode {self.mode}")


def _rows(packs: Sequence[RunData]) -> str:
    """Return how many rows are shown of those of each file."""
    return " and ".join(
        counted(pack.rows, "rows")
        if pack.rows == pack.rows_of_file
        else f"{pack.rows} of {counted(pack.rows_of_file, 'rows')}"
        for pack in packs
    )


def _size(text: str) -> tuple[int, int]:
    """Return width and height of a text like 1280x720."""
    from mbsim.errors import ModelError

    found = re.fullmatch(r"(\d{2,4})x(\d{2,4})", text.strip().lower())
    if found is None or max(int(found[1]), int(found[2])) > _LARGEST:
        raise ModelError(
            f"--size {text}: must be WIDTHxHEIGHT in pixels, each from 10 to {_LARGEST}"
        )
    return int(found[1]), int(found[2])
