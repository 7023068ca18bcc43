"""Damaged files of every kind are read or refused: no traceback, no hang, no dead process.

``MBSIM_FUZZ=9000 python -m pytest -s tests/fuzz`` reads so many of each kind, of those that take
longer a part: 100,000 files, in about an hour. With ``-m slow`` decks are changed and run: one of
six reaches its end.
"""

from __future__ import annotations

import io
import os
import random
import sys
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from helpers.folders import DATA, MODELS
from helpers.forked import finds
from helpers.mutations import bytes_changed, objects_changed, text_changed
from helpers.three_mf import mesh_text, write_3mf
from mbsim.cli.main import main
from mbsim.errors import MbsimError, ModelError
from mbsim.results.audit import Audit, Entry, Share
from mbsim.results.reading import open_results
from mbsim.results.recorder import Recorder

COUNT = int(os.environ.get("MBSIM_FUZZ", "5"))
SEED = int(os.environ.get("MBSIM_FUZZ_SEED", "1"))

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")

Do = Callable[[Path, random.Random], None]
#: What takes longer than most is done with one of so many files.
SLOW = {"info_of_results, objects": 4, "read_results, objects": 4, "draw_results, objects": 4}
SLOW |= {"view_results, objects": 4, "report_results, objects": 4}
SLOW |= {"fclib, objects": 4, "plot_results, objects": 10, "plot_results, bytes": 10}


def command(*line: str) -> None:
    """Run a command line; what it raises that is no message and exit code is raised here."""
    found = CliRunner().invoke(main, line)
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception


def survey(
    kind: str,
    make: Callable[[random.Random], Path],
    do: Do,
    most: int = COUNT,
    seconds: float = 5.0,
) -> None:
    """Make and read files; fail with what went wrong, each kind of find once."""
    count = min(most, -(-COUNT // SLOW.get(kind, 1)))

    def one(case: int) -> None:
        chance = random.Random(f"{SEED} {kind} {case}")
        path = make(chance)
        try:
            do(path, chance)
        except (MbsimError, click.UsageError):
            pass

    # users of h5py in one process share its one lock: nothing else runs here
    found = finds(one, range(count), seconds)
    by_place = Counter("\n".join(find.what.strip().splitlines()[-3:]) for find in found)
    first = {"\n".join(find.what.strip().splitlines()[-3:]): find for find in reversed(found)}
    told = [f"{by_place[place]} times, first {first[place].case}:\n{place}" for place in by_place]
    print(f"{kind}: {count} files, {len(found)} finds", *told, sep="\n\n")
    assert not found


def changed(folder: Path, seeds: list[Path], change: Callable[[bytes, random.Random], bytes]):
    """Return how to make a damaged copy of one of some files, under its own name."""
    texts = {path: path.read_bytes() for path in seeds}

    def make(chance: random.Random) -> Path:
        path = chance.choice(seeds)
        target = folder / path.name
        target.write_bytes(change(texts[path], chance))
        return target

    return make


JOINTS = (
    '<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20" label="ball"/>'
    '<Post_Request id="8" type="EXPRESSION" expr2="TIME" expr3="DZ(20)"/>'
    '<Constraint_Joint id="3" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>'
)
AUDIT = Audit(
    *(0.1, 2.0, 0.5, "J"),
    {"stages": Entry(1.0, 2.0, 0.5, "Body_Rigid[2]")},
    {301: Share(0.1, 0.0, 0.2), None: Share(0.0, 0.0, 0.0)},
    ("a warning",),
)


def result_files(folder: Path) -> list[Path]:
    """Return result files: of a run that goes on, of one that has finished, a long one."""
    found = []
    for name, statement, rows in (("on", JOINTS, 10), ("done", JOINTS, 10), ("long", "", 300)):
        system = fake_system(folder / f"{name}_deck", statement)
        recorder = Recorder(system, SETTINGS, folder / name)
        for first in range(0, rows, 10):
            add_rows(system, first, 10)
            recorder.take()
        recorder.flush(checkpoint(rows))
        if name == "on":
            recorder.abandon()
        else:
            recorder.close("finished", {"steps": 4}, system.scene.log.contacts, AUDIT).close()
        found.append(folder / name / "deck.h5")
        found[-1] = found[-1].rename(folder / f"{name}.h5")
    return found


def info_of_results(path: Path, chance: random.Random) -> None:
    """Show a result file; the command reads it apart, so that nothing in it may end or hang."""
    command("info", str(path), *(["--json"] if chance.random() < 0.5 else []))


def read_results(path: Path, chance: random.Random) -> None:
    """Read all of a result file as its users do."""
    with open_results(path) as results:
        repr(results)
        for name in results.keys()[:40]:
            try:
                np.asarray(results[name])
            except MbsimError:
                continue
        assert "nothing" not in results
        for part in ("bodies/2/position/x", "bodies/*/velocity/mag", "requests/7/F2", "a/b"):
            try:
                results.find(part)
            except MbsimError:
                pass


def draw_results(path: Path, chance: random.Random) -> None:
    from mbsim.results.curves import Choice, collect

    names = ("bodies/*/position", "requests/7/F2", "contacts/301/force/mag", "energy/kinetic")
    with open_results(path) as results:
        chosen = tuple(chance.sample(names, 2))
        collect([results], Choice(chosen, "time", None, None, False, chance.random() < 0.5), None)


def plot_results(path: Path, chance: random.Random) -> None:
    """Draw a result file: the picture itself is slow."""
    command("plot", str(path), "bodies/*/position", "-o", str(path.with_suffix(".png")))


def view_results(path: Path, chance: random.Random) -> None:
    """Write a page, or a model for other programs."""
    option, suffix = chance.choice((("-o", ".html"), ("--gltf", ".glb")))
    command("view", str(path), option, str(path.with_suffix(suffix)))


def report_results(path: Path, chance: random.Random) -> None:
    command("report", str(path), "-o", str(path.with_suffix(".html")))


READERS = (info_of_results, read_results, draw_results, plot_results, view_results, report_results)


@pytest.mark.parametrize("change", ["bytes", "objects"])
@pytest.mark.parametrize("do", READERS)
def test_result_files(tmp_path: Path, change: str, do: Do) -> None:
    seeds = result_files(tmp_path)
    (tmp_path / "try").mkdir()
    copy = changed(tmp_path / "try", seeds, bytes_changed)
    whole = changed(tmp_path / "try", seeds, lambda data, chance: data)

    def make(chance: random.Random) -> Path:
        if change == "bytes":
            return copy(chance)
        path = whole(chance)
        objects_changed(path, chance)
        return path

    survey(f"{do.__name__}, {change}", make, do)


@pytest.mark.parametrize("change", ["bytes", "objects"])
def test_resume(tmp_path: Path, change: str) -> None:
    data = result_files(tmp_path)[0].read_bytes()
    system = fake_system(tmp_path / "deck", JOINTS)
    target = tmp_path / "out" / "deck.h5"
    target.parent.mkdir()

    def make(chance: random.Random) -> Path:
        target.write_bytes(bytes_changed(data, chance) if change == "bytes" else data)
        if change == "objects":
            objects_changed(target, chance)
        return target

    def resume(path: Path, chance: random.Random) -> None:
        settings = SETTINGS | ({"tol": 1e-6} if chance.random() < 0.3 else {})
        system.scene.rows.used[:] = 0
        recorder = Recorder(system, settings, path.parent, resume=True)
        try:
            add_rows(system, 10, 2)
            recorder.take()
            recorder.close("finished", {}, system.scene.log.contacts).close()
        finally:
            recorder.abandon()

    survey(f"resume, {change}", make, resume)


@pytest.mark.parametrize("change", ["bytes", "objects"])
def test_fclib(tmp_path: Path, change: str) -> None:
    seeds = small("*.hdf5", DATA / "fclib")[:8]
    copy = changed(tmp_path, seeds, bytes_changed)
    whole = changed(tmp_path, seeds, lambda data, chance: data)

    def make(chance: random.Random) -> Path:
        path = copy(chance) if change == "bytes" else whole(chance)
        if change == "objects":
            objects_changed(path, chance)
        return path

    def read(path: Path, chance: random.Random) -> None:
        command("fclib", "info", str(path), *(["--json"] if chance.random() < 0.5 else []))

    survey(f"fclib, {change}", make, read)


def check_deck(path: Path, chance: random.Random) -> None:
    command(chance.choice(("check", "info")), str(path))


def small(pattern: str, folder: Path) -> list[Path]:
    """Return the smallest files of a folder: they are read in milliseconds."""
    return sorted(folder.rglob(pattern), key=lambda path: path.stat().st_size)[:30]


def test_xml_decks(tmp_path: Path) -> None:
    survey("XML", changed(tmp_path, small("*.xml", MODELS), text_changed), check_deck)


def test_adams_decks(tmp_path: Path) -> None:
    seeds = small("*.adm", DATA / "adams") + small("*.adm", MODELS)
    survey("ADM", changed(tmp_path, seeds, text_changed), check_deck)


#: Decks in which something acts from the start on.
ACTING = (
    *("bowling_ball", "sphere_pair", "sliding_block", "incline_slip", "stiction_incline"),
    *("four_bar", "slider_crank", "dry_friction_element", "belt_stick_slip", "free_top"),
    *("lugre_stick_slip", "ellipsoid_on_box", "pendulum_wall", "cam"),
)
#: Rows of a damaged deck's run, and how often it is asked whether it goes on: every 0.1 s.
SHORT, PATIENCE = 10, 20


class Enough(MbsimError):
    """A run takes longer than a short one of its deck would."""


def run_deck(path: Path, chance: random.Random) -> None:
    """Run what still reads for a short time: what finishes has numbers only."""
    from mbsim import read_model, simulate

    asked = 0

    def progress(time: float, step: float, end: float) -> None:
        nonlocal asked
        asked += 1
        if asked > PATIENCE:
            raise Enough("enough")

    method = chance.choice((None, None, "DOPRI5", "RADAU5", "GALPHA"))
    end = 0.02
    model = read_model(path)
    made = simulate(
        model, end_time=end, print_interval=end / SHORT, integrator=method, progress=progress
    )
    with made as results:
        assert results.status == "finished"
        for name in results.signals():
            assert np.isfinite(results[name]).all(), f"{name} is not finite"


@pytest.mark.slow
def test_damaged_decks_run(tmp_path: Path) -> None:
    """What a random change makes of a deck that still reads."""
    seeds = [MODELS / f"{name}.xml" for name in ACTING]
    ran = tmp_path / "ran"

    def run(path: Path, chance: random.Random) -> None:
        run_deck(path, chance)
        with ran.open("a") as file:
            file.write("x")

    (tmp_path / "try").mkdir()
    survey("runs", changed(tmp_path / "try", seeds, text_changed), run, seconds=300.0)
    print(f"{len(ran.read_text()) if ran.exists() else 0} of them ran to their end")


def meshes(folder: Path) -> list[Path]:
    """Return a small solid in every format of a mesh file."""
    import trimesh

    solid = trimesh.creation.box()
    found = []
    for name in ("a.stl", "b.obj", "c.off", "d.ply"):
        solid.export(folder / name)
        found.append(folder / name)
    for name, kind in (("e.stl", "stl_ascii"), ("f.ply", "ply")):
        more = {"encoding": "ascii"} if kind == "ply" else {}
        data = solid.export(file_type=kind, **more)
        (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
        found.append(folder / name)
    glb = solid.scene().export(file_type="glb")
    gltf = trimesh.exchange.gltf.export_gltf(solid.scene(), embed_buffers=True)["model.gltf"]
    for name, data in (("g.glb", glb), ("h.gltf", gltf)):
        (folder / name).write_bytes(data)
        found.append(folder / name)
    mesh = mesh_text(solid.vertices, solid.faces)
    parts = '<object id="2"><components><component objectid="1"/></components></object>'
    # one as it is, in which damage reaches the XML, and one compressed
    for name, how in (("i.3mf", zipfile.ZIP_STORED), ("j.3mf", zipfile.ZIP_DEFLATED)):
        text = f'<object id="1">{mesh}</object>{parts}'
        write_3mf(folder / name, text, '<item objectid="2"/>', compression=how)
        found.append(folder / name)
    return found


def archive_changed(data: bytes, chance: random.Random) -> bytes:
    """Return a 3MF archive, whole as such, with something wrong in the XML of its parts."""
    source, target = io.BytesIO(data), io.BytesIO()
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            part = old.read(name)
            new.writestr(name, text_changed(part, chance) if chance.random() < 0.7 else part)
    return target.getvalue()


def test_meshes(tmp_path: Path) -> None:
    from mbsim.model.mesh import solid_fault
    from mbsim.model.mesh_file import load_mesh
    from mbsim.model.mesh_findings import crossing_findings, mesh_findings
    from mbsim.model.mesh_repair import mend

    seeds = meshes(tmp_path)
    (tmp_path / "try").mkdir()
    makes = [changed(tmp_path / "try", seeds, way) for way in (bytes_changed, text_changed)]
    archives = [path for path in seeds if path.suffix == ".3mf"]
    makes.append(changed(tmp_path / "try", archives, archive_changed))

    def read(path: Path, chance: random.Random) -> None:
        vertices, faces, *_ = load_mesh(path)
        found = [*mesh_findings(vertices, faces), *crossing_findings(vertices, faces)]
        fault = solid_fault(vertices, faces)
        assert isinstance(fault, str)
        if fault:
            assert found
            mended = mend(vertices, faces)
            assert solid_fault(mended.vertices, mended.faces) == ""

    survey("meshes", lambda chance: chance.choice(makes)(chance), read)


def test_scripts(tmp_path: Path) -> None:
    from mbsim.plugins.source.script import load_script, user_function

    seeds = sorted((MODELS.parent / "userfuncs").glob("*.py"))
    makes = [changed(tmp_path, seeds, way) for way in (bytes_changed, text_changed)]

    def read(path: Path, chance: random.Random) -> None:
        script = load_script(path, "Force_Contact[1]", {})
        for name in ("CFFSUB", "CNFSUB"):
            if script.defines(name):
                user_function(script, name, "Force_Contact[1]")

    survey("scripts", lambda chance: chance.choice(makes)(chance), read)


def elf_changed(data: bytes, chance: random.Random) -> bytes:
    """Return a library with something wrong in its header or its table of sections."""
    head = bytes_changed(data[:64], chance) if chance.random() < 0.5 else data[:64]
    at = int.from_bytes(data[40:48], "little")
    return head + data[64:at] + bytes_changed(data[at:], chance)


def test_libraries(tmp_path: Path) -> None:
    """Libraries are only looked at: their tables of symbols."""
    import lxml.etree

    from mbsim.plugins.source.shared_library import choose, read_library
    from mbsim.plugins.source.symbols import ends_the_process

    source = Path(lxml.etree.__file__)
    if source.suffix != ".so":
        pytest.skip("no shared library")
    data = source.read_bytes()
    target = tmp_path / "law.so"

    def make(chance: random.Random) -> Path:
        target.write_bytes(elf_changed(data, chance))
        return target

    def read(path: Path, chance: random.Random) -> None:
        ends_the_process(path)
        library = read_library(path, "Force_Contact[1]")
        if library.functions is not None:
            try:
                choose(library, "CFFSUB", "cff", "")
            except ModelError:
                pass

    survey("libraries", make, read, 5000)
