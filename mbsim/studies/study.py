"""`read_study`: a study file, TOML, read and checked; its runs as overrides of a deck."""

from __future__ import annotations

import functools
import hashlib
import json
import re
import sys
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

from mbsim import __version__
from mbsim.errors import ModelError
from mbsim.reader.written import written
from mbsim.studies.designs import DESIGNS, SAMPLED
from mbsim.studies.distributions import MOST_RUNS, Numbers, Spread, read_spread
from mbsim.studies.formulas import Formula
from mbsim.studies.outputs import Output, read_output

_TABLES = ("study", "run", "parameters", "set", "outputs")
_STUDY = ("model", "design", "runs", "seed", "csv", "keep")
#: Options of a run that a study may give: name -> type, as `simulate` has them.
_RUN: dict[str, tuple[type, ...]] = {
    "end_time": (int, float),
    "print_interval": (int, float),
    "integrator": (str,),
    "tol": (int, float),
    "plugins": (list,),
    "detector": (str,),
    "interpret_plugins": (bool,),
    "allow_overlap": (bool,),
    "plugin_timeout": (int, float),
    "scripts": (bool,),
    "most_evaluations": (int,),
}
#: Attributes that an option of [run] stands in for, by their names folded; with an index the first
#: two are of one Simulate of several, which the option may leave as it is.
_STOOD_IN_FOR = {
    "simulate.endtime": "end_time",
    "simulate.printinterval": "print_interval",
    "paramtransient.integrtol": "tol",
    "paramtransient.integratortype": "integrator",
}
_NAME = re.compile(r"[A-Za-z_]\w*")
_BRACES = re.compile(r"\{([^{}]*)\}")
#: What columns of the table are called that are neither parameters nor outputs.
TAKEN = ("run", "key", "status", "reason", "steps", "evaluations")


class Case(NamedTuple):
    """One run of a study: its number, the values of its parameters, and what it is derived by.

    Each derivative may take `worth` times the run's evaluations, 0 for as many as it does.
    """

    run: int
    values: dict[str, float]
    sensitivity: tuple[str, ...] = ()
    worth: int = 0


@dataclass(frozen=True)
class Study:
    """What a study file says.

    Attributes
    ----------
    model : Path
        The deck.
    spreads : dict
        Values of each parameter, by name.
    paths : dict
        ``Element[id].attribute`` -> text with formulas of parameters in braces.
    """

    file: Path
    model: Path
    design: str
    runs: int
    seed: int
    csv: Path | None
    keep: tuple[int, ...]
    options: dict[str, Any]
    spreads: dict[str, Spread]
    paths: dict[str, str]
    outputs: tuple[Output, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def name(self) -> str:
        """What its files are called."""
        return self.file.stem

    @functools.cached_property
    def points(self) -> Numbers:
        """Values of the parameters, (runs, parameters)."""
        return DESIGNS[self.design](self)

    @functools.cached_property
    def _texts(self) -> dict[str, list[str | Formula]]:
        """Texts of `paths` in parts: plain text, and formulas."""
        return {path: _parts(text, self.spreads) for path, text in self.paths.items()}

    def case(self, run: int) -> Case:
        """Return a run with the values of its parameters."""
        return Case(run, dict(zip(self.spreads, self.points[run].tolist(), strict=True)))

    def __getstate__(self) -> dict[str, Any]:
        """Return what goes to workers: without the points, and what is made anew."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def overrides(self, values: Mapping[str, float]) -> dict[str, str]:
        """Return what values of the parameters change in the deck, by ``Element[id].attribute``.

        Raises
        ------
        ModelError
            If a formula has no value.
        """
        found: dict[str, str] = {}
        for path, parts in self._texts.items():
            try:
                found[path] = "".join(
                    part if isinstance(part, str) else written(part(values)) for part in parts
                )
            except (ArithmeticError, ValueError) as error:
                raise ModelError(f"set.{path}: {self.paths[path]}: {error}") from None
        return found

    def set_by(self, name: str) -> tuple[str, ...] | None:
        """Return the attributes that a parameter is the value of; None where a formula has it."""
        found = []
        for path, parts in self._texts.items():
            if any(isinstance(part, Formula) and name in part.names for part in parts):
                if self.paths[path] != f"{{{name}}}":
                    return None
                found.append(path)
        return tuple(found)

    def key(self, run: int, model: str) -> str:
        """Return the key of a run: a digest of all that its row follows from.

        `model` is the digest of the deck and of the files that it names.
        """
        values = self.case(run).values
        try:
            overrides = self.overrides(values)
        except ModelError as error:
            overrides = {"": str(error)}
        outputs = [asdict(output) for output in self.outputs]
        facts = [__version__, model, self.options, overrides, values, outputs]
        text = json.dumps(facts, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    @property
    def signals(self) -> tuple[str, ...]:
        """What runs record; a contact's peaks are there where its other signals are."""
        asked = {output.signal.replace("/peak_", "/") for output in self.outputs if output.signal}
        return tuple(sorted(asked))


def read_study(file: str | Path) -> Study:
    """Return the study that a TOML file describes.

    Raises
    ------
    ModelError
        All that is wrong with it, a line each.
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
    about = _about(tables["study"], len(tables["parameters"]), path, faults)
    options = read_options(tables["run"], path, faults)
    spreads = _spreads(tables["parameters"], about["design"] != "csv", faults)
    paths = read_paths(tables["parameters"], tables["set"], options, faults)
    outputs = _outputs(tables["outputs"], spreads, faults)
    if faults:
        raise ModelError("\n".join(f"{path}: {fault}" for fault in faults))
    study = Study(path, **about, options=options, spreads=spreads, paths=paths, outputs=outputs)
    try:
        count = len(study.points)
    except ModelError as error:
        at = "" if study.csv is not None and str(error).startswith(f"{study.csv}:") else f"{path}: "
        raise ModelError(f"{at}{error}") from None
    if beyond := [run for run in study.keep if not 0 <= run < count]:
        raise ModelError(f"{path}: study.keep: no run {beyond[0]}; runs are 0 to {count - 1}")
    return study


def load_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file, or raise `ModelError`."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        try:
            import tomli as tomllib
        except ImportError:
            raise ModelError('study files need: pip install "mbsim-contact[studies]"') from None
    try:
        with path.open("rb") as stream:
            found: dict[str, Any] = tomllib.load(stream)
            return found
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: is no TOML: {error}") from None


def _about(
    table: Mapping[str, Any], parameters: int, path: Path, faults: list[str]
) -> dict[str, Any]:
    """Return what [study] says, for a number of parameters."""
    if extra := sorted(table.keys() - set(_STUDY)):
        faults.append(f"study: unknown {', '.join(extra)}; known: {', '.join(_STUDY)}")
    model, design = table.get("model"), table.get("design", "csv" if "csv" in table else "grid")
    if not isinstance(model, str):
        faults.append("study.model: the deck must be named")
    if design not in DESIGNS:
        faults.append(f"study.design = {design!r}: must be one of {', '.join(DESIGNS)}")
    runs, seed, keep = table.get("runs", 0), table.get("seed", 0), table.get("keep", [])
    for name, value in (("runs", runs), ("seed", seed)):
        if type(value) is not int or value < 0:
            faults.append(f"study.{name} = {value!r}: must be a whole number from 0 on")
    if type(runs) is int and runs > MOST_RUNS:
        faults.append(f"study.runs = {runs}: at most {MOST_RUNS} are taken")
    counted = design in SAMPLED
    if counted and runs == 0:
        faults.append(f"study.runs: {design} needs their number")
    if not counted and design in DESIGNS and "runs" in table:
        faults.append(f"study.runs: {design} says itself how many there are")
    if (design == "csv") != ("csv" in table):
        faults.append('study: design = "csv" goes with csv = "FILE"')
    if not isinstance(keep, list) or not all(type(run) is int for run in keep):
        faults.append(f"study.keep = {keep!r}: must be a list of numbers of runs")
        keep = []
    notes: tuple[str, ...] = ()
    if design in ("sobol", "saltelli") and type(runs) is int:
        times = 1 if design == "sobol" else parameters + 2
        if (points := runs // times) & (points - 1):
            of = f"{points} x {times}" if times > 1 else f"{points}"
            notes = (f"Sobol's sequence is balanced for a power of 2 only; runs = {of}",)
    return {
        "model": path.parent / str(model),
        "design": design,
        "runs": runs,
        "seed": seed,
        "csv": path.parent / str(table["csv"]) if "csv" in table else None,
        "keep": tuple(keep),
        "notes": notes,
    }


def read_options(table: Mapping[str, Any], path: Path, faults: list[str]) -> dict[str, Any]:
    """Return the options of [run], paths of plugins being those from here.

    What is wrong is added to `faults`.
    """
    for name, value in table.items():
        if name not in _RUN:
            faults.append(f"run: unknown {name}; known: {', '.join(_RUN)}")
        elif type(value) not in _RUN[name]:
            faults.append(f"run.{name} = {value!r}: must be a {_RUN[name][-1].__name__}")
    found = dict(table)
    if isinstance(found.get("plugins"), list):
        found["plugins"] = [str(path.parent / str(file)) for file in found["plugins"]]
    return found


def _spreads(tables: Mapping[str, Any], needed: bool, faults: list[str]) -> dict[str, Spread]:
    """Return the values of all parameters; of a CSV they are not `needed`."""
    spreads: dict[str, Spread] = {}
    for name, table in tables.items():
        if isinstance(table, dict):
            try:
                spreads[name] = read_spread(table, needed)
            except ModelError as error:
                faults.append(f"parameters.{name}: {error}")
    return spreads


def key_of(path: str, text: str, parameters: Collection[str]) -> str:
    """Return the key of a study that changes an attribute, `text` being what it is set to."""
    return f"parameters.{text[1:-1]}.path" if text[1:-1] in parameters else "set"


def read_paths(
    tables: Mapping[str, Any],
    given: Mapping[str, Any],
    options: Mapping[str, Any],
    faults: list[str],
    elsewhere: Collection[str] = (),
) -> dict[str, str]:
    """Return what parameters and [set] change in the deck, as `Study.paths`.

    `options` are those of [run], `elsewhere` names parameters that change something else; what is
    wrong is added to `faults`.
    """
    from mbsim.reader.keywords import fold

    paths: dict[str, str] = {}
    taken: set[str] = set()
    if not tables:
        faults.append("parameters: there are none")
    for name, table in tables.items():
        if not _NAME.fullmatch(name) or name in TAKEN:
            faults.append(f"parameters.{name}: must be another name: letters, digits, _")
        if not isinstance(table, dict):
            faults.append(f"parameters.{name}: must be a table")
            continue
        where = table.get("path", [])
        listed = [where] if isinstance(where, str) else where
        if not isinstance(listed, list) or not all(isinstance(each, str) for each in listed):
            faults.append(f"parameters.{name}: path: must be a text, or a list of texts")
            continue
        for each in listed:
            if fold(each) in taken:
                faults.append(f"parameters.{name}: {each}: another parameter sets it too")
            taken.add(fold(each))
            paths[each] = f"{{{name}}}"
    for each, text in given.items():
        if fold(each) in taken:
            faults.append(f"set.{each}: a parameter sets it too, or [set] does twice")
        taken.add(fold(each))
        paths[each] = text if isinstance(text, str) else written(text)
    used = set(elsewhere)
    for each, text in paths.items():
        try:
            parts = _parts(text, tables)
        except ModelError as error:
            faults.append(f"set.{each}: {error}")
            continue
        used |= {name for part in parts if isinstance(part, Formula) for name in part.names}
    faults += [
        f"{key_of(each, text, tables)}: {each}: run.{option} stands in for it; leave one out"
        for each, text in paths.items()
        if (option := _STOOD_IN_FOR.get(fold(each))) in options
    ]
    faults += [
        f"parameters.{name}: changes nothing: it has no path, and no [set] names it"
        for name in tables
        if name not in used
    ]
    return paths


def _parts(text: str, names: Mapping[str, Any]) -> list[str | Formula]:
    """Return a text of [set] in parts: plain text, and the formulas in braces."""
    pieces = _BRACES.split(text)
    return [Formula(piece, names) if k % 2 else piece for k, piece in enumerate(pieces)]


def _outputs(
    tables: Mapping[str, Any], spreads: Mapping[str, Spread], faults: list[str]
) -> tuple[Output, ...]:
    """Return all outputs in order."""
    found: list[Output] = []
    if not tables:
        faults.append("outputs: there are none")
    for name, table in tables.items():
        if not _NAME.fullmatch(name) or name in TAKEN or name in spreads:
            faults.append(f"outputs.{name}: must be another name: letters, digits, _")
        if not isinstance(table, dict):
            faults.append(f"outputs.{name}: must be a table")
            continue
        try:
            output = read_output(name, table)
            if output.formula:
                above = [other.name for other in found if not other.is_curve]
                Formula(output.formula, [*spreads, *above])
        except ModelError as error:
            faults.append(f"outputs.{name}: {error}")
            continue
        found.append(output)
    return tuple(found)
