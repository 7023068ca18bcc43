"""`mbsim request`: signals that a run did not write, from the states that it did."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from mbsim.cli.completion import request_names
from mbsim.cli.messages import counted, echo
from mbsim.cli.options import json_option


@click.command("request")
@click.argument("result", type=click.Path(path_type=Path), metavar="RESULT.h5")
@click.argument("names", nargs=-1, required=True, metavar="NAME...", shell_complete=request_names)
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE.csv",
    help="Instead of standard output.",
)
@click.option(
    "--every",
    type=float,
    metavar="DT",
    help="At these times between the rows too: the run is made again.",
)
@click.option(
    "--no-scripts", "scripts", flag_value=False, default=True, help="Refuse decks with user code."
)
@json_option("one JSON object instead of CSV")
def command(
    result: Path,
    names: tuple[str, ...],
    output: Path | None,
    every: float | None,
    scripts: bool,
    as_json: bool,
) -> None:
    """Evaluate contact forces, and what is named by espy, again at the output times of RESULT.h5.

    NAME is Force_Contact[ID].force (torque, penetration, slip_speed, incidents, area) or
    Force_Contact[ID].incident[K].mu (force, torque, mode, slip, xdot, x, depth, rate, nforce,
    friction, stored, point, normal, area, state0, ..., and what a user's function names by espy),
    K counting the incidents of the row from 0. Of other elements it is what rows have,
    Constraint_Joint[ID].force or Force_Element[ID].UNKNOWN, and what their subroutines name by
    espy, Force_Scalar_TwoBody[ID].name. /x, /y, /z or /mag after a vector takes one number
    of it. The deck and users' files must be those of the run. With --every the run is made
    again with rows so far apart [T], and the columns are of these rows.
    """
    from mbsim.cli.messages import print_json
    from mbsim.errors import ModelError
    from mbsim.plugins.permission import no_scripts
    from mbsim.results.files import replace_text
    from mbsim.results.form import finite
    from mbsim.results.reading import open_results
    from mbsim.run.between_rows import ASKS_WHERE_ROWS_ARE, rerun
    from mbsim.run.replay import request

    if output is not None and as_json:
        raise ModelError("-o goes with CSV: take either -o or --json")
    with open_results(result) as results, no_scripts(not scripts):
        with nullcontext(results) if every is None else rerun(results, every) as rows:
            time, columns = request(rows, names)
        if every is not None and results.attributes["integrator"] == ASKS_WHERE_ROWS_ARE:
            said = f"steps of {ASKS_WHERE_ROWS_ARE} depend on rows: this is another run within tol"
            echo(f"mbsim: {said}", err=True)
    if as_json:
        print_json({"result_file": str(result), "time": time.tolist(), "signals": finite(columns)})
        return
    lines = _csv(time.tolist(), columns)
    if output is None:
        sys.stdout.writelines(lines)
        return
    replace_text(output, "".join(lines))
    echo(f"{output}: {counted(len(columns), 'columns')}, {counted(len(time), 'rows')}")


def _csv(time: list[float], columns: dict[str, list[Any]]) -> Iterator[str]:
    """Yield lines of CSV; what is not there is empty."""
    yield ",".join(["Time", *columns]) + "\n"
    for k, t in enumerate(time):
        yield ",".join([repr(t), *(_cell(values[k]) for values in columns.values())]) + "\n"


def _cell(value: Any) -> str:
    """Return a number such that it reads back exactly, or a text that is one cell."""
    if isinstance(value, str):
        plain = not any(character in value for character in ',"\n')
        return value if plain else '"' + value.replace('"', '""') + '"'
    return "" if value != value else repr(float(value))
