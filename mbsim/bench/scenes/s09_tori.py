"""S9: a torus given as a mesh falls on a plane, or onto a second torus that is fixed."""

from __future__ import annotations

import math

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

#: Critical damping of 1 kg: contacts of the peers do not rebound either.
LAW = p.ImpactLaw(k=1e6, e=1.0, c=2e3, dmax=1e-4)
TRANSITION = 0.01  # m/s, of the smoothed friction
STEPS = (2e-2, 1e-2, 5e-3, 2e-3)  # s, of rigid contact


def _graphic(number: int, marker: int) -> str:
    """Return the torus as a TriaMesh, its numbers in the deck."""
    vertices, faces = p.torus_mesh(p.S9)
    nodes = "\n".join(" ".join(map(repr, row)) for row in vertices.tolist())
    corners = "\n".join(" ".join(map(str, row)) for row in faces.tolist())
    return (
        f'<Post_Graphic id="{number}" type="TriaMesh" rm_id="{marker}">\n'
        f"<Nodes>\n{nodes}\n</Nodes>\n<Faces>\n{corners}\n</Faces>\n</Post_Graphic>"
    )


def _falling(turn: float) -> list[str]:
    """Return the falling torus and gravity; `turn` [rad] is about x."""
    c, s = math.cos(turn), math.sin(turn)
    axes = ((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c))
    place = (0.0, 0.0, p.S9.height)
    whole = text.body(2, p.S9.mass, p.torus_inertia(p.S9), place, axes=axes)
    return [text.GROUND, text.FLOOR, whole, _graphic(200, 20), text.gravity()]


def _law() -> dict[str, object]:
    return text.impact(*LAW) | text.coulomb(p.S9.mu, TRANSITION)


def _plane(variation: Variation) -> str:
    return text.deck(
        "A torus falls on a plane",
        [
            *_falling(p.S9.tilt),
            text.contact(301, [200], [100], **_law()),
            *text.fixed_step(variation),
        ],
        p.S9.end_time,
    )


def _torus(variation: Variation) -> str:
    return text.deck(
        "A torus falls onto a torus",
        [
            *_falling(math.pi / 2.0),
            text.marker(12, 1, p.S9.fixed),
            _graphic(110, 12),
            text.contact(301, [200], [100], **_law()),
            text.contact(302, [200], [110], **_law()),
            *text.fixed_step(variation),
        ],
        p.S9.end_time,
    )


def linking_number(position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Return how often the falling torus' centre circle is linked with the fixed one's, (n,).

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        Centre of the falling torus [m].
    quaternion : ndarray, shape (n, 4)
        Its attitude, w first.

    Notes
    -----
    The circle meets the plane of the fixed one in two points or none; they are linked if one of
    the two lies inside the fixed circle.
    """
    w, x, y, z = quaternion.T
    # columns of the rotation: two diameters of the circle
    first = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    second = np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    offset = position - np.array(p.S9.fixed)
    # height R (a cos t + b sin t) + h = 0
    a, b, h = first[:, 2], second[:, 2], offset[:, 2] / p.S9.ring
    reach = np.hypot(a, b)
    meets = np.abs(h) < reach
    middle = np.arctan2(b, a)
    half = np.arccos(np.where(meets, -h / np.where(meets, reach, 1.0), 0.0))
    inside = []
    for t in (middle - half, middle + half):
        at = offset + p.S9.ring * (np.cos(t)[:, None] * first + np.sin(t)[:, None] * second)
        inside.append(np.hypot(at[:, 0], at[:, 1]) < p.S9.ring)
    return np.asarray(meets & (inside[0] != inside[1])).astype(int)


def _at_rest(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return how far from lying flat on the plane it ends, its speed and its largest depth."""
    return _ends(outcome) | {"z_error": abs(float(outcome.position[-1, 0, 2]) - p.S9.tube)}


def _ends(outcome: Outcome) -> dict[str, float]:
    found = {
        "z_end": float(outcome.position[-1, 0, 2]),
        "v_end": float(np.linalg.norm(outcome.velocity[-1, 0])),
    }
    if "peak_penetration" in outcome.extra:
        found["penetration"] = outcome.extra["peak_penetration"]
    return found


def _on_torus(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return in how many rows one torus has gone through the other, and the depth of contact."""
    linked = linking_number(outcome.position[:, 0], outcome.quaternion[:, 0])
    return _ends(outcome) | {"passed_through": float((linked != linked[0]).sum())}


SCENES = (
    Scene(
        name="S9plane",
        title="mesh torus of 5184 triangles falls on a plane, 1 s",
        end_time=p.S9.end_time,
        measure="z_error",
        unit="height of the centre over that of a torus that lies flat [m]",
        deck=_plane,
        variations=({}, *({"h": h} for h in STEPS)),
        errors=_at_rest,
        targets=(Target(1 / 2),),
        pass_below=1e-4,
        tolerances=(1e-3, 1e-4, 1e-5, 1e-6),
        repeats=3,
    ),
    Scene(
        name="S9torus",
        title="mesh torus falls onto a fixed one, 5184 triangles each, 1 s",
        end_time=p.S9.end_time,
        measure="passed_through",
        unit="rows in which one torus has passed through the other",
        deck=_torus,
        variations=({}, *({"h": h} for h in STEPS)),
        errors=_on_torus,
        targets=(Target(1 / 2),),
        pass_below=0.5,
        tolerances=(1e-3, 1e-4, 1e-5, 1e-6),
        repeats=3,
    ),
)
