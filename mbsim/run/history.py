"""The rows of a run that goes on step by step, and results made of them at any time.

Rows are a chain of blocks, each with the one before it: a state that is gone back to has its own.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.results.blocks import Block, Gathered, nothing
from mbsim.results.recorder import Recorder

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsim.compile_model.build import System
    from mbsim.results.audit import Audit
    from mbsim.results.contact_posts import ContactPosts
    from mbsim.results.reading import Results
    from mbsim.results.store import Value


@dataclass(frozen=True)
class Chain:
    """Rows, and those before them."""

    block: Block
    before: Chain | None


class History:
    """Takes rows away as a `Recorder` does, and keeps them all.

    Attributes
    ----------
    chain : Chain or None
        The rows so far; setting it goes back to others.
    """

    directory = None

    def __init__(self, system: System, attributes: Mapping[str, Value], how: Any) -> None:
        self.system = system
        self.chain: Chain | None = None
        self._attributes, self._how = attributes, how
        self._posts: ContactPosts | None = None
        if system.posts:
            from mbsim.results.contact_posts import ContactPosts

            self._posts = ContactPosts(system, system.posts)

    def take(self) -> None:
        """Take all rows, incidents and events that the pipeline has left so far."""
        rows = self.system.scene.rows
        counts = [int(count) for count in rows.used]
        if not any(counts):
            return
        block = Gathered(self.system).take(*counts)
        rows.used[:] = 0
        if self._posts is not None:
            self._posts.take(block.time, block.contact, block.incident_count, block.incidents)
        self.chain = Chain(block, self.chain)

    def end(self) -> None:
        """Tell the users' CONTACTPOSTs that there will be no more rows."""
        if self._posts is not None:
            self._posts.end()

    def _all(self) -> Block:
        """Return all rows as one block, which the chain is from then on."""
        blocks, chain = list[Block](), self.chain
        while chain is not None:
            blocks.append(chain.block)
            chain = chain.before
        if not blocks:
            return nothing(self.system)
        if len(blocks) > 1:
            blocks.reverse()
            tables = {f.name: [getattr(each, f.name) for each in blocks] for f in fields(Block)}
            whole = Block(**{name: np.concatenate(each) for name, each in tables.items()})
            self.chain = Chain(whole, None)
            return whole
        return blocks[0]

    def results(
        self, folder: Path | None, status: str, stats: Mapping[str, Value], audit: Audit | None
    ) -> Results:
        """Return all rows so far as results, in memory or as files in a folder."""
        self.take()
        recorder = Recorder(self.system, self._attributes, folder, False, self._how)
        recorder.add(self._all())
        return recorder.close(status, stats, self.system.scene.log.contacts, audit)
