"""The whole manual as one HTML file: contents, search, formulas and pictures, no other file."""

from __future__ import annotations

import base64
import json
import posixpath
import re
from collections.abc import Iterator, Sequence
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token

from mbsim import __version__
from mbsim.manual.book import INDEX, PAGES, Page, pages
from mbsim.manual.mathematics import to_mathml
from mbsim.manual.search import EMPTY, NOTES, SYNONYMS
from mbsim.results.products import write_product

_STATIC = Path(__file__).parent / "static"
_LEXERS = {"console": "console", "xml": "xml", "python": "python", "c": "c", "toml": "toml"}
_LEXERS |= {"fortran": "fortran", "matlab": "matlab", "octave": "matlab", "sh": "bash"}
_COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def write(file: Path) -> None:
    """Write the manual; `write_product` says what is raised."""
    write_product(file, document(), "page", "--html")


def document() -> str:
    """Return the whole document."""
    every = list(pages().values())
    body = "\n".join(_article(page) for page in every)
    return (
        (_STATIC / "page.html")
        .read_text(encoding="utf-8")
        .format(
            version=escape(__version__),
            words=escape(
                json.dumps(
                    {"empty": sorted(EMPTY), "synonyms": SYNONYMS, "notes": anchor_of(NOTES)}
                )
            ),
            style=(_STATIC / "manual.css").read_text(encoding="utf-8") + _colours(),
            contents="\n".join(_contents(every)),
            body=body,
            script=(_STATIC / "manual.js").read_text(encoding="utf-8"),
        )
    )


def anchor_of(name: str, anchor: str = "") -> str:
    """Return the id of a page, or of a heading of it, within the document."""
    return f"{name}#{anchor}".rstrip("#").replace("#", "--").replace("/", ".")


def _contents(every: Sequence[Page]) -> Iterator[str]:
    """Yield the list of pages, one folded group a chapter; folders within are indented."""
    for chapter, group in groupby(every, key=lambda page: page.name.split("/")[0]):
        members = list(group)
        if len(members) == 1:
            yield f"<p>{_entry(members[0])}</p>"
            continue
        first, rest = members[0], members
        title = chapter.capitalize()
        if posixpath.basename(first.name) == INDEX:
            title, rest = first.title, members[1:]
            yield f'<details data-page="{anchor_of(first.name)}"><summary>{_entry(first)}</summary>'
        else:
            yield f"<details><summary>{escape(title)}</summary>"
        yield "<ul>"
        for page in rest:
            deep = page.name.count("/") - (posixpath.basename(page.name) == INDEX)
            yield f'<li class="deep{deep}">{_entry(page)}</li>'
        yield "</ul></details>"


def _entry(page: Page) -> str:
    return f'<a href="#{anchor_of(page.name)}">{escape(page.title)}</a>'


def _article(page: Page) -> str:
    """Return one page."""
    markdown = MarkdownIt("commonmark", {"html": False}, renderer_cls=_Renderer).enable("table")
    tokens = markdown.parse(_COMMENT.sub("", page.text))
    headings = iter(page.headings)
    for token in tokens:
        if token.type == "heading_open":
            token.attrSet("id", anchor_of(page.name, next(headings).anchor))
    inside = markdown.renderer.render(tokens, markdown.options, {"page": page})
    head = f'<article id="{anchor_of(page.name)}" data-title="{escape(page.title)}">'
    return f"{head}\n{inside}</article>"


class _Renderer(RendererHTML):
    """What differs from plain Markdown: links between pages, formulas, code, pictures, tables."""

    def fence(self, tokens: Sequence[Token], idx: int, options: Any, env: Any) -> str:
        """Return a fenced block: formulas as MathML, code in colours, a file with its name."""
        token = tokens[idx]
        kind, _, words = token.info.strip().partition(" ")
        if kind == "math":
            return f'<div class="math">{to_mathml(token.content)}</div>\n'
        name = next((word for word in words.split() if "." in word), "")
        head = f"<figcaption>{escape(name)}</figcaption>" if name else ""
        code = _coloured(token.content, kind)
        return f'<figure class="code">{head}<pre><code>{code}</code></pre></figure>\n'

    def link_open(self, tokens: Sequence[Token], idx: int, options: Any, env: Any) -> str:
        """Return a link; one to another page leads to its place in this document."""
        token = tokens[idx]
        href = str(token.attrGet("href") or "")
        if "://" not in href and not href.startswith("mailto:"):
            name, anchor = env["page"].target(href)
            if name in pages():
                token.attrSet("href", "#" + anchor_of(name, anchor))
        return str(self.renderToken(tokens, idx, options, env))

    def image(self, tokens: Sequence[Token], idx: int, options: Any, env: Any) -> str:
        """Return a picture with its words below, its file within the document."""
        token = tokens[idx]
        words = escape(self.renderInlineAsText(token.children or [], options, env))
        path = PAGES / posixpath.normpath(
            posixpath.join(posixpath.dirname(env["page"].name), str(token.attrGet("src")))
        )
        kind = {".svg": "svg+xml", ".png": "png"}[path.suffix]
        data = base64.b64encode(path.read_bytes()).decode()
        return f'<img alt="{words}" src="data:image/{kind};base64,{data}"/>'

    def table_open(self, tokens: Sequence[Token], idx: int, options: Any, env: Any) -> str:
        """Return the beginning of a table that scrolls where it is too wide."""
        return '<div class="wide"><table>\n'

    def table_close(self, tokens: Sequence[Token], idx: int, options: Any, env: Any) -> str:
        """Return the end of a table."""
        return "</table></div>\n"


def _coloured(code: str, kind: str) -> str:
    """Return code with spans of pygments' classes."""
    from pygments import highlight
    from pygments.formatters import HtmlFormatter
    from pygments.lexers import get_lexer_by_name

    if kind not in _LEXERS:
        return escape(code)
    spans = str(highlight(code, get_lexer_by_name(_LEXERS[kind]), HtmlFormatter(nowrap=True)))
    return spans.replace(' class="err"', "")  # `...` stands for what is left out: no error


def _colours() -> str:
    """Return the colours of code, light and dark."""
    from pygments.formatters import HtmlFormatter

    light = HtmlFormatter(style="friendly").get_style_defs("pre")
    dark = HtmlFormatter(style="github-dark").get_style_defs("[data-theme=dark] pre")
    return f"\n{_foreground(light)}\n{_foreground(dark)}\n"


def _foreground(style: str) -> str:
    """Return the rules of a style sheet without backgrounds and line numbers."""
    kept = [line for line in style.splitlines() if re.match(r"[^{]*\.\w+ \{", line)]
    kept = [line for line in kept if "linenos" not in line and ".hll" not in line]
    return "\n".join(re.sub(r"background-color: [^;}]*;?", "", line) for line in kept)
