"""`mbsim run`: run a deck and write its results."""

from __future__ import annotations

import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mbsim.cli.messages import counted, echo
from mbsim.cli.options import (
    folder_option,
    json_option,
    plugin_option,
    progress_option,
    resume_option,
    set_option,
)
from mbsim.integrators.catalog import METHODS

if TYPE_CHECKING:
    from mbsim.errors import MbsimError
    from mbsim.results.reading import Results

_METHODS = ", ".join(f"{name} ({what})" for name, what in METHODS.items())


@click.command("run")
@click.argument("model", type=click.Path())
@folder_option("results", "<model name>/")
@plugin_option("File with user subroutines")
@set_option("Change an attribute of the deck")
@click.option(
    "--integrator",
    metavar="NAME",
    help=f"{_METHODS}; MotionSolve's names run their kind.  [default: the deck's, else the first]",
)
@click.option(
    "--tol",
    type=float,
    metavar="X",
    help="Local error of a step, dimensionless.  [default: 0.01 of the deck's integr_tol, or 1e-5]",
)
@click.option("--end-time", type=float, metavar="T", help="Instead of the deck's.")
@click.option("--print-interval", type=float, metavar="DT", help="Between output rows.")
@resume_option("Go on from the last checkpoint in DIR")
@progress_option
@json_option("the end state as one JSON object")
@click.option(
    "--detector",
    type=click.Choice(["auto", "fcl"]),
    default="auto",
    show_default=True,
    help="fcl: no closed forms.",
)
@click.option(
    "--signals",
    multiple=True,
    metavar="NAME",
    help="Record these only, e.g. bodies/2/position, 'contacts/*/force', joints; may be repeated. "
    "Time, events and the deck's requests are always there.  [default: everything]",
)
@click.option(
    "--contact-points",
    is_flag=True,
    help="Record every point of contact with its force, slip speed and area, as `mbsim view` shows "
    "them.",
)
@click.option("--report", is_flag=True, help="Write DIR/<model>-report.html too.")
@click.option("--interpret-plugins", is_flag=True, help="Do not compile user subroutines.")
@click.option(
    "--no-scripts", "scripts", flag_value=False, default=True, help="Refuse decks with user code."
)
@click.option(
    "--plugin-timeout",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="S",
    help="End a call of an interpreted user function that takes longer.",
)
@click.option("--allow-overlap", is_flag=True, help="Start although shapes overlap deeply.")
@click.option(
    "--dump-fclib",
    type=click.IntRange(min=1),
    metavar="N",
    help="Write the contact problem of every N-th step, FCLIB files in DIR/fclib.",
)
@click.option(
    "--dump-hardest",
    type=click.IntRange(min=1),
    metavar="K",
    help="Keep the K of them that took MOREAU most sweeps; of every step without --dump-fclib.",
)
@click.option(
    "--verify",
    is_flag=False,
    flag_value="once",
    type=click.Choice(["once", "full"]),
    help="Run again with another method, and give error bars; full: with two or three.",
)
@click.option(
    "--sensitivity",
    multiple=True,
    metavar="ELEMENT[ID].ATTRIBUTE",
    help="Record the derivatives of all signals with respect to a parameter of the deck, e.g. "
    "'Force_Contact[301].mu_dynamic'; may be repeated.",
)
@click.option("--profile", is_flag=True, help="Print where the time went.")
def command(
    model: str,
    output: Path | None,
    overrides: tuple[str, ...],
    progress: str,
    as_json: bool,
    report: bool,
    profile: bool,
    verify: str | None,
    **options: Any,
) -> None:
    """Run MODEL and write DIR/<model>.h5, .csv (requests) and .log."""
    from mbsim.core.profile import profiling

    with profiling(time.process_time()) if profile else nullcontext():
        asked: dict[str | None, bool | str] = {None: False, "once": True, "full": "full"}
        options["verify"] = asked[verify]
        _run(model, output, overrides, progress, as_json, report, **options)


def _run(
    model: str,
    output: Path | None,
    overrides: tuple[str, ...],
    progress: str,
    as_json: bool,
    report: bool,
    **options: Any,
) -> None:
    """Run a deck, and print how it ended."""
    from mbsim.cli.messages import warn
    from mbsim.core.profile import part
    from mbsim.errors import Interrupted, PluginError, SolverError
    from mbsim.reader.xml import read_model
    from mbsim.results.files import prepare_directory

    with part("read"):
        deck = read_model(model, overrides)
    warn(deck.warnings)
    directory = Path(deck.name) if output is None else output
    # before anything is compiled: half a minute is too long to hear of a full disk
    prepare_directory(directory, deck.name)
    result_file = directory / f"{deck.name}.h5"

    from mbsim.cli.progress import Display
    from mbsim.core import jit
    from mbsim.run.simulation import simulate

    shown = progress == "auto" and sys.stderr.isatty()
    display = Display() if shown else None
    jit.on_compile = display.compiling if display else None
    with display or nullcontext():
        try:
            results = simulate(
                deck,
                output=directory,
                progress=display.update if display else None,
                notify=display.say if display else _say,
                **options,
            )
        except (SolverError, PluginError, Interrupted) as error:
            if display:
                display.stop()
            _report_failure(result_file, error, as_json)
            if report and result_file.is_file():
                _report(result_file)
            raise
    with results:
        if as_json:
            _print_json(results, result_file)
        else:
            _print_summary(results, result_file)
        if not as_json and "profile_loop_s" in results.stats:
            from mbsim.cli.profile import print_profile

            print_profile(results.stats)
    if report:
        _report(result_file)


def _report(result_file: Path) -> None:
    """Write the report of a run beside its results."""
    from mbsim.cli.report import write_report

    target = result_file.with_name(f"{result_file.stem}-report.html")
    write_report(result_file, target)
    _say(f"{target}: {target.stat().st_size / 1e6:.2f} MB")


def _say(text: str) -> None:
    """Print a message for the user."""
    echo(f"mbsim: {text}", err=True)


def _report_failure(result_file: Path, error: MbsimError, as_json: bool) -> None:
    """Say what a run that ended early has kept; its error follows from `main`."""
    from mbsim.errors import Interrupted, ResultsError
    from mbsim.results.reading import open_results

    try:
        with open_results(result_file) as results:
            # an older file of this name is not what this run has kept
            if results.status not in ("interrupted", "failed"):
                return
            if as_json:
                _print_json(results, result_file)
            else:
                kept = len(results["time"])
                are = "is" if kept == 1 else "are"
                echo(f"mbsim: {counted(kept, 'rows')} {are} kept in {result_file}", err=True)
            if isinstance(error, Interrupted) and results.has_checkpoint:
                echo("mbsim: the same command with --resume goes on from there", err=True)
    except ResultsError:
        return


def _print_json(results: Results, result_file: Path) -> None:
    """Print the documented JSON object."""
    from mbsim.cli.messages import print_json
    from mbsim.results.audit import facts
    from mbsim.results.form import finite
    from mbsim.results.reading import end_state

    time, audit = results["time"], results.audit
    print_json(
        {
            "status": results.status,
            "result_file": str(result_file),
            "end_time": finite(float(time[-1])) if len(time) else None,
            "stats": finite(results.stats),
            "audit": finite(facts(audit)) if audit is not None else None,
            "bodies": finite(end_state(results)),
        }
    )


def _print_summary(results: Results, result_file: Path) -> None:
    """Print a few lines for people."""
    time, stats = results["time"], results.stats
    end = f"{time[-1]:.9g}" if len(time) else "-"
    echo(f"{results.status} at time {end}, {counted(len(time), 'rows')} in {result_file}")
    echo(
        f"{counted(stats.get('steps', 0), 'steps')}, {stats.get('rejected', 0)} rejected, "
        f"{stats.get('wall_s', 0.0):.2f} s"
        + (f" ({stats['compile_s']:.1f} s of it compiling)" if stats.get("compile_s") else "")
    )
    audit = results.audit
    if audit is not None:
        echo(audit.line)
