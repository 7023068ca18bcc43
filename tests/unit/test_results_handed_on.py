"""Results as a mapping, as tables of other packages, in a notebook, and in another process."""

from __future__ import annotations

import copy
import pickle
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from mbsim.errors import ModelError, ResultsError, UnknownSignal
from mbsim.results.reading import open_results
from mbsim.results.recorder import Recorder


@pytest.fixture
def results(tmp_path):
    """Return the results of a fake run of ten rows."""
    with recorded(tmp_path) as found:
        yield found


def recorded(folder, kept=True, **settings):
    """Return the results of a fake run, kept in files or in memory."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS | settings, folder if kept else None)
    add_rows(system, 0, 10)
    recorder.take()
    return recorder.close("finished", {"steps": 12}, system.scene.log.contacts)


def test_a_mapping(results):
    assert list(results) == results.keys()
    assert len(results) == len(results.keys()) > 5
    assert "bodies/2/position" in list(results)
    items = dict(results.items())
    np.testing.assert_array_equal(items["bodies/2/position"], results["bodies/2/position"])
    for values, name in zip(results.values(), results, strict=True):
        np.testing.assert_array_equal(values, results[name])
    assert results._ipython_key_completions_() == results.keys()
    assert results.get("bodies/9/position") is None
    assert results.get("time", 0)[1] == 0.1
    assert dict(results).keys() == items.keys()
    assert results == results
    assert results != copy.copy(results)


def test_pandas(results):
    pytest.importorskip("pandas", reason="tables of pandas need it")
    frame = results.to_pandas()
    np.testing.assert_array_equal(frame.index, results["time"])
    assert frame.index.name == "time"
    for name in ("bodies/2/position/x", "bodies/2/quaternion/w", "requests/7/F2", "energy/kinetic"):
        np.testing.assert_array_equal(frame[name], results[name])
    units = frame.attrs["units"]
    assert set(units) == {"time", *frame.columns}
    assert units["bodies/2/velocity/x"] == "m/s"
    assert units["energy/kinetic"] == "J"
    assert units["time"] == "s"
    some = results.to_pandas("bodies/*/velocity/mag", "bodies/2/velocity")
    assert list(some.columns) == [f"bodies/2/velocity/{part}" for part in ("mag", "x", "y", "z")]
    np.testing.assert_array_equal(some.iloc[:, 0], results["bodies/2/velocity/mag"])
    with pytest.raises(UnknownSignal, match="bodies/2/position"):
        results.to_pandas("bodies/2/positio")


def test_units_are_the_models(tmp_path):
    pytest.importorskip("pandas", reason="tables of pandas need it")
    with recorded(tmp_path, units="NEWTON KILOGRAM MILLIMETER MILLISECOND") as results:
        units = results.to_pandas("bodies/2/velocity").attrs["units"]
    assert units["bodies/2/velocity/x"] == "mm/ms"
    assert units["time"] == "ms"


def test_xarray(results):
    pytest.importorskip("xarray", reason="arrays of xarray need it")
    dataset = results.to_xarray()
    position = dataset["bodies_position"]
    assert position.dims == ("time", "bodies", "xyz")
    assert position.attrs == {"units": "m", "long_name": "Position"}
    for id in results.ids("bodies"):
        for part in "xyz":
            np.testing.assert_array_equal(
                position.sel(bodies=id, xyz=part), results[f"bodies/{id}/position/{part}"]
            )
    np.testing.assert_array_equal(
        dataset["bodies_quaternion"].sel(bodies=2, wxyz="w"), results["bodies/2/quaternion/w"]
    )
    np.testing.assert_array_equal(dataset["requests_7"].sel(F="F2"), results["requests/7/F2"])
    units = dataset["requests_7"].attrs["units"]
    assert units == ["m"] * 4 + ["rad"] * 4
    np.testing.assert_array_equal(dataset["time"], results["time"])
    assert dataset["time"].attrs["units"] == "s"
    parts = results.to_xarray("bodies/2/velocity/mag", "requests/7/F5")
    assert list(parts.data_vars) == ["bodies_velocity_mag", "requests_7_F5"]
    np.testing.assert_array_equal(
        parts["bodies_velocity_mag"].sel(bodies=2), results["bodies/2/velocity/mag"]
    )
    assert parts["bodies_velocity_mag"].attrs["units"] == "m/s"
    assert parts["requests_7_F5"].attrs["units"] == "rad"


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_a_package_that_is_not_there(results, monkeypatch, package, method):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModelError, match=f"^{method} needs {package}.*: pip install {package}$"):
        getattr(results, method)()


def test_plot(results):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib").use("Agg")
    from matplotlib import pyplot

    axes = results.plot("bodies/2/position")
    assert [line.get_label() for line in axes.lines] == [f"bodies/2/position/{p}" for p in "xyz"]
    np.testing.assert_array_equal(axes.lines[0].get_xdata(), results["time"])
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), results["bodies/2/position/y"])
    assert axes.get_ylabel() == "Position [m]"
    assert results.plot("energy/kinetic", ax=axes) is axes
    assert len(axes.lines) == 4
    mixed = results.plot("bodies/2/position/x", "energy/kinetic")
    assert [line.get_label() for line in mixed.lines] == [
        "bodies/2/position/x [m]",
        "energy/kinetic [J]",
    ]
    with pytest.raises(ModelError, match="needs the name of a signal"):
        results.plot()
    pyplot.close("all")


def test_what_a_notebook_shows(tmp_path):
    with recorded(tmp_path / "<b>&x") as results:
        shown = results._repr_html_()
        tree = ElementTree.fromstring(shown)
        path = str(results.path)
    cells = [cell.text for cell in tree.iter("td")]
    assert cells[0] == f"{path}, finished"
    assert cells[1] == "0 to 0.9 s, 10 rows"
    points = tree.find(".//polyline").get("points").split()
    assert len(points) == 10
    assert "energy/kinetic" in tree.find(".//small").text
    closed = ElementTree.fromstring(results._repr_html_())
    assert closed.text == repr(results)


def test_a_long_curve_is_thinned_to_its_extremes_and_has_gaps():
    from mbsim.results.notebook import _pieces

    x = np.arange(100_000.0)
    y = np.zeros(100_000)
    y[77_777] = 50.0
    (piece,) = _pieces(x, y)
    assert len(piece.split()) <= 240
    assert "77777.0,50.0" in piece
    y[50_000:60_000] = np.nan
    first, second = _pieces(x, y)
    assert "50.0" in second
    assert "nan" not in first + second


@pytest.mark.parametrize("kept", [True, False])
def test_a_copy_in_another_process(tmp_path, kept):
    with recorded(tmp_path, kept) as results:
        packed = pickle.dumps(results)
        position, keys = results["bodies/2/position"], results.keys()
    with pickle.loads(packed) as found:
        assert found.keys() == keys
        np.testing.assert_array_equal(found["bodies/2/position"], position)
        assert found.attributes["status"] == "finished"
        assert (found.path is None) is not kept
    if not kept:
        with pytest.raises(ResultsError, match="closed"):
            pickle.dumps(results)


def test_rows_of_a_run_that_goes_on(tmp_path):
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 4)
    recorder.take()
    recorder.flush(checkpoint(4))
    with open_results(tmp_path / "deck.h5") as results:
        assert len(results["time"]) == 4
        assert results.refresh() == 0
        add_rows(system, 4, 3)
        recorder.take()
        recorder.flush(checkpoint(7))
        assert len(results["time"]) == 4
        assert results.refresh() == 3
        assert len(results["bodies/2/position"]) == 7
        assert results.status == "running"
        recorder.close("finished", {"steps": 12}, system.scene.log.contacts)
        assert results.refresh() == 0
        assert results.status == "finished"
