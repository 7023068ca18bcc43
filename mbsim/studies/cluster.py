"""Workers of a Dask cluster; the one home of `distributed`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from itertools import islice
from typing import TYPE_CHECKING, Any

from mbsim.errors import ModelError
from mbsim.studies.worker import PoolLost, Row, failed, run_batch

if TYPE_CHECKING:
    from mbsim.studies.study import Case, Study

#: Called with a line for the user.
Notify = Callable[[str], None]
#: Runs of one task, and tasks that each thread of the cluster has in hand or waiting: a scheduler
#: that holds all tasks of a large study at once dies of it.
AT_ONCE, IN_HAND = 25, 3
#: How long the scheduler may take to answer [s].
PATIENCE = 20.0


def need_distributed() -> Any:
    """Return the module, or raise `ModelError` saying how it is installed."""
    try:
        import distributed
    except ImportError:
        raise ModelError('--scheduler needs: pip install "mbsim-contact[studies]"') from None
    return distributed


def cluster_rows(
    study: Study, address: str, runs: Sequence[int], notify: Notify | None = None
) -> Iterator[Row]:
    """Yield the row of every run as it comes from a Dask cluster.

    Parameters
    ----------
    study : Study
        Its model must be at the same path on every worker.
    address : str
        Of the scheduler, ``tcp://host:8786``.
    runs : sequence of int
    notify : callable, optional
        Called with a line for the user where no worker is there yet.

    Raises
    ------
    ModelError
        If nobody answers there.
    PoolLost
        If nobody answers any more.
    """
    with closing(Cluster(study, address, notify)) as cluster:
        yield from cluster.share(map(study.case, runs), len(runs))


class Cluster:
    """Workers of a Dask cluster; arguments and errors as of `cluster_rows`."""

    def __init__(self, study: Study, address: str, notify: Notify | None = None) -> None:
        self._distributed = need_distributed()
        self._study = study
        self._loaded = False  # whether a run was done
        try:
            # a client of an address that is none does not end for a while
            self._distributed.comm.get_address_host_port(address)
        except ValueError as error:
            why = f"{error}; must be such as tcp://host:8786"
            raise ModelError(f"--scheduler {address}: {why}") from None
        # of a scheduler that is lost it logs tracebacks; what follows from that is said here
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self._client = self._distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise ModelError(f"--scheduler: nobody answers at {address} ({error})") from None
        if notify is not None and not self._client.nthreads():
            notify(f"--scheduler {address} has no workers yet: runs wait for one")

    def share(self, cases: Iterable[Case], count: int) -> Iterator[Row]:
        """Yield the row of each of `count` runs as it comes; the very first run is alone."""
        coming = iter(cases)
        if count and not self._loaded:
            self._loaded = True
            yield from _tasks(self._distributed, self._client, self._study, [[next(coming)]])
            count -= 1
        size = AT_ONCE if count > AT_ONCE * IN_HAND else 1
        batches = iter(lambda: list(islice(coming, size)), [])
        yield from _tasks(self._distributed, self._client, self._study, batches)

    def close(self) -> None:
        """Let go of the cluster, which drops what is not done."""
        self._client.close()


def _tasks(
    distributed: Any, client: Any, study: Study, batches: Iterable[list[Case]]
) -> Iterator[Row]:
    """Yield rows of batches; the scheduler holds a few tasks at a time, and none that is done."""
    waiting = iter(batches)
    threads = sum(client.nthreads().values())
    hold = max(2, IN_HAND * threads)
    done = distributed.as_completed(loop=client.loop)
    runs_of: dict[str, list[Case]] = {}

    def submit(batch: list[Case]) -> None:
        future = client.submit(run_batch, study, batch, pure=False)
        runs_of[future.key] = batch
        done.add(future)

    for batch in islice(waiting, hold):
        submit(batch)
    for future in done:
        batch = runs_of.pop(future.key)
        if future.cancelled():
            raise PoolLost("the scheduler does not answer any more")
        error = future.exception() if future.status != "finished" else None
        found = future.result() if error is None else None
        future.release()
        if found is not None:
            yield from (Row(*row) for row in found)
        elif len(batch) > 1:
            # which of them killed the worker is found by running each alone
            for case in batch:
                submit([case])
        else:
            yield failed(batch[0].run, f"{type(error).__name__}: {error}", lost=True)
        for more in islice(waiting, max(0, hold - len(runs_of))):
            submit(more)
