"""`python -m mbsim.manual.make [tables|pictures|gallery]`: what the pages have from the program."""

from __future__ import annotations

import click

from mbsim.manual import book, gallery, pictures, tables


def stale() -> dict[str, str]:
    """Return pages whose tables are not what the program says now, with their right text."""
    found = {}
    for page in book.pages().values():
        text = tables.filled(page)
        if text != page.text:
            found[page.name] = text
    return found


@click.command()
@click.argument("what", type=click.Choice(["all", "tables", "pictures", "gallery"]), default="all")
@click.argument("names", nargs=-1)
def main(what: str, names: tuple[str, ...]) -> None:
    """Make the tables and pictures of the manual; NAMES are pictures, or decks of the gallery.

    The gallery needs a browser and is made where it is asked for.
    """
    if what in ("all", "tables"):
        for name, text in stale().items():
            (book.PAGES / f"{name}.md").write_text(text, encoding="utf-8")
            click.echo(f"tables of {name}")
    if what in ("all", "pictures"):
        pictures.FOLDER.mkdir(exist_ok=True)
        for name in names or pictures.drawings():
            path = pictures.draw(name)
            click.echo(f"{path.name}: {path.stat().st_size // 1000} kB")
    if what == "gallery":
        for photograph in gallery.GALLERY:
            if not names or photograph.deck in names:
                path = gallery.take(photograph)
                click.echo(f"{path.name}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
