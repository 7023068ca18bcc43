"""What a run is made of: all that its results follow from, to compare a resumed run with.

The model as it is run (`--set` included), how it is run, the bytes of users' files, and which
arrays a checkpoint of this version holds. Every
field of every element counts, whatever it is called, but for those that are marked ASIDE where they
are declared. Facts are kept, so that a message can name what differs.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import MISSING, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Tangent
from mbsim.core import tags
from mbsim.expressions import Expression
from mbsim.integrators.scheme import Method
from mbsim.model.elements import ASIDE, Source
from mbsim.model.names import element_name
from mbsim.results.elements import GROUPS, with_own_tables

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

#: What elements are called in decks, by the field of `Model`; others are called by the field.
_STATEMENTS = {
    "bodies": "Body_Rigid",
    "markers": "Reference_Marker",
    "graphics": "Post_Graphic",
    "variables": "Reference_Variable",
    "differentials": "Control_Diff",
    "splines": "Reference_Spline",
    "arrays": "Reference_Array",
    "sensors": "Sensor_Event",
    "evaluations": "Sensor_Evaluate",
    "requests": "Post_Request",
    "gravity": "Force_Gravity",
    "transient": "Param_Transient",
    "units": "Param_Unit",
    "simulations": "Simulate",
    "stages": "Simulate",
} | {group.member: group.title for group in GROUPS.values()}


class Kind(NamedTuple):
    """Facts of one kind: the result file's attribute of their digest, what another one says."""

    attribute: str
    differs: str


#: Kinds of facts. That of the checkpoint is first: by another version others may differ too.
KINDS = {
    "checkpoint": Kind(
        "checkpoint_sha256", "its checkpoint was written by a version of mbsim with other arrays"
    ),
    "model": Kind("system_sha256", "elements of the model have changed (--set?)"),
    "settings": Kind("settings_sha256", "how it is run has changed"),
    "subroutines": Kind("subroutines_sha256", "a user subroutine has changed"),
}
#: To be raised where anything else in a checkpoint than its arrays changes its form.
CHECKPOINT = 3
#: Differences that a message lists.
MOST_LISTED = 3
#: What stands for a field that facts leave out, and for an element that is not there.
_DEFAULT, _ABSENT = object(), object()
#: Types of values that are facts as they are.
_PLAIN = frozenset((type(None), bool, int, float, str))


def plain(value: Any) -> Any:
    """Return a value as numbers, texts, lists and mappings; of dataclasses what is not a default.

    Left out are file and line of an element and fields marked ASIDE. Arrays become digests,
    expressions their text: a tree may be deeper than JSON goes.
    """
    kind: Any = type(value)
    if kind in _PLAIN:
        return value
    return _forms(kind)(value)


@functools.cache
def _forms(kind: Any) -> Callable[[Any], Any]:
    """Return what makes values of a type plain."""
    for types, form in _FORMS:
        if issubclass(kind, types):
            return form
    if not is_dataclass(kind):
        raise TypeError(f"{kind.__name__} is nothing that a run can be compared by")
    return _element


def _element(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that are no defaults."""
    made = {"": type(value).__name__}
    kind: Any = type(value)
    for name, default, shown in _defaults(kind):
        item = getattr(value, name)
        if item is default or isinstance(item, Source):
            continue
        known = item if type(item) in _PLAIN else plain(item)
        # of all elements a text is long
        if not shown or repr(known) != shown:
            made[name] = known
    return made


def _array(value: np.ndarray[Any, Any]) -> str:
    """Return shape and digest of an array."""
    data = np.ascontiguousarray(value)
    return f"{'x'.join(map(str, data.shape))} {hashlib.sha256(data.tobytes()).hexdigest()}"


def _sequence(value: Sequence[Any]) -> Any:
    """Return a list; of pairs of a name and a value a mapping."""
    if _PLAIN.issuperset(map(type, value)):
        return list(value)
    named = all(isinstance(item, tuple) and len(item) == 2 for item in value)
    if named and all(isinstance(item[0], str) for item in value):
        return {name: plain(item) for name, item in value}
    return [plain(item) for item in value]


#: What makes values plain, by their types; the first that fits counts.
_FORMS: tuple[tuple[Any, Callable[[Any], Any]], ...] = (
    ((bool, int, float, str), lambda value: value),
    (Expression, lambda value: value.text),
    (np.ndarray, _array),
    (Mapping, lambda value: {str(key): plain(item) for key, item in value.items()}),
    (np.generic, lambda value: value.item()),
    ((list, tuple), _sequence),
)


@functools.cache
def _defaults(kind: Any) -> list[tuple[str, Any, str]]:
    """Return the fields of a dataclass that count: name, default, its plain form as text."""
    return [
        (field.name, field.default, "" if field.default is MISSING else repr(plain(field.default)))
        for field in fields(kind)
        if ASIDE not in field.metadata and not isinstance(field.default, Source)
    ]


def of_elements(holder: Any, file: str) -> dict[str, Any]:
    """Return the facts of a model or of settings, by the name of each element in its deck."""
    facts: dict[str, Any] = {}
    named = plain(holder)
    # kinds of forces between markers are tables of their own
    for member, value in (named | named.pop("marker_forces", {})).items():
        title = _STATEMENTS.get(member, member)
        if isinstance(value, dict) and member in _STATEMENTS and "" not in value:
            facts |= {element_name(file, title, int(id)): item for id, item in value.items()}
        elif isinstance(value, list) and member in _STATEMENTS:
            facts |= {f"{title}[{k}]": item for k, item in enumerate(value, 1)}
        elif member:
            facts[title] = value
    return facts


def _stamp(file: Path) -> tuple[int, ...]:
    """Return what changes whenever a file does."""
    found = file.stat()
    return found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_ino


@functools.lru_cache(maxsize=1 << 10)
def _words(file: Path, stamp: tuple[int, ...]) -> frozenset[str]:
    """Return the names in a script; `stamp` is that of the file."""
    return frozenset(re.findall(r"[^\W\d]\w*", file.read_text("utf-8", "replace")))


@functools.lru_cache(maxsize=1 << 10)
def _digest(file: Path, stamp: tuple[int, ...]) -> str:
    """Return the digest of a file's bytes; `stamp` is that of the file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _files(file: Path) -> list[Path]:
    """Return a user's file and those beside it that it names: scripts import their neighbours."""
    found, waiting = {file}, [file]
    beside: dict[Path, set[str]] = {}
    while waiting:
        one = waiting.pop()
        ending, home = one.suffix, one.parent
        if ending not in (".py", ".m"):
            continue
        # a look at the folder, and not one for every word of a script
        if home not in beside:
            beside[home] = set(os.listdir(home))
        words, end = _words(one, _stamp(one)), len(ending)
        named = [home / name for name in beside[home]
                 if name[-end:] == ending and name[:-end] in words]  # fmt: skip
        named = [file for file in named if file in found or file.is_file()]
        if ending == ".py":
            for word in words & beside[home]:
                named += (home / word).rglob("*.py")  # of a file there is nothing
        waiting += [other for other in named if other not in found]
        found.update(named)
    return sorted(found)


def of_users(system: System) -> dict[str, Any]:
    """Return the facts of users' subroutines, by element: what is called, and bytes of files."""
    users = [
        *((f"Force_Contact[{id}]: {user.name}", user) for id, user in system.user_laws),
        *((f"Force_Contact[{p.contact.id}]: {p.user.fnc_name}", p) for p in system.posts),
        *((f"Force_Element[{id}]: {user.name}", user) for id, user in system.residuals.items()),
        *((f"{s}[{id}]: {user.name}", user) for (s, id), user in system.subroutines.items()),
    ]
    facts: dict[str, Any] = {}
    digests: dict[Path, dict[str, str]] = {}
    for name, user in users:
        source = Path(user.source)
        if source not in digests:
            digests[source] = {
                str(file.relative_to(source.parent)): _digest(file, _stamp(file))
                for file in _files(source)
            }
        facts[name] = digests[source] | {"compiled": getattr(user, "compiled", False)}
    return facts


@functools.cache
def _layouts() -> dict[str, str]:
    """Return type and number of axes of the arrays of a checkpoint by name."""
    groups = {"": Scene, "method/": Method, "tangent/": Tangent}
    found: dict[str, str] = {}
    for path, group in groups.items():
        found |= tags.layout(group, tags.STATE, path)
    return found


def of_checkpoint() -> dict[str, str]:
    """Return the form of a checkpoint, and type and number of axes of its arrays by name."""
    return {"form": str(CHECKPOINT)} | _layouts()


class Identity:
    """What a run is made of, by kind.

    Parameters
    ----------
    system : System
    settings : dataclass, optional
        How it is run.
    """

    def __init__(self, system: System, settings: Any = None) -> None:
        self._model, self._settings = system.model, settings
        self._users: Callable[[], dict[str, Any]] = partial(of_users, system)

    def settled(self) -> Identity:
        """Return one that says the same whatever becomes of users' files and the model's tables.

        It holds none of the system's arrays.
        """
        found, users = copy(self), self._users()
        found._model, found._users = with_own_tables(self._model), lambda: users
        return found

    @functools.cached_property
    def facts(self) -> dict[str, dict[str, Any]]:
        """Facts by kind, by name; made when they are asked for: only a file needs them."""
        settings, file = self._settings, self._model.file
        return {
            "checkpoint": of_checkpoint(),
            "model": of_elements(self._model, file),
            "settings": {} if settings is None else of_elements(settings, file),
            "subroutines": self._users(),
        }

    @functools.cached_property
    def _texts(self) -> dict[str, bytes]:
        """Facts as texts, by kind."""
        return {kind: _text(facts) for kind, facts in self.facts.items()}

    @functools.cached_property
    def digests(self) -> dict[str, str]:
        """Digests by the name of the result file's attribute."""
        return {
            KINDS[kind].attribute: hashlib.sha256(text).hexdigest()
            for kind, text in self._texts.items()
        }

    @functools.cached_property
    def packed(self) -> np.ndarray[Any, Any]:
        """All facts as bytes: the text of one mapping."""
        parts = [b'"%s": %s' % (kind.encode(), self._texts[kind]) for kind in sorted(self._texts)]
        return np.frombuffer(zlib.compress(b"{%s}" % b", ".join(parts), 1), dtype=np.uint8)

    def changes(self, packed: np.ndarray[Any, Any], kind: str) -> str:
        """Return what differs from the packed facts of another run, empty if nothing does."""
        before = json.loads(zlib.decompress(packed.tobytes())).get(kind)
        if before is None:
            return ""  # an earlier version did not say
        now = json.loads(_text(self.facts[kind]))
        found = list(_differences(before, now, ""))
        more = f" and {len(found) - MOST_LISTED} more" if len(found) > MOST_LISTED else ""
        return ", ".join(found[:MOST_LISTED]) + more


def _text(facts: Any) -> bytes:
    return json.dumps(facts, sort_keys=True).encode()


def _differences(before: Any, now: Any, name: str) -> Iterator[str]:
    """Yield what differs, in words."""
    if before == now:
        return
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            part = f"{name}.{key}" if name and key else name or key
            absent = _DEFAULT if name else _ABSENT
            yield from _differences(before.get(key, absent), now.get(key, absent), part)
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for k, (one, other) in enumerate(zip(before, now, strict=True), 1):
            yield from _differences(one, other, f"{name}[{k}]")
    elif isinstance(before, str) and isinstance(now, str) and len(now) >= 64:
        yield f"{name} is another"  # a digest says nothing more
    else:
        yield f"{name} was {_shown(before)} and is {_shown(now)} now"


def _shown(value: Any) -> str:
    """Return a value for a message."""
    known = {_DEFAULT: "the default", _ABSENT: "not there", None: "not given"}
    if value is None or value is _DEFAULT or value is _ABSENT:
        return known[value]
    text = f"{value:.15g}" if isinstance(value, float) else str(value)
    return "there" if isinstance(value, dict | list) else text
