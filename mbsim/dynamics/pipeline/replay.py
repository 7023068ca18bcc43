"""Contact forces of an output row, once more from what the row holds.

`Rows.incidents` has beside y all that a contact's force followed from: where, in which tangent
frame, what friction remembered at the begin of the step. So nothing is detected anew, and the
same code gives the same numbers to the last bit.
"""

from __future__ import annotations

from mbsim.arrays.codes import (
    CONTACT_COLUMNS,
    INC_COUPLE,
    INC_COUPLE_OF_FORCE,
    INC_DEPTH,
    INC_FROZEN,
    INC_GRAPHIC_I,
    INC_GRAPHIC_J,
    INC_KIND,
    INC_MEMORY,
    INC_NORMAL,
    INC_POINT,
    INC_REGION,
    INC_SLOT,
    INC_STEP,
    INC_TANGENT,
    INC_TOUCHES,
    INC_WEIGHT,
    NOW,
    REPLAYED,
    SLOT_COLUMNS,
    USED_INCIDENTS,
)
from mbsim.arrays.hooks import failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, F2, Pointer
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.contact.forces import add_contact
from mbsim.dynamics.pipeline.output import fill_contacts
from mbsim.geometry.catalog import (
    AREA,
    AT_DEPTH,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    GAIN,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
)


@jitable
def put_back(scene: Scene, row: F1) -> int:
    """Put the incident of a table's row back into its slot; return the slot."""
    state, work, pairs = scene.state, scene.work, scene.pairs
    s = int(row[INC_SLOT])
    pair = scene.slots.pair[s]
    pairs.kind[pair], pairs.touches[pair] = int(row[INC_KIND]), int(row[INC_TOUCHES])
    pairs.graphic_i[pair] = int(row[INC_GRAPHIC_I])
    pairs.graphic_j[pair] = int(row[INC_GRAPHIC_J])
    point = work.points[s]
    point[AT_DEPTH], point[AT_WEIGHT] = row[INC_DEPTH], row[INC_WEIGHT]
    for k in range(3):
        point[1 + k], point[4 + k] = row[INC_POINT + k], row[INC_NORMAL + k]
        point[COUPLE + k] = row[INC_COUPLE + k]
        point[COUPLE_OF_FORCE + k] = row[INC_COUPLE_OF_FORCE + k]
        state.t[s, k] = row[INC_TANGENT + k]
    if scene.kinds.whole[pairs.kind[pair]] > 0.0:
        numbers, at = work.points[s + 1], len(row) - INC_REGION
        numbers[AREA], numbers[MOMENT_XX] = row[at], row[at + 1]
        numbers[MOMENT_XY], numbers[MOMENT_YY] = row[at + 2], row[at + 3]
        numbers[GAIN] = row[at + 4]
    state.touching[s] = int(row[INC_FROZEN])
    for k in range(state.before.shape[1]):
        state.before[s, k] = row[INC_MEMORY + k]
    return s


@jitable
def evaluate_replay(scene: Scene, t: float, y: F1, dy: F1, contacts: F1, table: F2) -> int:
    """Fill `contacts` as a row has them, `table` with inputs, outputs, `Work.slot` of each.

    The rows of incidents lie in `Rows.incidents`. Return 0 or a law's code.
    """
    work, rows = scene.work, scene.rows
    place_bodies(scene, y)
    scene.world.past[0], scene.state.frozen[0] = REPLAYED, 1
    count, code = rows.used[USED_INCIDENTS], 0
    work.hit[len(work.hit) - 1] = count
    for k in range(count):
        s = put_back(scene, rows.incidents[k])
        work.hit[k] = s
    for k in range(count):
        s, at = work.hit[k], 0
        for group in (work.law_in, work.law_out):
            for j in range(len(group)):
                group[j] = 0.0
        code = max(code, add_contact(scene, t, rows.incidents[k, INC_STEP], y, dy, s))
        for group in (work.law_in, work.law_out, work.slot[s]):
            for j in range(len(group)):
                table[k, at + j] = group[j]
            at += len(group)
    fill_contacts(scene, y, contacts)
    scene.world.past[0] = NOW
    return code


def replay_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Forces of a row once more: `a` is its y, `b` room for y', contacts and the table."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    size = CONTACT_COLUMNS * len(scene.contacts.id)
    wide = len(scene.work.law_in) + len(scene.work.law_out) + SLOT_COLUMNS
    count = scene.rows.used[USED_INCIDENTS]
    room = vector_at(b, n + size + count * wide)
    table = room[n + size :].reshape(count, wide)
    found = evaluate_replay(scene, t, vector_at(a, n), room[:n], room[n : n + size], table)
    return failure_or(scene, found)
