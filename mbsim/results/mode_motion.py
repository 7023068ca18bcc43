"""A mode of a linear analysis as a motion: results in memory that can be looked at as a run's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.form import is_dataset, is_group, values_of
from mbsim.results.linear import mode_of
from mbsim.results.memory import MemoryFile
from mbsim.results.reading import Results

Array = np.ndarray[Any, Any]
#: Rows of a period, and periods.
_ROWS, _PERIODS = 40, 2
#: How far a body goes at most, of the size of the scene, and how far it turns [rad].
_FAR, _TURN = 0.1, 0.35
#: What pictures are made of.
_SHOWN = ("graphics", "markers", "connections")


def motion_of_mode(results: Results, number: int) -> Results:
    """Return a mode, by its number in the table, as a motion about where it was found.

    It swings with its own frequency; growth and decay are left out. What does not swing goes to and
    fro once in a unit of time. Amplitudes are so large that one sees them.

    Raises
    ------
    ResultsError
        If there is no such mode, or positions of bodies were not recorded.
    """
    model, mode = mode_of(results, number)
    ids = results.ids("bodies")
    names = [f"bodies/{id}/{what}" for id in ids for what in ("position", "quaternion")]
    if missing := [name for name in names if name not in results]:
        raise ResultsError(f"{results.place}: a mode is shown from {missing[0]}: record it")
    rows = np.flatnonzero(np.atleast_1d(results["time"]) <= model.time)
    if not len(rows):
        raise ResultsError(f"{results.place}: has no row of time {model.time:.9g}")
    place = {name: k for k, name in enumerate(model.numbers)}
    shape = np.array(
        [
            [[mode.shape[place[f"bodies/{id}/{kind}/{axis}"]] for axis in "xyz"] for id in ids]
            for kind in ("position", "turn")
        ]
    )
    size = float(results.attribute("graphics", "size") or 1.0)
    far, turn = (float(np.abs(each).max(initial=0.0)) for each in shape)
    amplitude = min(_FAR * size / max(far, 1e-300), _TURN / max(turn, 1e-300))
    swings = abs(mode.eigenvalue.imag) / (2.0 * math.pi) or 1.0
    periods = np.arange(_ROWS * _PERIODS + 1) / _ROWS
    swing = amplitude * np.exp(2j * math.pi * periods)[:, None, None]
    shift, turns = (np.real(swing * each) for each in shape)

    file = MemoryFile()
    source, *_ = results.located("time")
    file.attrs.update(source.attrs)
    for name in (*_SHOWN, "bodies"):
        _copied(source, file, name)
    p = np.stack([results[f"bodies/{id}/position"][rows[-1]] for id in ids])
    q = np.stack([results[f"bodies/{id}/quaternion"][rows[-1]] for id in ids])
    file.create_dataset("time", periods / swings)
    file.create_dataset("bodies/position", p + shift)
    file.create_dataset("bodies/quaternion", _turned(q, turns))
    return Results(file, None)


def _turned(q: Array, turn: Array) -> Array:
    """Return quaternions (n, bodies, 4) of bodies turned about their own axes by (n, bodies, 3).

    Small turns are taken as the vector part of a quaternion: they are shown, not measured.
    """
    half = 0.5 * turn
    w, u = q[..., :1], q[..., 1:]
    scalar = w - (u * half).sum(axis=-1, keepdims=True)
    vector = u + w * half + np.cross(np.broadcast_to(u, half.shape), half)
    found = np.concatenate([scalar, vector], axis=-1)
    made: Array = found / np.linalg.norm(found, axis=-1, keepdims=True)
    return made


def _copied(source: Any, file: MemoryFile, path: str) -> None:
    """Copy facts of bodies and what pictures are made of: no signals over time."""
    item = source.get(path)
    if is_dataset(item):
        if not path.startswith("bodies/") or item.ndim == 1:
            file.create_dataset(path, values_of(item)).attrs.update(item.attrs)
    elif is_group(item):
        file.create_group(path).attrs.update(item.attrs)
        for name in item.keys():
            _copied(source, file, f"{path}/{name}")
