"""`mbsim plot`: signals of result files as a picture."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.completion import signal_names
from mbsim.cli.messages import echo
from mbsim.cli.options import RESULT_SUFFIXES, json_option

if TYPE_CHECKING:
    from mbsim.results.curves import Choice, Picture
    from mbsim.results.reading import Results

_TABLE_SUFFIX = ".parquet"
#: Longest made-up name of a picture.
_LONGEST = 100


@click.command("plot")
@click.argument(
    "arguments",
    nargs=-1,
    required=True,
    metavar="RESULT.h5... NAME...",
    shell_complete=signal_names,
)
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="PNG or SVG, by its suffix.  [default: <result>-<signals>.png]",
)
@click.option(
    "--x", "over", metavar="NAME", default="time", help="Draw over this signal, not over time."
)
@click.option("--from", "start", type=float, metavar="T", help="First time to draw.")
@click.option("--to", "end", type=float, metavar="T", help="Last time to draw.")
@click.option("--log", is_flag=True, help="Logarithmic y axes.")
@click.option("--events", is_flag=True, help="Mark when contacts touch and leave (one file).")
@click.option(
    "--minus",
    type=click.Path(path_type=Path),
    metavar="RESULT.h5",
    help="Draw differences from this run.",
)
@json_option("what was drawn as one JSON object")
def command(
    arguments: tuple[str, ...],
    output: Path | None,
    over: str,
    start: float | None,
    end: float | None,
    log: bool,
    events: bool,
    minus: Path | None,
    as_json: bool,
) -> None:
    """Draw signals of RESULT.h5 against time, one panel for each quantity.

    STUDY.parquet, the table of `mbsim sweep`, is drawn too: its outputs over its parameters; NAME
    is then an output or a parameter.

    NAME is a signal as `mbsim info RESULT.h5` lists it, for example bodies/2/position/z,
    contacts/301/force/mag, requests/3/F2 or energy/kinetic. Without /x, /y, /z or /mag a vector
    gives all its components; 'bodies/*/velocity/mag' (in quotes) all bodies. Several result
    files are drawn over each other, in the units of the first.

    Of a run with --sensitivity, 'sensitivity/Body_Rigid[2].mass/bodies/2/position/z' (in quotes) is
    the derivative of that signal by that parameter; a line across the panel marks the time from
    which it is not known.
    """
    from mbsim.cli.messages import print_json, warn
    from mbsim.errors import ModelError
    from mbsim.results.curves import Choice, collect
    from mbsim.results.drawing import check_target, draw, need_matplotlib, save
    from mbsim.results.opening import read_apart
    from mbsim.results.reading import open_results

    if tables := [name for name in arguments if name.lower().endswith(_TABLE_SUFFIX)]:
        asked = {"--x": over != "time", "--from": start is not None, "--to": end is not None}
        asked |= {"--log": log, "--events": events, "--minus": minus is not None}
        if option := next((name for name, given in asked.items() if given), None):
            raise ModelError(f"{tables[0]}: {option} is for result files, not for a study's table")
        rest = [name for name in arguments if name != tables[0]]
        _draw_table(Path(tables[0]), rest, output, as_json)
        return
    paths, names = _sorted_out(arguments)
    if events and (over.strip("/") != "time" or len(paths) > 1 or minus is not None):
        raise ModelError("--events goes with one result file over time only")
    need_matplotlib()
    choice = Choice(names, over.strip("/"), start, end, log, events)
    target = output or Path(_made_up(paths, choice, minus))

    def read() -> Picture:
        with ExitStack() as stack:
            files = [stack.enter_context(open_results(path)) for path in paths]
            if not names:
                raise ModelError(_no_names(files[0]))
            other = None if minus is None else stack.enter_context(open_results(minus))
            # before the numbers are read: a long run takes a while
            check_target(target)
            return collect(files, choice, other)

    picture = read_apart(read, *paths, *([] if minus is None else [minus]))
    warn(picture.warnings)
    warn(save(draw(picture), target))
    if as_json:
        print_json(_drawn(picture, target))
    else:
        count = sum(len(panel.curves) for panel in picture.panels)
        quantities = ", ".join(panel.axis for panel in picture.panels)
        echo(f"{target}: {count} curve{'s' * (count > 1)}, {quantities}")


def _draw_table(path: Path, names: Sequence[str], output: Path | None, as_json: bool) -> None:
    """Draw the responses of a study: outputs over parameters, all unless some are named."""
    from mbsim.errors import ModelError
    from mbsim.results.drawing import check_target, need_matplotlib, save
    from mbsim.results.response_drawing import MOST_COLUMNS, draw_responses
    from mbsim.studies.table import Responses

    need_matplotlib()
    table = Responses(path)
    if unknown := [name for name in names if name not in (*table.parameters, *table.outputs)]:
        there = ", ".join((*table.parameters, *table.outputs))
        raise ModelError(f"{path}: no column {unknown[0]} to draw; there is {there}")
    parameters = [name for name in table.parameters if name in names] or table.parameters
    outputs = [name for name in table.outputs if name in names] or table.outputs
    if not outputs:
        raise ModelError(f"{path}: has no outputs that are numbers")
    if len(parameters) > MOST_COLUMNS or len(outputs) > MOST_COLUMNS:
        raise ModelError(f"{path}: name at most {MOST_COLUMNS} parameters and outputs to draw")
    target = output or Path(f"{path.stem}.png")
    check_target(target)
    columns = {name: table[name] for name in (*parameters, *outputs, "status")}
    failed = int((columns["status"] == "failed").sum())
    title = f"{path.stem}: {len(table)} runs" + (f", {failed} failed" if failed else "")
    from mbsim.cli.messages import print_json, warn

    warnings = save(draw_responses(columns, parameters, outputs, title), target)
    warn(warnings)
    if as_json:
        drawn: dict[str, object] = {"picture": str(target), "table": str(path)}
        drawn |= {"parameters": list(parameters), "outputs": list(outputs)}
        print_json(drawn | {"runs": len(table), "failed": failed, "warnings": warnings})
    else:
        echo(f"{target}: {len(outputs)} x {len(parameters)} panels, {len(table)} runs")


def _sorted_out(arguments: Sequence[str]) -> tuple[list[Path], tuple[str, ...]]:
    """Return result files and names, each once, in their order."""
    from mbsim.errors import ModelError

    files: dict[Path, None] = {}
    names: dict[str, None] = {}
    for argument in arguments:
        if argument.lower().endswith(RESULT_SUFFIXES) or Path(argument).is_file():
            files[Path(argument)] = None
        else:
            names[argument.strip("/")] = None
    if not files:
        raise ModelError("no result file given: mbsim plot RESULT.h5 NAME...")
    return list(files), tuple(names)


def _no_names(results: Results) -> str:
    """Return what to say where no signal is named: which there are."""
    from mbsim.results.names import compact

    there = ", ".join(compact(results.signals())) or "nothing"
    return f"no signal named; {results.path} has {there}"


def _made_up(paths: Sequence[Path], choice: Choice, minus: Path | None) -> str:
    """Return a name for a picture, in the current directory, that says what is in it."""
    from mbsim.results.curves import names_of

    called = names_of([*paths, *([] if minus is None else [minus])])
    words = ["+".join(called[: len(paths)])]
    words += [f"minus-{called[-1]}"] if minus is not None else []
    words += choice.names[:2]
    words += [f"and-{len(choice.names) - 2}-more"] if len(choice.names) > 2 else []
    words += [] if choice.over == "time" else [f"over-{choice.over}"]
    words += ["log"] if choice.log else []
    text = re.sub(r"[^\w.+-]+", "-", "-".join(words).replace("*", "all"))
    return text[:_LONGEST].rstrip("-.") + ".png"


def _drawn(picture: Picture, target: Path) -> dict[str, object]:
    """Return what is in a picture, for JSON."""
    return {
        "picture": str(target),
        "files": picture.files,
        "x": picture.axis,
        "panels": [
            {
                "quantity": panel.quantity.name,
                "unit": panel.unit,
                **({"known_until": panel.until} if panel.until else {}),
                "curves": [
                    {
                        "file": picture.files[curve.file],
                        "name": curve.name,
                        "label": curve.label,
                        "rows": len(curve.y),
                    }
                    for curve in panel.curves
                ],
            }
            for panel in picture.panels
        ],
        "warnings": picture.warnings,
        "notes": picture.notes,
    }
