"""Hands a contact's results at an output time to the user's CONTACTPOST."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import CONTACT_COLUMNS, INC_MEMORY, INC_REGION
from mbsim.plugins.contact_post import ContactPost
from mbsim.plugins.helpers import Pair, Shown, host

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

#: A contact of more pairs of graphics than this is shown pairs that touch alone.
MOST_PAIRS = 256


def pairs_of(post: ContactPost) -> list[Pair]:
    """Return the pairs of graphics of a contact, none where they are too many."""
    contact = post.contact
    i, j = contact.i_graphics_id, contact.j_graphics_id
    if len(i) * len(j) > MOST_PAIRS:
        return []
    if contact.with_itself:
        return [(a, b) for k, a in enumerate(i) for b in i[k + 1 :]]
    return [(a, b) for a in i for b in j]


class ContactPosts:
    """Calls every CONTACTPOST of a system for the rows that a run leaves."""

    def __init__(self, system: System, posts: Sequence[ContactPost]) -> None:
        self.system, self.posts = system, posts
        self.last: tuple[float, dict[int, list[Pair]]] | None = None

    def take(self, time: Any, contact: Any, count: Any, incidents: Any) -> None:
        """Show rows: times, what contacts did, how many incidents each row has, and these.

        The rows are those just left: places in the scene are what they were then.
        """
        at = 0
        for k in range(len(time)):
            rows = incidents[at : at + count[k]]
            at += int(count[k])
            self._show(float(time[k]), contact[k].reshape(-1, CONTACT_COLUMNS), rows)
            assert self.last is not None
            self._call(0)

    def end(self) -> None:
        """Call all once more, with the results of the last row and endflg 1."""
        if self.last is not None:
            self._call(1)
        host.shown.clear()

    def _call(self, endflg: int) -> None:
        assert self.last is not None
        time, pairs = self.last
        for post in self.posts:
            for pair in pairs[post.contact.id]:
                post.call(pair, time, endflg=endflg)

    def _area(self, row: np.ndarray[Any, Any]) -> float:
        """Return the area of an incident, 0 of a point."""
        points = len(row) == INC_MEMORY + self.system.scene.state.before.shape[1]
        return 0.0 if points else float(row[-INC_REGION])

    def _show(self, time: float, net: np.ndarray[Any, Any], rows: np.ndarray[Any, Any]) -> None:
        """Let `py_get_ncontacts` and `py_get_contact_post` see a row."""
        scene, ids = self.system.scene, self.system.graphic_ids
        found: dict[int, dict[Pair, list[list[float]]]] = {}
        for post in self.posts:
            found[post.contact.id] = {pair: [] for pair in pairs_of(post)}
        for row in rows:
            pair = int(scene.slots.pair[int(row[0])])
            kind = scene.pairs.kind[pair]
            id = self.system.contact_ids[int(scene.kinds.contact[kind])]
            if id not in found:
                continue
            graphics = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
            i, j = (ids[int(g)] for g in graphics)
            if scene.kinds.swapped[kind] == 1:
                i, j = j, i
            key = (j, i) if (j, i) in found[id] and (i, j) not in found[id] else (i, j)
            numbers = [row[13], *row[1:7], *row[10:13], self._area(row)]
            found[id].setdefault(key, []).append([float(value) for value in numbers])
        host.shown.clear()
        for post in self.posts:
            id = post.contact.id
            values = net[self.system.contact_ids.index(id), :8]
            host.shown[id] = Shown(values.tolist(), found[id])
        self.last = time, {id: list(pairs) for id, pairs in found.items()}
