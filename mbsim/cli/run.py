"""`mbsim run`: run a model, show how far it is, say where the results are."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from mbsim.simulation import Progress


@contextlib.contextmanager
def _progress(wanted: bool) -> Iterator[Progress | None]:
    """Show simulated time, step size and time left while a terminal looks on."""
    if not wanted or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        BarColumn(),
        TextColumn("t = {task.completed:.4g} of {task.total:.4g}"),
        TextColumn("step {task.fields[step]:.2e}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("run", total=None, step=0.0)

        def show(time: float, step: float, end_time: float) -> None:
            bar.update(task, completed=time, total=end_time, step=step)

        yield show


@click.command("run")
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for results; default <model name>/.",
)
@click.option(
    "--plugin",
    "plugins",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="File with user subroutines; may be given again.",
)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="SELECTOR=VALUE",
    help="Change an attribute, e.g. 'Force_Contact[1].mu_static=0.3'.",
)
@click.option("--integrator", metavar="NAME", help="DOPRI5.")
@click.option("--tol", type=float, help="Local error of a step, dimensionless; default 1e-5.")
@click.option("--end-time", type=float, help="Instead of the deck's.")
@click.option("--print-interval", type=float, help="Instead of the deck's.")
@click.option("--resume", is_flag=True, help="Go on from the last checkpoint in DIR.")
@click.option("--progress", type=click.Choice(["auto", "off"]), default="auto")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")
@click.option(
    "--detector",
    type=click.Choice(["auto", "fcl"]),
    default="auto",
    help="fcl: every pair through FCL.",
)
@click.option("--interpret-plugins", is_flag=True, help="Do not compile user subroutines.")
@click.option("--allow-overlap", is_flag=True, help="Start although shapes overlap deeply.")
def command(
    model: Path,
    output: Path | None,
    plugins: tuple[Path, ...],
    overrides: tuple[str, ...],
    progress: str,
    as_json: bool,
    **settings: Any,
) -> None:
    """Run MODEL.xml and write results to a folder."""
    from mbsim.reader.xml import read_model

    deck = read_model(model, overrides)
    # reading first: a fault of the deck costs no import of what would run it
    from mbsim.results.reading import end_state, finite
    from mbsim.simulation import simulate

    for line in deck.warnings:
        click.echo(f"mbsim: warning: {line}", err=True)
    folder = Path(deck.name) if output is None else output
    with _progress(progress == "auto") as show:
        results = simulate(
            deck,
            plugins=plugins,
            output=folder,
            progress=show,
            notify=lambda line: click.echo(f"mbsim: {line}", err=True),
            **settings,
        )
    with results:
        stats, end = results.stats, float(results["time"][-1])
        if as_json:
            answer = {
                "status": results.status,
                "result_file": str(results.path),
                "end_time": end,
                "stats": stats,
                "bodies": end_state(results),
            }
            click.echo(json.dumps(finite(answer)))
            return
        click.echo(
            f"{results.status} at t = {end:g}: {stats['steps']} steps, "
            f"{stats['rhs_evaluations']} evaluations, {stats['wall_s']:.2f} s; {results.path}"
        )
