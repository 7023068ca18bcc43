"""`read_model`: a deck, MotionSolve's XML or Adams' .adm, read, checked and made a `Model`."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

from mbsim.core.collection import no_collection
from mbsim.core.stored import read_regular
from mbsim.errors import DeckError, Fault, ModelError
from mbsim.model import elements as el
from mbsim.model.checks import Known, check_model
from mbsim.model.names import is_adams, is_commands
from mbsim.reader.clusters import hold_clusters
from mbsim.reader.constraints import complete_motions
from mbsim.reader.controls import complete_sensors
from mbsim.reader.curves import complete_curves
from mbsim.reader.draft import Draft
from mbsim.reader.gears import complete_gears
from mbsim.reader.keywords import fold
from mbsim.reader.linear_analysis import check_plants
from mbsim.reader.linear_systems import expand
from mbsim.reader.multi_point import expand as expand_multi_points
from mbsim.reader.overrides import apply_overrides, as_texts
from mbsim.reader.parse import MAX_BYTES, Node, parse, parsed
from mbsim.reader.points import hold_points
from mbsim.reader.statements import read_section

if TYPE_CHECKING:
    from mbsim.reader.builder import Model as Builder

_COMPATIBILITY = "MOTIONSOLVE"
_SECTIONS = ("model", "command")
#: What a deck may be given as.
Given: TypeAlias = "str | PathLike[str] | IO[str] | IO[bytes] | Builder"

#: What a deck is called that is no file; the files that it names are looked for from here.
_NO_FILE = "deck.xml"
#: What may stand before the first element of a deck that is given as text.
_BEFORE_XML = "\ufeff \t\r\n"
_DECLARATION = re.compile(r"\A\ufeff?\s*<\?xml\b[^>]*\?>|\A\ufeff")


class _Deck(NamedTuple):
    """What a stream held, to be read any number of times."""

    name: str | None
    text: str | bytes

    def read(self) -> str | bytes:
        return self.text


def to_keep(given: el.Model | Given) -> Any:
    """Return what a deck can be read from again: of a stream, which is read here, what it held."""
    read = getattr(given, "read", None)
    # a deck written in Python is read as often as it is asked, and says where its faults are
    if read is None or hasattr(given, "placed"):
        return given
    return _Deck(getattr(given, "name", None), read())


def as_model(
    model: el.Model | Given,
    overrides: Mapping[str, object] | Sequence[str] = (),
) -> el.Model:
    """Return a model as it is, or read; overrides are for one that is not read yet."""
    if not isinstance(model, el.Model):
        return read_model(model, overrides)
    if overrides:
        raise ModelError("overrides: this model is read already; give them to read_model")
    return model


@no_collection()
def read_model(
    path: Given,
    overrides: Mapping[str, object] | Sequence[str] = (),
) -> el.Model:
    """Return the model that a deck describes, with everything about it checked.

    Parameters
    ----------
    path : path-like, text or file
        The deck: an Adams deck where it ends in .adm, an Adams command file with its deck where
        it ends in .acf, else an XML file with <Model> and <Command> parts under any root. A text
        that begins with ``<`` is the XML itself, and something with `read` is read, a `mbsim.Model`
        too; files that it names are looked for in the current folder.
    overrides : mapping or sequence of str, optional
        ``{"Element[id].attribute": value}`` or ``["Element[id].attribute=value"]``, set in the
        deck before it is read.

    Returns
    -------
    Model
        In the deck's own units. `notes` lists what was accepted and has no effect,
        `warnings` what is allowed and looks wrong.

    Raises
    ------
    DeckError
        All faults of the deck at once, each with file and line.
    ModelError
        If the file cannot be read, or an override names what is not there.
    """
    try:
        return _read(path, as_texts(overrides))
    except DeckError as error:
        placed = getattr(path, "placed", None)
        if placed is None:
            raise
        raise DeckError([placed(fault) for fault in error.faults]) from None


def _read(path: Given, texts: tuple[str, ...]) -> el.Model:
    """Return the model of a deck; overrides as texts."""
    name, data = _given(path)
    deck = Path(name)
    draft, said_so = _read_draft(name, data, texts)
    draft.faults.extend(map(said_so, expand(draft)))
    draft.faults.extend(map(said_so, expand_multi_points(draft)))
    draft.faults.extend(map(said_so, complete_sensors(draft)))
    draft.faults.extend(map(said_so, complete_curves(draft)))
    draft.faults.extend(map(said_so, check_plants(draft)))
    complete_motions(draft)
    if draft.clusters or draft.planar:
        draft.faults.extend(map(said_so, hold_clusters(draft, _to_model(draft, deck, ""))))
    if draft.gears:
        draft.faults.extend(map(said_so, complete_gears(draft, _to_model(draft, deck, ""))))
    model = _to_model(draft, deck, hashlib.sha256(data + draft.more).hexdigest())
    known = Known(frozenset(draft.broken), draft.display_graphics)
    faults, warnings = check_model(model, known)
    for simulation in model.simulations:
        if simulation.changes:
            later, _ = check_model(model.changed(simulation.changes), known)
            faults = [*faults, *(fault for fault in later if fault not in faults)]
    if draft.faults or faults:
        raise DeckError([*draft.faults, *map(said_so, faults)])
    return replace(model, warnings=(*draft.warnings, *warnings), overrides=texts)


def _read_draft(
    path: str | PathLike[str], data: bytes, overrides: Sequence[str]
) -> tuple[Draft, Callable[[Fault], Fault]]:
    """Return what the deck's statements say, and how its faults are worded."""
    deck = Path(path)
    if is_adams(deck.name):
        from mbsim.reader.adm.draft import AdmDraft
        from mbsim.reader.adm.read import fill, in_words

        if is_commands(deck.name):
            return _read_commands(path, data, overrides), in_words
        adams = AdmDraft(str(path), deck.absolute().parent)
        fill(data, adams, overrides)
        return adams, in_words
    draft = Draft(str(path), deck.absolute().parent)
    _fill(data, draft, overrides)
    return draft, _as_it_is


def _read_commands(path: str | PathLike[str], data: bytes, overrides: Sequence[str]) -> Draft:
    """Return the deck that an Adams command file runs, with its analyses."""
    from mbsim.reader.adm.commands import deck_of, run_commands
    from mbsim.reader.adm.draft import AdmDraft
    from mbsim.reader.adm.read import fill

    deck = deck_of(data, Path(path))
    of_deck = _read_bytes(deck)
    draft = AdmDraft(str(deck), deck.absolute().parent, more=of_deck)
    fill(of_deck, draft, overrides)
    run_commands(data, str(path), draft)
    return draft


def read_graphics(path: str | PathLike[str], overrides: Sequence[str] = ()) -> list[el.Graphic]:
    """Return the graphics of a deck, whether or not the rest of it makes sense.

    Parameters
    ----------
    path : path-like
        The deck.
    overrides : sequence of str, optional
        As of `read_model`.

    Raises
    ------
    DeckError
        Faults of the graphics themselves, or that the file is no deck.
    ModelError
        If the file cannot be read, or an override names what is not there.
    """
    draft, _ = _read_draft(path, _read_bytes(Path(path)), overrides)
    faults = [fault for fault in draft.faults if fault.element.startswith("Post_Graphic")]
    if faults:
        raise DeckError(faults)
    return list(draft.graphics.values())


def _as_it_is(fault: Fault) -> Fault:
    return fault


def _fill(data: bytes, draft: Draft, overrides: Sequence[str]) -> None:
    """Read the XML deck `data` into the draft; faults go there too."""
    root = parsed(data, draft.file, draft.note)
    sections = list(_find_sections(root, draft))
    if overrides:
        sections = [section.copy() for section in sections]
        apply_overrides(sections, overrides)

    # the model first, wherever it stands: commands refer to it
    for section in sorted(sections, key=lambda section: section.key != "model"):
        _check_section(section, draft)
        read_section(section, draft)
    hold_points(draft)
    if not any(section.key == "model" for section in sections) and not draft.faults:
        draft.fault(root.line, root.tag, "no <Model> in the deck: there is nothing to simulate")


def _given(path: Given) -> tuple[str | PathLike[str], bytes]:
    """Return what a deck is called, and its bytes."""
    if path == "":
        raise ModelError("an empty text is neither a path nor XML")
    if isinstance(path, str) and path.lstrip(_BEFORE_XML).startswith("<"):
        return _NO_FILE, _encoded(path)
    if isinstance(path, (str, PathLike)):
        file = cast("str | PathLike[str]", path)
        return file, _read_bytes(Path(file))
    read = getattr(path, "read", None)
    if read is None:
        raise ModelError(f"{path!r}: must be a path, XML as text, or something to read it from")
    data = read()
    named = getattr(path, "name", None)
    name = named if isinstance(named, str) else _NO_FILE
    return name, _encoded(data) if isinstance(data, str) else data


def _encoded(text: str) -> bytes:
    """Return a deck's text as UTF-8, without the declaration, which says how bytes are to be read.

    Lines keep their numbers.
    """
    text = _DECLARATION.sub(lambda found: "\n" * found[0].count("\n"), text)
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise ModelError(
            f"{_NO_FILE}:{line}: a character that is no text: {text[error.start]!r}"
        ) from None


def _read_bytes(path: Path) -> bytes:
    """Return the deck's bytes; whatever prevents it becomes one line."""
    try:
        return read_regular(path, MAX_BYTES + 1)
    except OSError as error:
        raise ModelError(f"{path}: {_why_not(path, error)}") from None
    except ValueError as error:
        raise ModelError(f"{str(path)!r}: is no file name: {error}") from None


def _why_not(path: Path, error: OSError) -> str:
    """Return why a deck cannot be read."""
    with suppress(OSError):  # of a name that is too long
        if path.is_dir():
            return "is a directory, not a deck"
        if path.exists() and not path.is_file():
            return "is not a regular file"
    return f"cannot be read: {error.strerror or error}"


def read_sections(deck: Given) -> tuple[str, list[Node]]:
    """Return what an XML deck is called, and its <Model> and <Command> parts as they stand.

    The first has the comments at the deck's head too.
    """
    name, data = _given(deck)
    if is_adams(Path(name).name):
        raise ModelError(f"{name}: an Adams deck; only XML can be gone on with")
    draft = Draft(str(name), Path(name).absolute().parent)
    root = parse(data, draft.file)
    sections = list(_find_sections(root, draft))
    if draft.faults:
        raise DeckError(draft.faults)
    if sections and sections[0] is not root:
        sections[0].comments = root.comments + sections[0].comments
    return str(name), sections


def _find_sections(node: Node, draft: Draft) -> Iterator[Node]:
    """Yield every <Model> and <Command>; what is neither, nor holds one, is refused."""
    if node.key in _SECTIONS:
        yield node
        return
    for child in node.children:
        if child.key in _SECTIONS or _holds_section(child):
            yield from _find_sections(child, draft)
        else:
            draft.fault(
                child.line, child.tag, f"<{child.tag}> stands outside <Model> and <Command>"
            )
    if node.text:
        draft.fault(node.line, node.tag, f"text {node.text[:40]!r} outside <Model> and <Command>")


def _holds_section(node: Node) -> bool:
    return any(child.key in _SECTIONS or _holds_section(child) for child in node.children)


def _check_section(section: Node, draft: Draft) -> None:
    """Read the attributes of <Model> and <Command> themselves."""
    for attribute in section.attributes:
        name = fold(attribute.name)
        if section.key == "model" and name == "compatibility":
            if fold(attribute.value) != fold(_COMPATIBILITY):
                message = f'compatibility="{attribute.value}": must be {_COMPATIBILITY}'
                draft.fault(attribute.line, section.tag, message)
            draft.compatibility = _COMPATIBILITY
        elif name not in ("id", "label", "name"):
            known = (
                "compatibility, id, label, name" if section.key == "model" else "id, label, name"
            )
            message = f'{attribute.name}="{attribute.value}": unknown attribute; known: {known}'
            draft.fault(attribute.line, section.tag, message)


def _to_model(draft: Draft, deck: Path, sha256: str) -> el.Model:
    """Return the draft as a model."""
    return el.Model(
        name=deck.stem,
        file=draft.file,
        sha256=sha256,
        units=draft.units or el.Units(),
        bodies=draft.bodies,
        markers=draft.markers,
        graphics=draft.graphics,
        contacts=draft.contacts,
        joints=draft.joints,
        primitives=draft.primitives,
        couplers=draft.couplers,
        motions=draft.motions,
        general_constraints=draft.general_constraints,
        points_on_curves=draft.points_on_curves,
        curves_on_curves=draft.curves_on_curves,
        points_on_surfaces=draft.points_on_surfaces,
        surfaces=draft.surfaces,
        scalar_forces=draft.scalar_forces,
        marker_forces=draft.marker_forces,
        vector_forces=draft.vector_forces,
        body_forces=draft.body_forces,
        joint_frictions=draft.joint_frictions,
        joint_limits=draft.joint_limits,
        force_elements=draft.force_elements,
        variables=draft.variables,
        differentials=draft.differentials,
        splines=draft.splines,
        curves=draft.curves,
        arrays=draft.arrays,
        sensors=draft.sensors,
        evaluations=draft.evaluations,
        gravity=draft.gravity or el.Gravity(),
        transient=draft.transient or el.Transient(),
        simulations=tuple(draft.simulations),
        requests=draft.requests,
        compatibility=draft.compatibility,
        notes=draft.notes(),
        warnings=tuple(draft.warnings),
    )
