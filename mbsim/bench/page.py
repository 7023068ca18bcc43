"""The benchmark as one HTML page: tables, a picture a scene, no other file."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from pathlib import Path

from markdown_it import MarkdownIt


def page(text: str, pictures: Mapping[str, Path]) -> str:
    """Return the page of a report.

    Parameters
    ----------
    text : str
        As `report.markdown` returns it.
    pictures : mapping
        PNG files by the names of their scenes.
    """
    from mbsim.view.page import static
    from mbsim.view.report import paged

    head, *parts = text.split("\n## ")
    render = MarkdownIt("commonmark").enable("table").render
    title, _, where = head.partition("\n")
    sections = [("About", render(where))]
    for part in parts:
        name, _, body = part.partition("\n")
        picture = pictures.get(name.partition(":")[0])
        sections.append((name, render(body) + (_embedded(name, picture) if picture else "")))
    heading = title.removeprefix("# ")
    return paged(f"mbsim bench: {heading}", heading, sections, static("report.css"))


def _embedded(name: str, picture: Path) -> str:
    """Return an image that has its data in itself."""
    data = base64.b64encode(picture.read_bytes()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{escape(name)}: time against error">'
