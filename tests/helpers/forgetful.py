"""Runs that forget, whenever compiled code comes back, all that a checkpoint does not hold."""

from __future__ import annotations

from mbsim.compile_model.scratch import place_fixed
from mbsim.core import tags
from mbsim.results.recorder import Recorder
from mbsim.run import loop


def groups_of(runner):
    """Return all groups of arrays of a run."""
    tangent, rigid = runner.methods._tangent, runner.methods.rigid
    own = [tangent[0]] if tangent is not None else []
    if rigid is not None:
        own.append(rigid.stepping)
    return [runner.system.scene, runner.method, *own]


def forgetful(patch, budget=1):
    """Let runs forget after every so many evaluations, and go on from what a checkpoint holds.

    All state and scratch is filled with NaN in between, integers with 0.
    """
    runners, init, take = [], loop.Runner.__init__, Recorder.take

    def begin(self, *given, **named):
        init(self, *given, **named)
        runners.append(self)

    def forget(self):
        take(self)
        if not runners or runners[-1].recorder is not self:
            return
        runner = runners[-1]
        # where AUTO may go back to is kept: a checkpoint goes back there, this is about the rest
        first, runner._first = runner._first, None
        saved = runner.checkpoint()
        for group in groups_of(runner):
            tags.forget(group, tags.STATE)
            tags.forget(group, tags.SCRATCH)
        place_fixed(runner.system.scene.work, runner.system.scene.graphics)
        runner.restore(saved)
        runner._first = first

    patch.setattr(loop.Runner, "__init__", begin)
    patch.setattr(Recorder, "take", forget)
    patch.setattr(loop, "FIRST_BUDGET", budget)
    patch.setattr(loop, "next_budget", lambda *called: budget)
