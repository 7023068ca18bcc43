r"""Adams command files (.acf): which deck is run, and what is done with it.

    file/model=arm                     the deck, arm.adm beside the command file
    SIMULATE/STATICS                   commands, spelled as statements are
    SIMULATE/DYNAMICS, END=2, STEPS=200
    STOP

An older form names the deck on the first line and the output on the second.
"""

from __future__ import annotations

import re
from pathlib import Path

from mbsim.errors import DeckError, Fault
from mbsim.reader.activity import ACTIVATE, DEACTIVATE, TYPES, TYPES_NOT_BUILT, ids_of
from mbsim.reader.adm import statements as decks
from mbsim.reader.adm.control import build_equilibrium, build_integrator
from mbsim.reader.adm.declare import IDS_BY_COMMAS, AdmStatement, numbers
from mbsim.reader.adm.draft import AdmDraft, require
from mbsim.reader.adm.lexer import split_statements, to_node, unique
from mbsim.reader.adm.translate import read_as
from mbsim.reader.command import SIMULATE as XML_SIMULATE
from mbsim.reader.keywords import fold, nearest, spellings
from mbsim.reader.kinds import COUNT, ID, POSITIVE, REAL, TEXT, keyword
from mbsim.reader.linear_analysis import PARAM_LINEAR
from mbsim.reader.statement import Entry, Spec, Statement

_MODEL = re.compile(r"\s*FILE\s*/.*?\bMOD[EL]*\s*=\s*([^,!\s]+)", re.IGNORECASE)
_KINDS = {
    "STATICS": "STATIC",
    "DYNAMICS": "TRANSIENT",
    "TRANSIENT": "TRANSIENT",
    "KINEMATICS": "KINEMATIC",
    "INITIAL_CONDITIONS": "ASSEMBLY",
}


def _build_simulate(entry: Entry) -> None:
    """Add an analysis."""
    kind = entry.get("KIND")
    if kind is None:
        require(entry, "KIND")
        return
    names = {
        "END": "end_time",
        "DURATION": "duration",
        "STEPS": "num_steps",
        "DTOUT": "print_interval",
    }
    read_as(entry, XML_SIMULATE, names, {"analysis_type": _KINDS[kind]})


def _build_linear(entry: Entry) -> None:
    """Add a linear analysis."""
    names = {"PINPUT": "pinput_id", "POUTPUT": "poutput_id"}
    eigen = "TRUE" if entry.get("KIND", "EIGENSOL") == "EIGENSOL" else "FALSE"
    before = entry.draft.linear
    read_as(entry, PARAM_LINEAR, names, {"eigen_analysis": eigen})
    read_as(entry, XML_SIMULATE, {}, {"analysis_type": "LINEAR"})
    entry.draft.linear = before


def _build_integrator(entry: Entry) -> None:
    """Set tolerance and steps of the analyses that follow."""
    draft = entry.draft
    of_deck, draft.transient = draft.transient, None
    build_integrator(entry)
    draft.command_transient, draft.transient = draft.transient, of_deck


SIMULATE = AdmStatement(
    "SIMULATE",
    {
        "KIND": Spec(keyword(spellings(**dict.fromkeys(_KINDS, "")))),
        "END": Spec(REAL),
        "DURATION": Spec(POSITIVE),
        "STEPS": Spec(COUNT),
        "DTOUT": Spec(POSITIVE),
    },
    _build_simulate,
    words={name: ("KIND", name) for name in _KINDS},
    xml="Simulate",
)
_LINEAR_KINDS = ("EIGENSOL", "STATEMAT")
_LINEAR_FILES = "matrices, eigenvalues and shapes are in /linear of the result file"
LINEAR = AdmStatement(
    "LINEAR",
    {
        "KIND": Spec(keyword(spellings(**dict.fromkeys(_LINEAR_KINDS, "")))),
        "PINPUT": Spec(ID),
        "POUTPUT": Spec(ID),
        "PSTATE": Spec(ID, refused="other states than positions and turns are not built"),
        "NODAMPING": Spec(TEXT, refused="is not built; take the damping out of the forces"),
        **{
            name: Spec(TEXT, note=_LINEAR_FILES)
            for name in ("FILE", "FORMAT", "COORDS", "TABLE", "KINETIC", "ORIGINAL", "NORMALMODE")
        },
    },
    _build_linear,
    words={name: ("KIND", name) for name in _LINEAR_KINDS}
    | {name: (name, "TRUE") for name in ("NODAMPING", "KINETIC", "ORIGINAL", "NORMALMODE")},
    xml="Simulate",
)
INTEGRATOR = AdmStatement(
    "INTEGRATOR",
    decks.BY_KEY["integrator"].attributes,
    _build_integrator,
    words=decks.BY_KEY["integrator"].words,
    xml="Param_Transient",
)
EQUILIBRIUM = AdmStatement(
    "EQUILIBRIUM",
    decks.BY_KEY["equilibrium"].attributes,
    build_equilibrium,
    words=decks.BY_KEY["equilibrium"].words,
    xml="Param_Static",
)
#: Adams' words for types of elements whose names in MotionSolve are others.
_WORDS = {"BUSHING": "BUSH", "SPRINGDAMPER": "SPDP", "GEAR": "COUPLER"}
_TYPES = {"BUSHING", "SPRINGDAMPER", "GEAR", *TYPES.values()} - {"BUSH", "SPDP", "FORCE"}
_TYPES_NOT_BUILT = {*TYPES_NOT_BUILT.values(), "CLEARANCE"} - {"GEAR"}


def _switch(statement: Statement) -> AdmStatement:
    """Return the command that switches elements of a type, one by one."""

    def build(entry: Entry) -> None:
        kind, ids, span = entry.get("TYPE"), entry.get("ID"), entry.get("RANGE")
        if kind is None:
            require(entry, "TYPE")
            return
        if (ids is None) == (span is None):
            entry.fault(f"{statement.name.upper()}: one of ID and RANGE is needed")
            return
        name = _WORDS.get(kind, kind)
        if span is not None:
            low, high = map(int, span)
            ids = tuple(id for id in ids_of(entry.draft, name) if low <= id <= high)
            if not ids:
                entry.fault(f"there is no {kind} from {low} to {high}", "RANGE")
        for id in ids:
            read_as(entry, statement, {}, {"element_type": name, "element_id": str(id)})

    return AdmStatement(
        statement.name.upper(),
        {
            "TYPE": Spec(keyword(_words(_TYPES), _words(_TYPES_NOT_BUILT))),
            "ID": Spec(IDS_BY_COMMAS),
            "RANGE": Spec(numbers(2)),
        },
        build,
        words={name: ("TYPE", name) for name in sorted({*_TYPES, *_TYPES_NOT_BUILT})},
        xml=statement.name,
    )


def _words(names: set[str]) -> dict[str, str]:
    return spellings(**dict.fromkeys(sorted(names), ""))


_OUTPUT = "results and messages are mbsim's own; it sets nothing"
COMMANDS = (
    SIMULATE,
    LINEAR,
    INTEGRATOR,
    EQUILIBRIUM,
    _switch(ACTIVATE),
    _switch(DEACTIVATE),
    *(
        decks.output_only(name, _OUTPUT)
        for name in (
            *("FILE", "OUTPUT", "RESULTS", "PREFERENCES", "DEBUG", "CONTROL", "INFO", "LIST"),
            *("SHOW", "TIME", "IC", "KINEMATICS", "LSOLVER", "HELP"),
        )
    ),
    AdmStatement("STOP"),
)
_BY_KEY = {fold(command.name): command for command in COMMANDS}
#: Documented commands that change the model or what is done with it.
NOT_BUILT = (
    "ACCGRAV ARRAY BEAM BUSHING CONTACT COUPLER DIFF FRICTION GEAR GFORCE "
    "JOINT LSE MARKER MOTION PART RELOAD SAVE SENSOR SFORCE SPLINE SPRINGDAMPER TFSISO "
    "VARIABLE VFORCE VTORQUE"
).split()


def deck_of(data: bytes, path: Path) -> Path:
    """Return the deck that a command file runs.

    Raises
    ------
    DeckError
        If it names none, or one that is not there.
    """
    lines = data.decode("utf-8", "replace").splitlines()
    named = [
        (k, match.group(1)) for k, line in enumerate(lines, 1) if (match := _MODEL.match(line))
    ]
    first = next(((k, line.strip()) for k, line in enumerate(lines, 1) if line.strip()), (1, ""))
    line, name = named[0] if named else first
    if not name or ("/" in name.strip("./") and not named):
        raise DeckError([Fault(str(path), line, "", "no FILE/MODEL=name: which deck is run?")])
    deck = Path(name if name.lower().endswith(".adm") else f"{name}.adm")
    deck = deck if deck.is_absolute() else path.parent / deck
    if not deck.is_file():
        message = f"there is no {deck.name} beside the command file"
        raise DeckError([Fault(str(path), line, "FILE", message)])
    return deck


def run_commands(data: bytes, path: str, draft: AdmDraft) -> None:
    """Read the commands of a file into the draft of its deck; faults go there too."""
    text = data.decode("utf-8", "replace")
    lines = text.split("\n")
    if not any(_MODEL.match(line) for line in lines):
        lines[:2] = ["", ""]  # names of the deck and of its output
    text = "\n" + "\n".join(lines)  # no title here
    draft.file, draft.in_command = path, True
    for raw in split_statements(text):
        raw.lines = [line - 1 for line in raw.lines]
        node = to_node(raw, _BY_KEY, draft.fault)
        if node is None:
            continue
        draft.puzzling |= {fault.element for fault in draft.faults}
        close = unique(node.tag, NOT_BUILT)
        node.tag = close[0] if len(close) == 1 and node.key not in _BY_KEY else node.tag
        command = _BY_KEY.get(node.key)
        if node.key == "stop":
            break
        if command is not None:
            command.read(node, draft)
        elif node.tag in NOT_BUILT:
            draft.fault(node.line, node.tag, f"{node.tag} is documented but not built yet")
        else:
            known = [*(each.name for each in COMMANDS), *NOT_BUILT]
            message = f"unknown command {node.tag}{nearest(node.tag, known, 0.7)}"
            draft.fault(node.line, node.tag, message)
    draft.in_command = False
