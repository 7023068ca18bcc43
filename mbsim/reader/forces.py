"""Statements of applied forces, in both languages, as `forces.catalog` has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, get_args, get_type_hints

from mbsim.expressions import Expression
from mbsim.forces.catalog import (
    FORCES,
    USERS,
    ForceKind,
    MultiPoint,
    OfResidual,
    Parameter,
    Reading,
)
from mbsim.model import elements as el
from mbsim.reader.contact import CFF_ALL, CFF_USES, FORCE_CONTACT, check_coulomb
from mbsim.reader.keywords import CFF_OF_JOINTS, CNF_OF_LIMITS, spellings
from mbsim.reader.kinds import (
    EXPRESSION,
    FLAG,
    ID,
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    REALS,
    BadValueError,
    Kind,
    keyword,
)
from mbsim.reader.normal_force import check_normal, note_unused
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB, by_user, result, subroutine

#: Attributes that are neither numbers nor words of their own.
_KINDS = {
    "id": ID,
    "flag": FLAG,
    "expression": EXPRESSION,
    "friction of joints": keyword(CFF_OF_JOINTS),
    "law of limits": keyword(CNF_OF_LIMITS),
}

#: What some decks say beside markers, and why it does nothing.
_BODIES = (
    ("body1_id", "i_marker_id"),
    ("body2_id", "j_marker_id"),
    ("body2_id", "j_floating_marker_id"),
    ("ref_body_id", "ref_marker_id"),
)
_OF_MARKERS = "the bodies are those of the markers"


def kind_of(parameter: Parameter) -> Kind:
    """Return what an attribute may be, or one number of it."""
    if parameter.kind == "words":
        return _words(parameter.words)
    if parameter.kind:
        return _KINDS[parameter.kind]
    if parameter.words:
        words = dict.fromkeys(parameter.words, "") | dict(parameter.others)
        return keyword(spellings(**words))
    if parameter.signed:
        return REAL
    return POSITIVE if parameter.positive else NOT_NEGATIVE


def _words(known: tuple[str, ...]) -> Kind:
    """Return the kind of words of some known, each once, separated by blanks or commas."""

    def parse(text: str) -> tuple[str, ...]:
        words = tuple(text.replace(",", " ").upper().split())
        if not words or any(word not in known for word in words) or len(set(words)) < len(words):
            raise BadValueError
        return words

    return Kind(f"one or more of {', '.join(known)}, each once", parse)


def _several(count: int) -> Kind:
    """Return the kind of so many numbers, separated by blanks or commas."""

    def parse(text: str) -> tuple[float, ...]:
        values: tuple[float, ...] = REALS.parse(text)
        if len(values) != count:
            raise BadValueError
        return values

    return Kind(f"{count} numbers", parse)


def add_force(
    entry: Entry,
    kind: ForceKind,
    values: Mapping[str, Any],
    i: int,
    j: int,
    words: Mapping[str, str],
) -> None:
    """Check the values of an element and add it; `words` are its attributes as the deck has them.

    Attributes that must be given and are not have the value None, and their fault already.
    """
    needed = [each.name for each in kind.parameters if not each.optional]
    if all(values[name] is not None for name in needed):
        for finding in kind.check(values):
            say = entry.warn if finding.warns else entry.fault
            say(finding.message, words.get(finding.attribute, finding.attribute))
    force = el.MarkerForce(
        id=entry.get("id", 0),
        kind=kind.name,
        label=entry.get("label", ""),
        i_marker_id=i,
        j_marker_id=j,
        parameters=tuple(values.items()),
        source=entry.source,
    )
    entry.register_in(entry.draft.marker_forces.setdefault(kind.name, {}), force)


class _Given:
    """What a deck gives of an element: `forces.catalog.Given`."""

    def __init__(self, entry: Entry, kind: ForceKind) -> None:
        self.entry, self.name = entry, kind.name
        self.given, self.fault = entry.given, entry.fault

    def by_user(self, expressions: tuple[str, ...] = ("expr",)) -> bool:
        return by_user(self.entry, expressions)

    def subroutine(self, default: str) -> el.Subroutine:
        libraries = not isinstance(FORCES[self.name].form, OfResidual)
        return subroutine(self.entry, "usrsub", default, libraries)

    def result(self, user: el.Subroutine, component: int = 0) -> Expression:
        return result(self.entry, self.name, user, component)

    def check_law(self, attribute: str) -> None:
        law = self.entry.get(attribute)
        if attribute == "cnf_type":
            check_normal(self.entry, law)
            return
        note_unused(self.entry, f"cff_type {law}", CFF_ALL - CFF_USES[law])
        if law != "COULOMB_OFF":
            check_coulomb(self.entry, law)


def _spec(parameter: Parameter) -> dict[str, Spec]:
    """Return the attribute that a parameter stands for, or those."""
    if parameter is USERS:
        return USERSUB
    if parameter.kind == "of contacts":
        return {parameter.name: FORCE_CONTACT.attributes[parameter.name]}
    number = isinstance(parameter.default, float) and not (parameter.kind or parameter.optional)
    found = Spec(
        kind_of(parameter) if parameter.count == 1 else _several(parameter.count),
        parameter.about,
        parameter.unit,
        f"{parameter.default:g}" if number else parameter.shown,
        required=parameter.default is None and not parameter.optional,
        alias=parameter.alias,
    )
    return {parameter.name: found}


def _build_marker_force(kind: ForceKind) -> Callable[[Entry], None]:
    """Return what makes elements of a kind that has no class of its own."""

    def build(entry: Entry) -> None:
        values = {each.name: entry.get(each.name, each.default) for each in kind.parameters}
        i, j = entry.get("i_marker_id", 0), entry.get("j_marker_id", 0)
        add_force(entry, kind, values, i, j, {})

    return build


def _build_own(kind: ForceKind, reading: Reading) -> Callable[[Entry], None]:
    """Return what makes elements of a kind's own class."""
    made: Any = get_args(get_type_hints(el.Model)[kind.table])[1]

    def build(entry: Entry) -> None:
        values = {each.name: entry.get(each.name) for each in reading.attributes}
        for each in reading.attributes:
            if each.kind == "id" and not each.optional:
                values[each.name] = values[each.name] or 0
        known = {name: value for name, value in values.items() if value is not None}
        found = reading.read(_Given(entry, kind), known)
        if found is not None:
            id, label = entry.get("id", 0), entry.get("label", "")
            element = made(id=id, label=label, source=entry.source, **found)
            entry.register_in(getattr(entry.draft, kind.table), element)

    return build


def _statement(kind: ForceKind) -> Statement:
    """Return the XML statement of a kind."""
    attributes, reading = dict(NAMED), kind.reading
    if reading is None:
        attributes |= MARKERS
    for each in reading.attributes if reading else kind.parameters:
        attributes |= _spec(each)
    for body, name in _BODIES:
        if name in attributes:
            attributes[body] = Spec(ID, note=_OF_MARKERS)
    attributes |= {name: Spec(refused=why) for name, why in kind.refused.items()}
    if isinstance(kind.form, OfResidual):
        why = "is of a shared library, which a residual cannot be in"
        attributes["usrsub_language"] = Spec(refused=why)
    build = _build_own(kind, reading) if reading else _build_marker_force(kind)
    return Statement(kind.statement, attributes, build, about=kind.about)


def force_statements() -> list[Statement]:
    """Return the XML statements of all kinds but those that are put together by `multi_point`."""
    kinds = [FORCES[name] for name in FORCES]
    return [_statement(kind) for kind in kinds if not isinstance(kind.form, MultiPoint)]
