"""Solvers side by side over a folder: a table, a CSV file and performance profiles."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mbsim.errors import MbsimError, ResultsError
from mbsim.fclib import hdf5, peers
from mbsim.fclib.merit import completed, judge, judged
from mbsim.fclib.reduction import reduce
from mbsim.fclib.solve import solve
from mbsim.fclib.solvers.catalog import SOLVERS

if TYPE_CHECKING:
    from mbsim.fclib.problem import Global, Local

#: Below this nobody waits; ratios of such times say nothing [s].
TOO_SHORT = 1e-4
#: Repeats end when they have taken so long [s].
ENOUGH = 2.0


@dataclass(frozen=True)
class Row:
    """One solver on one problem; errors as in `merit`, seconds the best of the repeats."""

    problem: str
    kind: str
    contacts: int
    solver: str
    status: str
    seconds: float
    iterations: int
    error: float
    error_q: float
    merit1: float
    impulse_norm: float

    @property
    def solved(self) -> bool:
        """Whether the published error is small enough, which is all that Siconos looks at."""
        return self.status != "not_solved"


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return the HDF5 files among paths and in folders among them."""
    found: list[Path] = []
    for path in paths:
        found += sorted(path.glob("*.hdf5")) if path.is_dir() else [path]
    return found


def compare(
    files: Sequence[Path],
    tol: float,
    solvers: Sequence[str],
    *,
    repeats: int,
    max_seconds: float,
    siconos_seconds: float,
    say: Callable[[str], None],
) -> list[Row]:
    """Run every solver on every file; a file that cannot be read is told and left out.

    `siconos_seconds`: for each of Siconos' solvers; 0 leaves them out.
    """
    rows: list[Row] = []
    for file in files:
        try:
            problem = hdf5.read(file).problem
        except MbsimError as error:
            say(f"left out: {error}")
            continue
        say(file.stem)
        for name in solvers:
            if problem.mu_r is None or SOLVERS[name.upper()][2]:
                rows.append(_ours(file.stem, problem, tol, name, repeats, max_seconds))
        if siconos_seconds:
            rows += _siconos(file.stem, problem, tol, repeats, siconos_seconds)
    return rows


def _ours(
    name: str, problem: Local | Global, tol: float, solver: str, repeats: int, max_seconds: float
) -> Row:
    """Return our row."""
    best = solve(problem, tol, solver, max_seconds=max_seconds)
    spent = best.solve_s
    for _ in range(repeats - 1):
        if spent > ENOUGH:
            break
        again = solve(problem, tol, solver, max_seconds=max_seconds)
        spent += again.solve_s
        best = min(best, again, key=lambda result: result.solve_s)
    figures = best.figures
    return Row(
        name, problem.kind, problem.contacts, f"mbsim {solver.upper()}", best.status,
        best.solve_s, best.iterations, figures.error, figures.error_q, figures.merit1,
        figures.impulse_norm,
    )  # fmt: skip


def _siconos(
    name: str, problem: Local | Global, tol: float, repeats: int, max_seconds: float
) -> list[Row]:
    """Return the rows of Siconos' solvers."""
    blocks = reduce(problem)
    rows = []
    for run in peers.run(problem, blocks, tol, max_seconds, repeats):
        if run.r is None:
            nothing = (math.nan,) * 4
            figures = ("not_solved", math.inf, 0, *nothing)
        else:
            found = judge(problem, completed(problem, run.r, blocks), blocks)
            # its own test stands on the same error, in its units and of the condensed problem
            status = judged(found)._replace(own_error=0.0).status(2.0 * tol)
            figures = (
                status, run.seconds, run.iterations,
                found.error, found.error_q, found.merit1, found.impulse_norm,
            )  # fmt: skip
        rows.append(Row(name, problem.kind, problem.contacts, run.solver, *figures))
    return rows


def table(rows: Sequence[Row]) -> str:
    """Return a text table: AUTO (or our first solver) against the best of the others."""
    lines = [
        f"{'problem':44s} {'nc':>5s} {'status':>15s} {'time':>10s} {'error':>8s} {'err_q':>8s}"
    ]
    lines[0] += f"   {'best Siconos':24s} {'time':>10s} {'ratio':>6s}"
    for name in dict.fromkeys(row.problem for row in rows):
        mine = [row for row in rows if row.problem == name]
        ours = next((row for row in mine if row.solver.startswith("mbsim")), None)
        if ours is None:
            continue
        line = f"{name:44s} {ours.contacts:5d} {ours.status:>15s} {_time(ours.seconds):>10s}"
        line += f" {ours.error:8.1e} {ours.error_q:8.1e}"
        best = best_peer(mine)
        if best is not None:
            ratio = ours.seconds / best.seconds
            line += f"   {best.solver:24s} {_time(best.seconds):>10s} {ratio:6.2f}"
        lines.append(line)
    return "\n".join([*lines, "", *summary(rows)])


def best_peer(rows: Sequence[Row], *, own: bool = False) -> Row | None:
    """Return the fastest row of Siconos that solved its problem.

    `own`: of global problems only by its global solvers, where these solve it.
    """
    theirs = [row for row in rows if row.solver.startswith("Siconos") and row.solved]
    if own:
        theirs = [row for row in theirs if "GLOBAL" in row.solver] or theirs
    return min(theirs, key=lambda row: row.seconds, default=None)


def summary(rows: Sequence[Row]) -> list[str]:
    """Return how many each solver solved, and geometric means of time ratios."""
    problems = list(dict.fromkeys(row.problem for row in rows))
    lines = []
    for solver in dict.fromkeys(row.solver for row in rows):
        mine = [row for row in rows if row.solver == solver]
        line = f"{solver:24s} solved {sum(row.solved for row in mine):3d} of {len(problems)}"
        if solver.startswith("mbsim"):
            line += _mean(rows, mine, own=False, words="times the best Siconos")
            if any("GLOBAL" in row.solver for row in rows):
                line += _mean(rows, mine, own=True, words="with its global solvers alone")
        lines.append(line)
    return lines


def _mean(rows: Sequence[Row], mine: Sequence[Row], *, own: bool, words: str) -> str:
    """Return the geometric mean of time ratios with words about it, or nothing."""
    ratios = []
    for row in mine:
        best = best_peer([other for other in rows if other.problem == row.problem], own=own)
        if row.solved and best is not None and best.seconds >= TOO_SHORT:
            ratios.append(math.log(row.seconds / best.seconds))
    if not ratios:
        return ""
    mean = math.exp(sum(ratios) / len(ratios))
    return f", {mean:.2f} {words} (geometric mean over {len(ratios)})"


def _time(seconds: float) -> str:
    """Return a time with its unit."""
    if not math.isfinite(seconds):
        return "-"
    if seconds < 1e-3:
        return f"{1e6 * seconds:.1f} us"
    return f"{1e3 * seconds:.2f} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def write_csv(rows: Sequence[Row], path: Path) -> None:
    """Write one line a run."""
    names = list(Row.__dataclass_fields__)
    lines = [",".join(names)]
    for row in rows:
        values = asdict(row)
        lines.append(",".join(_cell(values[name]) for name in names))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def _cell(value: object) -> str:
    """Return a value for a CSV file."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def can_draw() -> bool:
    """Return whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def profile(rows: Sequence[Row]) -> dict[str, list[float]]:
    """Return for every solver its time over the best on each problem it solved, sorted.

    This is Dolan and More's performance profile: a solver's curve at t is the share of problems
    that it solves within t times the best time (Benchmarking optimization software with
    performance profiles, Math. Program. 91, 2002).
    """
    ratios: dict[str, list[float]] = {row.solver: [] for row in rows}
    for name in dict.fromkeys(row.problem for row in rows):
        solved = [row for row in rows if row.problem == name and row.solved]
        best = min((row.seconds for row in solved), default=math.nan)
        for row in solved:
            ratios[row.solver].append(row.seconds / best)
    return {solver: sorted(values) for solver, values in ratios.items()}


def draw(rows: Sequence[Row], tol: float, path: Path) -> None:
    """Draw the performance profile into a PNG file."""
    from matplotlib.figure import Figure

    count = len({row.problem for row in rows})
    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.add_subplot()
    curves = profile(rows)
    end = max((values[-1] for values in curves.values() if values), default=1.0) * 2.0
    for solver, values in curves.items():
        ours = solver.startswith("mbsim")
        x = [1.0, *values, end]
        y = [0.0, *((k + 1) / count for k in range(len(values))), len(values) / count]
        line, width = "-" if ours else "--", 2.0 if "AUTO" in solver else 1.2
        axes.step(x, y, where="post", label=solver, linestyle=line, linewidth=width)
    axes.set(xscale="log", xlim=(1.0, end), ylim=(0.0, 1.02))
    axes.set_xlabel("time over the best solver's on the same problem")
    axes.set_ylabel("share of problems solved")
    axes.set_title(f"{count} problems, error at most {tol:g}")
    axes.grid(True, alpha=0.3)
    axes.legend(fontsize=8)
    try:
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None
