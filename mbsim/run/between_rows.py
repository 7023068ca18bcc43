"""A run of a result file once more, with rows at other times: for what lies between its rows."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mbsim.errors import ModelError, SolverError
from mbsim.integrators.catalog import RIGID
from mbsim.run.settings import BY_CALLER

if TYPE_CHECKING:
    from mbsim.results.reading import Results

#: A method whose steps depend, within tol, on where rows are: see `integrators.dop853`.
ASKS_WHERE_ROWS_ARE = "DOP853"


@contextmanager
def rerun(results: Results, every: float) -> Iterator[Results]:
    """Yield results of the same run with rows every so often [T], in a folder that goes with them.

    Steps do not depend on rows, so these are states of the run itself, to the last bit. They do
    with DOP853, whose run is another one within its tolerance.

    Raises
    ------
    ModelError
        If `every` is no time, the deck or users' files have changed, the integrator is MOREAU, or
        the run does not end where it did: the clock or chance is asked in a user's code, or steps
        are bounded by rows.
    """
    from mbsim.results.reading import open_results
    from mbsim.run.replay import Replay, deck_of, lines_of
    from mbsim.run.simulation import simulate

    if not 0.0 < every < math.inf:
        raise ModelError(f"--every {every:g}: must be a time above 0")
    named = results.attributes
    if named["integrator"] == RIGID:
        raise ModelError(f"{results.path}: integrator {RIGID} has no state between its steps")
    Replay(results)
    with tempfile.TemporaryDirectory() as folder:
        try:
            simulate(
                deck_of(results),
                overrides=lines_of(named["overrides"]),
                end_time=float(named["end_time"]) or None,
                print_interval=every,
                integrator=str(named["integrator"]),
                tol=float(named["tol"]) if str(named["tol_from"]).endswith(BY_CALLER) else None,
                plugins=lines_of(named["plugins"]),
                output=folder,
                detector=str(named["detector"]),
                interpret_plugins=bool(named["interpret_plugins"]),
                allow_overlap=True,
            ).close()
        except SolverError:
            # where it gave up before it gives up again
            if named["status"] == "finished":
                raise
        (file,) = Path(folder).glob("*.h5")
        with open_results(file) as again:
            _compare(results, again)
            yield again


def _compare(results: Results, again: Results) -> None:
    """Raise `ModelError` unless the run once more is at the last row of both where it was.

    That of a run which was interrupted need not be its last.
    """
    if results.attributes["integrator"] == ASKS_WHERE_ROWS_ARE:
        return
    times, here, there = np.intersect1d(results["time"], again["time"], return_indices=True)
    was = np.atleast_2d(results["state/y"])[here[-1]]
    if not np.array_equal(np.atleast_2d(again["state/y"])[there[-1]], was):
        raise ModelError(
            f"{results.path}: run again it is not at time {times[-1]:g} where it was, so nothing "
            "is known between its rows: a user's code asks for the time of day or chance, or the "
            'deck has compatibility="MOTIONSOLVE", where steps are no longer than rows are apart; '
            "ask without --every"
        )
