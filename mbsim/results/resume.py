"""Whether a run can go on from a result file, and from which numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError, ResultsError
from mbsim.results.blocks import Table
from mbsim.results.csv_file import write_csv
from mbsim.results.identity import KINDS, Identity
from mbsim.results.reading import Results, open_results
from mbsim.results.store import Value

if TYPE_CHECKING:
    from mbsim.model.elements import Model

#: Attributes of which digests say whether they matter.
_SAID_ELSEWHERE = (
    *("tol_from", "model_file", "overrides", "plugins", "interpret_plugins"),
    "allow_overlap",  # of the start alone
    "length",  # follows from the model, which says what differs
)
#: What a digest that differs says, and of which facts of `Identity` it is.
_DIGESTS = {
    "model_sha256": ("the model file has changed", "model"),
    **{kind.attribute: (kind.differs, name) for name, kind in KINDS.items()},
}
#: Where a checkpoint says what the run is made of, and how much it had written by then.
MADE_OF, WRITTEN = "made_of", "written"


def check_same(
    path: Path, results: Results, settings: Mapping[str, Value], identity: Identity
) -> None:
    """Raise `ModelError` unless a run with these settings can go on from a result file."""
    there = results.attributes
    if results.status == "finished":
        raise ModelError(f"--resume: {path}: this run has finished; there is nothing to go on with")
    if not results.has_checkpoint:
        raise ModelError(f"--resume: {path}: no checkpoint in it; start without --resume")
    made_of = results.tables("checkpoint").get(MADE_OF)
    # what explains a difference comes before the digests that only show it
    for name, value in settings.items():
        if name in _SAID_ELSEWHERE or (name == "subroutines_sha256" and results.status == "failed"):
            continue  # a failed user subroutine may be mended
        if name in there and there[name] == value:
            continue
        if name in _DIGESTS:
            what, kind = _DIGESTS[name]
            found = "" if made_of is None else identity.changes(made_of, kind)
            what += f": {found}" if found else ""
        else:
            what = f"{name} was {there.get(name, 'not given')} and is {value} now"
        raise ModelError(f"--resume: {path}: {what}; a run goes on as it began")


def digest(tables: Mapping[str, Table]) -> str:
    """Return the SHA-256 of tables: of their names, shapes, types and bytes."""
    found = hashlib.sha256()
    for name in sorted(tables):
        table = np.ascontiguousarray(tables[name])
        found.update(f"{name} {np.shape(tables[name])} {table.dtype.str}\n".encode())
        found.update(table.tobytes())
    return found.hexdigest()


def completed(model: Model, directory: Path, tell: Callable[[str], None]) -> Results | None:
    """Write the ``.csv`` of a run that has finished, where it is missing, and return its results.

    None where that is not what the folder lacks.
    """
    target = directory / f"{model.name}.h5"
    path = target.with_suffix(".csv")
    if not model.requests or not target.is_file() or path.exists():
        return None
    results = open_results(target)
    ids = [id for id in model.requests if f"requests/{id}" in results]
    same = results.attributes.get("model_sha256") == model.sha256
    if results.status != "finished" or not same or len(ids) != len(model.requests):
        results.close()
        return None
    write_csv(path, results, ids)
    tell(f"{target}: this run has finished; {path.name} was missing and is written again")
    return results


def read_checkpoint(
    target: Path | None, settings: Mapping[str, Any], identity: Identity
) -> dict[str, Table]:
    """Return the checkpoint of a result file, after comparing what it was made with.

    Raises
    ------
    ModelError
        If there is none, it is damaged, or it was made with another model or other settings.
    """
    if target is None:
        raise ModelError("resume: there is no folder with results to go on from")
    if not target.is_file():
        raise ModelError(f"--resume: {target}: no such file; start without --resume")
    try:
        with open_results(target) as results:
            if not results.checked:
                raise ModelError(
                    f"--resume: {target}: has no checksums: it is of an earlier version, "
                    "or damaged; start without --resume"
                )
            check_same(target, results, settings, identity)
            tables = results.tables("checkpoint")
            if results.attribute("checkpoint", "sha256") != digest(tables):
                raise ModelError(
                    f"--resume: {target}: the checkpoint is damaged: its numbers are not "
                    "those that were written; start without --resume"
                )
            if len(results["time"]) < tables[WRITTEN][0]:
                raise ModelError(
                    f"--resume: {target}: has fewer rows than its checkpoint was made "
                    "behind; start without --resume"
                )
    except ResultsError as error:
        raise ModelError(f"--resume: {error}") from None
    return tables
