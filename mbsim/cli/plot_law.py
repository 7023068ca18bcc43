"""`mbsim plot-law`: friction laws as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import echo
from mbsim.cli.options import json_option, plugin_option

if TYPE_CHECKING:
    from mbsim.laws.slip_test import Conditions, Sample


@click.command("plot-law")
@click.argument("laws", nargs=-1, required=True, metavar="LAW...")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="PNG or SVG, by its suffix.  [default: friction-<laws>.png]",
)
@plugin_option("Python file with a friction function, which LAW may then name")
@click.option(
    "--set",
    "given",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of the laws, or nforce, stiffness, mass, amplitude, speed, spin, radius; "
    "par=1,2,... is what a user's function gets. May be repeated.",
)
@json_option("what was drawn as one JSON object")
def command(
    laws: tuple[str, ...],
    output: Path | None,
    plugins: tuple[Path, ...],
    given: tuple[str, ...],
    as_json: bool,
) -> None:
    """Draw friction laws: over slip speed, and through a slip to and fro.

    LAW is a cff_type (TANH, STICTION, ...) or, with --plugin FILE.py, a function of that file.
    The upper panel has friction over normal force after a long slide at each speed, the lower
    one the force through x = amplitude sin(w t), which is fastest at x = 0, with `speed`.
    """
    from mbsim.cli.messages import print_json, warn
    from mbsim.laws.slip_test import Conditions, described
    from mbsim.results.drawing import check_target, draw, need_matplotlib, save
    from mbsim.results.law_curves import law_picture
    from mbsim.run.preparing import check_plugins

    need_matplotlib()
    check_plugins(plugins)
    names = tuple(dict.fromkeys(laws))
    target = output or Path(f"friction-{'+'.join(names).lower()}.png")
    check_target(target)
    values, par = _settings(given)
    at = Conditions(**{k: values.pop(k) for k in Conditions._fields if k in values})
    _check(at)
    used: dict[str, float] = {}
    wanted = [_sample(name, values, used, par, at, plugins) for name in names]
    foreign = sorted(set(values) - set(used))
    if foreign:
        from mbsim.errors import ModelError

        raise ModelError(
            f"--set {foreign[0]}: no parameter of {', '.join(names)}; there are "
            f"{', '.join((*used, *Conditions._fields, 'par'))}"
        )
    notes = [described(at._asdict()), described(used), "units: any consistent set"]
    picture = law_picture(wanted, at, [note for note in notes if note])
    warn(save(draw(picture), target))
    if as_json:
        print_json({"picture": str(target), "laws": list(names), **at._asdict(), "set": {
            name: value for name, value in used.items() if math.isfinite(value)}})  # fmt: skip
    else:
        echo(f"{target}: {', '.join(names)}")


def _settings(given: Sequence[str]) -> tuple[dict[str, float], list[float]]:
    """Return what --set gives: numbers by name, and `par`."""
    from mbsim.errors import ModelError

    values: dict[str, float] = {}
    par: list[float] = []
    for text in given:
        name, equals, value = text.partition("=")
        try:
            numbers = [float(part) for part in value.split(",")]
        except ValueError:
            numbers = []
        name = name.strip()
        single = name != "par" and len(numbers) != 1
        if not equals or not numbers or single or not all(map(math.isfinite, numbers)):
            raise ModelError(f"--set {text}: give NAME=VALUE with a number, or par=1,2,...")
        if name == "par":
            par = numbers
        else:
            values[name] = numbers[0]
    return values, par


def _check(at: Conditions) -> None:
    """Raise `ModelError` unless something can be rubbed under these conditions."""
    from mbsim.errors import ModelError

    for name in ("nforce", "stiffness", "mass", "amplitude", "speed"):
        if not getattr(at, name) > 0.0:
            raise ModelError(f"--set {name}={getattr(at, name):g}: must be above 0")


def _sample(
    name: str,
    values: dict[str, float],
    used: dict[str, float],
    par: list[float],
    at: Conditions,
    plugins: Sequence[Path],
) -> Sample:
    """Return a law by its name; what it takes of `values`, or has by itself, goes to `used`."""
    from mbsim.errors import ModelError
    from mbsim.laws.catalog import FRICTION_LAWS
    from mbsim.laws.slip_test import sample_of, usual_parameters

    if name.upper() in FRICTION_LAWS:
        law = FRICTION_LAWS[name.upper()]
        own = {each.name: each for each in law.own}
        for each, usual in usual_parameters(law).items():
            number = values.get(each, usual)
            if number is None:
                raise ModelError(f"{name}: give its {each} with --set {each}=VALUE")
            at_least = "above 0" if each in own and own[each].positive else "0 or more"
            if number < 0.0 or (number == 0.0 and at_least == "above 0"):
                raise ModelError(f"--set {each}={number:g}: must be {at_least}")
            used[each] = number
        return sample_of(law, used, at)
    there = f"there are {', '.join(FRICTION_LAWS)}"
    if not plugins:
        raise ModelError(
            f"{name}: no such friction law; {there}, and functions of a --plugin FILE.py"
        )
    try:
        return _users(name, par, plugins)
    except ModelError as error:
        raise ModelError(f"{name}: no such friction law; {there}; {error}") from None


def _ignore(line: str) -> None:
    """Say nothing: it is meant to be interpreted."""


def _users(name: str, par: list[float], plugins: Sequence[Path]) -> Sample:
    """Return a user's friction function, interpreted."""
    from mbsim.errors import ModelError, PluginError
    from mbsim.laws.catalog import FrictionInput
    from mbsim.laws.slip_test import Sample
    from mbsim.model.elements import Contact, Subroutine
    from mbsim.plugins import host, load_friction
    from mbsim.plugins.helpers import StopRun

    host.forget()
    user = Subroutine(par=tuple(par), fnc_name=name, dll_name="NULL")
    contact = Contact(id=1, cff_type="USERCFF", cff=user)
    function = load_friction(contact, plugins, interpret=True, log=_ignore)
    if function.function is None:
        raise ModelError(f"{function.source}: {name} is no Python function: it cannot be drawn")

    def ask(
        inputs: FrictionInput, memory: tuple[float, ...]
    ) -> tuple[list[float], tuple[float, ...]]:
        try:
            found = function.call(
                inputs.time, par, inputs.loci, inputs.locj, inputs.x, inputs.xdot, inputs.nforce,
                state=memory,
            )  # fmt: skip
        except (Exception, StopRun) as error:
            given = f"--set par={','.join(map(str, par))}" if par else "no --set par=1,2,..."
            raise PluginError(
                f"{name} of {function.source} failed: {type(error).__name__}: {error} ({given})"
            ) from None
        return [found[0], found[1], 0.0, 0.0, found[2]], tuple(found[3:])

    return Sample(name, ask, function.states)
