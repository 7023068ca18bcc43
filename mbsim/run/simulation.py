"""`simulate`: a model becomes a system, is run (`run/loop.py`), and leaves results."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from mbsim.core.profile import part, profiling
from mbsim.errors import Interrupted, ModelError, ResultsError
from mbsim.model.elements import Model
from mbsim.run.loop import Runner
from mbsim.run.options import Notify, Options, Progress
from mbsim.run.preparing import begin_log, check_plugins, prepare
from mbsim.run.settings import Settings, output_rows, settle, tightened

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.results.audit import Audit
    from mbsim.results.reading import Results
    from mbsim.sensitivity.parameters import Direction


#: Signals that end a run at the next return from compiled code, what there is being kept.
_STOPPING = ("SIGINT", "SIGTERM", "SIGHUP")


@contextmanager
def _stoppable(runner: Runner) -> Iterator[None]:
    """Let Ctrl-C and a scheduler's signals ask the runner to stop."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {}

    for name in _STOPPING:
        number = getattr(signal, name, None)
        # what `nohup` has switched off stays so; Ctrl-C a shell switches off for all that it starts
        # in the background, where somebody who sends it means it
        off = number is not None and signal.getsignal(number) is signal.SIG_IGN
        if number is not None and not (off and name == "SIGHUP"):
            before[number] = signal.signal(number, lambda number, _: runner.ask_to_stop(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _limited(system: System, timeout: float | None, tell: Notify) -> AbstractContextManager[None]:
    """Return what watches over users' functions while the run goes on, where there are some."""
    if not (system.user_laws or system.subroutines or system.posts or system.residuals):
        return nullcontext()
    from mbsim.plugins.permission import limited

    users = (*(user for _, user in system.user_laws), *system.residuals.values())
    interpreted = system.subroutines or system.posts or not all(user.compiled for user in users)
    return limited(timeout, tell, bool(interpreted))


def _listed(name: str, given: Iterable[Any]) -> tuple[Any, ...]:
    """Return what was given as a list; one text is no list of its letters."""
    if isinstance(given, (str, PathLike)):
        raise ModelError(f"{name}={str(given)!r}: must be a list, as [{str(given)!r}]")
    return tuple(given)


def simulate(
    model: Model | str | PathLike[str] | IO[str] | IO[bytes],
    *,
    overrides: Mapping[str, object] | Sequence[str] = (),
    end_time: float | None = None,
    print_interval: float | None = None,
    integrator: str | None = None,
    tol: float | None = None,
    plugins: Sequence[str | Path] = (),
    output: str | Path | None = None,
    resume: bool = False,
    detector: str = "auto",
    interpret_plugins: bool = False,
    allow_overlap: bool = False,
    dump_fclib: int | None = None,
    dump_hardest: int | None = None,
    signals: Sequence[str] = (),
    contact_points: bool = False,
    scripts: bool = True,
    plugin_timeout: float | None = None,
    progress: Progress | None = None,
    notify: Notify | None = None,
    profile: bool = False,
    verify: bool | str = False,
    sensitivity: Sequence[str] = (),
) -> Results:
    """Run a model and return its results.

    Many arguments because each option of a run is one, by keyword.

    Parameters
    ----------
    model : Model, path, or XML
        As `read_model` takes it, or what that returned.
    overrides : mapping or sequence of str
        As of `read_model`, where the model is not read yet.
    end_time, print_interval : float, optional
        Instead of the deck's [T]; of an Adams deck both are needed.
    integrator : str, optional
        A name of `integrators.catalog.METHODS`; default: the deck's, else "AUTO", DOPRI5 and RADAU5
        while the model is stiff.
    tol : float, optional
        Local error of a step, dimensionless (manual: tolerance); default: the deck's, else 1e-5,
        of Adams decks 1e-8.
    plugins : sequence of path
        Files with user subroutines.
    output : path, optional
        Folder for result files; None keeps results in memory.
    resume : bool
        Go on from the last checkpoint in `output`.
    detector : {"auto", "fcl"}
        "fcl" sends every pair through FCL.
    interpret_plugins, allow_overlap : bool
        Do not compile user subroutines; start although shapes overlap deeply.
    dump_fclib : int, optional
        Write the frictional contact problem of every so many steps into `output`/fclib.
    dump_hardest : int, optional
        Keep so many of them, which took MOREAU most sweeps; of every step without `dump_fclib`.
    signals : sequence of str
        Names or patterns of what to record, ``bodies/2/position``, ``contacts/*/force``,
        ``joints``, beside time, events and requests; default: everything.
    contact_points : bool
        Record every point of contact with its force, slip speed and area as well.
    scripts : bool
        False refuses a model that needs users' code, that of `plugins` included.
    plugin_timeout : float, optional
        Longest time of one call of an interpreted user function [s]; default: no bound.
    progress : callable, optional
        Called with time, step and end time [T] now and then.
    notify : callable, optional
        Called with lines for the user.
    profile : bool
        Count where the time goes: ``profile_*`` of `Results.stats`.
    verify : bool or "full"
        Run once more, or two to three times, for error bars: `Results.errors`.
    sensitivity : sequence of str
        Parameters, ``Element[id].attribute``, by which derivatives of all signals are recorded:
        `Results.sensitivity`.

    Raises
    ------
    ModelError, SolverError, PluginError, ResultsError, Interrupted
        What was recorded up to there is kept.
    """
    from mbsim.reader.xml import as_model, to_keep

    model = to_keep(model)
    options = Options(
        end_time=end_time,
        print_interval=print_interval,
        integrator=integrator,
        tol=tol,
        plugins=_listed("plugins", plugins),
        output=output,
        resume=resume,
        detector=detector,
        interpret_plugins=interpret_plugins,
        allow_overlap=allow_overlap,
        dump_fclib=dump_fclib,
        dump_hardest=dump_hardest,
        signals=_listed("signals", signals),
        contact_points=contact_points,
        scripts=scripts,
        plugin_timeout=plugin_timeout,
        progress=progress,
        notify=notify,
        verify=verify,
        sensitivity=_listed("sensitivity", sensitivity),
        source=None if isinstance(model, Model) else model,
    )
    if verify not in (False, True, "full"):
        raise ModelError(f'verify={verify!r}: False, True and "full" are allowed')
    with profiling() if profile else nullcontext():
        read = as_model(model, overrides)
        results = _run(read, options)
        if not verify:
            return results
        from mbsim.run.verify import verified

        return verified(read, options, results, _run)


def run_model(model: Model, options: Options) -> Results:
    """Run a model as options say; see `simulate`, of whose warnings `options.notify` is told."""
    return _run(model, options)


def _settled(model: Model, options: Options) -> Settings:
    """Return the settings of a run."""
    asked = options.end_time, options.print_interval, options.integrator, options.tol
    settings = settle(model, *asked)
    if options.tighter == 1.0:
        return settings
    return tightened(settings, options.tighter, options.least_steps, options.h_most)


def _run(model: Model, options: Options) -> Results:
    """Run a model; see `simulate`."""
    from mbsim.compile_model.scratch import with_points
    from mbsim.core import jit
    from mbsim.results.log import NoLog, RunLog
    from mbsim.results.recorder import Recorder
    from mbsim.results.resume import completed

    began = time.perf_counter()
    settings = _settled(model, options)
    tell = options.notify or (lambda line: None)
    compiled_before = jit.compile_seconds
    files = [Path(file) for file in options.plugins]
    folder = None if options.output is None else Path(options.output)
    if options.resume and folder is not None:
        check_plugins(files)
        if (whole := completed(model, folder, tell)) is not None:
            return whole
    how = options.detector, options.interpret_plugins, options.scripts
    system, said, attributes, changes = prepare(model, settings, files, *how, tell)
    recorded = (*options.signals, *(["contact_points"] if options.contact_points else []))
    attributes["signals"] = "\n".join(recorded)
    if options.allow_overlap:
        attributes["allow_overlap"] = True
    if options.contact_points:
        system.scene = system.scene._replace(rows=with_points(system.scene.rows))
    asked = settings, options.signals, options.bare
    found = _directions(settings, system, options)
    recorder = Recorder(system, attributes, folder, options.resume, *asked)
    try:
        recorder.check_room(output_rows(settings))
    except ModelError:
        recorder.abandon()
        raise
    log = NoLog() if folder is None else RunLog(system, attributes, folder, options.resume)
    begin_log(log, system, (*said, *settings.notes, *_advice(model, settings)))
    status, reason = "failed", ""
    with part("build"):
        runner = Runner(system, settings, recorder, log, tell, changes)
    with _stoppable(runner):
        try:
            with _limited(system, options.plugin_timeout, tell):
                if options.resume:
                    _goes_on(runner)
                else:
                    runner.start(options.allow_overlap)
                if found:
                    from mbsim.run.sensitivity import attach

                    attach(runner, found, options.sensitivity_worth)
                if options.dump_fclib is not None or options.dump_hardest is not None:
                    every = 1 if options.dump_fclib is None else options.dump_fclib
                    runner.dump_every(every, options.resume, options.dump_hardest)
                runner.most_evaluations = options.most_evaluations
                runner.run(options.progress, options.resume)
                recorder.end()
                runner.storing = True
            status = "finished"
        except Interrupted as error:
            status, reason = "interrupted", str(error)
            log.line(reason)
            raise
        except KeyboardInterrupt:
            status, reason = "interrupted", str(stopped := runner.stopped())
            log.line(reason)
            raise stopped from None
        except Exception as error:
            reason = str(error)
            log.line(f"{type(error).__name__}: {reason}")
            raise
        finally:
            runner.storing = True
            compiled = jit.compile_seconds - compiled_before
            results = _finish(runner, status, reason, time.perf_counter() - began, compiled)
    assert results is not None  # a finished run has rows
    return results


def _directions(settings: Settings, system: System, options: Options) -> list[Direction]:
    """Return how the parameters of which derivatives are asked for change the run."""
    if not options.sensitivity:
        return []
    from mbsim.run import sensitivity

    sensitivity.check(settings, system, options)
    with part("build"):
        return sensitivity.directions(system, options)


def end_users(system: System) -> None:
    """Let interpreters that were started for the run end."""
    if any(user.language == "Octave" for _, user in system.user_laws):
        from mbsim.plugins.subroutine import end_run

        end_run()


def _advice(model: Model, settings: Settings) -> list[str]:
    """Return what AUTO says of another method that would serve better."""
    from mbsim.integrators.catalog import AUTO
    from mbsim.stepping.refusals import serves_better

    said = serves_better(model) if settings.integrator == AUTO else ""
    return [said] if said else []


def _goes_on(runner: Runner) -> None:
    """Put a runner where its checkpoint was written, and say so."""
    runner.restore(runner.recorder.checkpoint)
    line = f"goes on at {runner.time:.6g} of {runner.settings.end_time:.6g}"
    runner.tell(line)
    runner.log.line(line)


def _finish(
    runner: Runner, status: str, reason: str, wall: float, compiled: float
) -> Results | None:
    """Keep what was recorded, close the log, and return the results, if there are any.

    `reason` is why it ended early; `wall` and `compiled` are the seconds of the call, and of its
    compiling.
    """
    system = runner.system
    with part("storing"):
        runner.recorder.take()
    stats = runner.stats(wall, compiled) | ({"reason": reason} if reason else {})
    audit = runner.audit()
    for warning in audit.warnings if audit is not None else ():
        runner.tell(f"warning: {warning}")
    log = runner.log

    def close_log() -> None:
        log.close(status, stats, runner.recorder.watch, audit)

    if runner.dump is not None and status == "finished":
        runner.tell(f"{runner.dump.written} contact problems in {runner.dump.folder}")
    try:
        with part("storing"):
            return _keep(runner, status, stats, audit, close_log)
    except ResultsError:
        if not log.closed and (runner.recorder.shown or not runner.recorder.earlier):
            with suppress(ResultsError):
                close_log()
        raise
    finally:
        end_users(system)


def _keep(
    runner: Runner,
    status: str,
    stats: Mapping[str, float | str],
    audit: Audit | None,
    close_log: Callable[[], None],
) -> Results | None:
    """Close the files; None where there is no row: an earlier run's files stay as they are."""
    recorder = runner.recorder
    if recorder.empty and recorder.directory is not None:
        recorder.abandon()
        if not recorder.earlier:
            close_log()
        return None
    if status != "finished" and not runner.torn:
        recorder.flush(runner.checkpoint())
    contacts = runner.system.scene.log.contacts
    last = None if runner.torn else runner.checkpoint
    for line in runner.sensitivities.lines if runner.sensitivities is not None else ():
        runner.say(line)
    results: Results = recorder.close(status, stats, contacts, audit, last, close_log)
    results = runner.linear.kept(results)
    if runner.sensitivities is None:
        return results
    from mbsim.results.error_bar_file import with_tables

    return with_tables(results, *runner.sensitivities.tables(runner.recorder.asked))
