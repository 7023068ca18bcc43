"""`mbsim fclib`: frictional contact problems in FCLIB files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mbsim.cli.messages import counted, echo, print_json
from mbsim.cli.options import json_option

if TYPE_CHECKING:
    from mbsim.errors import MbsimError
    from mbsim.fclib.merit import Figures
    from mbsim.fclib.problem import Contents, Global, Local, Matrix
    from mbsim.fclib.solve import Result

_FILES = click.argument(
    "files",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE.hdf5|FOLDER...",
)
_JSON = json_option("a JSON list")


def _positive(ctx: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    """Refuse numbers that are not above 0."""
    if value is not None and (not value > 0.0 or not math.isfinite(value)):
        raise click.BadParameter(f"{value}: a number above 0 is allowed")
    return value


_TOL = click.option(
    "--tol",
    type=float,
    default=1e-8,
    show_default=True,
    callback=_positive,
    help="Largest relative natural-map error of a solution.",
)
_TIME = click.option(
    "--max-time",
    type=float,
    default=20.0,
    show_default=True,
    callback=_positive,
    metavar="SECONDS",
    help="Give up after this long on a problem.",
)


@click.group("fclib")
def command() -> None:
    """Frictional contact problems in FCLIB files: show, judge, solve, compare."""


@command.command("info")
@_FILES
@_JSON
def info(files: tuple[Path, ...], as_json: bool) -> None:
    """Show what is in FILE: kind, sizes, storage, friction, solution and guesses."""
    faults: list[MbsimError] = []
    found = [_about(file, contents) for file, contents in _contents(files, faults)]
    if as_json:
        _print_list(found)
    else:
        for about in found:
            echo(f"{about.pop('file')}")
            for name, value in about.items():
                if value not in (None, ""):
                    echo(f"  {name.replace('_', ' '):14s} {_text(value)}")
    _end(faults)


@command.command("merit")
@_FILES
@_JSON
def merit(files: tuple[Path, ...], as_json: bool) -> None:
    """Judge the solution and the guesses that FILE holds; u is recomputed, not believed.

    Files written by Siconos hold r = 0 as their solution.
    """
    from mbsim.fclib.merit import judge
    from mbsim.fclib.reduction import reduce

    found: list[dict[str, Any]] = []
    faults: list[MbsimError] = []
    for file, contents in _contents(files, faults):
        blocks = reduce(contents.problem)
        stored = [("solution", contents.solution)] if contents.solution is not None else []
        stored += [(f"guesses/{k}", guess) for k, guess in enumerate(contents.guesses, 1)]
        if not stored:
            echo(f"mbsim: {file}: no solution and no guesses", err=True)
        for place, solution in stored:
            assert solution is not None
            figures = judge(contents.problem, solution, blocks)
            found.append({"file": str(file), "place": place, **_judged(figures)})
    if as_json:
        _print_list(found)
    else:
        for entry in found:
            echo(f"{entry.pop('file')} {entry.pop('place')}")
            for name, value in entry.items():
                echo(f"  {name.replace('_', ' '):26s} {_text(value)}")
    _end(faults)


@command.command("solve")
@_FILES
@click.option("--solver", default="AUTO", show_default=True, metavar="NAME", help="One of ours.")
@_TOL
@_TIME
@click.option("--strict", is_flag=True, help="The natural map over |q| must be at most tol, too.")
@click.option("--guess", type=click.IntRange(min=1), help="Start from the file's guess N.")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the problem with the solution (one FILE.hdf5 only).",
)
@_JSON
def solve(
    files: tuple[Path, ...],
    solver: str,
    tol: float,
    max_time: float,
    strict: bool,
    guess: int | None,
    output: Path | None,
    as_json: bool,
) -> None:
    """Solve the problem in each FILE and say how good the solution is.

    Exit code 3 if one is not solved; its best iterate is written all the same. "solved relative":
    only the published relative error is met, and a contact may be wrong by more than its own size.
    """
    from mbsim.errors import ModelError, SolverError
    from mbsim.fclib import hdf5
    from mbsim.fclib.solve import solve as solve_problem
    from mbsim.fclib.solvers.catalog import solver as named

    chosen = _expanded(files)
    if output is not None and len(chosen) > 1:
        raise ModelError("-o FILE goes with one problem only")
    named(solver)
    _tell_compiling()
    found: list[dict[str, Any]] = []
    faults: list[MbsimError] = []
    for file, contents in _contents(chosen, faults):
        start = None
        if guess is not None:
            if guess > len(contents.guesses):
                there = len(contents.guesses)
                faults.append(ModelError(f"{file}: guess {guess}: there are {there}"))
                continue
            start = contents.guesses[guess - 1]
        result = solve_problem(
            contents.problem, tol, solver, guess=start, strict=strict, max_seconds=max_time
        )
        found.append(_solved(file, contents.problem, result))
        if result.status == "not_solved":
            faults.append(SolverError(f"{file}: not solved to {tol:g}: {result.reason}"))
        if output is not None:
            hdf5.write(output, contents.problem, result.solution, contents.guesses)
        if not as_json:
            _show_solved(found[-1], result.reason)
    if as_json:
        _print_list(found)
    elif len(found) > 1:
        _show_all(found)
    _end(faults)


@command.command("compare")
@_FILES
@_TOL
@_TIME
@click.option(
    "--solver",
    "solvers",
    multiple=True,
    metavar="NAME",
    help="Ours; may be repeated.  [default: AUTO NSGS PROX ADMM NSN]",
)
@click.option("--repeats", type=click.IntRange(min=1), default=3, show_default=True)
@click.option(
    "--siconos-time",
    type=float,
    callback=_positive,
    metavar="SECONDS",
    help="Stop each of Siconos' solvers after this long.  [default: --max-time]",
)
@click.option("--no-siconos", is_flag=True, help="Run only ours, whatever is installed.")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    default=Path("fclib-compare"),
    show_default=True,
    metavar="DIR",
    help="Folder for compare.csv and profile.png.",
)
@_JSON
def compare(
    files: tuple[Path, ...],
    tol: float,
    max_time: float,
    solvers: tuple[str, ...],
    repeats: int,
    siconos_time: float | None,
    no_siconos: bool,
    output: Path,
    as_json: bool,
) -> None:
    """Run solvers on FILEs and folders side by side, Siconos' too where it is installed.

    Writes DIR/compare.csv and, with matplotlib, DIR/profile.png.
    """
    from mbsim.errors import ModelError
    from mbsim.fclib import compare as comparing
    from mbsim.fclib import peers
    from mbsim.fclib.solvers.catalog import solver as named

    names = solvers or ("AUTO", "NSGS", "PROX", "ADMM", "NSN")
    for name in names:
        named(name)
    chosen = _expanded(files)
    siconos = not no_siconos and peers.python() is not None
    if not no_siconos and not siconos:
        _say(f"Siconos is not compared: {peers.why_not()}")
    comparing.write_csv([], output / "compare.csv")  # now, not after minutes
    _tell_compiling()
    rows = comparing.compare(
        chosen,
        tol,
        names,
        repeats=repeats,
        max_seconds=max_time,
        siconos_seconds=(siconos_time or max_time) if siconos else 0.0,
        say=_say,
    )
    if not rows:
        raise ModelError("none of the files could be read")
    comparing.write_csv(rows, output / "compare.csv")
    if comparing.can_draw():
        comparing.draw(rows, tol, output / "profile.png")
    else:
        _say("no picture: matplotlib is not installed; mbsim-contact[plot] has it")
    if as_json:
        _print_list([_finite(vars(row)) for row in rows])
    else:
        echo(comparing.table(rows))
    _say(f"{len(rows)} runs in {output / 'compare.csv'}")


def _expanded(files: Sequence[Path]) -> list[Path]:
    """Return files, folders replaced by the HDF5 files in them."""
    from mbsim.errors import ModelError
    from mbsim.fclib.compare import files_of

    found = files_of(files)
    if not found:
        raise ModelError(f"{files[0]}: no .hdf5 file in this folder")
    return found


def _contents(files: Sequence[Path], faults: list[MbsimError]) -> Iterator[tuple[Path, Contents]]:
    """Yield what is in each file; one that cannot be read does not keep the others back."""
    from mbsim.core.stored import apart
    from mbsim.errors import ModelError, ResultsError
    from mbsim.fclib import hdf5

    for file in _expanded(files):
        try:
            contents = apart(partial(hdf5.read, file), file)
        except (ModelError, ResultsError) as error:
            faults.append(error)
        else:
            yield file, contents


def _end(faults: Sequence[MbsimError]) -> None:
    """Raise what went wrong with any file, all at once; what cannot be read comes first."""
    if faults:
        worst = min(faults, key=lambda fault: fault.exit_code)
        raise type(worst)("\n".join(str(fault) for fault in faults))


def _say(text: str) -> None:
    """Print a line for people, not for pipes."""
    echo(f"mbsim: {text}", err=True)


def _tell_compiling() -> None:
    """Say before the first compilation that it takes a while."""
    from mbsim.core import jit

    jit.on_first_compile = lambda: _say(
        "compiling the solvers, once on this machine; this can take a minute"
    )


def _print_list(entries: Sequence[dict[str, Any]]) -> None:
    """Print the one JSON list that standard output shall hold."""
    print_json([_finite(entry) for entry in entries])


def _finite(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry in which what is no finite number is null."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in entry.items()
    }


def _text(value: object) -> str:
    """Return a value for people; bytes of another encoding become marks."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(entry)}" for name, entry in value.items())
    return str(value)


def _readable(text: str | None) -> str | None:
    """Return a text of a file that can be printed."""
    if text is None:
        return None
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _about(file: Path, contents: Contents) -> dict[str, Any]:
    """Return what `info` shows."""
    problem = contents.problem
    matrices = ("W", "V", "R") if problem.kind == "local" else ("M", "H", "G")
    stored = {
        name: _matrix(entry)
        for name in matrices
        if (entry := getattr(problem, name, None)) is not None
    }
    told = problem.info
    about: dict[str, Any] = {
        "file": str(file),
        "kind": problem.kind,
        "spacedim": problem.spacedim,
        "contacts": problem.contacts,
        "unknowns": _unknowns(problem),
        "equalities": problem.equalities,
        "matrices": stored,
        "mu": _range(problem.mu),
        "mu_r": None if problem.mu_r is None else _range(problem.mu_r),
        "solution": "no" if contents.solution is None else _stored(contents.solution.r),
        "guesses": len(contents.guesses),
        "title": None if told is None else _readable(told.title),
        "description": None if told is None else _readable(told.description),
        "math_info": None if told is None else _readable(told.math_info),
    }
    return about


def _unknowns(problem: Local | Global) -> int:
    """Return the number of velocities of a global problem, of impulses of a local one."""
    from mbsim.fclib.problem import Local

    return len(problem.q) if isinstance(problem, Local) else problem.H.m


def _matrix(stored: Matrix) -> str:
    """Return size, storage and filling of a matrix."""
    size = stored.m * stored.n
    filled = f", {100.0 * stored.entries / size:.2g} % filled" if size else ""
    return f"{stored.m} x {stored.n} {stored.storage}{filled}"


def _range(values: Any) -> str:
    """Return the smallest and the largest number."""
    if not len(values):
        return "none"
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _stored(r: Any) -> str:
    """Return a warning where a stored solution has no impulses."""
    return "yes" if r.any() else "yes, but its r is zero"


def _judged(figures: Figures) -> dict[str, Any]:
    """Return the figures of a solution."""
    return {
        "error": figures.error,
        "error_q": figures.error_q,
        "own_error": figures.own_error,
        "scale_free": figures.scale_free,
        "velocity_error": figures.velocity_error,
        "merit1": figures.merit1,
        "merit1_corrected": figures.merit1_corrected,
        "dynamics": figures.dynamics,
        "equalities": figures.equalities,
        "max_cone_violation": figures.max_cone_violation,
        "max_penetration_velocity": figures.max_penetration_velocity,
        "relative_penetration": figures.relative_penetration,
        "complementarity": figures.complementarity,
        "max_impulse": figures.max_impulse,
        "impulse_norm": figures.impulse_norm,
        "states": figures.counts(),
    }


def _solved(file: Path, problem: Local | Global, result: Result) -> dict[str, Any]:
    """Return what `solve --json` prints of one file."""
    return {
        "file": str(file),
        "kind": problem.kind,
        "contacts": problem.contacts,
        "solver": result.solver,
        "status": result.status,
        "reason": result.reason or None,
        "iterations": result.iterations,
        "solve_s": result.solve_s,
        "condense_s": result.condense_s,
        **_judged(result.figures),
    }


def _show_solved(entry: dict[str, Any], reason: str) -> None:
    """Print two lines on a solution."""
    states = ", ".join(f"{count} {name}" for name, count in entry["states"].items())
    status = entry["status"].replace("_", " ")
    echo(
        f"{entry['file']}: {status} by {entry['solver']} in {1e3 * entry['solve_s']:.3f} ms, "
        f"{counted(entry['iterations'], 'iterations')}" + (f" ({reason})" if reason else "")
    )
    echo(
        f"  error {entry['error']:.2e}, over |q| {entry['error_q']:.2e}, scale-free "
        f"{entry['scale_free']:.2e}, MERIT_1 {entry['merit1']:.2e}, "
        f"|r| {entry['impulse_norm']:.3g}, "
        f"cone violation {entry['max_cone_violation']:.1e}, penetration velocity "
        f"{entry['max_penetration_velocity']:.1e}; {states}"
    )


def _show_all(found: Sequence[dict[str, Any]]) -> None:
    """Print a line on all problems."""
    counts = [entry["contacts"] for entry in found]
    statuses = [entry["status"] for entry in found]
    ends = ", ".join(
        f"{statuses.count(status)} {status.replace('_', ' ')}" for status in dict.fromkeys(statuses)
    )
    seconds = sum(entry["solve_s"] for entry in found)
    echo(
        f"{len(found)} problems of {min(counts)} to {max(counts)} contacts: {ends}, in "
        f"{seconds:.3g} s; largest error {max(entry['error'] for entry in found):.1e}, scale-free "
        f"{max(entry['scale_free'] for entry in found):.1e}"
    )
