"""`mbsim new`: a first deck to change, with what it names."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import click

from mbsim.cli.messages import echo
from mbsim.errors import ModelError
from mbsim.results.files import problem

#: Starters: what each is, and the files that it has, as they are named here -> as they are written.
STARTERS = {
    "bowling": (
        "a ball with friction of your own",
        {"bowling.xml": "bowling.xml", "friction.py.txt": "friction.py"},
    ),
    "mechanism": ("a motor, a crank, a slider on a rail", {"mechanism.xml": "mechanism.xml"}),
    "stack": ("boxes on each other that hold a push", {"stack.xml": "stack.xml"}),
    "mesh": (
        "a part from a mesh file falls on a table",
        {"mesh.xml": "mesh.xml", "bracket.obj": "bracket.obj"},
    ),
}


@click.command("new")
@click.argument("kind", type=click.Choice(list(STARTERS)))
@click.argument("folder", type=click.Path(path_type=Path), default=Path())
def command(kind: str, folder: Path) -> None:
    """Write a commented deck of this KIND into FOLDER (default: here), to be changed.

    bowling: a ball with friction of your own. mechanism: a motor, a crank, a slider. stack: boxes
    that hold a push. mesh: a part from a mesh file. No file is overwritten.
    """
    about, names = STARTERS[kind]
    texts = {
        folder / target: (files("mbsim.cli") / "starters" / name).read_text("utf-8")
        for name, target in names.items()
    }
    there = [str(path) for path in texts if path.exists() or path.is_symlink()]
    if there:
        raise ModelError(f"{', '.join(there)}: there already; name another folder")
    made: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in texts.items():
            with path.open("x", encoding="utf-8") as file:
                made.append(path)
                file.write(text)
    except OSError as error:
        # half a deck is none, and would be in the way of a second try
        for path in made:
            path.unlink(missing_ok=True)
        if isinstance(error, FileExistsError | NotADirectoryError):
            raise ModelError(f"{error.filename}: is no folder; name another one") from None
        raise problem(Path(error.filename or folder), error, "the deck") from None
    deck = folder / f"{kind}.xml"
    echo(f"{deck}: {about}")
    for path in list(texts)[1:]:
        echo(f"{path}: what it names")
    echo(f"next: mbsim run {deck}")
