"""`mbsim identify`: parameters of a deck fitted to measured curves."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import counted, echo, warn
from mbsim.cli.options import (
    folder_option,
    json_option,
    progress_option,
    scheduler_option,
    workers_option,
)

if TYPE_CHECKING:
    from mbsim.studies.identify import Identified


@click.command("identify")
@click.argument("file", type=click.Path(path_type=Path), metavar="STUDY.toml")
@folder_option("what comes of it", "<study name>/")
@workers_option
@scheduler_option
@progress_option
@json_option("all that came of it as one JSON object")
def command(
    file: Path,
    output: Path | None,
    workers: int | None,
    scheduler: str | None,
    progress: str,
    as_json: bool,
) -> None:
    """Fit parameters of a deck to the measured curves that STUDY.toml names.

    Writes DIR/<study>.json and DIR/<study>.html: estimates with standard deviations, what the
    records do not see, and whether the model explains them. Ctrl-C keeps the best so far.
    """
    from mbsim.cli.count_bar import CountBar
    from mbsim.cli.messages import print_json
    from mbsim.cli.options import check_workers
    from mbsim.errors import Interrupted, ResultsError
    from mbsim.results.files import prepare_directory
    from mbsim.results.products import check_product
    from mbsim.studies.account import facts
    from mbsim.studies.identify import identify, pool_of
    from mbsim.studies.problem import read_problem
    from mbsim.studies.stopping import stoppable

    check_workers(workers, scheduler)
    problem = read_problem(file)
    warn(problem.notes)
    folder = output or Path(problem.name)
    prepare_directory(folder, problem.name)
    check_product(folder / f"{problem.name}.html", "page")
    shown = progress == "auto" and sys.stderr.isatty()
    bar = CountBar("runs") if shown else None
    try:
        with stoppable():
            pool = pool_of(problem, workers, scheduler, lambda line: warn([line]))
            found = identify(problem, pool, (lambda runs: bar.update(runs)) if bar else None)
    finally:
        if bar:
            bar.stop()
    about = facts(found)
    # said before it is written: a full disk takes nothing of what the runs have found
    if as_json:
        print_json(about)
    else:
        _show(found)
    _write(found, folder, about)
    if not as_json:
        _show_files(found, folder)
    if found.stopped and found.stopped_by == 0:
        raise ResultsError(f"stopped: the best so far is in {folder}")
    if found.stopped:
        raise Interrupted(f"interrupted: the best so far is in {folder}", found.stopped_by)


def _write(found: Identified, folder: Path, about: dict[str, object]) -> None:
    """Write the JSON file and the page."""
    import json

    from mbsim.results.files import replace_bytes
    from mbsim.results.products import write_product
    from mbsim.studies.account import page

    name = found.problem.name
    text = json.dumps(about, indent=1, allow_nan=False) + "\n"
    replace_bytes(folder / f"{name}.json", text.encode())
    write_product(folder / f"{name}.html", page(found), "page")


def _show(found: Identified) -> None:
    """Print what came of it."""
    from mbsim.studies.account import lines_of

    for line in lines_of(found):
        echo(line)


def _show_files(found: Identified, folder: Path) -> None:
    """Print what was written and how many runs it took, and warn of what is wrong."""
    failed = sum(count for count, _ in found.reasons)
    name = found.problem.name
    echo(
        f"{folder / name}.html, .json: {counted(found.runs, 'runs')}"
        + (f", {failed} failed" if failed else "")
    )
    warn(found.warnings)
    warn(f"{counted(count, 'runs')} failed: {why}" for count, why in found.reasons[:3])
