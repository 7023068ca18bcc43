"""`mbsim sweep`: a study of many runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import counted, echo, warn
from mbsim.cli.options import (
    check_workers,
    folder_option,
    json_option,
    progress_option,
    resume_option,
    scheduler_option,
    workers_option,
)

if TYPE_CHECKING:
    from mbsim.studies.study import Study
    from mbsim.studies.sweep import Swept

#: Reasons of failed runs that are printed.
_MOST_REASONS = 3


@click.command("sweep")
@click.argument("file", type=click.Path(path_type=Path), metavar="STUDY.toml")
@folder_option("the table", "<study name>/")
@workers_option
@scheduler_option
@resume_option("Keep the rows that DIR has of the same runs")
@click.option(
    "--only",
    multiple=True,
    type=click.IntRange(min=0),
    metavar="RUN",
    help="Run this one only, and write all its results into DIR/run-RUN; may be repeated.",
)
@progress_option
@json_option("what came of it as one JSON object")
def command(
    file: Path,
    output: Path | None,
    workers: int | None,
    scheduler: str | None,
    resume: bool,
    only: tuple[int, ...],
    progress: str,
    as_json: bool,
) -> None:
    """Run a deck as often as STUDY.toml says, and write DIR/<study>.parquet, a row a run.

    Every row is written down as it comes: what was interrupted goes on with --resume. A run that
    fails, or warns, is a row that says so. A design that draws from distributions gives bands of
    the outputs, and Saltelli's Sobol indices, in DIR/<study>.uncertainty.json too.
    """
    from mbsim.cli.count_bar import CountBar
    from mbsim.studies.stopping import stoppable
    from mbsim.studies.study import read_study
    from mbsim.studies.sweep import sweep

    check_workers(workers, scheduler)
    study = read_study(file)
    warn(study.notes)
    folder = output or Path(study.name)
    if only:
        _run_only(study, only, folder, as_json)
        return
    shown = progress == "auto" and sys.stderr.isatty()
    bar = CountBar("runs") if shown else None
    try:
        with stoppable():
            swept = sweep(
                study,
                folder,
                workers=workers,
                scheduler=scheduler,
                resume=resume,
                progress=bar.update if bar else None,
                notify=lambda line: echo(f"mbsim: {line}", err=True),
            )
    finally:
        if bar:
            bar.stop()
    _show(swept, as_json)


def _run_only(study: Study, only: tuple[int, ...], folder: Path, as_json: bool) -> None:
    """Run some of a study's runs here, with all results."""
    from mbsim.cli.messages import print_json
    from mbsim.errors import SolverError
    from mbsim.studies.sweep import write_run

    rows = [write_run(study, run, folder) for run in only]
    if as_json:
        print_json([{**row._asdict(), "folder": str(folder / f"run-{row.run}")} for row in rows])
    for row in rows if not as_json else ():
        why = f": {row.reason}" if row.reason else ""
        echo(f"{folder / f'run-{row.run}'}: {row.status}{why}")
    if all(row.status == "failed" for row in rows):
        raise SolverError("no run came to its end")


def _show(swept: Swept, as_json: bool) -> None:
    """Print what came of a sweep."""
    from mbsim.cli.messages import print_json
    from mbsim.studies.uncertainty import lines_of, warnings_of

    if as_json:
        print_json(
            {
                "table": str(swept.table),
                "runs": sum(swept.counts.values()),
                **{name: swept.counts.get(name, 0) for name in ("finished", "warned", "failed")},
                "kept": swept.kept,
                "reasons": [{"runs": number, "reason": why} for number, why in swept.reasons],
                "warnings": [{"runs": number, "reason": why} for number, why in swept.warnings],
                "uncertainty": swept.uncertainty,
            }
        )
        return
    counts = ", ".join(f"{number} {name}" for name, number in sorted(swept.counts.items()))
    already = f"; {swept.kept} were there" if swept.kept else ""
    echo(f"{swept.table}: {counted(sum(swept.counts.values()), 'runs')}, {counts}{already}")
    for line in lines_of(swept.uncertainty) if swept.uncertainty else ():
        echo(line)
    for what, reasons in (("failed", swept.reasons), ("warned", swept.warnings)):
        shown = reasons[:_MOST_REASONS]
        warn(f"{counted(number, 'runs')} {what}: {why}" for number, why in shown)
        if (more := len(reasons) - _MOST_REASONS) > 0:
            warn([f"{more} more reasons why runs {what} are in the table"])
    warn(warnings_of(swept.uncertainty) if swept.uncertainty else [])
