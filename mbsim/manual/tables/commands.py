"""Tables of the program itself: commands, options, exit codes, decks of models/."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from lxml import etree

import mbsim
from mbsim import errors
from mbsim.errors import MbsimError
from mbsim.manual.book import Page
from mbsim.manual.tables import first_sentence, item, reference, rows, table

#: Endings that are no error, and those of classes that end a run with results kept.
_DONE = (0, "done")
_USAGE = "wrong usage"


def program() -> click.Group:
    """Return the group of all commands.

    It stands above the manual, which it shows; only what makes pages looks at it, by its name.
    """
    group: click.Group = import_module("mbsim.cli.main").main
    return group


def commands_of(group: click.Group, before: str = "") -> dict[str, click.Command]:
    """Return all commands of a group by their full name; groups within it are gone into."""
    context = click.Context(group)
    found: dict[str, click.Command] = {}
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            found |= {name: command} | commands_of(command, f"{before}{name} ")
        elif command is not None:
            found[before + name] = command
    return found


def _arguments(command: click.Command) -> str:
    context = click.Context(command)
    return " ".join(
        piece
        for parameter in command.get_params(context)
        if isinstance(parameter, click.Argument)
        for piece in parameter.get_usage_pieces(context)
    )


@table("commands")
def commands(_: str, page: Page) -> list[str]:
    """Return every command with the first sentence of its help."""
    return rows(
        ("command", "what it does"),
        (
            (
                reference(page, f"reference/commands/{name.split()[0]}", f"`{name}`"),
                first_sentence((command.help or "").replace("<model>", "MODEL")),
            )
            for name, command in commands_of(program()).items()
        ),
    )


@table("options")
def options(name: str, page: Page) -> list[str]:
    """Return arguments and options of one command."""
    command = commands_of(program())[name]
    context = click.Context(command)
    lines: list[str] = []
    for parameter in command.get_params(context):
        if not isinstance(parameter, click.Option) or "--help" in parameter.opts:
            continue
        record: Any = parameter.get_help_record(context)
        if record is not None:
            flags, text = record
            text = re.sub(r"<[^>]*>\S*", lambda word: f"`{word.group()}`", " ".join(text.split()))
            lines += item(f"`{flags}`: {text}")
    return lines or ["It has no options."]


def classes() -> list[type[MbsimError]]:
    """Return the classes of errors in the order of their file."""
    return [
        each
        for each in vars(errors).values()
        if isinstance(each, type) and issubclass(each, MbsimError) and each is not MbsimError
    ]


@table("exit-codes")
def exit_codes(_: str, page: Page) -> list[str]:
    """Return the exit codes with their class in Python and what they say."""
    body = [("0", "", "done")]
    for each in sorted(classes(), key=lambda one: one.exit_code):
        body.append((str(each.exit_code), f"`{each.__name__}`", first_sentence(each.__doc__ or "")))
    return rows(("code", "class in Python", "what happened"), body)


def decks() -> list[Path]:
    """Return the decks of models/, in a checkout or in an installed package."""
    package = Path(mbsim.__file__).parent
    for folder in (package.parent / "models", package / "examples" / "models"):
        if folder.is_dir():
            return sorted(folder.rglob("*.xml")) + sorted(folder.rglob("*.adm"))
    return []


def _deck_about(path: Path) -> str:
    """Return the first sentence of a deck's first comment."""
    if path.suffix == ".adm":
        return path.read_text(encoding="utf-8").splitlines()[0].lstrip("! ")
    comments: Any = etree.parse(str(path)).xpath("//comment()")
    text = " ".join((comments[0].text or "").split()) if comments else ""
    return re.sub(r" \(units [^)]*\)", "", re.split(r"\.(?: |$)|: ", text)[0])


@table("models")
def models(_: str, page: Page) -> list[str]:
    """Return the decks of models/ and what each shows, from its first comment."""
    lines: list[str] = []
    for path in decks():
        name = path.as_posix().split("models/", 1)[1]
        lines += item(f"`models/{name}`: {_deck_about(path)}.")
    return lines
