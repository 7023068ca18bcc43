"""Adams' statements of forces between two markers, as `forces.catalog` has them."""

from __future__ import annotations

from typing import Any

from mbsim.forces.catalog import FORCES, Adams, ForceKind
from mbsim.reader.adm.declare import IDS_BY_COMMAS, AdmStatement, numbers
from mbsim.reader.adm.translate import read_as
from mbsim.reader.forces import add_force, kind_of
from mbsim.reader.kinds import ID, NOT_NEGATIVE
from mbsim.reader.multi_point import FORCE_MULTI_POINT
from mbsim.reader.statement import Entry, Spec


def _counts(kind: ForceKind, adams: Adams) -> dict[str, int]:
    """Return how many numbers each word takes."""
    count = {each.name: each.count for each in kind.parameters}
    return {word: sum(count[name] for name in names) for word, names in adams.words.items()}


def _statement(kind: ForceKind, adams: Adams) -> AdmStatement:
    """Return the statement of a kind."""
    parameters = {each.name: each for each in kind.parameters}
    counts = _counts(kind, adams)
    words = {name: word for word, names in adams.words.items() for name in names}

    def given(entry: Entry, word: str) -> dict[str, Any]:
        """Return the attributes that a word gives, None where it must be there and is not."""
        names, value = adams.words[word], entry.get(word)
        if value is None:
            return {name: parameters[name].default for name in names}
        if len(names) == 1:
            return {names[0]: value}
        if any(v < 0.0 and not parameters[n].signed for n, v in zip(names, value, strict=True)):
            entry.fault(f"must be {len(names)} numbers >= 0", word)
        return dict(zip(names, value, strict=True))

    def build(entry: Entry) -> None:
        found = {each.name: each.default for each in kind.parameters}
        for word in adams.words:
            found |= given(entry, word)
        add_force(entry, kind, found, entry.get("I", 0), entry.get("J", 0), words)

    def spec(word: str) -> Spec:
        first = parameters[adams.words[word][0]]
        one = kind_of(first) if counts[word] == 1 else numbers(counts[word])
        return Spec(one, required=first.default is None)

    attributes = {name: Spec(ID, required=True) for name in ("id", "I", "J")}
    attributes |= {word: spec(word) for word in adams.words}
    return AdmStatement(adams.name, attributes, build, xml=kind.statement)


def _build_many(entry: Entry) -> None:
    """Add a force between many markers."""
    names = {
        "IMARKERS": "i_marker_ids",
        "J": "ref_marker_id",
        "KMATRIX": "kmtx_id",
        "CMATRIX": "cmtx_id",
        "CRATIO": "cratio",
        "FORCE": "preload_mtx_id",
        "LENGTH": "length_mtx_id",
    }
    read_as(entry, FORCE_MULTI_POINT, names)


NFORCE = AdmStatement(
    "NFORCE",
    {
        "id": Spec(ID, required=True),
        "IMARKERS": Spec(IDS_BY_COMMAS, required=True),
        "J": Spec(ID, required=True),
        "KMATRIX": Spec(ID, required=True),
        "CMATRIX": Spec(ID),
        "CRATIO": Spec(NOT_NEGATIVE),
        "FORCE": Spec(ID),
        "LENGTH": Spec(ID),
    },
    _build_many,
    xml="Force_MultiPoint",
)


def marker_forces() -> list[AdmStatement]:
    """Return the statements of all kinds that Adams has and that have no reader of their own."""
    kinds = [FORCES[name] for name in FORCES]
    return [_statement(kind, kind.adams) for kind in kinds if kind.adams and kind.adams.words]
