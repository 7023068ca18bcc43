"""`sweep`: all runs of a study, each written down as it comes; then one table of them."""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsim.errors import DeckError, Interrupted, ModelError, ResultsError, SolverError
from mbsim.results.files import replace_text
from mbsim.studies.journal import Journal, rows_kept
from mbsim.studies.local import Workers
from mbsim.studies.outputs import OF_A_PEAK, is_peak, no_curve
from mbsim.studies.sizes import output_sizes
from mbsim.studies.stopping import number_of
from mbsim.studies.study import key_of
from mbsim.studies.table import SUFFIX, Responses, need_pyarrow, write_table
from mbsim.studies.uncertainty import SUFFIX as UNCERTAINTY
from mbsim.studies.uncertainty import need_salib, uncertainty
from mbsim.studies.worker import FAILED, WARNED, PoolLost, Row, run_one

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.run.settings import Settings
    from mbsim.studies.study import Study

#: Called with how many rows there are, and how many there will be.
Progress = Callable[[int, int], None]
#: Called with a line for the user.
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Swept:
    """What a sweep left.

    Attributes
    ----------
    table : Path
        The Parquet file.
    counts : dict
        Runs by their status.
    kept : int
        How many rows were there already.
    reasons : list of (int, str)
        Why runs failed: how many, and why, the most frequent first.
    warnings : list of (int, str)
        Of what runs warned, likewise.
    uncertainty : dict or None
        Bands and Sobol indices, as ``<study>.uncertainty.json`` has them.
    """

    table: Path
    counts: dict[str, int]
    kept: int
    reasons: list[tuple[int, str]]
    warnings: list[tuple[int, str]]
    uncertainty: dict[str, Any] | None


def sweep(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    notify: Notify | None = None,
) -> Swept:
    """Run a study and write its table.

    Parameters
    ----------
    study : Study
    folder : Path
        For ``<study>.parquet``, ``<study>.uncertainty.json``, ``<study>.rows`` (the journal) and
        ``run-<number>/``.
    workers : int, optional
        Local processes; default: one a processor.
    scheduler : str, optional
        Address of a Dask scheduler, instead of local processes.
    resume : bool
        Keep rows of the same runs that a journal in the folder has.
    progress : callable, optional
    notify : callable, optional
        Called with lines for the user while it waits.

    Raises
    ------
    ModelError
        If the deck, the study or an address is at fault: before the first run.
    SolverError
        If not one run came to its end.
    ResultsError
        If something cannot be written, or a scheduler does not answer any more.
    Interrupted
        If Ctrl-C came; what is written stays.
    """
    from mbsim.results.files import prepare_directory

    need_pyarrow()
    if study.design == "saltelli":
        need_salib()
    count = len(study.points)
    model, sizes = described(study)
    prepare_directory(folder, study.name)
    keys = [study.key(run, model) for run in range(count)]
    path = folder / f"{study.name}.rows"
    found = rows_kept(path, {key: run for run, key in enumerate(keys)}) if resume else {}
    # two runs of equal parameters are one row twice
    same = {key: run for run, key in reversed(list(enumerate(keys)))}
    left = sorted(run for run in same.values() if run not in found)
    kept = len(found)
    if resume and notify is not None:
        notify(f"{path}: {kept} of {len(same)} runs are kept, {len(left)} are left to do")
    if progress is not None:
        progress(kept, len(same))
    try:
        with closing(Journal(path, resume)) as journal:
            for row in _rows(study, left, workers, scheduler, notify):
                journal.add(keys[row.run], row)
                found[row.run] = row
                if progress is not None:
                    progress(len(found), len(same))
    except (KeyboardInterrupt, PoolLost) as error:
        kept_now = f"{len(found)} of {len(same)} runs are kept in {path}; --resume goes on"
        if isinstance(error, PoolLost):
            raise ResultsError(f"{error}: {kept_now}") from None
        raise Interrupted(f"interrupted: {kept_now}", number_of(error)) from None
    by_key = {keys[run]: row for run, row in found.items()}
    rows = [by_key[key]._replace(run=run) for run, key in enumerate(keys)]
    table = folder / f"{study.name}{SUFFIX}"
    write_table(table, study, keys, rows)
    for run in study.keep:
        write_run(study, run, folder)
    counts = Counter(row.status for row in rows)
    reasons, warnings = _reasons(rows, FAILED), _reasons(rows, WARNED)
    if counts[FAILED] == count:
        raise SolverError(f"{table}: not one of {count} runs came to its end: {reasons[0][1]}")
    about = _write_uncertainty(study, table, sizes)
    return Swept(table, dict(counts), kept, reasons, warnings, about)


def _reasons(rows: Sequence[Row], status: str) -> list[tuple[int, str]]:
    """Return why rows have a status: how many, and why, the most frequent first."""
    found = Counter(row.reason for row in rows if row.status == status).most_common()
    return [(number, why) for why, number in found]


def _write_uncertainty(
    study: Study, table: Path, sizes: Mapping[str, float]
) -> dict[str, Any] | None:
    """Write bands and indices beside the table; of a study without them, remove older ones."""
    path = table.with_name(f"{study.name}{UNCERTAINTY}")
    about = uncertainty(study, Responses(table), sizes)
    if about is None:
        with suppress(OSError):
            path.unlink()
    else:
        replace_text(path, json.dumps(about, indent=1, allow_nan=False) + "\n")
    return about


def _rows(
    study: Study,
    runs: Sequence[int],
    workers: int | None,
    scheduler: str | None,
    notify: Notify | None,
) -> Iterator[Row]:
    """Yield rows as they come, from where they are asked of."""
    if scheduler is not None:
        from mbsim.studies.cluster import cluster_rows

        return cluster_rows(study, scheduler, runs, notify)
    return Workers(study, workers or processors()).rows(runs)


def processors() -> int:
    """Return how many processors this process may use."""
    with suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def write_run(study: Study, run: int, folder: Path) -> Row:
    """Run one of a study's runs here, and write all its results into ``run-<number>/``.

    Raises
    ------
    ModelError
        If there is no such run.
    """
    if not 0 <= run < len(study.points):
        raise ModelError(f"{study.file}: no run {run}; runs are 0 to {len(study.points) - 1}")
    return run_one(study, study.case(run), folder / f"run-{run}")


def described(study: Study) -> tuple[str, Mapping[str, float]]:
    """Return the digest of a study's deck and of all files that it names, and outputs' sizes.

    Raises
    ------
    DeckError, ModelError
        If the deck is at fault, or the first run's changes or an output name what it has not.
    """
    from mbsim.reader.keywords import fold
    from mbsim.results.identity import Identity

    try:
        system, settings = checked_system(study, _first_changes(study))
    except ModelError as error:
        lines = str(error).split("\n")
        if isinstance(error, DeckError) or not any(line.startswith("--set ") for line in lines):
            raise
        said = (f"{study.file}: {by_key(study, line)}" for line in lines)
        raise ModelError("\n".join(said)) from None
    faults = [*check_signals(study, system, "outputs:"), *_vectors(study, system), *_peaks(study)]
    faults += _out_of_time(study, settings)
    if faults:
        raise ModelError("\n".join(f"{study.file}: {line}" for line in faults))
    facts: dict[str, Any] = Identity(system).facts
    # without what differs from run to run, so that a study that grows keeps its rows
    changed = {fold(path.rpartition(".")[0]) for path in study.paths}
    others = {name: fact for name, fact in facts["model"].items() if fold(name) not in changed}
    about = [system.model.sha256, others, facts["subroutines"]]
    text = json.dumps(about, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest(), output_sizes(study, system)


def _out_of_time(study: Study, settings: Settings) -> Iterator[str]:
    """Yield outputs at times that no run comes to; where runs end differently, none is told."""
    from mbsim.reader.keywords import fold

    if any(fold(path).startswith("simulate") for path in study.paths):
        return
    start, end = settings.stages[0].simulation.start_time, settings.end_time
    for output in study.outputs:
        if output.reduce == "at" and not start <= output.at <= end * (1.0 + 1e-12):
            yield f"outputs.{output.name}: at = {output.at:g}: runs go from {start:g} to {end:g}"


def checked_system(study: Study, changes: Mapping[str, str]) -> tuple[System, Settings]:
    """Return a study's deck, with changes, as a system, and how it is run.

    Raises
    ------
    DeckError, ModelError
        If the deck is at fault, or a change names what it has not.
    """
    from mbsim.compile_model.build import build
    from mbsim.reader.xml import read_model
    from mbsim.run.settings import settle

    with_changes = read_model(study.model, changes)
    options = study.options
    how = (options.get(name) for name in ("end_time", "print_interval", "integrator", "tol"))
    settings = settle(with_changes, *how)
    plugins = [Path(file) for file in options.get("plugins", [])]
    system = build(
        with_changes,
        plugins,
        bool(options.get("interpret_plugins", False)),
        options.get("detector", "auto"),
        lambda line: None,
    )
    return system, settings


def check_signals(study: Study, system: System, key: str) -> list[str]:
    """Return which of a study's signals the deck has not, a line each that begins with `key`."""
    from mbsim.results.signal_filter import SignalFilter
    from mbsim.results.signals import names_of

    known = [*names_of(system), *(f"requests/{id}" for id in system.model.requests)]
    # a contact's peaks are there where its other signals are
    known += [
        f"contacts/{id}/peak_{name}"
        for id in system.model.contacts
        for name in ("force", "penetration", "slip_speed")
    ]
    asked = sorted({output.signal for output in study.outputs if output.signal})
    try:
        SignalFilter(asked).check(known)
    except ModelError as error:
        return str(error).replace("--signals", key).split("\n")
    return []


def _vectors(study: Study, system: System) -> list[str]:
    """Return which outputs are of several numbers a row, a line each."""
    from mbsim.results.quantities import quantity_in

    return [
        f"outputs.{output.name}: {output.signal} is a vector: name one component"
        for output in study.outputs
        if output.signal and not quantity_in(system.model, output.signal)[1]
    ]


def _peaks(study: Study) -> list[str]:
    """Return which outputs ask for rows of what is one number a run, a line each."""
    return [
        f"outputs.{output.name}: {output.reduce}: {no_curve(output.signal)}"
        for output in study.outputs
        if is_peak(output.signal) and output.reduce not in OF_A_PEAK
    ]


def by_key(study: Study, line: str) -> str:
    """Return what is wrong with the deck, with the key of the study that it follows from."""
    for path, text in study.paths.items():
        if line.startswith(f"--set {path}="):
            return f"{key_of(path, text, study.spreads)}: {path}: {line.partition(': ')[2]}"
    return line


def _first_changes(study: Study) -> dict[str, str]:
    """Return what the first run that has values changes: all runs change the same attributes."""
    for run in range(len(study.points)):
        with suppress(ModelError):
            return study.overrides(study.case(run).values)
    raise ModelError(f"{study.file}: set: formulas have no value in any run")
