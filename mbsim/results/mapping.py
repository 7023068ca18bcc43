"""`SignalMapping`: what results share with a `dict`, and the forms they are handed on in.

pandas, xarray and matplotlib are imported where they are asked for, not before.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from mbsim.results.reading import Results


class SignalMapping(ABC):
    """Signals by name, as a mapping that is read only.

    It is no `collections.abc.Mapping`: two results are equal where they are the same object,
    and `keys` is a list, sorted as numbers where names have some.
    """

    @abstractmethod
    def keys(self) -> list[str]:
        """Names of all signals and tables."""

    @abstractmethod
    def __getitem__(self, name: str) -> Any: ...

    @abstractmethod
    def __contains__(self, name: object) -> bool: ...

    @abstractmethod
    def _itself(self) -> Results: ...

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self.keys())

    def __bool__(self) -> bool:
        return True

    def values(self) -> Iterator[Any]:
        """Yield all signals and tables, each read when its turn comes."""
        return (self[name] for name in self.keys())

    def items(self) -> Iterator[tuple[str, Any]]:
        """Yield names with their signals and tables, each read when its turn comes."""
        return ((name, self[name]) for name in self.keys())

    def get(self, name: str, default: Any = None) -> Any:
        """Return a signal or table; the default where there is none of this name."""
        return self[name] if name in self else default

    def _ipython_key_completions_(self) -> list[str]:
        """Return what IPython offers within the brackets."""
        return self.keys()

    def to_pandas(self, *names: str) -> pandas.DataFrame:
        """Return signals as a table over time, one column for each component.

        Columns are called as here, ``bodies/2/position/x``; ``frame.attrs["units"]`` has the
        unit of each and of ``time``, the index.

        Parameters
        ----------
        *names : str
            Names or patterns, ``bodies/*/velocity``; none stands for all signals.
        """
        from mbsim.results.handed_on import pandas_frame

        return pandas_frame(self._itself(), names)

    def to_xarray(self, *names: str) -> xarray.Dataset:
        """Return signals as arrays over time, element and component, with their units.

        What all elements of a group have is one variable: ``bodies_position`` over ``time``,
        ``bodies`` (ids) and ``xyz``.

        Parameters
        ----------
        *names : str
            Names or patterns; none stands for all signals. Components are always whole.
        """
        from mbsim.results.handed_on import xarray_dataset

        return xarray_dataset(self._itself(), names)

    def plot(self, *names: str, ax: Axes | None = None) -> Axes:
        """Draw signals over time, and return the matplotlib axes.

        Parameters
        ----------
        *names : str
            Names or patterns; a vector gives all its components.
        ax : Axes, optional
            Where to draw; default: a new figure of pyplot's.
        """
        from mbsim.results.drawing import draw_signals

        return draw_signals(self._itself(), names, ax)

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        from mbsim.results.notebook import summary

        return summary(self._itself())
