"""`fill`: the statements of an Adams deck into a draft, and faults in the deck's own words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from mbsim.errors import DeckError, Fault, ModelError
from mbsim.reader.adm.draft import AdmDraft
from mbsim.reader.adm.lexer import split_statements, to_node
from mbsim.reader.adm.statements import BY_KEY, NOT_BUILT, STATEMENTS
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.overrides import apply_overrides
from mbsim.reader.parse import MAX_BYTES, Node, refuse_results
from mbsim.reader.points import hold_points

_NAMES = {statement.xml: statement.name for statement in STATEMENTS if statement.xml}
_NAMES["Motion_Marker"] = "MOTION"
_NAMES["Body_Rigid"] = "PART"
_NAMES["Force_Vector_TwoBody"] = "GFORCE"
_XML_NAMES = {statement.name: statement.xml for statement in STATEMENTS if statement.xml}
# what the checks of the whole model call attributes, in the words of this deck
_ATTRIBUTES = {
    **{"cg_id": "CM", "im_id": "IM", "vm_id": "VM", "wm_id": "WM", "body_id": "PART"},
    **{
        "i_marker_id": "I",
        "j_marker_id": "J",
        "ref_marker_id": "RM",
        "j_floating_marker_id": "JFLOAT",
        "joint_id": "JOINT",
    },
    **{"i_graphics_id": "IGEOM", "j_graphics_id": "JGEOM"},
    **{"center_marker_id": "CM", "corner_marker_id": "CORNER", "rm_id": "RM"},
    **{"expr": "FUNCTION", "motion_type": "direction"},
    **{f"{name}_expression": name.upper() for name in ("fx", "fy", "fz", "tx", "ty", "tz")},
    **{f"expr{k}": f"F{k}" for k in range(1, 9)},
    **{f"inertia_{axes}": f"IP {axes}" for axes in ("xx", "yy", "zz", "xy", "yz", "xz")},
}
_WORD = re.compile(r"\b(" + "|".join(map(re.escape, _NAMES | _ATTRIBUTES)) + r")\b")


def fill(data: bytes, draft: AdmDraft, overrides: Sequence[str]) -> None:
    """Read the deck `data` into the draft; faults go there too.

    Raises
    ------
    ModelError
        If the deck is too large, or an override names what is not there.
    DeckError
        If it is not text.
    """
    text = _decode(data, draft.file)
    nodes: list[Node] = []
    for raw in split_statements(text):
        if nodes and nodes[-1].key == "end":
            draft.warn(raw.lines[0], "END", "what follows END is not read")
            break
        node = to_node(raw, BY_KEY, draft.fault)
        if node is not None:
            nodes.append(node)
    _check_ends(text, nodes, draft)
    draft.puzzling = {fault.element for fault in draft.faults}
    section = Node("deck", 1, children=nodes)
    apply_overrides([section], overrides, _known_attributes)

    # parts first: their markers are given in their frames; gears follow from markers and joints
    turn = {"units": 0, "part": 1, "pointmass": 1, "coupler": 3, "gear": 3, "friction": 3}
    for node in sorted(nodes, key=lambda node: turn.get(node.key, 2)):
        _read_statement(node, draft)
    hold_points(draft)
    draft.broken = {(_XML_NAMES.get(name, name), id) for name, id in draft.broken}
    draft.broken |= {(_XML_NAMES[name], int(id)) for name, id in _named(draft.puzzling)}
    draft.faults = [in_words(fault) for fault in draft.faults]
    draft.faults.sort(key=lambda fault: fault.line)


def _named(elements: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield statement and id of those elements that have one."""
    for element in elements:
        name, _, id = element.removesuffix("]").partition("[")
        if name in _XML_NAMES and id.isdigit():
            yield name, id


def in_words(fault: Fault) -> Fault:
    """Return a fault of the whole model in the words of an Adams deck."""

    def word(match: re.Match[str]) -> str:
        return (_NAMES | _ATTRIBUTES)[match.group(1)]

    element, message = _WORD.sub(word, fault.element), _WORD.sub(word, fault.message)
    return Fault(fault.file, fault.line, element, message)


def _decode(data: bytes, file: str) -> str:
    """Return the deck as text, UTF-8 or else Latin-1."""
    if len(data) > MAX_BYTES:
        raise ModelError(f"{file}: larger than {MAX_BYTES // 2**20} MiB, the limit of a deck")
    refuse_results(data, file)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise DeckError([Fault(file, line, "", "not a text file: it holds a NUL character")])
    return text


def _check_ends(text: str, nodes: Sequence[Node], draft: AdmDraft) -> None:
    """Say where the title may be a statement, and where the end is missing."""
    title = text.split("\n", 1)[0]
    head = re.match(r"\s*(\w+)\s*/", title)
    if head and (fold(head.group(1)) in BY_KEY or head.group(1).upper() in NOT_BUILT):
        draft.warn(1, "title", "looks like a statement; the first line is the title and not read")
    if not nodes:
        draft.fault(1, "", "no statement in the deck: there is nothing to simulate")
    elif nodes[-1].key != "end":
        draft.warn(nodes[-1].line, nodes[-1].tag, "the deck does not END; it may be incomplete")


def _known_attributes(node: Node) -> list[str] | None:
    """Return the attributes that a statement of this name may have, None where that is open."""
    statement = BY_KEY.get(node.key)
    if statement is None or statement.any_attribute(node):
        return None
    return list(statement.attributes)


def _read_statement(node: Node, draft: AdmDraft) -> None:
    """Read one statement, or refuse it by name."""
    statement = BY_KEY.get(node.key)
    if statement is not None:
        statement.read(node, draft)
        return
    id = node.find("id")
    label = node.tag + (f"[{id.value}]" if id else "")
    if node.tag in NOT_BUILT:
        message = f"{node.tag} is documented but not built yet"
    else:
        known = [*(statement.name for statement in STATEMENTS), *NOT_BUILT]
        # names end alike: SOLVER is no COUPLER
        message = f"unknown statement {node.tag}{nearest(node.tag, known, 0.7)}"
    draft.fault(node.line, label, message)
