"""`mbsim check`: read and check only."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("check")
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="SELECTOR=VALUE",
              help="Change an attribute first, e.g. 'Force_Contact[1].mu_static=0.3'.")  # fmt: skip
@click.option("--detector", type=click.Choice(["auto", "fcl"]), default="auto")
def command(model: Path, overrides: tuple[str, ...], detector: str) -> None:
    """Read and check MODEL.xml; list every fault with file and line."""
    from mbsim.model.placement import place
    from mbsim.reader.xml import read_model
    from mbsim.system.pairing import plan_pairs

    deck = read_model(model, overrides)
    place(deck)
    plans = plan_pairs(deck, detector)
    for line in deck.warnings:
        click.echo(f"warning: {line}", err=True)
    for line in deck.notes:
        click.echo(f"note: {line}", err=True)
    moving = sum(not body.is_ground for body in deck.bodies.values())
    click.echo(
        f"ok: {model}: {moving} moving bodies, {len(deck.markers)} markers, "
        f"{len(deck.graphics)} graphics, {len(deck.contacts)} contacts"
    )
    for plan in plans:
        click.echo(
            f"  Force_Contact[{plan.contact}]: Post_Graphic[{plan.graphic_i}] on "
            f"Post_Graphic[{plan.graphic_j}]: {plan.detector}"
        )
