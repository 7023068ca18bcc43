"""Sensitivities of a run: its deck read anew with each parameter changed, and what follows it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbsim.errors import ModelError

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.model.elements import Model
    from mbsim.run.loop import Runner
    from mbsim.run.options import Options
    from mbsim.run.settings import Settings
    from mbsim.sensitivity.parameters import Direction


def deck_of(model: Model, source: Any) -> Any:
    """Return what a model can be read from again.

    Raises
    ------
    ModelError
        If that is not there any more, or is another deck.
    """
    if source is not None:
        return source
    file = Path(model.file)
    try:
        same = hashlib.sha256(file.read_bytes()).hexdigest() == model.sha256
    except OSError:
        same = False
    if not same:
        raise ModelError(
            f"sensitivity: {model.file} is not there as it was read, and is read again with every "
            "parameter changed; give simulate its path, or its text, in place of the model"
        )
    return model.file


def check(settings: Settings, system: System, options: Options) -> None:
    """Raise `ModelError` where a run is none of those that sensitivities are for."""
    from mbsim.sensitivity.parameters import refused

    if options.resume:
        raise ModelError("sensitivity: a run that goes on from a checkpoint has none; run it anew")
    if len(set(options.sensitivity)) < len(options.sensitivity):
        raise ModelError("sensitivity: a parameter is named twice")
    why = refused(system, settings)
    if why is not None:
        raise ModelError(f"sensitivity: {why}")


def directions(system: System, options: Options) -> list[Direction]:
    """Return how each parameter that is asked for changes a run.

    Raises
    ------
    ModelError
        If a parameter is not there, or not one of those that have a derivative.
    """
    from mbsim.compile_model.build import build
    from mbsim.reader.overrides import apply_overrides, value_of
    from mbsim.reader.xml import read_model, read_sections
    from mbsim.sensitivity.parameters import direction, value_in

    model = system.model
    deck = deck_of(model, options.source)
    files = [Path(file) for file in options.plugins]
    _, sections = read_sections(deck)
    apply_overrides(sections, model.overrides)

    def built(name: str, value: float) -> System:
        changed = read_model(deck, [*model.overrides, f"{name}={value!r}"])
        return build(changed, files, options.interpret_plugins, options.detector, lambda line: None)

    found = []
    for name in options.sensitivity:
        try:
            text = value_of(sections, name)
        except ModelError as error:
            raise ModelError(f"sensitivity: {error}") from None
        value = value_in(name, text)
        found.append(direction(name, value, built, system))
    return found


def attach(runner: Runner, found: Sequence[Direction], worth: int) -> None:
    """Let a run that has been started carry derivatives along; `worth` as of `Sensitivities`."""
    from mbsim.arrays.hooks import Joints
    from mbsim.run.hook_calls import HookCalls
    from mbsim.sensitivity.setup import Sensitivities

    start = runner.time

    def assemble(twin: System, changed: System, problem: Any, y: Any) -> None:
        hooks = HookCalls(twin, problem, runner.detector)
        serve = hooks.joints_at(start)
        if serve is not None:
            _assembled(twin, changed, serve, y)
            for _ in range(3):
                hooks.ask_joints(Joints.PROJECT, start, y, y)

    tol = runner.settings.stages[0].tol
    y, problem = runner.method.y, runner.problem
    made = Sensitivities(runner.system, found, y, assemble, problem, tol, worth, start)
    runner.methods.follow(made)
    runner.sensitivities = made
    runner.problem = runner.methods.problem
    runner.hooks = HookCalls(runner.system, runner.problem, runner.detector)


def _assembled(twin: System, changed: System, serve: Callable[[int, Any], None], y: Any) -> None:
    from mbsim.dynamics.initial.assembly import assemble

    assemble(twin.scene, y, serve, changed.given_velocities())
