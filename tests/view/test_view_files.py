"""The page of a view, its numbers, what is escaped, glTF, and the commands that write them."""

from __future__ import annotations

import base64
import re
import zlib

import h5py
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import mbsim
from helpers.views import HOSTILE, run_balls
from mbsim.cli.main import main
from mbsim.errors import ModelError, UnknownSignal
from mbsim.results.reading import open_results
from mbsim.view import pictures
from mbsim.view.channels import MOST_VALUES
from mbsim.view.gltf import glb
from mbsim.view.packing import from_planes, unpack
from mbsim.view.page import packs_of, page, scripts
from mbsim.view.run_data import TOLERANCE, run_data
from mbsim.view.scene import read_scene


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return run_balls(tmp_path_factory.mktemp("balls"))


@pytest.fixture
def scene(file):
    with open_results(file) as results:
        yield read_scene(results)


def test_positions_of_a_pack_are_those_of_the_file(scene):
    about, arrays = unpack(run_data(scene).data)
    rows, bodies = about["rows"], len(about["bodies"])
    steps = from_planes(arrays["p"], about["p"]["planes"], about["p"]["order"], rows, 3 * bodies)
    found = steps.reshape(rows, bodies, 3) * about["step"] + about["centre"]
    assert np.abs(found - scene.poses.p).max() < TOLERANCE * scene.size
    turns = from_planes(arrays["q"], about["q"]["planes"], about["q"]["order"], rows, 4 * bodies)
    assert np.abs(turns.reshape(rows, bodies, 4) * about["turn"] - scene.poses.q).max() < 2e-5
    np.testing.assert_array_equal(arrays["time"].tobytes(), scene.time.astype("<f8").tobytes())


def falling(folder, units="", end=0.5, interval=0.01, speed=1.0, size=0.1):
    """Return the scene of a ball that flies, in units of the deck."""
    deck = f"""<MotionSolve><Model><Param_Unit {units}/>
    <Body_Rigid id="1" isground="TRUE"/>
    <Body_Rigid id="2" mass="1" cg_id="20" inertia_xx="1" inertia_yy="1" inertia_zz="1"
      v_ic_x="{speed}" v_ic_x_flag="TRUE"/>
    <Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2"/>
    <Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="{size}"/></Model>
    <Command><Simulate analysis_type="Transient" end_time="{end}" print_interval="{interval}"/>
    </Command></MotionSolve>"""
    folder.mkdir()
    (folder / "ball.xml").write_text(deck)
    mbsim.simulate(mbsim.read_model(folder / "ball.xml"), output=folder).close()
    return folder / "ball.h5"


def test_a_second_run_is_shown_in_the_units_of_the_first(tmp_path):
    metres = falling(tmp_path / "m")
    other = falling(
        tmp_path / "mm",
        'length_unit="MILLIMETER" time_unit="MILLISECOND"',
        end=500,
        interval=10,
        size=100,
    )
    with open_results(metres) as one, open_results(other) as two:
        packs = [unpack(pack.data) for pack in packs_of([read_scene(one), read_scene(two)])]
    found = []
    for about, arrays in packs:
        at = 0
        for channel in about["channels"]:
            if channel["name"] == "bodies/2/velocity/x":
                assert channel["unit"] == "m/s"
                # bytes of the same place stand together
                values = arrays["channels"].reshape(4, -1).T.copy().view("<f4").reshape(-1)
                found.append(values[at : at + channel["rows"]])
            at += channel["rows"]
        assert about["shown"]["position"] == "m"
    assert packs[1][0]["factor"] == {"length": 1e-3, "time": 1e-3}
    assert [each[0] for each in found] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ("unit", "second"), [("SECOND", 1.0), ("MINUTE", 1 / 60), ("MICROSECOND", 1e6)]
)
def test_a_page_knows_how_long_a_second_is(tmp_path, unit, second):
    with open_results(falling(tmp_path / "run", f'time_unit="{unit}"')) as results:
        about, _ = unpack(run_data(read_scene(results)).data)
    assert about["second"] == pytest.approx(second)


def test_a_curve_that_is_not_there_is_refused(scene):
    with pytest.raises(UnknownSignal, match="no signal 'nope'"):
        packs_of([scene], ["nope"])
    about, _ = unpack(packs_of([scene], ["bodies/*/velocity"])[0].data)
    assert about["channels"][0]["name"] == "bodies/2/velocity/x"
    assert about["asked"][0] == "bodies/2/velocity"


def test_a_second_run_need_not_have_the_curves_that_are_asked_for(scene, tmp_path):
    with open_results(falling(tmp_path / "run")) as other:
        packs = packs_of([scene, read_scene(other)], ["contacts/*/force", "bodies/2/velocity"])
        with pytest.raises(UnknownSignal, match="contacts"):
            packs_of([read_scene(other), scene], ["contacts/*/force"])
    asked = [unpack(pack.data)[0]["asked"] for pack in packs]
    assert asked[1] == ["bodies/2/velocity"]
    assert len(asked[0]) > 1


def test_magnitudes_of_a_long_run_are_packed(tmp_path):
    with open_results(falling(tmp_path / "run", interval=1e-4)) as results:
        about, _ = unpack(run_data(read_scene(results)).data)
    names = {channel["name"]: channel["rows"] for channel in about["channels"]}
    assert 2 <= names["bodies/2/velocity/mag"] <= MOST_VALUES


def channel_values(about, arrays):
    """Return the values of all channels by name."""
    flat = arrays["channels"].reshape(4, -1).T.copy().view("<f4").reshape(-1)
    ends = np.cumsum([channel["rows"] for channel in about["channels"]])
    names = [channel["name"] for channel in about["channels"]]
    return dict(zip(names, np.split(flat, ends[:-1]), strict=True))


def test_derivatives_are_curves_with_their_own_magnitudes_and_units(tmp_path):
    name, signal = "Body_Rigid[2].v_ic_x", "bodies/2/velocity"
    with open_results(run_balls(tmp_path, sensitivity=[name])) as results:
        pack = run_data(read_scene(results))
        about, arrays = unpack(pack.data)
        found, units = channel_values(about, arrays), {}
        for channel in about["channels"]:
            units[channel["name"]] = channel["unit"]
        for part in ("x", "z", "mag"):
            asked = f"sensitivity/{name}/{signal}/{part}"
            assert found[asked] == pytest.approx(results[asked], rel=1e-3, abs=1e-6)
            assert units[asked] == units[f"sensitivity/{name}/{signal}/x"]
        wanted = [each for each in results.signals() if each.startswith(f"sensitivity/{name}/")]
        assert f"sensitivity/{name}/bodies/2/position" in wanted
        there = {each.removesuffix(f"/{each.rpartition('/')[2]}") for each in found} | set(found)
        assert set(wanted) <= there
        assert pack.signals_left_out == 0
        first = unpack(packs_of([read_scene(results)], [f"sensitivity/{name}/energy/*"])[0].data)[0]
        assert first["channels"][0]["name"].startswith(f"sensitivity/{name}/energy/")


def test_a_body_that_goes_far_is_said_to_be_shown_coarsely(tmp_path):
    with open_results(falling(tmp_path / "run", end=1000, interval=10, speed=7e3)) as results:
        scene = read_scene(results)
        pack = run_data(scene)
    about, arrays = unpack(pack.data)
    steps = from_planes(arrays["p"], about["p"]["planes"], about["p"]["order"], about["rows"], 3)
    off = np.abs(steps * about["step"] + about["centre"] - scene.poses.p.reshape(-1, 3)).max()
    assert off < pack.error * scene.size
    assert pack.error > TOLERANCE
    assert "bodies go so far" in " ".join(pack.warnings)


def test_a_page_needs_nothing_else_and_is_small(scene):
    text = page("balls", {}, [run_data(scene)])
    assert len(text) < 1_000_000
    assert not re.search(r"<(link|img|iframe)\b|\bsrc=|@import|url\(", text.split("<script>")[0])
    assert "connect-src 'none'" in text


def test_what_comes_from_decks_is_data(scene, file):
    text = page(HOSTILE, {"signals": [HOSTILE]}, [run_data(scene)])
    assert HOSTILE not in text
    assert "window.hostile" in text  # of the title, escaped
    packed = re.search(r'data-pack="0">([^<]*)</script>', text)
    assert HOSTILE.encode() in zlib.decompress(base64.b64decode(packed[1])).replace(b"\\", b"")
    assert scene.labels[1] == HOSTILE


def test_scripts_write_no_markup():
    assert not re.search(r"innerHTML|insertAdjacentHTML|document\.write|\beval\(", scripts())


def test_resultants_act_where_bodies_touch(scene):
    about, arrays = unpack(run_data(scene).data)
    assert not about["arrows_at_points"]
    count = about["arrows"]["count"]
    assert count > 10
    step, facts = about["step"], about["arrows"]
    at = from_planes(arrays["arrows"], facts["planes"], facts["order"], count, 3) * step
    at += about["centre"]
    ids = arrays["arrow_contact"]
    # the ball touches the plane in a point; its force goes through it
    row = np.repeat(np.arange(about["rows"]), np.diff(arrays["arrows_first"].astype(int)))
    ball = scene.poses.p[row[ids == 1], 0]
    np.testing.assert_allclose(at[ids == 1][:, :2], ball[:, :2], atol=1e-4)
    # half of the depth below the plane
    depth = scene.results["contacts/1/penetration"][row[ids == 1]]
    np.testing.assert_allclose(at[ids == 1][:, 2], -0.5 * depth, atol=1e-5)


def test_points_with_their_forces(tmp_path):
    with open_results(run_balls(tmp_path, contact_points=True)) as results:
        about, arrays = unpack(run_data(read_scene(results)).data)
        assert about["arrows_at_points"]
        np.testing.assert_array_equal(
            arrays["arrows_first"], results["contact_points/offsets"].astype(np.uint32)
        )


def test_a_file_without_shapes_takes_those_of_its_deck(file, tmp_path, scene):
    old = _without_graphics(file, tmp_path)
    with open_results(old) as results:
        found = read_scene(results)
    assert found.warnings == []
    np.testing.assert_array_equal(found.shapes["id"], scene.shapes["id"])
    assert str(found.shapes["shape"][0]) == "PLANE"
    assert found.size == scene.size
    np.testing.assert_array_equal(found.up, [0.0, 0.0, 1.0])


def test_a_file_without_shapes_whose_deck_has_changed_shows_balls(file, tmp_path):
    old = _without_graphics(file, tmp_path, model_sha256="another")
    with open_results(old) as results:
        found = read_scene(results)
        assert "has changed since the run" in found.warnings[0]
        assert [str(shape) for shape in found.shapes["shape"]] == ["SPHERE", "SPHERE"]
        assert run_data(found).rows == 101


def _without_graphics(file, folder, **attributes):
    """Return a copy as an earlier version would have written it."""
    from mbsim.core.stored import read_regular

    target = folder / file.name
    with h5py.File(target, "w") as to, open_results(file) as results:
        assert read_regular(file, 4)
        source = results._file
        for name in source:
            if name not in ("graphics", "markers", "connections"):
                source.copy(name, to)
        for name, value in source.attrs.items():
            to.attrs[name] = attributes.get(name, value)
    return target


def test_no_motion_is_refused(tmp_path):
    file = run_balls(tmp_path, signals=("energy",))
    with open_results(file) as results, pytest.raises(ModelError, match="bodies/\\*/position"):
        read_scene(results)


def test_gltf_is_read_by_others_and_stands_where_bodies_stand(scene, tmp_path):
    (tmp_path / "balls.glb").write_bytes(glb(scene))
    loaded = trimesh.load(tmp_path / "balls.glb")
    # y is up there: x stays, z becomes y, y becomes -z
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    for k, id in enumerate(scene.body_ids):
        node = next(n for n in loaded.graph.nodes if str(n).startswith(f"body {id}"))
        matrix = loaded.graph.get(node)[0]
        np.testing.assert_allclose(matrix[:3, 3], upright @ scene.poses.p[0, k], atol=1e-6)
    bounds = loaded.geometry and loaded.bounds
    assert np.isfinite(bounds).all()


def test_the_motion_of_a_gltf_is_that_of_the_file(scene):
    import json
    import struct

    data = glb(scene)
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    motion = document["animations"][0]

    def table(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        found = np.frombuffer(binary, "<f4", accessor["count"] * width, view["byteOffset"])
        return found.reshape(-1, width)

    for channel in motion["channels"]:
        sampler = motion["samplers"][channel["sampler"]]
        name = document["nodes"][channel["target"]["node"]]["name"]
        k = next(n for n, id in enumerate(scene.body_ids) if name.startswith(f"body {id}"))
        values = table(sampler["output"])
        np.testing.assert_allclose(table(sampler["input"])[:, 0], scene.time, rtol=1e-6)
        if channel["target"]["path"] == "translation":
            np.testing.assert_allclose(values, scene.poses.p[:, k], atol=1e-4 * scene.size)
        else:
            np.testing.assert_allclose(values[:, [3, 0, 1, 2]], scene.poses.q[:, k], atol=1e-6)


def test_the_command_writes_page_and_gltf(file, tmp_path):
    target, model = tmp_path / "a.html", tmp_path / "a.glb"
    done = CliRunner().invoke(main, ["view", str(file), str(file), "-o", str(target)])
    assert done.exit_code == 0, done.output
    assert "101 rows and 101 rows" in done.output
    assert target.read_text(encoding="utf-8").count("data-pack=") == 2
    done = CliRunner().invoke(main, ["view", str(file), "--gltf", str(model)])
    assert done.exit_code == 0, done.output
    assert model.read_bytes()[:4] == b"glTF"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{}", "{}", "{}"], "one or two result files"),
        (["{}", "{}", "--gltf", "x.glb"], "--gltf takes one"),
        (["{}", "--serve", "--png", "x.png"], "--serve writes no files"),
        (["{}", "--size", "9x9", "--png", "x.png"], "--size 9x9"),
        (["nothing.h5"], "no such file"),
        (["nothing.xml", "--serve"], "no such file; a result file is named <model>.h5"),
    ],
)
def test_what_cannot_be_is_refused(file, arguments, words):
    done = CliRunner().invoke(main, ["view", *(a.format(file) for a in arguments)])
    assert done.exit_code in (2, 5)
    assert words in done.output


def test_missing_tools_are_named(file, monkeypatch):
    monkeypatch.setenv("MBSIM_BROWSER", "/no/such/browser")
    done = CliRunner().invoke(main, ["view", str(file), "--png", "x.png"])
    assert done.exit_code == 2
    assert "chromium" in done.output
    monkeypatch.setattr(pictures, "needed_browser", lambda: "browser")
    monkeypatch.setattr(pictures.shutil, "which", lambda name: None)
    done = CliRunner().invoke(main, ["view", str(file), "--mp4", "x.mp4"])
    assert done.exit_code == 2
    assert "ffmpeg" in done.output
