"""Results as pandas and xarray have them; neither is needed for anything else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.results.curves import components
from mbsim.results.names import PARTS
from mbsim.results.quantities import quantity_of
from mbsim.results.units import TIME, UnitSystem

if TYPE_CHECKING:
    import pandas
    import xarray

    from mbsim.results.reading import Results

#: What the axis of components is called, by their number.
_AXES = {3: "xyz", 4: "wxyz", 8: "F"}


def _need(package: str, method: str) -> Any:
    """Return a package that not everybody has; `ModelError` says how to get it."""
    from importlib import import_module

    try:
        return import_module(package)
    except ImportError:
        raise ModelError(
            f"{method} needs {package}, which is not installed: pip install {package}"
        ) from None


def _facts(results: Results) -> dict[str, str]:
    """Return what a table says of the run that it comes from."""
    about = results.attributes
    return {
        "model_file": str(about.get("model_file", "")),
        "status": results.status,
        "mbsim_version": str(about.get("mbsim_version", "")),
    }


def _named(results: Results, names: Sequence[str]) -> list[tuple[str, str]]:
    """Return what names and patterns stand for, each once: a signal, and the part of it asked for.

    The part of a whole signal is empty.
    """
    signals = results.signals()
    found = [each for name in names for each in results.find(name)] if names else list(signals)
    parts = ((each, "") if each in signals else each.rpartition("/")[::2] for each in found)
    return [(name, part) for name, part in dict.fromkeys(parts) if name != "time"]


def pandas_frame(results: Results, names: Sequence[str]) -> pandas.DataFrame:
    """Return signals as a table over time, see `SignalMapping.to_pandas`."""
    package = _need("pandas", "to_pandas")
    units, system = {"time": ""}, UnitSystem.of(results.attributes)
    units["time"] = system.text(TIME)
    columns, read = {}, dict[str, Any]()
    for name in names or list(results.signals()):
        for each in components(results, name):
            if each.dataset == "time" or each.name in columns:
                continue
            if each.dataset not in read:
                read = {each.dataset: results[each.dataset]}
            values = read[each.dataset]
            if each.part == "mag":
                columns[each.name] = results[each.name]
            else:
                columns[each.name] = values[:, each.column] if each.part else values
            units[each.name] = system.text(quantity_of(results, each.dataset, each.column))
    index = package.Index(results["time"], name="time")
    frame: pandas.DataFrame = package.DataFrame(columns, index=index)
    frame.attrs = {"units": units, **_facts(results)}
    return frame


def _units(results: Results, name: str, count: int) -> str | list[str]:
    """Return the unit of a signal; one for each component where they differ."""
    system = UnitSystem.of(results.attributes)
    found = [system.text(quantity_of(results, name, k)) for k in range(count)]
    return found[0] if len(set(found)) == 1 else found


def _variable(
    package: Any, results: Results, group: str, ids: list[int], names: list[str], part: str
) -> Any:
    """Return one variable: of elements side by side, or of one signal that has no id."""
    columns = results.signals()[names[0]]
    count = 1 if part else columns
    values = [results[f"{name}/{part}" if part else name] for name in names]
    dims, coords = ["time"], {"time": results["time"]}
    if ids:
        dims.append(group)
        coords[group] = ids
        labels = [results.label(f"{group}/{id}") for id in ids]
        if any(labels):
            coords[f"{group}_label"] = (group, labels)
    if count > 1:
        dims.append(_AXES[count])
        coords[_AXES[count]] = list(PARTS[count])
    array = package.DataArray(np.stack(values, 1) if ids else values[0], coords, dims)
    column = PARTS.get(columns, {}).get(part, 0)
    quantity = quantity_of(results, names[0], column)
    units = _units(results, names[0], count)
    if part:
        units = UnitSystem.of(results.attributes).text(quantity)
    array.attrs = {"units": units, "long_name": quantity.name}
    return array


def xarray_dataset(results: Results, names: Sequence[str]) -> xarray.Dataset:
    """Return signals as arrays with coordinates, see `SignalMapping.to_xarray`."""
    package = _need("xarray", "to_xarray")
    alike: dict[tuple[str, str], tuple[list[int], list[str]]] = {}
    for name, part in _named(results, names):
        group, _, rest = name.partition("/")
        id, _, last = rest.partition("/")
        beside = last and id.isdecimal()
        stored = f"{group}/{last}" if beside else name
        ids, same = alike.setdefault((stored, part), ([], []))
        same.append(name)
        if beside:
            ids.append(int(id))
    made = {
        # "/" has no place in a name of netCDF, in which xarray stores
        "_".join(filter(None, (*stored.split("/"), part))): _variable(
            package, results, stored.partition("/")[0], ids, same, part
        )
        for (stored, part), (ids, same) in alike.items()
    }
    dataset: xarray.Dataset = package.Dataset(made, {"time": results["time"]}, _facts(results))
    dataset["time"].attrs["units"] = UnitSystem.of(results.attributes).text(TIME)
    return dataset
