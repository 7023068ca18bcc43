"""Linearised models, as a run finds them and as a result file keeps them: `/linear/1/A`.

x' = A x + B u, y = C x + D u about the state of a run at one time. Positions of bodies are those of
their centres; a turn is a small one about the body's own axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.damage import reads
from mbsim.results.form import values_of

if TYPE_CHECKING:
    from mbsim.results.reading import Results

Array = np.ndarray[Any, Any]
#: Group of a result file.
GROUP = "linear"
_MATRICES = ("A", "B", "C", "D", "basis", "rates")
#: A table shows no damping that is less than this of a mode.
_ROUNDING = 1e-9
_NAMES = ("states", "inputs", "outputs", "numbers")


class Mode(NamedTuple):
    """A real eigenvalue, or a pair of conjugate ones by the one whose imaginary part is > 0.

    `shape` has a complex number for each of `LinearModel.numbers`; what goes farthest, as a
    position or as a turn, is 1.
    """

    eigenvalue: complex  # [1/T]
    frequency: float  # [1/T] of the undamped mode, abs(eigenvalue) / 2 pi
    damping_ratio: float  # -Re / abs; 1 of what decays without swinging
    shape: Array


@dataclass(frozen=True, eq=False)
class LinearModel:
    """x' = rates + A x + B u, y = C x + D u, all but rates and A as changes from where it is.

    Attributes
    ----------
    A, B, C, D : ndarray
        (n, n), (n, m), (p, n), (p, m).
    states : tuple of str
        ``bodies/2/position/x``; ``bodies/2/turn/z`` is a small turn about the body's own z [rad],
        ``angular_velocity`` is about its own axes; ``diffs/3/value``.
    inputs, outputs : tuple of str
    numbers : tuple of str
        All positions, turns, velocities and states; of them `states` are enough.
    basis : ndarray, shape (len(numbers), n)
        All numbers as they follow from the states.
    rates : ndarray, shape (n,)
        x' where it is: 0 of a model at rest. Eigenvalues of one that moves depend on the states.
    time : float
        When [T].
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    numbers: tuple[str, ...]
    basis: Array
    rates: Array
    time: float = 0.0

    @property
    def eigenvalues(self) -> Array:
        """Eigenvalues of A [1/T], by their real parts, largest first."""
        found: Array = np.linalg.eigvals(self.A)
        return found[np.lexsort((found.imag, -found.real))]

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes by their frequencies, lowest first."""
        values, vectors = np.linalg.eig(self.A)
        found = []
        for k in np.lexsort((values.real, np.abs(values))):
            value = complex(values[k])
            if value.imag < 0.0:
                continue
            size = abs(value)
            ratio = -value.real / size if size > 0.0 else 0.0
            found.append(
                Mode(value, size / (2.0 * np.pi), ratio, self._scaled(self.basis @ vectors[:, k]))
            )
        return tuple(found)

    def _scaled(self, shape: Array) -> Array:
        """Return a shape over what goes farthest in it."""
        for kind in ("/position/", "/turn/", ""):
            rows = [k for k, name in enumerate(self.numbers) if kind in name]
            sizes = np.abs(shape[rows])
            # what is only rounding beside the rest is no motion
            if len(rows) and sizes.max() > 1e-9 * np.abs(shape).max(initial=0.0):
                scaled: Array = shape / shape[rows[int(sizes.argmax())]] + 0.0  # no -0
                return scaled
        return shape

    def table(self, unit: str = "T") -> list[str]:
        """Return the modes as lines of a table; `unit` is that of time."""
        if not self.modes:
            return ["no eigenvalues: the model has no degree of freedom"]
        per = f"[1/{unit}]"
        lines = [f"{'mode':>4} {'frequency ' + per:>18} {'damping ratio':>14} eigenvalue {per}"]
        for k, mode in enumerate(self.modes, 1):
            real, imaginary = mode.eigenvalue.real, mode.eigenvalue.imag
            ratio = mode.damping_ratio
            if abs(real) < _ROUNDING * abs(imaginary):
                real = ratio = 0.0
            value = f"{real:.9g} +- {imaginary:.9g}i" if imaginary else f"{real:.9g}"
            lines.append(f"{k:>4} {mode.frequency:>18.9g} {ratio:>14.6g} {value}")
        return lines

    def tables(self, path: str) -> dict[str, Array]:
        """Return the datasets of a group of a result file."""
        modes = self.modes
        shapes = np.array([mode.shape for mode in modes]).reshape(len(modes), len(self.numbers))
        values = np.array([mode.eigenvalue for mode in modes], dtype=complex)
        return {
            **{f"{path}/{name}": getattr(self, name) for name in _MATRICES},
            f"{path}/eigenvalues": np.column_stack([values.real, values.imag]),
            f"{path}/frequencies": np.array([mode.frequency for mode in modes]),
            f"{path}/damping_ratios": np.array([mode.damping_ratio for mode in modes]),
            f"{path}/shapes": np.stack([shapes.real, shapes.imag], axis=-1),
        }

    def facts(self, path: str, unit: str = "T") -> dict[str, dict[str, Any]]:
        """Return the attributes of that group and of its datasets; `unit` is that of time."""
        names = {name: "\n".join(getattr(self, name)) for name in _NAMES}
        per_time = {"unit": f"1/{unit}"}
        return {
            path: {"time": self.time, **names},
            f"{path}/eigenvalues": {**per_time, "columns": "real\nimaginary"},
            f"{path}/frequencies": per_time,
            f"{path}/damping_ratios": {"unit": "1"},
        }


def from_tables(tables: Mapping[str, Array], facts: Mapping[str, Any]) -> LinearModel:
    """Return the model of a group: its matrices and attributes.

    Raises
    ------
    ValueError
        If matrices and names do not fit.
    """
    names: dict[str, Any] = {
        name: tuple(str(facts[name]).split("\n")) if facts[name] else () for name in _NAMES
    }
    found: dict[str, Any] = {name: np.asarray(tables[name], dtype=np.float64) for name in _MATRICES}
    sizes = {name: len(each) for name, each in names.items()}
    n, m, p = sizes["states"], sizes["inputs"], sizes["outputs"]
    shapes: dict[str, tuple[int, ...]] = {
        "A": (n, n),
        "B": (n, m),
        "C": (p, n),
        "D": (p, m),
        "basis": (sizes["numbers"], n),
    }
    shapes["rates"] = (n,)
    for name, shape in shapes.items():
        if found[name].shape != shape:
            raise ValueError(f"{GROUP}: {name} is {found[name].shape} and not {shape}")
    return LinearModel(**found, **names, time=float(facts["time"]))


class WithLinear:
    """What results know of linear analyses."""

    @property
    @reads
    def linear(self: Results) -> tuple[LinearModel, ...]:  # type: ignore[misc]
        """The models of all ``Simulate analysis_type="Linear"`` of the run, in their order."""
        file, *_ = self.located("time")
        group = file.get(GROUP)
        if group is None:
            return ()
        found = []
        for name in sorted(group.keys(), key=int):
            item = group[name]
            tables = {each: values_of(item[each]) for each in _MATRICES}
            facts = {each: item.attrs[each] for each in (*_NAMES, "time")}
            found.append(from_tables(tables, facts))
        return tuple(found)


def mode_of(results: Results, number: int) -> tuple[LinearModel, Mode]:
    """Return a mode of the last linear analysis by its number in the table, from 1.

    Raises
    ------
    ResultsError
        If there is none.
    """
    place = results.place
    if not results.linear:
        raise ResultsError(f'{place}: holds no Simulate analysis_type="Linear", so no modes')
    model = results.linear[-1]
    if not 1 <= number <= len(model.modes):
        raise ResultsError(f"{place}: there are modes 1 to {len(model.modes)}, and no {number}")
    return model, model.modes[number - 1]
