"""A run as binary glTF 2.0 with its motion as an animation, for other programs.

Lengths are in metres, times in seconds, and y is up, as glTF has it: one node on top turns and
scales the scene. Each body is a node that moves; its shapes are nodes within it.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from mbsim.model.elements import Array, Graphic
from mbsim.model.tessellation import triangles_of
from mbsim.results.units import POSITION, TIME, UnitSystem
from mbsim.view.colours import colour_of
from mbsim.view.run_data import label_of, view_rows
from mbsim.view.scene import Scene

Table = np.ndarray[Any, Any]
_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
#: Shapes that share one mesh of unit size, scaled.
_UNIT = {"SPHERE": "SPHERE", "ELLIPSOID": "SPHERE", "BOX": "BOX", "CYLINDER": "CYLINDER"}
_SIZES = {"SPHERE": (1.0,), "BOX": (1.0, 1.0, 1.0), "CYLINDER": (1.0, 1.0)}


class _Writer:
    """Collects buffers, accessors and what refers to them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.parts: dict[str, list[Any]] = {
            name: [] for name in ("bufferViews", "accessors", "meshes", "materials", "nodes")
        }
        self._meshes: dict[Any, Any] = {}
        self._materials: dict[int, int] = {}

    def add(self, kind: str, item: Any) -> int:
        """Add an item to one of the lists and return its index."""
        self.parts[kind].append(item)
        return len(self.parts[kind]) - 1

    def accessor(self, table: Table, target: int | None = None, bounds: bool = False) -> int:
        """Return the accessor of a table of float32 or uint32."""
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[1 if table.ndim == 1 else table.shape[1]]
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data)}
        data = np.ascontiguousarray(table).tobytes()
        view["byteLength"] = len(data)
        if target is not None:
            view["target"] = target
        self.data += data + bytes(-len(data) % 4)
        made = {
            "bufferView": self.add("bufferViews", view),
            "componentType": _UNSIGNED if table.dtype.kind == "u" else _FLOAT,
            "count": len(table),
            "type": kind,
        }
        if bounds:
            rows = table.reshape(len(table), -1)
            made |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self.add("accessors", made)

    def material(self, colour: int) -> int:
        """Return the material of a colour 0xRRGGBB."""
        if colour not in self._materials:
            srgb = np.array([(colour >> shift & 255) / 255.0 for shift in (16, 8, 0)])
            linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
            look = {
                "baseColorFactor": [*linear.tolist(), 1.0],
                "metallicFactor": 0.1,
                "roughnessFactor": 0.5,
            }
            made = {"pbrMetallicRoughness": look, "doubleSided": True}
            self._materials[colour] = self.add("materials", made)
        return self._materials[colour]

    def mesh(self, key: Any, colour: int, vertices: Array, faces: Table, ball: bool) -> int:
        """Return the mesh of some triangles in a colour; those of a key are stored once."""
        if key not in self._meshes:
            made: dict[str, Any] = {
                "attributes": {"POSITION": self.accessor(vertices.astype("<f4"), _VERTICES, True)},
                "indices": self.accessor(faces.astype("<u4").reshape(-1), _INDICES),
            }
            if ball:
                normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
                made["attributes"]["NORMAL"] = self.accessor(normals.astype("<f4"), _VERTICES)
            self._meshes[key] = made
        if (key, colour) not in self._meshes:
            primitive = {**self._meshes[key], "material": self.material(colour)}
            self._meshes[key, colour] = self.add("meshes", {"primitives": [primitive]})
        index: int = self._meshes[key, colour]
        return index


def glb(scene: Scene) -> bytes:
    """Return a run as a .glb file."""
    writer = _Writer()
    column = {id: k for k, id in enumerate(scene.body_ids)}
    children: dict[int, list[int]] = {}
    for shape in scene.shapes:
        body = column.get(int(shape["body"]), -1)
        node = _shape_node(writer, scene, shape, body)
        children.setdefault(body, []).append(writer.add("nodes", node))
    bodies = []
    for k, id in enumerate(scene.body_ids):
        node = {
            "name": f"body {id} {scene.labels[k]}".rstrip(),
            "translation": scene.poses.p[0, k].tolist(),
            "rotation": _turned(scene.poses.q[0, k]),
        }
        if k in children:
            node["children"] = children[k]
        bodies.append(writer.add("nodes", node))
    metre = UnitSystem(length="METER", time="SECOND")
    root = {
        "name": scene.name,
        "rotation": _turned(_upright(scene.up)),
        "scale": [scene.units.factor_to(metre, POSITION)] * 3,
        "children": [*bodies, *children.get(-1, [])],
    }
    top = writer.add("nodes", root)
    document = {
        "asset": {"version": "2.0", "generator": "mbsim"},
        "scene": 0,
        "scenes": [{"nodes": [top]}],
        "animations": [_animation(writer, scene, bodies, scene.units.factor_to(metre, TIME))],
        **{name: items for name, items in writer.parts.items() if items},
        "buffers": [{"byteLength": len(writer.data)}],
    }
    return _binary(document, bytes(writer.data))


def _turned(q: Array) -> list[float]:
    """Return a quaternion w first as glTF has it, w last."""
    return [float(value) for value in (*q[1:], q[0])]


def _upright(up: Array) -> Array:
    """Return the quaternion, w first, that turns a direction to y."""
    y = np.array([0.0, 1.0, 0.0])
    if up @ y < -0.999999:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1.0 + up @ y, *np.cross(up, y)])
    found: Array = q / np.linalg.norm(q)
    return found


def _shape_node(writer: _Writer, scene: Scene, shape: Any, body: int) -> dict[str, Any]:
    """Return the node of a shape, its mesh made where it is the first."""
    kind, size = str(shape["shape"]), [float(value) for value in shape["size"]]
    colour = colour_of(int(shape["color"]), body)
    node: dict[str, Any] = {
        "name": f"graphic {shape['id']} {label_of(shape)}".rstrip(),
        "translation": [float(value) for value in shape["position"]],
        "rotation": _turned(shape["quaternion"]),
    }
    if kind == "MESH":
        row = scene.meshes[int(shape["mesh"])]
        vertices = scene.vertices[row["vertex"] : row["vertex"] + row["vertices"]]
        faces = scene.faces[row["face"] : row["face"] + row["faces"]]
        node["mesh"] = writer.mesh(("MESH", int(shape["mesh"])), colour, vertices, faces, False)
    elif kind == "PLANE":
        vertices, faces = _square(scene, shape)
        node["mesh"] = writer.mesh(("PLANE", int(shape["id"])), colour, vertices, faces, False)
    elif kind in _UNIT:
        unit = _UNIT[kind]
        vertices, faces = triangles_of(Graphic(id=0, shape=unit, size=_SIZES[unit]))
        node["mesh"] = writer.mesh(unit, colour, vertices, faces, unit == "SPHERE")
        wide = {"SPHERE": [size[0]] * 3, "CYLINDER": [size[0], size[0], size[1]]}
        node["scale"] = wide.get(kind, size)
    else:
        vertices, faces = triangles_of(Graphic(id=0, shape=kind, size=tuple(size)))
        node["mesh"] = writer.mesh((kind, *size), colour, vertices, faces, False)
    return node


def _square(scene: Scene, shape: Any) -> tuple[Array, Table]:
    """Return two triangles of a plane: its bounds, else a square around what is there at first."""
    x0, x1, y0, y1 = (float(value) for value in shape["bounds"])
    if not (x1 > x0 and y1 > y0):
        far = float(np.linalg.norm(scene.poses.p[[0, -1]] - shape["position"], axis=2).max())
        x1 = y1 = 1.5 * max(far, 0.5 * scene.size)
        x0 = y0 = -x1
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def _animation(writer: _Writer, scene: Scene, nodes: list[int], second: float) -> dict[str, Any]:
    """Return the motion of all bodies, at the rows of a view."""
    rows, _ = view_rows(scene)
    time = (scene.time[rows] * second).astype("<f4")
    # glTF wants times that grow
    kept = np.flatnonzero(np.append(True, np.diff(time) > 0.0))
    rows, time = rows[kept], time[kept]
    at = writer.accessor(time, bounds=True)
    samplers, channels = [], []
    for k, node in enumerate(nodes):
        p = scene.poses.p[rows, k].astype("<f4")
        q = scene.poses.q[rows, k][:, [1, 2, 3, 0]].astype("<f4")
        for path, table in (("translation", p), ("rotation", q)):
            samplers.append({"input": at, "output": writer.accessor(table)})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    return {"name": "motion", "samplers": samplers, "channels": channels}


def _binary(document: dict[str, Any], data: bytes) -> bytes:
    """Return the two chunks of a .glb behind its head."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
