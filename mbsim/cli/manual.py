"""`mbsim manual`: pages of the manual, on the terminal or as one file."""

from __future__ import annotations

from pathlib import Path

import click

from mbsim.cli.messages import echo


@click.command("manual")
@click.argument("topic", nargs=-1)
@click.option("--list", "listed", is_flag=True, help="Names and titles of all pages.")
@click.option(
    "--html",
    "file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the whole manual as one page that needs no other file.",
)
def command(topic: tuple[str, ...], listed: bool, file: Path | None) -> None:
    """Show the page of TOPIC: a page's name, words of its title, or words to search for.

    Where no page has that name and several have the words, they are listed, the best first.
    Without TOPIC the first page is shown, which says where to find what.
    """
    from mbsim.errors import ModelError
    from mbsim.manual import book, search

    if file is not None:
        from mbsim.manual.html import write

        write(file)
        echo(f"{file}: {len(book.pages())} pages, {file.stat().st_size / 1e6:.2f} MB")
        return
    from mbsim.manual import terminal

    if listed:
        terminal.show_list()
        return
    words = " ".join(topic)
    if not words:
        terminal.show_page(book.page_of(book.INDEX))
        return
    hits = search.search(words)
    found = book.named(words)
    if not found and len(titled := search.titled(words)) == 1:
        found = titled
    if not found and len(hits) == 1 and not hits[0].missing:
        found = [hits[0].page]
    if found:
        terminal.show_page(found[0], [*found, *(hit.page for hit in hits)])
    elif hits:
        terminal.show_hits(words, hits)
    else:
        raise ModelError(f"{words}: no page has it; mbsim manual --list names all pages")
