"""`mbsim view`: the motion of result files in 3D, as a page for a browser."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import echo

if TYPE_CHECKING:
    from mbsim.view.run_data import RunData


@click.command("view")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULT.h5...")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE.html",
    help="The page.  [default: <result>.html]",
)
@click.option(
    "--signals",
    multiple=True,
    metavar="NAME",
    help="Show these curves first, e.g. contacts/301/force; may be repeated.",
)
def command(files: tuple[Path, ...], output: Path | None, signals: tuple[str, ...]) -> None:
    """Write the motion of RESULT.h5 as one HTML page that any browser shows, without a network."""
    from mbsim.cli.messages import warn
    from mbsim.errors import ModelError
    from mbsim.results.curves import names_of
    from mbsim.results.opening import read_apart
    from mbsim.results.reading import open_results
    from mbsim.view.page import factors, packs_of, page, title_of, write
    from mbsim.view.scene import read_scene

    if len(files) > 2:
        raise ModelError("one or two result files are shown over each other")
    target = output or Path("-over-".join(names_of(list(files))) + ".html")

    def read() -> tuple[str, list[RunData]]:
        with ExitStack() as stack:
            scenes = [read_scene(stack.enter_context(open_results(file))) for file in files]
            packs = packs_of(scenes, signals)
            settings = {"factors": factors(scenes), "signals": list(signals)}
            return page(title_of(scenes), settings, packs), packs

    text, packs = read_apart(read, *files)
    write(target, text)
    warn(line for pack in packs for line in pack.warnings)
    rows = ", ".join(
        f"{pack.rows} rows" if pack.rows == pack.rows_of_file else f"{pack.rows} of {pack.rows_of_file} rows"
        for pack in packs
    )
    echo(f"{target}: {rows}, {target.stat().st_size / 1e6:.2f} MB")
