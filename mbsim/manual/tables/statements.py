"""Tables of the deck's statements and attributes, in both languages."""

from __future__ import annotations

import re
from collections.abc import Mapping

from mbsim.manual.book import Page
from mbsim.manual.tables import item, reference, rows, table
from mbsim.model.request_types import TYPES
from mbsim.reader.adm import statements as adams
from mbsim.reader.keywords import fold
from mbsim.reader.kinds import EXPRESSION, FLAG, ID, IDS, TEXT, USER, Kind
from mbsim.reader.statement import Spec, Statement
from mbsim.reader.statements import BY_KEY, NOT_BUILT, REFUSED, STATEMENTS

_SHORT = {
    id(ID): "id",
    id(IDS): "ids",
    id(FLAG): "TRUE or FALSE",
    id(TEXT): "text",
    id(USER): "`USER(...)`",
    id(EXPRESSION): "expression",
}
_WIDEST_CHOICE = 34


def _type(kind: Kind) -> str:
    """Return type and range of a value; what is long is listed below the table."""
    short = _SHORT.get(id(kind))
    if short:
        return short
    text = range_of(kind).replace(", separated by blanks or commas", "")
    return text if len(text) <= _WIDEST_CHOICE else "one of those below"


def range_of(kind: Kind) -> str:
    """Return what a value may be, in a few words; a number has its range alone."""
    return re.sub(r"^number (?=[<>])", "", re.sub(r"^an? ", "", kind.allowed))


def _default(spec: Spec) -> str:
    if spec.required:
        return "needed"
    return spec.default


@table("attributes")
def attributes(name: str, page: Page) -> list[str]:
    """Return the attributes of a statement, then long choices, what has no effect, what is not."""
    statement = BY_KEY[fold(name)]
    known = statement.attributes
    read = {n: s for n, s in known.items() if not (s.refused or s.note)}
    lines = rows(
        ("attribute", "type and range", "unit", "default", "meaning"),
        (
            (f"`{n}`", _type(spec.kind), spec.unit, _default(spec), _meaning(spec))
            for n, spec in read.items()
        ),
    )
    notes = [_choices(n, spec) for n, spec in read.items() if _type(spec.kind).endswith("below")]
    notes += _grouped(known, "note", "Accepted, without effect")
    notes += _grouped(known, "refused", "Refused")
    if notes and lines:
        lines.append("")
    for text in notes:
        lines += item(text)
    return lines


def _meaning(spec: Spec) -> str:
    others = " or ".join(f"`{name}`" for name in spec.alias.split())
    return f"{spec.about}; also {others}" if others else spec.about


def _choices(name: str, spec: Spec) -> str:
    return f"`{name}`: {re.sub(r'^an? ', '', spec.kind.allowed)}."


def _grouped(known: Mapping[str, Spec], field: str, what: str) -> list[str]:
    """Return one entry for each reason that attributes have."""
    by_reason: dict[str, list[str]] = {}
    for name, spec in known.items():
        if reason := getattr(spec, field):
            by_reason.setdefault(reason, []).append(name)
    return [
        f"{what}: {', '.join(f'`{name}`' for name in names)} ({reason})."
        for reason, names in by_reason.items()
    ]


def _where(statement: Statement) -> str:
    places = [
        name
        for name, there in (("Model", statement.in_model), ("Command", statement.in_command))
        if there
    ]
    return ", ".join(places)


@table("statements")
def statements(_: str, page: Page) -> list[str]:
    """Return every statement that is read, then those that are known and not built."""
    lines = rows(
        ("statement", "stands in", "what it is"),
        (
            (
                reference(page, statement.name, f"`{statement.name}`"),
                _where(statement),
                statement.about or statement.note,
            )
            for statement in STATEMENTS
        ),
    )
    lines += ["", *item(f"Known and not built, refused by name: {_codes(NOT_BUILT)}.")]
    for name, why in REFUSED.items():
        lines += item(f"`{name}` is refused: {why}.")
    return lines


def _codes(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


@table("adams-statements")
def adams_statements(_: str, page: Page) -> list[str]:
    """Return every statement of an Adams deck that is read, its arguments and what it becomes."""
    lines: list[str] = []
    for statement in adams.STATEMENTS:
        names = [name for name in (*statement.names(), *statement.words) if name != "id"]
        given = f"; {_codes(list(dict.fromkeys(names)))}" if names else ""
        if statement.xml:
            becomes = f" becomes {reference(page, statement.xml, f'`{statement.xml}`')}"
        else:
            becomes = f": {statement.note}" if statement.note else ""
        lines += item(f"`{statement.name}`{becomes}{given}.")
    lines += ["", *item(f"Known and not built, refused by name: {_codes(adams.NOT_BUILT)}.")]
    return lines


@table("coverage")
def coverage(name: str, page: Page) -> list[str]:
    """Return what of a language is built, how, and what of it is not taken or does nothing."""
    adm = name == "adams"
    known = adams.STATEMENTS if adm else STATEMENTS
    lines: list[str] = []
    for statement in known:
        lines += item(f"`{statement.name}`: {_how(statement, page)}{_deviations(statement)}.")
    lines += item(f"Not built, refused by name: {_codes(adams.NOT_BUILT if adm else NOT_BUILT)}.")
    for refused, why in () if adm else REFUSED.items():
        lines += item(f"`{refused}` is refused: {why}.")
    return lines


def _how(statement: Statement, page: Page) -> str:
    """Return what a statement is read as."""
    xml = getattr(statement, "xml", "")
    if xml:
        return f"read as {reference(page, xml, f'`{xml}`')}"
    if not statement.attributes or statement.note:
        return statement.note or statement.about or "read"
    return reference(page, statement.name, statement.about or statement.name)


def _deviations(statement: Statement) -> str:
    """Return what a statement accepts without effect and what it refuses."""
    said = []
    for field, what in (("note", "no effect"), ("refused", "refused")):
        names = [n for n, spec in statement.attributes.items() if getattr(spec, field)]
        if names:
            said.append(f"; {what}: {_codes(names)}")
    return "".join(said)


@table("requests")
def requests(_: str, page: Page) -> list[str]:
    """Return the types of Post_Request and what F1 to F8 of each are."""
    head = ("type", "also written", *(f"F{k}" for k in range(1, 9)))
    return rows(
        head,
        (
            (
                f"`{name}`",
                ", ".join(f"`{word}`" for word in type.spellings.split()),
                *(type.columns or tuple(f"`expr{k}`" for k in range(1, 9))),
            )
            for name, type in TYPES.items()
        ),
    )
