"""`read_problem`: what is fitted to what: a study file of `mbsim identify`, read and checked."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.studies.csv_file import read_csv
from mbsim.studies.distributions import Numbers, Spread
from mbsim.studies.outputs import Output, is_peak, no_curve
from mbsim.studies.records import TIME, Asked, Record, read_asked, read_record
from mbsim.studies.study import Case, Study, load_toml, read_options, read_paths
from mbsim.studies.unknown_curves import BETWEEN, UnknownCurve, bends_of, read_curves

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.run.settings import Settings

_TABLES = ("study", "run", "parameters", "curves", "set", "records")
_STUDY = ("model", "starts", "seed", "most_iterations", "jacobian")
#: With jacobian = "auto" the derivatives of a run end where they have taken so many times its
#: evaluations: twice what differences take, so that a costly stretch does not decide.
WORTH = 4
#: Where slopes come from.
JACOBIANS = ("auto", "sensitivities", "differences")
_PARAMETER = ("path", "start", "low", "high", "scale", "prior")
#: Of runs where the study does not say it: differences need runs that are the same but for what
#: the parameters change.
TIGHT = 1e-8
MOST_STARTS = 10_000
#: A curve may be off by so much of the noise between rows, or of a hundredth of its range.
_COARSE = 0.2


@dataclass(frozen=True)
class Unknown:
    """A parameter that is fitted.

    The fit moves z, which is 0 at `low` and 1 at `high`, evenly or with `log` over the logarithm.
    A prior is normal in the value, or with `prior_log` in its logarithm: `centre` and `sd` there.
    """

    name: str
    start: float
    low: float
    high: float
    log: bool = False
    prior: tuple[float, float] | None = None
    prior_log: bool = False

    @property
    def width(self) -> float:
        """How wide the range is, of the value or its logarithm."""
        return math.log(self.high / self.low) if self.log else self.high - self.low

    @property
    def expected(self) -> float:
        """Where the centre of its prior is."""
        assert self.prior is not None
        return math.exp(self.prior[0]) if self.prior_log else self.prior[0]

    def value(self, z: float) -> float:
        """Return the value at z, the bounds being exact."""
        if z <= 0.0 or z >= 1.0:
            return self.low if z <= 0.0 else self.high
        if self.log:
            return min(max(self.low * math.exp(z * self.width), self.low), self.high)
        return min(max(self.low + z * self.width, self.low), self.high)

    def place(self, value: float) -> float:
        """Return z of a value."""
        return (math.log(value / self.low) if self.log else value - self.low) / self.width

    def slope(self, z: float) -> float:
        """Return how fast the value grows with z."""
        return self.width * self.value(z) if self.log else self.width

    def surprise(self, z: float) -> tuple[float, float]:
        """Return how many standard deviations of the prior z is off, and how fast that grows."""
        assert self.prior is not None
        centre, sd = self.prior
        value = self.value(z)
        if self.prior_log:
            return (math.log(value) - centre) / sd, self.slope(z) / (value * sd)
        return (value - centre) / sd, self.slope(z) / sd


@dataclass(frozen=True)
class Problem:
    """What is fitted to what.

    Attributes
    ----------
    study : Study
        What workers run: cases of it give the curves that the records measured.
    unknowns : tuple of Unknown
    records : tuple of Record
    starts : int
        From how many points it is fitted: the one that the file gives, and others between the
        bounds.
    notes : tuple of str
        What the user is told before the first run.
    """

    study: Study
    unknowns: tuple[Unknown, ...]
    records: tuple[Record, ...]
    starts: int
    most_iterations: int
    notes: tuple[str, ...] = ()
    jacobian: str = "auto"
    unknown_curves: tuple[UnknownCurve, ...] = ()

    @property
    def name(self) -> str:
        """What its files are called."""
        return self.study.name

    @functools.cached_property
    def measured(self) -> Numbers:
        """All measured values, record after record, (rows,)."""
        return np.concatenate([record.value for record in self.records])

    @property
    def is_stated(self) -> bool:
        """Whether the noise of the records is."""
        return all(record.sd is not None for record in self.records)

    @functools.cached_property
    def sd(self) -> Numbers:
        """The noise of every row as stated; else the record's range, of which it is a part."""
        return np.concatenate(
            [
                record.sd
                if record.sd is not None
                else np.full(len(record.value), float(np.ptp(record.value)) or 1.0)
                for record in self.records
            ]
        )

    @functools.cached_property
    def weight(self) -> Numbers:
        """What the square of every row's residual is multiplied with."""
        return np.concatenate([np.full(len(r.value), r.weight) for r in self.records])

    def values(self, z: Numbers) -> dict[str, float]:
        """Return the parameters at a point of the unit cube."""
        return {u.name: u.value(float(each)) for u, each in zip(self.unknowns, z, strict=True)}

    def case(self, run: int, z: Numbers, sensitivity: tuple[str, ...] = ()) -> Case:
        """Return the run at a point of the unit cube."""
        return Case(run, self.values(z), sensitivity, WORTH if self.jacobian == "auto" else 0)

    def curves(self, outputs: Mapping[str, Any], z: Numbers) -> Numbers | None:
        """Return what a run gives at all measured times, (rows,); None where it does not."""
        t = np.asarray(outputs[TIME], dtype=np.float64)
        found = []
        for record in self.records:
            x = np.asarray(outputs[record.name], dtype=np.float64)
            at = record.of(t, x, self.values(z))
            if at is None or not np.all(np.isfinite(at)):
                return None
            found.append(at)
        return np.concatenate(found)

    def too_coarse(self, outputs: Mapping[str, Any], z: Numbers) -> list[str]:
        """Return which records a run's rows are too far apart for, as a line for the user each."""
        t = np.asarray(outputs[TIME], dtype=np.float64)
        lines = []
        for record in self.records:
            off = record.between_rows(t, np.asarray(outputs[record.name]), self.values(z))
            noise = float(np.median(record.sd)) if record.sd is not None else None
            allowed = _COARSE * (float(np.ptp(record.value)) * 1e-2 if noise is None else noise)
            if off > allowed:
                lines.append(
                    f"records.{record.name}: between output rows the curve is off by about "
                    f"{off:.2g} {record.unit}: a smaller run.print_interval"
                )
        return lines

    def start_points(self) -> Numbers:
        """Return where fits begin, (starts, unknowns): the file's own, then a Latin hypercube."""
        first = np.array([[unknown.place(unknown.start) for unknown in self.unknowns]])
        if self.starts == 1:
            return first
        spreads = {u.name: Spread("uniform", {"low": 0.0, "high": 1.0}) for u in self.unknowns}
        others = replace(
            self.study, design="latin_hypercube", runs=self.starts - 1, spreads=spreads
        )
        return np.concatenate([first, others.points])

    @functools.cached_property
    def priors(self) -> list[int]:
        """Which unknowns have a prior."""
        return [k for k, unknown in enumerate(self.unknowns) if unknown.prior is not None]

    @functools.cached_property
    def bends(self) -> Numbers:
        """What makes second derivatives of unknown curves, over their sd, of unknowns' values."""
        return bends_of(self.unknown_curves, self.unknowns)


def read_problem(file: str | Path) -> Problem:
    """Return the problem that a TOML file describes.

    Raises
    ------
    ModelError
        All that is wrong with it, with its deck and with its records, a line each.
    """
    path = Path(file)
    data = load_toml(path)
    faults: list[str] = []
    if extra := sorted(data.keys() - set(_TABLES)):
        faults.append(f"unknown table {', '.join(extra)}; known: {', '.join(_TABLES)}")
    tables = {name: data.get(name, {}) for name in _TABLES}
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise ModelError(f"{path}: {name}: must be a table")
    about = _about(tables["study"], faults)
    if (way := tables["study"].get("jacobian", "auto")) not in JACOBIANS:
        faults.append(f"study.jacobian = {way!r}: must be one of {', '.join(JACOBIANS)}")
    options = {"tol": TIGHT, **read_options(tables["run"], path, faults)}
    curves, ordinates, points = read_curves(tables["curves"], len(tables["parameters"]), faults)
    for kind, more in (("parameters", ordinates), ("set", points)):
        faults += [f"curves: {kind}.{key}: is given too" for key in more.keys() & tables[kind]]
        tables[kind] = {**tables[kind], **more}
    unknowns = _unknowns(tables["parameters"], faults)
    asked = read_asked(tables["records"], path.parent, tables["parameters"], faults)
    shifts = {one.offset for one in asked if isinstance(one.offset, str)}
    paths = read_paths(tables["parameters"], tables["set"], options, faults, shifts)
    weighed = bool(curves) or any(unknown.prior for unknown in unknowns)
    if weighed and any("sd" not in a.table for a in asked):
        faults.append("records: sd: needed where a parameter has a prior, to be weighed against it")
    study = Study(
        file=path,
        model=path.parent / str(tables["study"].get("model")),
        design="random",
        runs=1,
        seed=about["seed"],
        csv=None,
        keep=(),
        options=options,
        # those that are at fault too, so that what names them is not
        spreads={
            name: Spread("uniform", {"low": 0.0, "high": 1.0}) for name in tables["parameters"]
        },
        paths=paths,
        outputs=(
            Output(TIME, signal="time", reduce="curve"),
            *(Output(one.name, signal=one.signal, reduce="curve") for one in asked),
        ),
    )
    problem = Problem(
        study, tuple(unknowns), (), about["starts"], about["most_iterations"], (), way, curves
    )
    stand_ins = {u.name: u.start for u in unknowns}
    for name, table in tables["parameters"].items():
        given = table if isinstance(table, dict) else {}
        numbers = [given.get(key) for key in ("high", "start", "low")]
        finite = [float(x) for x in numbers if isinstance(x, int | float) and math.isfinite(x)]
        stand_ins.setdefault(name, finite[0] if finite else 1.0)
    return _with_records(problem, asked, stand_ins, faults)


def _about(table: Mapping[str, Any], faults: list[str]) -> dict[str, int]:
    """Return the numbers of [study]."""
    if extra := sorted(table.keys() - set(_STUDY)):
        faults.append(f"study: unknown {', '.join(extra)}; known: {', '.join(_STUDY)}")
    if not isinstance(table.get("model"), str):
        faults.append("study.model: the deck must be named")
    found: dict[str, int] = {}
    for name, usual, low in (("starts", 1, 1), ("seed", 0, 0), ("most_iterations", 50, 1)):
        value = table.get(name, usual)
        if type(value) is not int or not low <= value <= MOST_STARTS:
            allowed = f"a whole number from {low} to {MOST_STARTS}"
            faults.append(f"study.{name} = {value!r}: must be {allowed}")
            value = usual
        found[name] = value
    return found


def _unknowns(tables: Mapping[str, Any], faults: list[str]) -> list[Unknown]:
    """Return the parameters that are fitted."""
    found: list[Unknown] = []
    for name, table in tables.items():
        if not isinstance(table, dict):
            continue  # `read_paths` says so
        said: list[str] = []
        if extra := sorted(table.keys() - set(_PARAMETER)):
            said.append(f"unknown {', '.join(extra)}; known: {', '.join(_PARAMETER)}")
        if missing := [key for key in ("low", "high") if key not in table]:
            said.append(f"needs {' and '.join(missing)}, the bounds of the fit")
        for key in ("low", "high", "start"):
            value = table.get(key, 0.0)
            if type(value) not in (int, float) or not math.isfinite(value):
                why = BETWEEN if value in (math.inf, -math.inf) and key != "start" else ""
                said.append(f"{key} = {value!r}: must be a finite number{why}")
        scale = table.get("scale", "linear")
        if scale not in ("linear", "log"):
            said.append(f'scale = {scale!r}: must be "linear" or "log"')
        if not said:
            with suppress(_Fault):
                found.append(_unknown(name, table, scale == "log", said))
        faults += [f"parameters.{name}: {one}" for one in said]
    return found


class _Fault(Exception):
    """A parameter cannot be one."""


def _unknown(name: str, table: Mapping[str, Any], log: bool, said: list[str]) -> Unknown:
    """Return a parameter whose numbers are numbers."""
    low, high = float(table["low"]), float(table["high"])
    if not low < high:
        said.append(f"low = {low:g}, high = {high:g}: low must be below high")
    if log and not low > 0.0:
        said.append(f'low = {low:g}: must be above 0 with scale = "log"')
    if said:
        raise _Fault
    middle = math.sqrt(low * high) if log else 0.5 * (low + high)
    start = float(table.get("start", middle))
    if not low <= start <= high:
        said.append(f"start = {start:g}: must be from low = {low:g} to high = {high:g}")
    prior, prior_log = None, False
    if "prior" in table:
        prior, prior_log = _prior(table["prior"], low, said)
    if said:
        raise _Fault
    return Unknown(name, start, low, high, log, prior, prior_log)


def _prior(table: Any, low: float, said: list[str]) -> tuple[tuple[float, float] | None, bool]:
    """Return centre and standard deviation of a prior, and whether they are of the logarithm."""
    keys = set(table) if isinstance(table, dict) else set()
    good = keys in ({"mean", "sd"}, {"median", "factor"}) and all(
        type(value) in (int, float) and math.isfinite(value) for value in table.values()
    )
    if good and "mean" in keys and table["sd"] > 0.0:
        return (float(table["mean"]), float(table["sd"])), False
    if good and "median" in keys and table["median"] > 0.0 and table["factor"] > 1.0:
        if low > 0.0:
            return (math.log(table["median"]), math.log(table["factor"])), True
        said.append("prior: median and factor need low above 0")
        return None, True
    said.append(
        f"prior = {table!r}: must be {{ mean, sd }} with sd above 0, "
        "or { median, factor } with median above 0 and factor above 1"
    )
    return None, False


def _with_records(
    problem: Problem, asked: list[Asked], values: Mapping[str, float], faults: list[str]
) -> Problem:
    """Return a problem with its records, its deck being checked at values of the parameters.

    What is wrong with them, and what is in `faults` already, is raised.
    """
    study = problem.study
    files: dict[Path, Any] = {}
    for one in asked:
        if one.file not in files:
            try:
                files[one.file] = read_csv(one.file)
            except ModelError as error:
                files[one.file] = None
                faults += str(error).split("\n")
    checked = _checked(problem.study, values, faults)
    records: list[Record] = []
    for one in asked:
        factor, per_time, unit = 1.0, 1.0, ""
        if checked is not None:
            factor, per_time, unit = _factors(one, checked[0], faults)
        if files[one.file] is None:
            continue
        try:
            record = read_record(one, files[one.file], factor, per_time)
        except ModelError as error:
            faults += str(error).split("\n")
            continue
        records.append(replace(record, unit=unit))
    notes = [
        f"{r.file}: {r.missing} rows without a number are left out" for r in records if r.missing
    ]
    notes += [
        f"parameters.{u.name}: the centre of its prior, {u.expected:g}, is not within its bounds"
        for u in problem.unknowns
        if u.prior is not None and not u.low <= u.expected <= u.high
    ]
    if checked is not None:
        for record in records:
            _check_times(problem, record, checked[1], faults)
        if "print_interval" not in study.options and records and not faults:
            study = replace(study, options={**study.options, **_interval(records, checked[1])})
    if faults:
        raise ModelError(
            "\n".join(line if _names(line) else f"{study.file}: {line}" for line in faults)
        )
    return replace(problem, study=study, records=tuple(records), notes=tuple(notes))


def _names(line: str) -> bool:
    """Return whether a fault begins with the file that it is in."""
    head = line.split(":", 1)[0]
    return "." in head and not head.startswith(tuple(f"{name}." for name in _TABLES))


def _checked(
    study: Study, values: Mapping[str, float], faults: list[str]
) -> tuple[Model, Settings] | None:
    """Return the deck with these values and how it is run, or None; with what is wrong."""
    from mbsim.studies.sweep import by_key, check_signals, checked_system

    if not study.model.is_file():
        if study.model.name != "None":  # that the study names none is said
            faults.append(f"study.model: {study.model}: no such file")
        return None
    try:
        overrides = study.overrides(values)
    except ModelError as error:
        faults.append(str(error))
        return None
    for _ in range(2):
        try:
            system, settings = checked_system(study, overrides)
        except ModelError as error:
            lines = str(error).split("\n")
        else:
            faults += check_signals(study, system, "records: signal")
            return system.model, settings
        faults += [by_key(study, line) for line in lines]
        named = [p for p in overrides if any(line.startswith(f"--set {p}=") for line in lines)]
        if not named:
            break
        # what else there is is found without them
        overrides = {path: overrides[path] for path in overrides if path not in named}
    return None


def _factors(one: Asked, model: Model, faults: list[str]) -> tuple[float, float, str]:
    """Return the factors of a record's values and times to the model's units, and that unit."""
    from mbsim.results.quantities import quantity_in
    from mbsim.results.units import TIME as TIMES
    from mbsim.results.units import UnitSystem, factor_from

    units = UnitSystem(model.units.force, model.units.length, model.units.time)
    quantity, single = quantity_in(model, one.signal)
    if not single:
        faults.append(f"records.{one.name}.signal: {one.signal} is a vector: name one component")
    if is_peak(one.signal):
        faults.append(f"records.{one.name}.signal: {no_curve(one.signal)}")
    factors = []
    for key, measured in (("unit", quantity), ("time_unit", TIMES)):
        factor = 1.0
        if key in one.table:
            try:
                factor = factor_from(one.table[key], measured, units)
            except ValueError as error:
                faults.append(f"records.{one.name}.{key}: {error}")
        factors.append(factor)
    return factors[0], factors[1], units.text(quantity)


def _check_times(problem: Problem, record: Record, settings: Settings, faults: list[str]) -> None:
    """Add to `faults` where a record goes beyond the run, whatever its offset may be."""
    first = min(stage.simulation.start_time for stage in settings.stages)
    if isinstance(record.offset, str):
        unknown = {u.name: u for u in problem.unknowns}.get(record.offset)
        if unknown is None:
            return
        low, high = unknown.low, unknown.high
    else:
        low = high = record.offset
    begins, ends = float(record.time[0]) + low, float(record.time[-1]) + high
    room = 1e-9 * settings.end_time
    if begins < first - room or ends > settings.end_time + room:
        faults.append(
            f"records.{record.name}: {record.file}: goes from time {begins:g} to {ends:g}"
            f"{', time_offset at its bounds' if isinstance(record.offset, str) else ''}; the run "
            f"from {first:g} to {settings.end_time:g}: give from, to, or run.end_time"
        )


def _interval(records: list[Record], settings: Settings) -> dict[str, float]:
    """Return an output interval at which the records are followed, if the deck's is too long."""
    shortest = min(
        float(record.time[-1] - record.time[0]) / (len(record.time) - 1) for record in records
    )
    deck = min(stage.simulation.print_interval for stage in settings.stages)
    return {"print_interval": shortest} if shortest < deck else {}
