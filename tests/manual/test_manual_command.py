"""Commands that pages name exist with these options; help and messages name pages."""

from __future__ import annotations

import re
import shlex

import click
import pytest
from click.testing import CliRunner

from helpers.folders import PACKAGES
from helpers.minimal_deck import MINIMAL
from mbsim.cli.main import COMMANDS, main
from mbsim.errors import DeckError, Fault, ModelError, PluginError, SolverError
from mbsim.manual import book, errors, search
from mbsim.manual.book import pages
from mbsim.manual.tables.commands import commands_of

_COMMAND = re.compile(r"(?:^|[`$(&|;] ?|    )mbsim ([^`\n]*)", re.MULTILINE)
_README = PACKAGES / "README.md"


def texts():
    found = [(page.name, page.text) for page in pages().values()]
    return [*found, ("README", _README.read_text(encoding="utf-8"))]


def options_of(command):
    context = click.Context(command)
    return {flag for each in command.get_params(context) for flag in each.opts} | {"-h"}


def words_of(line):
    """Return the words of a command up to what a shell does with it."""
    line = re.split(r"[|;&>]|  +|\s#", line)[0]
    try:
        return shlex.split(line)
    except ValueError:
        return line.split()


@pytest.mark.parametrize(("name", "text"), texts(), ids=[name for name, _ in texts()])
def test_commands_and_options_exist(name, text):
    every = commands_of(main)
    for match in _COMMAND.finditer(text):
        words = words_of(match.group(1))
        if not words or words[0] not in every:
            continue
        command = every[words[0]]
        if isinstance(command, click.Group) and len(words) > 1:
            command = every.get(f"{words[0]} {words[1]}", command)
        for word in words:
            flag = word.split("=")[0].strip("[],.()")
            if re.fullmatch(r"--[a-z][\w-]*|-[a-z]", flag):
                assert flag in options_of(command), f"{name}: mbsim {match.group(1)}"


def test_every_option_stands_on_its_page():
    for name, command in commands_of(main).items():
        page = book.page_of(f"reference/commands/{name.split()[0]}")
        if isinstance(command, click.Group):
            continue
        for flag in options_of(command) - {"--help", "-h"}:
            assert flag.startswith("-") is False or f"`{flag}" in page.text, f"{name}: {flag}"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_names_its_page(name):
    result = CliRunner().invoke(main, [name, "--help"])
    assert f"mbsim manual {name}" in result.output
    assert book.named(name), name


def test_messages_name_the_page_of_the_element():
    faults = [Fault("a.xml", 3, "Force_Contact[301]", "no"), Fault("a.xml", 4, "Body_Rigid[2]", "")]
    assert errors.about(DeckError, [fault.element for fault in faults]) == [
        "force_contact",
        "body_rigid",
    ]
    assert errors.about(ModelError, ["no.xml: cannot be read"]) == []
    assert errors.about(SolverError, ["Force_Contact[3]: too stiff"]) == ["force_contact"]


@pytest.mark.parametrize(
    ("error", "text", "command", "pages"),
    [
        (PluginError, "Force_Contact[3]: CFFSUB failed", "run", ["cffsub"]),
        (PluginError, "Force_Contact[3]: oil failed", "run", ["subroutines"]),
        (ModelError, "--resume: a.h5: no such file", "run", ["what-happens-when", "run"]),
        (ModelError, "Force_Contact[3].mu: no", "request", ["reference/commands/request"]),
        (DeckError, ".adm:3: GRAPHICS/1", "check", ["adams"]),
        (DeckError, ".xml:3: Force_Contact[3]", "request", ["force_contact"]),
    ],
)
def test_pages_of_options_commands_and_other_decks(error, text, command, pages):
    assert errors.about(error, [text], command) == pages
    assert all(len(book.named(page)) == 1 for page in pages)


def test_a_refused_adams_statement_names_the_page_of_adams_decks(tmp_path):
    deck = tmp_path / "deck.adm"
    deck.write_text("title\nPART/1, GROUND\nFLEX_BODY/1\nEND\n")
    result = CliRunner().invoke(main, ["check", str(deck)])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "mbsim: see: mbsim manual adams"


@pytest.mark.parametrize("error", [ModelError, SolverError, PluginError, DeckError])
def test_pages_that_messages_name_exist(error):
    for name in errors.about(error, ["something"]):
        assert len(book.named(name)) == 1
    for statement in ("Force_Contact[1]", "Constraint_Joint[1]"):
        for name in errors.about(error, [statement]):
            assert len(book.named(name)) == 1


def test_a_fault_at_the_command_line(tmp_path):
    deck = tmp_path / "deck.xml"
    deck.write_text(MINIMAL.replace('stiffness="1e8"', 'stifness="1e8"'))
    result = CliRunner().invoke(main, ["check", str(deck)])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "mbsim: see: mbsim manual force_contact"


def test_a_page_by_its_name():
    result = CliRunner().invoke(main, ["manual", "exit-codes"])
    assert result.exit_code == 0
    assert "Exit codes" in result.output
    assert "130" in result.output


def test_words_are_searched_in_all_pages():
    hits = search.search("import-linter layers")
    assert hits
    assert all(hit.line for hit in hits)
    result = CliRunner().invoke(main, ["manual", "friction", "law"])
    assert result.exit_code == 0
    assert search.search("") == []


def test_whole_words_come_before_parts_of_others():
    for hit in search.search("sign"):
        assert re.search(r"\bsigns?\b", hit.page.text.lower()), hit.page.name
    assert len(search.search("integrat")) > 1  # no page has it alone


@pytest.mark.parametrize("topic", ["reaction force", "redundant", "normal direction", "time step"])
def test_notes_of_design_come_last(topic):
    assert not search.search(topic)[0].page.name.startswith("develop/")


def test_most_words_where_no_page_has_all():
    hits = search.search("dissipated friction qwertz")
    assert {hit.missing for hit in hits} == {("qwertz",)}
    output = CliRunner().invoke(main, ["manual", "dissipated", "friction", "qwertz"]).output
    assert output.startswith("no page has all of")


@pytest.mark.parametrize(("word", "other"), search.SYNONYMS.items())
def test_a_synonym_finds_what_pages_say(word, other):
    found = {hit.page.name for hit in search.search(word)}
    assert {hit.page.name for hit in search.search(other)} <= found


def test_a_page_by_the_end_of_its_path():
    (page,) = book.named("statements/post_request")
    assert page.name == "reference/statements/post_request"
    assert book.named("ments/post_request") == book.named("") == []


def test_what_is_nowhere_is_an_error():
    result = CliRunner().invoke(main, ["manual", "xyzzy" + "x"])
    assert result.exit_code == 2
    assert "mbsim manual --list" in result.stderr


def test_the_list_has_every_page():
    result = CliRunner().invoke(main, ["manual", "--list"])
    for name in pages():
        assert name in result.output


def test_html_is_one_file(tmp_path):
    file = tmp_path / "manual.html"
    result = CliRunner().invoke(main, ["manual", "--html", str(file)])
    assert result.exit_code == 0, result.output
    text = file.read_text(encoding="utf-8")
    # pictures of a gallery are in it
    assert file.stat().st_size < 4_000_000
    # nothing is loaded from elsewhere, and every link within leads to an id
    assert not re.search(r'(?:src|href)="(?!#|data:|https?://|mailto:)', text)
    assert not re.search(r'<(?:script|link|img)[^>]*(?:src|href)="https?:', text)
    ids = set(re.findall(r'id="([^"]+)"', text))
    missing = {link for link in re.findall(r'href="#([^"]+)"', text) if link not in ids}
    assert not missing
    assert 'class="err"' not in text
    assert text.count("<article ") == len(pages())
    result = CliRunner().invoke(main, ["manual", "--html", str(tmp_path / "no" / "manual.html")])
    assert result.exit_code == 5
