"""The view as one HTML file that needs no other: library, scripts, style and packs within it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from mbsim.view.packing import text_of
from mbsim.view.run_data import ROOM, RunData, run_data
from mbsim.view.scene import Scene

_STATIC = Path(__file__).parent / "static"
#: Our scripts in the order in which they need each other.
_SCRIPTS = (
    *("unpack", "run", "lit", "shapes", "ground", "stage", "contacts", "extras", "curves"),
    *("view", "start"),
)
#: Makes the view of a page that is nothing else.
_MOUNT = """
window.mbsimReady = mbsim.start(document.getElementById("view")).then(function (view) {
  window.mbsimView = view;
  return view;
});
"""
#: A page that is the view alone.
_WHOLE = "html, body { margin: 0; height: 100%; overflow: hidden; }\n"


def static(name: str) -> str:
    """Return the text of a file that is shipped beside this module."""
    return (_STATIC / name).read_text(encoding="utf-8")


def library() -> str:
    """Return three.js as one script that defines THREE, its licence before it."""
    licence = static("three.LICENSE.txt").strip()
    return f"/*\n{licence}\n*/\n{static('three.min.js').strip()}"


def scripts() -> str:
    """Return our scripts as one."""
    parts = [static(f"{name}.js") for name in _SCRIPTS]
    return '"use strict";\nconst mbsim = {};\n' + "\n".join(parts)


def packs_of(scenes: Sequence[Scene], asked: Sequence[str] = ()) -> list[RunData]:
    """Return the packs of runs that are shown over each other, in the units of the first.

    `asked` are names or patterns of signals of the first run, whose curves are shown first;
    `UnknownSignal` is raised where it has none.
    """
    shown, room = scenes[0].units, ROOM // len(scenes)
    names = [each for name in asked for each in scenes[0].results.find(name)]
    # another model need not have them
    return [
        run_data(scene, room, [name for name in names if name in scene.results], shown)
        for scene in scenes
    ]


def pack_elements(packs: Sequence[RunData]) -> str:
    """Return packs as elements that a page's script reads."""
    return "\n".join(
        f'<script type="application/octet-stream" data-pack="{k}">{text_of(pack.data)}</script>'
        for k, pack in enumerate(packs)
    )


def document(
    title: str, body: str, style: str, script: str, connect: str = "'none'", view: bool = True
) -> str:
    """Return a page that needs nothing else: its body, opened, and what it is shown and run by.

    `title` is escaped here; `script` follows ours; `connect` as in `page`; without `view` the page
    has nothing that draws bodies.
    """
    text = static("page.html").format(
        title=escape(title),
        connect=connect,
        style=style,
        body=body.rstrip(),
        library=library() if view else "",
        script=scripts() + script if view else script,
    )
    # bytes of file names that are no text as escapes
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def page(
    title: str, settings: Mapping[str, Any], packs: Sequence[RunData] = (), connect: str = "'none'"
) -> str:
    """Return the whole page.

    Parameters
    ----------
    title : str
        Of the page; what comes from decks is escaped here.
    settings : mapping
        What the script is told: `theme`, `live`.
    packs : sequence of RunData
        Runs that are within the page.
    connect : str
        From where the page may ask for more, as its security policy has it.
    """
    body = static("view.html").format(
        settings=escape(json.dumps(settings)),
        body=static("body.html"),
        packs=pack_elements(packs),
    )
    return document(title, body, _WHOLE + static("view.css"), _MOUNT, connect)


def title_of(scenes: Sequence[Scene]) -> str:
    """Return what the page of these runs is called."""
    return " and ".join(scene.name for scene in scenes)
