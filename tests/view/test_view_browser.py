"""The page of a view in a real browser: what it shows, and what keys and clicks do."""

from __future__ import annotations

import base64
import io
import os
import select
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest

from helpers.views import complaints, run_balls
from mbsim.results.reading import open_results
from mbsim.view.browser import browser_path, opened_page
from mbsim.view.page import packs_of
from mbsim.view.page import page as page_of
from mbsim.view.pictures import make
from mbsim.view.report import report
from mbsim.view.run_data import TOLERANCE
from mbsim.view.scene import read_scene
from mbsim.view.serve import HOST, Served, server

pytestmark = pytest.mark.skipif(browser_path() is None, reason="no Chromium on this machine")
PICTURE = Path(__file__).with_name("balls.png")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return run_balls(tmp_path_factory.mktemp("balls"), contact_points=True)


@pytest.fixture(scope="module")
def text(file):
    with open_results(file) as results:
        return page_of("balls", {"theme": "light"}, packs_of([read_scene(results)]))


@pytest.fixture(scope="module")
def window():
    with opened_page(1000, 640) as page:
        yield page


@pytest.fixture
def page(window, text, tmp_path):
    """Return the view, loaded anew."""
    file = tmp_path / "balls.html"
    file.write_text(text, encoding="utf-8")
    window.console.clear()
    window.requests.clear()
    window.size(1000, 640)
    window.open(file.as_uri())
    window.run("mbsimReady.then(() => 0)")
    yield window
    assert complaints(window) == []
    # the page asks for nothing but itself
    assert [
        address for address in window.requests if not address.startswith(("data:", "blob:"))
    ] == [file.as_uri()]


def press(page, key, **more):
    for kind in ("keyDown", "keyUp"):
        page.call(
            "Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 else "", **more
        )


def click(page, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


def shot(page):
    from PIL import Image

    data = page.run(
        "(mbsimView.stage.setCoarse(false), mbsimView.draw(), mbsimView.canvas.toDataURL())"
    ).partition(",")[2]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"), dtype=float)


def test_positions_shown_are_those_of_the_file(page, file):
    with open_results(file) as results:
        scene = read_scene(results)
    rows = list(range(0, len(scene.time), 7))
    found = page.run(
        f"{[float(t) for t in scene.time[rows]]}.map(t => (mbsimView.setTime(t), "
        "[2, 3].map(id => mbsimView.positionOf(id))))"
    )
    assert np.abs(np.array(found) - scene.poses.p[rows]).max() < TOLERANCE * scene.size


def test_what_is_drawn_is_where_it_is(page, file):
    """The matrix of the ball's instance is its position and its rotation."""
    page.run("mbsimView.setTime(0.4); mbsimView.draw()")
    found = page.run(
        "(() => { const v = mbsimView, out = []; for (const mesh of v.runs[0].shapes.meshes) "
        "mesh.userData.members.forEach((m, i) => { if (m.shape >= 0) "
        "out.push([v.runs[0].about.shapes[m.shape].id, "
        "[...mesh.instanceMatrix.array.slice(16 * i, 16 * i + 16)]]); }); return out; })()"
    )
    centre = np.array(page.run("mbsimView.runs[0].about.centre"))
    with open_results(file) as results:
        row = int(np.searchsorted(results["time"], 0.4 - 1e-9))
        matrices = {id: np.array(m).reshape(4, 4).T for id, m in found}
        place = results["bodies/2/position"][row]
        np.testing.assert_allclose(matrices[200][:3, 3] + centre, place, atol=1e-4)
        np.testing.assert_allclose(np.linalg.norm(matrices[200][:3, :3], axis=0), 0.1, rtol=1e-3)
        edges = np.linalg.norm(matrices[300][:3, :3], axis=0)
        np.testing.assert_allclose(edges, [0.2, 0.1, 0.1], rtol=1e-3)
    assert not matrices[401].any()  # hidden


def test_frames_differ_and_playing_moves_on(page):
    page.run("mbsimView.setTime(0)")
    first = shot(page)
    page.run("mbsimView.setTime(0.4)")
    assert np.abs(shot(page) - first).max() > 100.0
    press(page, " ")
    moved = page.run(
        "new Promise(done => { const from = mbsimView.time; (function look() { "
        "if (mbsimView.time !== from) done(mbsimView.playing); "
        "else requestAnimationFrame(look); })(); })"
    )
    assert moved is True
    press(page, " ")
    assert page.run("mbsimView.playing") is False


def test_keys(page):
    press(page, "End")
    assert page.run("mbsimView.time === mbsimView.span[1]")
    press(page, "ArrowLeft")
    assert page.run("mbsimView.time") == pytest.approx(0.495)
    press(page, "Home")
    press(page, "ArrowRight", modifiers=8)
    assert page.run("mbsimView.time") == pytest.approx(0.05)
    for key, switch in (("m", "markers"), ("j", "joints"), ("g", "ground"), ("c", "dots")):
        before = page.run(f"mbsimView.on.{switch}")
        press(page, key)
        assert page.run(f"mbsimView.on.{switch}") is not before
    press(page, "d")
    assert page.run("mbsimView.root.dataset.theme") == "dark"
    press(page, "?")
    assert page.run("!mbsimView.parts.help.hidden")


def test_a_click_selects_a_body_and_shows_its_numbers(page):
    page.run("mbsimView.setTime(0.2); mbsimView.draw()")
    x, y = page.run(
        "(() => { const v = mbsimView, p = new THREE.Vector3(...v.runs[0].p.subarray(3, 6)); "
        "p.project(v.stage.camera); const b = v.canvas.getBoundingClientRect(); "
        "return [b.left + (p.x + 1) / 2 * b.width, b.top + (1 - p.y) / 2 * b.height]; })()"
    )
    click(page, x, y)
    assert page.run("mbsimView.selected") == 1
    said = page.run("mbsimView.parts.numbers.textContent")
    assert "position" in said
    assert "angular velocity" in said
    press(page, "f")
    assert page.run("mbsimView.followed") == "selected"
    press(page, "Escape")
    assert page.run("mbsimView.selected") is None


def test_labels_of_decks_are_text(page):
    said = page.run("[...mbsimView.parts.pick.options].map(option => option.textContent).join()")
    assert "<img src=x" in said
    assert page.run("window.hostile") is None


def test_a_signal_is_found_added_and_followed(page, file):
    page.run(
        "mbsimView.parts.find.value = 'bodies 2 velocity x'; "
        "mbsimView.parts.find.dispatchEvent(new Event('input'))"
    )
    assert page.run("mbsimView.parts.hits.firstChild.textContent") == "bodies/2/velocity/x"
    page.run("mbsimView.parts.hits.firstChild.click(); mbsimView.setTime(0.1)")
    with open_results(file) as results:
        wanted = results["bodies/2/velocity/x"][20]
    assert page.run("mbsimView.runs[0].valueAt('bodies/2/velocity/x', 0.1)") == pytest.approx(
        wanted, rel=1e-3
    )
    size = page.run("mbsimView.runs[0].valueAt('bodies/2/velocity/mag', 0.1)")
    assert size == pytest.approx(np.hypot(wanted, 9.81 * 0.1), rel=0.5)


def test_what_is_round_is_shown_round(page):
    # pixels that a slope takes, across over up: with the panel, without it, and in a picture
    ratio = """(() => { const stage = mbsimView.stage, canvas = mbsimView.canvas;
      const p = stage.camera.projectionMatrix.elements;
      return p[0] * canvas.clientWidth / (p[5] * canvas.clientHeight); })()"""
    found = [page.run(ratio)]
    for _ in range(2):
        page.run("mbsimView.panel()")
        found.append(page.run(ratio))
    page.run("mbsimView.still(0.0).length")
    found.append(page.run(ratio))
    assert found == pytest.approx([1.0] * 4, rel=1e-6)


def test_a_picture_looks_as_it_did(text, tmp_path):
    """Made by `mbsim view balls.h5 --png tests/view/balls.png --time 0.3 --size 320x200`."""
    from PIL import Image

    make(text, (320, 200), png=tmp_path / "now.png", time=0.3)
    small = [
        np.asarray(Image.open(file).convert("RGB").resize((96, 60)), dtype=float)
        for file in (PICTURE, tmp_path / "now.png")
    ]
    assert small[0].std() > 10.0
    # of 255; versions of a browser round edges of shapes and shadows differently
    assert np.abs(small[0] - small[1]).mean() < 3.0
    assert np.percentile(np.abs(small[0] - small[1]), 99) < 60.0


def test_a_gif_moves(text, tmp_path):
    from PIL import Image

    told = []
    make(text, (160, 100), gif=tmp_path / "a.gif", speed=0.5, progress=lambda *at: told.append(at))
    assert told == [(done, 20) for done in range(1, 21)]
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 20
        first = np.asarray(film.convert("RGB"), dtype=float)
        film.seek(15)
        assert np.abs(np.asarray(film.convert("RGB"), dtype=float) - first).max() > 50.0


def test_two_runs_over_each_other(window, file, tmp_path):
    other = run_balls(tmp_path)
    with open_results(file) as one, open_results(other) as two:
        packs = packs_of([read_scene(one), read_scene(two)])
    window.console.clear()
    (tmp_path / "two.html").write_text(page_of("two", {}, packs), encoding="utf-8")
    window.open((tmp_path / "two.html").as_uri())
    assert window.run("mbsimReady.then(view => view.runs.length)") == 2
    assert (
        window.run("(mbsimView.turn('second'), mbsimView.draw(), mbsimView.groups[1].visible)")
        is False
    )
    assert complaints(window) == []


def test_it_is_read_on_a_phone(page):
    page.size(390, 780, mobile=True, ratio=2.0)
    page.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.run("document.documentElement.scrollWidth <= innerWidth")
    boxes = page.run(
        "[...document.querySelectorAll('.bar.bottom > *, .tools button')].map(e => { "
        "const b = e.getBoundingClientRect(); return [b.left, b.right]; })"
    )
    assert all(left >= 0.0 and right <= 390.0 for left, right in boxes)


def test_a_page_is_renewed_while_a_run_goes_on(window, file, tmp_path):
    served = Served([tmp_path / "balls.h5"])
    with server(served) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        try:
            window.console.clear()
            window.open(f"http://{HOST}:{made.server_port}/")
            assert "no such file" in served.state()["message"]
            (tmp_path / "balls.h5").write_bytes(file.read_bytes())
            assert window.run("mbsimReady.then(view => view.runs[0].rows)") == 101
            assert complaints(window) == []
        finally:
            made.shutdown()
            thread.join()


def test_a_report_is_shown_and_printed(window, file, tmp_path):
    with open_results(file) as results:
        text = report(results)
    window.console.clear()
    window.size(1000, 640)
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    window.open((tmp_path / "report.html").as_uri())
    assert window.run("mbsimReady.then(view => view.runs[0].rows)") == 101
    assert window.run("document.querySelectorAll('.strip canvas').length") == 6
    titles = window.run("[...document.querySelectorAll('h2')].map(each => each.textContent)")
    assert titles[:5] == ["Summary", "Warnings", "Motion", "Curves", "Contacts"]
    assert window.run("window.hostile") is None
    assert window.run("document.documentElement.scrollWidth <= innerWidth")
    printed = base64.b64decode(window.call("Page.printToPDF", printBackground=True)["data"])
    assert printed[:5] == b"%PDF-"
    assert printed.count(b"/Type /Page\n") + printed.count(b"/Type /Page ") >= 2
    assert complaints(window) == []


HOLDS = """
from mbsim.view.browser import opened_page
with opened_page() as page:
    print(page.run("1 + 1"), flush=True)
    input()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc, as Linux has it")
def test_a_browser_ends_with_a_python_that_was_killed():
    # the name of a socket there may have a hundred letters
    with tempfile.TemporaryDirectory(prefix="b", ignore_cleanup_errors=True) as folder:
        kill_its_python(folder)


def kill_its_python(folder):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDS],
        env=os.environ | {"TMPDIR": folder},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout.readline() == "2\n"
    browsers = []
    for entry in Path("/proc").iterdir():
        # its profile is the only thing in that folder
        if entry.name.isdecimal() and f"--user-data-dir={folder}" in words_of(entry):
            browsers.append(os.pidfd_open(int(entry.name)))
    assert browsers
    holder.kill()
    holder.communicate()
    for browser in browsers:
        ended, _, _ = select.select([browser], [], [], 30.0)
        os.close(browser)
        assert ended


def words_of(entry):
    """Return the command line of a process, nothing where it has ended."""
    try:
        return (entry / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""
