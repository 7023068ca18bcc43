"""The table of a study as a Parquet file, a row a run; the one home of pyarrow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError, NoSuchResults, ResultsError
from mbsim.results.files import replace_bytes

if TYPE_CHECKING:
    from mbsim.studies.study import Study
    from mbsim.studies.worker import Row

SUFFIX = ".parquet"


def need_pyarrow() -> Any:
    """Return `pyarrow` with its Parquet, or raise `ModelError` saying how it is installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ModelError('tables of studies need: pip install "mbsim-contact[studies]"') from None
    return pyarrow


def write_table(path: Path, study: Study, keys: Sequence[str], rows: Sequence[Row]) -> None:
    """Write the table of a study; nothing in it depends on who ran what, and when.

    Parameters
    ----------
    path : Path
    study : Study
    keys : sequence of str
        Of every row.
    rows : sequence of Row
        In order of their runs.

    Raises
    ------
    ResultsError
        If it cannot be written.
    """
    arrow = need_pyarrow()
    number = arrow.float64()
    columns: dict[str, Any] = {
        "run": arrow.array([row.run for row in rows], arrow.int64()),
        "key": arrow.array(list(keys), arrow.string()),
    }
    points = study.points[[row.run for row in rows]]
    for k, name in enumerate(study.spreads):
        columns[name] = arrow.array(points[:, k], number)
    columns["status"] = arrow.array([row.status for row in rows], arrow.string())
    columns["reason"] = arrow.array([row.reason for row in rows], arrow.string())
    for output in study.outputs:
        kind = arrow.list_(number) if output.is_curve else number
        columns[output.name] = arrow.array([row.outputs.get(output.name) for row in rows], kind)
    for name in ("steps", "evaluations"):
        columns[name] = arrow.array([getattr(row, name) for row in rows], arrow.int64())
    about = {
        "mbsim": "study",
        "model": study.model.name,
        "parameters": ",".join(study.spreads),
        "outputs": ",".join(o.name for o in study.outputs if not o.is_curve),
        "curves": ",".join(o.name for o in study.outputs if o.is_curve),
    }
    made = arrow.table(columns).replace_schema_metadata(about)
    stream = arrow.BufferOutputStream()
    arrow.parquet.write_table(made, stream, compression="zstd")
    replace_bytes(path, stream.getvalue().to_pybytes())


class Responses:
    """A table that was read: columns as arrays, and which of them are what."""

    def __init__(self, path: Path) -> None:
        arrow = need_pyarrow()
        if not path.is_file():
            raise NoSuchResults(f"{path}: no such file")
        try:
            table = arrow.parquet.read_table(path)
        except (OSError, arrow.ArrowException) as error:
            raise ResultsError(f"{path}: is no Parquet file: {error}") from None
        about = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
        if about.get("mbsim") != "study":
            raise ResultsError(f"{path}: is Parquet, but no table of a study")
        self.path, self.model = path, about.get("model", "")
        self.parameters, self.outputs, self.curves = (
            [name for name in about[kind].split(",") if name]
            for kind in ("parameters", "outputs", "curves")
        )
        self._table = table

    def __len__(self) -> int:
        return int(self._table.num_rows)

    def __getitem__(self, name: str) -> Any:
        """Return a column as an array; of numbers, what is missing as NaN."""
        column = self._table[name].to_pylist()
        if name in self.curves:
            return column
        if name in self.parameters or name in self.outputs:
            return np.array([math.nan if v is None else v for v in column], dtype=np.float64)
        return np.array(column)
