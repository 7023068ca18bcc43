"""`mbsim bench`: run time against error, and peers where they are installed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from mbsim.cli.messages import echo
from mbsim.cli.options import json_option

if TYPE_CHECKING:
    from mbsim.bench.runner import Options, Report
    from mbsim.bench.whole import Whole


#: CPU time that a case of stress may take, s.
LONGEST = 60.0


def _numbers(ctx: click.Context, parameter: click.Parameter, value: str | None) -> list[float]:
    """Return a list of numbers separated by commas."""
    try:
        return [float(text) for text in value.split(",")] if value else []
    except ValueError:
        raise click.BadParameter(f"{value}: numbers separated by commas, e.g. 1e-4,1e-8") from None


@click.command("bench")
@click.argument("scenes", nargs=-1, metavar="[SCENE]...")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    default=Path("bench"),
    show_default=True,
    metavar="DIR",
    help="Folder for bench.csv, bench.md, bench.html, a picture a scene, and the decks.",
)
@click.option(
    "--tol",
    "tolerances",
    callback=_numbers,
    metavar="X,X,...",
    help="Our tolerances; default: the scene's, mostly 1e-3 to 1e-12.",
)
@click.option(
    "--integrator",
    "integrators",
    multiple=True,
    metavar="NAME",
    help="Ours; may be repeated; default: all there are.",
)
@click.option(
    "--repeats",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="The time is their median; runs below 10 ms are repeated three times as often, "
    "those above 2 s not at all.",
)
@click.option("--no-peers", is_flag=True, help="Run only mbsim, whatever is installed.")
@click.option(
    "--stress",
    is_flag=True,
    help="Run decks at the ends of what may be asked for instead, SCENE being a family of them.",
)
@json_option("all numbers as one JSON object")
def command(
    scenes: tuple[str, ...],
    output: Path,
    tolerances: list[float],
    integrators: tuple[str, ...],
    repeats: int,
    no_peers: bool,
    stress: bool,
    as_json: bool,
) -> None:
    """Run SCENEs (default: all) here and on the peers that are installed.

    Writes DIR/bench.csv, bench.md, bench.html and, with matplotlib, one PNG a scene; with
    --stress DIR/stress.csv and stress.md.
    """
    if stress:
        given = click.get_current_context().get_parameter_source
        for name in ("repeats", "no_peers"):
            if given(name) is not ParameterSource.DEFAULT:
                option = "--" + name.replace("_", "-")
                raise click.UsageError(
                    f"--stress runs each case once and no peer: leave out {option}"
                )
        _stress(scenes, output, tolerances, integrators, as_json)
        return
    from mbsim.bench import page, peers, plot, report, runner, whole
    from mbsim.cli.messages import print_json

    installed = [] if no_peers else peers.available()
    missing = [] if no_peers else [name for name in peers.ENGINES if name not in installed]
    if missing:
        has = "mbsim-contact[bench] has them"
        has += ", but for ode: a library and a C compiler" if "ode" in missing else ""
        _say(f"not installed, so not compared: {', '.join(missing)}; {has}")
    chosen = runner.choose_scenes(scenes)
    methods = runner.choose_integrators(integrators)
    options = runner.Options(chosen, methods, tolerances, repeats, installed)
    report.write_text(output / "bench.csv", "")  # now, not after minutes, if DIR cannot be used
    done = runner.run(options, output, _say)
    wholes = whole.measure(chosen, whole.chosen(chosen, done.rows, done.cells), output / "decks")
    absent = list(peers.ENGINES) if no_peers else missing
    text = report.markdown(done.machine, chosen, done.rows, done.cells, absent, wholes)
    report.write_text(output / "bench.md", text)
    pictures = _draw(options, done, output) if plot.available() else {}
    report.write_text(output / "bench.html", page.page(text, pictures))
    if not plot.available():
        _say("no pictures: matplotlib is not installed; mbsim-contact[plot] has it")
    if as_json:
        print_json(_as_json(done, wholes, output, pictures))
    else:
        echo(text, nl=False)
    _say(f"{len(done.rows)} measurements in {output / 'bench.csv'}")


def _stress(
    families: tuple[str, ...],
    output: Path,
    tolerances: list[float],
    integrators: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run the cases of stress; exit code 1 where one ends as it may not."""
    import os

    from mbsim.bench import report, runner
    from mbsim.bench.machine import describe
    from mbsim.bench.stress import Asked, chosen, judge, table, workers
    from mbsim.cli.messages import print_json

    asked = Asked(families, runner.choose_integrators(integrators), tolerances)
    cases, verdicts = chosen(asked), []
    report.write_text(output / "stress.csv", "")
    for found in workers.verdicts(cases, asked, os.cpu_count() or 1, LONGEST):
        verdicts.append(found)
        _say(f"[{len(verdicts)}/{len(cases)}] {table.line(found)[2:]}")
    table.write_csv(output / "stress.csv", describe(), verdicts)
    text = table.markdown(verdicts)
    report.write_text(output / "stress.md", text)
    if as_json:
        print_json([found._asdict() for found in verdicts])
    else:
        echo(text, nl=False)
    if any(found.ended in judge.FAULTS for found in verdicts):
        raise SystemExit(1)


def _say(text: str) -> None:
    """Print a line for people, not for pipes."""
    echo(f"mbsim: {text}", err=True)


def _draw(options: Options, done: Report, output: Path) -> dict[str, Path]:
    """Draw every scene that has a result, and return the files by scene."""
    from mbsim.bench import plot

    drawn = {}
    for scene in options.scenes:
        if any(row.scene == scene.name and row.errors for row in done.rows):
            path = output / f"{scene.name}.png"
            plot.draw(scene, done.rows, path)
            drawn[scene.name] = path
    return drawn


def _as_json(
    done: Report, wholes: list[Whole], output: Path, pictures: dict[str, Path]
) -> dict[str, object]:
    """Return the report as JSON has it; what is no number is null."""
    from mbsim.results.form import finite

    return {
        "machine": done.machine,
        "rows": [finite(row._asdict()) for row in done.rows],
        "cells": [finite(cell._asdict()) for cell in done.cells],
        "whole_runs": [finite(whole._asdict()) for whole in wholes],
        "files": [
            *(str(output / name) for name in ("bench.csv", "bench.md", "bench.html")),
            *map(str, pictures.values()),
        ],
    }
