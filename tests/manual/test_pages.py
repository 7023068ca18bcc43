"""Pages: size, links, anchors, formulas, tables and pictures that are what the program says."""

from __future__ import annotations

import posixpath
import re
from collections import Counter

import pytest

from helpers.snippets import ROOT, blocks
from mbsim.manual import book, gallery, make, mathematics, pictures, tables
from mbsim.manual.book import INDEX, PAGES, pages
from mbsim.manual.markdown import for_terminal

_KINDS = {"", "text", "console", "python", "xml", "c", "fortran", "math", "toml", "matlab", "adams"}
_KINDS |= {"octave", "sh", "json", "cpp"}
_PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
#: A picture without words, a link or a table within a page is no prose that a length is about.
_LONGEST, _WIDEST = 400, 120


@pytest.fixture(params=list(pages()))
def page(request):
    return pages()[request.param]


def test_a_page_has_a_title_and_says_what_it_is(page):
    lines = page.text.splitlines()
    assert lines[0].startswith("# ")
    assert page.summary, "a sentence under the title says what the page is"
    assert sum(heading.level == 1 for heading in page.headings) == 1


def test_a_page_can_be_read(page):
    lines = page.text.splitlines()
    assert len(lines) <= _LONGEST
    wide = [k for k, line in enumerate(lines, 1) if len(line) > _WIDEST]
    assert not wide, f"lines {wide} have more than {_WIDEST} characters"


def test_links_lead_somewhere(page):
    for line, link in page.links():
        if "://" in link:
            continue
        name, anchor = page.target(link)
        if link.partition("#")[0] and not link.partition("#")[0].endswith(".md"):
            path = PAGES / posixpath.dirname(page.name) / link
            assert path.exists(), f"line {line}: {link}"
            continue
        assert name in pages(), f"line {line}: {link}: no such page"
        anchors = [heading.anchor for heading in pages()[name].headings]
        assert not anchor or anchor in anchors, f"line {line}: {link}: no such heading"


def test_pictures_are_there(page):
    for words, source in _PICTURE.findall(page.text):
        assert words, f"{source}: what is seen must be said"
        path = PAGES / posixpath.dirname(page.name) / source
        assert path.is_file(), source
        assert path.resolve().parent == pictures.FOLDER, "pictures live in pages/pictures"


def test_blocks_are_of_a_known_kind(page):
    for block in blocks(page):
        assert block.kind in _KINDS, f"line {block.line}: {block.kind}"
        words = {word for word in block.words if "." not in word}
        assert words <= {"slow", "norun"}, f"line {block.line}: {block.words}"


def test_formulas_can_be_shown(page):
    for block in blocks(page):
        if block.kind == "math":
            text = "\n".join(block.lines)
            assert "<math" in mathematics.to_mathml(text)
            plain = mathematics.to_text(text)
            assert "\\" not in plain, f"line {block.line}: {plain}"


def test_a_page_can_be_printed(page):
    text = for_terminal(page)
    assert "<!--" not in text
    assert "```math" not in text
    outside = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    assert not re.search(r"\]\([^)\s]*\.md", outside), "a link shows its file"


def test_tables_are_fresh():
    stale = make.stale()
    assert not stale, f"python -m mbsim.manual.make tables: {', '.join(stale)}"


def test_tables_are_all_closed(page):
    assert page.text.count("<!-- table: ") == page.text.count("<!-- end of table -->")
    assert len(tables.asked(page.text)) == page.text.count("<!-- table: ")


def test_every_picture_has_its_maker_and_a_page():
    files = {path.name for path in pictures.FOLDER.glob("*") if path.name != ".gitkeep"}
    photographs = {photograph.name for photograph in gallery.GALLERY}
    assert files == {*pictures.drawings(), *photographs}
    shown = {posixpath.basename(s) for p in pages().values() for _, s in _PICTURE.findall(p.text)}
    assert files <= shown


def test_pictures_are_small():
    for path in pictures.FOLDER.glob("*.*g"):
        assert path.stat().st_size <= pictures.LARGEST, path.name


def test_every_page_is_linked():
    linked = {
        page.target(link)[0]
        for page in pages().values()
        for _, link in page.links()
        if "://" not in link
    }
    missing = [name for name in pages() if name != INDEX and name not in linked]
    assert not missing


def test_no_page_speaks_of_the_readme(page):
    said = page.name.startswith("develop/") or page.name == "changelog"
    assert said or not re.search(r"README", page.text)


def test_formulas_as_text():
    for latex, text in (
        (r"F = -\mu_d N \frac{v}{|v|}", "F = -μ_d N v/(|v|)"),
        (r"\ddot{x} + \omega^2 x = 0", "ẍ + ω² x = 0".replace("ẍ", "x\u0308")),
        (r"\sqrt{a + b} \le 10^{-3}", "√(a + b) ≤ 10⁻³"),
        (r"x_{i,j} \cdot \text{if } k", "x_(i,j) · if k"),
    ):
        assert mathematics.to_text(latex) == text


def test_paths_that_pages_name_exist(page):
    for path in re.findall(r"`((?:mbsim|models|tests|userfuncs)/[\w./-]+)`", page.text):
        assert (ROOT / path).exists(), path


def test_anchors_are_those_of_github():
    assert book.slug("What `tol` bounds, and not") == "what-tol-bounds-and-not"


def test_each_promise_of_what_happens_names_a_test_that_exists():
    """Each promise has a row of the same number with its tests; a name stands for one of them."""
    text = pages()["reference/results/what-happens-when"].text
    rows = [
        line.strip("| ").split(" | ") for line in text.splitlines() if re.match(r"\| \d+ \|", line)
    ]
    promises = [row[0] for row in rows if len(row) == 3]
    tests = {row[0]: row[1] for row in rows if len(row) == 2}
    assert len(promises) > 30
    assert list(tests) == promises == [str(k + 1) for k in range(len(promises))]
    defined = Counter(
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.M)
    )
    for number, names in tests.items():
        found = re.findall(r"`(\w+)`", names)
        assert found, f"{number}: no test"
        for name in found:
            assert defined[name] == 1, f"{number}: {name}"
