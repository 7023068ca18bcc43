"""From the attributes of an element to the user's file that defines its function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from mbsim.errors import ModelError
from mbsim.model.elements import Contact, Model, Subroutine
from mbsim.model.subroutines import of_contacts, wanted
from mbsim.plugins.source.octave import SUFFIX, OctaveFile, read_octave
from mbsim.plugins.source.script import Script, Scripts, load_script, require
from mbsim.plugins.source.shared_library import Library, choose, is_library, read_library

Found = TypeVar("Found", Script, Script | Library | OctaveFile)


def check_libraries(model: Model) -> None:
    """Look for the functions of the libraries that elements name; none of them is called.

    Raises
    ------
    ModelError
        With a line for each that is not there, or whose language is not clear.
    """
    named = list(of_contacts(model))
    named += [(f"{each.statement}[{each.id}]", "usrsub", each.user) for each in wanted(model)]
    faults = []
    for element, prefix, user in named:
        if not user.dll_name:
            continue
        try:
            library = find_source(user, user.fnc_name, element, prefix)
            assert isinstance(library, Library)
            choose(library, user.fnc_name, prefix, user.language)
        except ModelError as error:
            faults.append(str(error))
    if faults:
        raise ModelError("\n".join(faults))


def usersub_folder() -> Path:
    """Return the folder with what C and Fortran need to ask mbsim: `mbsim_usersub.h`, `.f90`."""
    home = Path(__file__).parents[2]
    shipped = home / "examples" / "userfuncs"
    return shipped if shipped.is_dir() else home.parent / "userfuncs"


def find_subroutine(
    contact: Contact, plugin_files: Sequence[Path] = (), scripts: Scripts | None = None
) -> Script | Library | OctaveFile:
    """Return what defines the friction function of a contact: a script, run once, or a library.

    `cff_dll_name` and `script_name` in the deck come before `plugin_files`; two of these that
    define the function are an error.

    Raises
    ------
    ModelError
        If no file is named, or none that is named can be used.
    """
    element = f"Force_Contact[{contact.id}]"
    name = contact.cff.fnc_name or "CFFSUB"
    return find_source(contact.cff, name, element, "cff", plugin_files, scripts)


def find_source(
    user: Subroutine,
    name: str,
    element: str,
    prefix: str,
    plugin_files: Sequence[Path] = (),
    scripts: Scripts | None = None,
) -> Script | Library | OctaveFile:
    """Return the script or library that defines function `name` of a contact."""
    scripts = {} if scripts is None else scripts
    if user.dll_name.strip().upper() not in ("", "NULL"):
        place = f"{user.source.file}:{user.source.line}: " if user.source.file else ""
        return read_library(Path(user.dll_name), place + element)
    in_matlab = user.interpreter.upper() in ("MATLAB", "OCTAVE")
    if user.script_name and (in_matlab or Path(user.script_name).suffix.lower() == SUFFIX):
        return read_octave(Path(user.script_name), name, element)
    files = list(dict.fromkeys(Path(file).absolute() for file in plugin_files))
    if in_matlab and not any(file.suffix.lower() == SUFFIX for file in files):
        raise ModelError(
            f'{element}: interpreter="{user.interpreter}" names no .m file; name {name}.m by '
            f"script_name, or with --plugin {name}.m"
        )
    if user.script_name or not any(is_library(f) or f.suffix.lower() == SUFFIX for f in files):
        return find_script(user, name, element, prefix, files, scripts)
    loaded = [_any_kind(file, element, scripts) for file in files]
    return _only_one(loaded, name, element, f"{prefix}_fnc_name")


def _any_kind(file: Path, element: str, scripts: Scripts) -> Script | Library | OctaveFile:
    """Return a --plugin file."""
    if is_library(file):
        return read_library(file, element)
    if file.suffix.lower() == SUFFIX:
        return read_octave(file, file.stem, element)
    return load_script(file, element, scripts)


def _only_one(loaded: Sequence[Found], name: str, element: str, attribute: str) -> Found:
    """Return the one of several files that defines a function."""
    found = [source for source in loaded if source.defines(name)]
    if len(found) > 1:
        both = ", ".join(str(source.path) for source in found)
        raise ModelError(f"{element}: {name} is defined twice: {both}")
    if not found:
        defined = "; ".join(f"{source.path} defines {source.listed()}" for source in loaded)
        raise ModelError(f'{element}: no plugin file defines {attribute}="{name}": {defined}')
    return found[0]


def find_either(
    user: Subroutine,
    name: str,
    element: str,
    prefix: str,
    plugin_files: Sequence[Path] = (),
    scripts: Scripts | None = None,
) -> Script | Library:
    """Return the script or library that defines a function which is no law of a contact."""
    scripts = {} if scripts is None else scripts
    if user.dll_name.strip().upper() not in ("", "NULL"):
        place = f"{user.source.file}:{user.source.line}: " if user.source.file else ""
        return read_library(Path(user.dll_name), place + element)
    files = list(dict.fromkeys(Path(file).absolute() for file in plugin_files))
    defining = [file for file in files if is_library(file)]
    defining = [file for file in defining if read_library(file, element).defines(name)]
    if user.script_name or not defining:
        return find_script(user, name, element, prefix, files, scripts)
    others = [file for file in files if not is_library(file) and file.suffix.lower() != SUFFIX]
    loaded = [_any_kind(file, element, scripts) for file in (*defining, *others)]
    found = _only_one(loaded, name, element, f"{prefix}_fnc_name")
    assert not isinstance(found, OctaveFile)
    return found


def find_script(
    user: Subroutine,
    name: str,
    element: str,
    prefix: str,
    plugin_files: Sequence[Path] = (),
    scripts: Scripts | None = None,
) -> Script:
    """Return the script that defines function `name` of an element; see `find_subroutine`.

    `element` is how messages name it, `prefix` (cff, usrsub) what its attributes begin with,
    or ROUTINE of an Adams deck.
    """
    scripts = {} if scripts is None else scripts
    attribute = prefix if prefix == "ROUTINE" else f"{prefix}_fnc_name"
    if user.interpreter and user.interpreter.upper() != "PYTHON":
        raise ModelError(
            f'{element}: interpreter="{user.interpreter}": only the laws of Force_Contact can be '
            "in the MATLAB language; use Python"
        )
    if user.script_name:
        script = load_script(Path(user.script_name), element, scripts)
        require(script, name, element, attribute)
        return script

    dll_name = user.dll_name.strip()
    # shared libraries and the MATLAB language are for contacts
    files = [file for file in dict.fromkeys(map(Path.absolute, map(Path, plugin_files)))
             if not is_library(file) and file.suffix.lower() != SUFFIX]  # fmt: skip
    if not files:
        said = f'{prefix}_dll_name="{dll_name}"' if dll_name else "no script_name"
        said = f"no FILE.py::{name}" if prefix == "ROUTINE" else said
        raise ModelError(
            f'{element}: {attribute}="{name}" names no file ({said}); '
            "name one with --plugin FILE.py"
        )
    loaded = [load_script(file, element, scripts) for file in files]
    return _only_one(loaded, name, element, attribute)
