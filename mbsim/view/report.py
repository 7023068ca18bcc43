"""A run as one HTML page: motion, curves, contacts, audit, settings, and what it was made of."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from html import escape
from pathlib import Path

from mbsim.core.stored import read_regular
from mbsim.errors import MbsimError
from mbsim.model.elements import Model
from mbsim.model.subroutines import wanted
from mbsim.results.reading import Results
from mbsim.view import report_parts as parts
from mbsim.view.page import document, pack_elements, packs_of, static
from mbsim.view.scene import read_scene

#: Longest text of a deck or script that a report quotes [characters].
_LONGEST = 200_000


def report(results: Results) -> str:
    """Return the report of a result file."""
    told: list[str] = []
    motion = _motion(results, told)
    model = _model(results, told)
    name = results.path.stem if results.path is not None else "run"
    command = parts.command(results, model)
    sections = [
        ("Summary", parts.summary(results)),
        ("Warnings", parts.warnings(results, told)),
        ("Motion", motion),
        ("Curves", "".join(parts.requests(results))),
        ("Contacts", parts.contacts(results)),
        ("Joints and forces", parts.connections(results)),
        ("Energy and audit", parts.energy(results)),
        ("Settings", parts.settings(results)),
        ("Run again", f"<pre><code>{escape(command)}</code></pre>"),
        ("Versions", parts.versions(results)),
        ("Counters", parts.counters(results)),
        ("Deck and user files", _texts(results, model)),
    ]
    style = static("view.css") + static("report.css")
    return paged(f"{name}: report", name, sections, style, static("report.js"))


def paged(
    title: str, name: str, sections: Sequence[tuple[str, str]], style: str, script: str = ""
) -> str:
    """Return a page of sections, each a heading and its HTML; those without text are left out.

    `script` mounts the view, without which the page has none.
    """
    body = static("report.html").format(
        name=escape(name),
        contents="".join(
            f'<a href="#{_anchor(head)}">{escape(head)}</a>' for head, text in sections if text
        ),
        sections="\n".join(
            f'<section id="{_anchor(head)}"><h2>{escape(head)}</h2>\n{text}</section>'
            for head, text in sections
            if text
        ),
    )
    return document(title, body, style, script, view=bool(script))


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _motion(results: Results, told: list[str]) -> str:
    """Return the view as a part of the page, or why there is none."""
    try:
        scene = read_scene(results)
    except MbsimError as error:
        return f"<p>{escape(str(error))}</p>"
    packs = packs_of([scene])
    told += packs[0].warnings
    return (
        f'<div class="mbsim-view framed folded" id="view" data-settings="{{}}">'
        f'{static("body.html")}</div>\n<div class="strip" id="strip"></div>\n'
        f"{pack_elements(packs)}"
    )


def _deck(results: Results) -> tuple[Path, bytes | None, str]:
    """Return the deck's path, its bytes if it is the one that was run, and what to say else."""
    file = Path(str(results.attributes.get("model_file", "")))
    try:
        data = read_regular(file)
    except (OSError, ValueError) as error:
        return file, None, f"{file} cannot be read: {getattr(error, 'strerror', error)}"
    if hashlib.sha256(data).hexdigest() != results.attributes.get("model_sha256"):
        return file, None, f"{file} has changed since the run and is not quoted."
    return file, data, ""


def _model(results: Results, told: list[str]) -> Model | None:
    """Return the deck's model if it is the one that was run."""
    file, data, why = _deck(results)
    if data is None:
        told.append(why)
        return None
    try:
        from mbsim.reader.xml import read_model

        return read_model(file, str(results.attributes.get("overrides", "")).splitlines())
    except MbsimError as error:
        told.append(f"{file} cannot be read any more: {str(error).splitlines()[0]}")
        return None


def _scripts(results: Results, model: Model | None) -> list[Path]:
    """Return users' files: those of --plugin, and those that the deck names."""
    names = [name for name in str(results.attributes.get("plugins", "")).splitlines() if name]
    if model is not None:
        users = [each.user for each in wanted(model)]
        for contact in model.contacts.values():
            users += [contact.cff, contact.cnf, *([contact.cpost] if contact.cpost else [])]
        names += [user.script_name for user in users if user.script_name]
    return [Path(name) for name in dict.fromkeys(names)]


def _texts(results: Results, model: Model | None) -> str:
    """Return the texts of deck and users' files."""
    file, data, why = _deck(results)
    found = []
    if data is None:
        found.append(f'<p class="note">{escape(why)}</p>')
    else:
        found.append(_quoted(file, data, "as it was run"))
    for script in _scripts(results, model):
        try:
            data = read_regular(script)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", error)
            found.append(f'<p class="note">{escape(f"{script} cannot be read: {reason}")}</p>')
            continue
        if b"\0" in data[:4096]:
            about = f"{script}: a library, SHA-256 {hashlib.sha256(data).hexdigest()} now"
            found.append(f'<p class="note">{escape(about)}</p>')
        else:
            found.append(_quoted(script, data, "as it is now"))
    return "".join(found)


def _quoted(file: Path, data: bytes, when: str) -> str:
    """Return a text in a part of the page that can be folded."""
    text = data.decode("utf-8", "replace")
    cut = ""
    if len(text) > _LONGEST:
        cut = f'<p class="note">The first {_LONGEST} of {len(text)} characters.</p>'
    head = f"{file.name}, {when}"
    return (
        f"<details><summary>{escape(head)}</summary>{cut}"
        f"<pre><code>{escape(text[:_LONGEST])}</code></pre></details>"
    )
