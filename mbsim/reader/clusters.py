"""Reference_2DCluster and Subsystem_Planar: bodies that stay in a plane of the global axes.

A joint to ground holds each body: PLANAR, and INPLANE a point mass, which does not turn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mbsim.errors import Fault
from mbsim.model import elements as el
from mbsim.model.frames import marker_frames
from mbsim.reader.draft import Draft, PlanarCluster
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import COUNT, IDS, keyword
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

#: Global axes, as columns, whose third is at right angles to the plane.
_AXES = {
    "XY": np.eye(3),
    "YZ": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "ZX": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
_PLANES = keyword(spellings(XY="YX", YZ="ZY", ZX="XZ"))


def _listed(entry: Entry, list_of: str, count: str) -> tuple[int, ...]:
    """Return a list of ids, of which the deck may say how many they are."""
    ids: tuple[int, ...] = entry.get(list_of, ())
    if entry.given(count) and entry.get(count) not in (None, len(ids)):
        entry.fault(f"must be the number of ids in the list, {len(ids)}", count)
    return ids


def _build_cluster(entry: Entry) -> None:
    """Keep a cluster until bodies are known."""
    bodies = _listed(entry, "bodies", "num_body")
    cluster = PlanarCluster(
        entry.get("id", 0), entry.get("planar_type", "XY"), bodies, entry.source
    )
    entry.register("clusters", cluster)


def _build_planar(entry: Entry) -> None:
    """Keep which clusters are in force."""
    for id in _listed(entry, "clusters", "num_2d_cluster"):
        entry.draft.planar.setdefault(id, entry.source)


@dataclass
class _Held:
    """What bodies in planes are held by, while it is made."""

    draft: Draft
    ground: int
    marker: int

    def hold(self, cluster: PlanarCluster, cg: int, R: np.ndarray, point: bool) -> None:
        """Hold a body whose cg marker has the axes R at the start."""
        draft, ids = self.draft, []
        body = draft.markers[cg].body_id
        for id in (body, self.ground):
            self.marker += 1
            ids.append(self.marker)
            draft.markers[self.marker] = el.Marker(
                id=self.marker,
                body_id=id,
                rm_id=cg,
                R=R.T @ _AXES[cluster.plane],
                source=cluster.source,
            )
        table = draft.primitives if point else draft.joints
        id = max(table, default=0) + 1
        table[id] = el.Joint(
            id=id,
            type="INPLANE" if point else "PLANAR",
            label=f"body {body} in {cluster.plane}",
            i_marker_id=ids[0],
            j_marker_id=ids[1],
            is_primitive=point,
            source=cluster.source,
        )


def hold_clusters(draft: Draft, model: el.Model) -> Iterator[Fault]:
    """Hold the bodies of clusters that are in force; yield what does not fit."""
    for id, source in draft.planar.items():
        if id not in draft.clusters and ("Reference_2DCluster", id) not in draft.broken:
            message = f"there is no Reference_2DCluster {id}"
            yield Fault(source.file, source.line, "Subsystem_Planar", message)
    frames = marker_frames(model) if draft.clusters else {}
    ground = next((body.id for body in draft.bodies.values() if body.is_ground), 0)
    held = _Held(draft, ground, max(draft.markers, default=0))
    for cluster in draft.clusters.values():
        name = f"Reference_2DCluster[{cluster.id}]"
        if cluster.id not in draft.planar:
            draft.note(
                cluster.source.line,
                "Reference_2DCluster: no Subsystem_Planar names it; its bodies move freely",
            )
        for id in cluster.bodies:
            body, said = draft.bodies.get(id), ""
            if body is None:
                broken = {("Body_Rigid", id), ("Body_Point", id)} & draft.broken
                said = "" if broken else f"there is no body {id}"
            elif body.is_ground:
                said = f"body {id} is ground, which does not move"
            elif cluster.id in draft.planar and not ground:
                said = "needs a ground body in the deck, in whose plane its bodies stay"
            elif cluster.id in draft.planar and body.cg_id not in draft.markers:
                said = f"body {id} needs a cg_id"
            elif cluster.id in draft.planar and body.cg_id in frames:
                held.hold(cluster, body.cg_id, frames[body.cg_id].R, id in draft.points)
            if said:
                yield Fault(cluster.source.file, cluster.source.line, name, said)


REFERENCE_2D_CLUSTER = Statement(
    "Reference_2DCluster",
    {
        **NAMED,
        "planar_type": Spec(_PLANES, "plane in which its bodies stay", required=True),
        "num_body": Spec(COUNT, "number of bodies", "", "as many as are listed"),
        "bodies": Spec(IDS, "the bodies; text of the element too", required=True),
    },
    _build_cluster,
    text="bodies",
    about="bodies that may be kept in a plane",
    call="planar_cluster",
)
SUBSYSTEM_PLANAR = Statement(
    "Subsystem_Planar",
    {
        "num_2d_cluster": Spec(COUNT, "number of clusters", "", "as many as are listed"),
        "clusters": Spec(
            IDS, "the Reference_2DCluster elements; text of the element too", required=True
        ),
    },
    _build_planar,
    text="clusters",
    about="which clusters are kept in their planes",
)
