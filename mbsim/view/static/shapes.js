"use strict";
// Radius of a ball about a shape's centre that holds it; 0 of a plane.
mbsim.radiusOf = function (run, k) {
  const [a, b, c] = run.arrays.shape_size.subarray(7 * k, 7 * k + 3);
  switch (run.about.shapes[k].shape) {
    case "SPHERE": return a;
    case "ELLIPSOID": return Math.max(a, b, c);
    case "BOX": return 0.5 * Math.hypot(a, b, c);
    case "CYLINDER": return Math.hypot(a, b / 2);
    case "FRUSTUM": return Math.hypot(Math.max(a, b), c / 2);
    case "MESH": return mbsim.meshRadius(run, run.arrays.shape_looks[3 * k + 2]);
    default: return 0;
  }
};

// Box along a shape's own axes: its middle and half its edges.
mbsim.localBox = function (run, k) {
  const [a, b, c] = run.arrays.shape_size.subarray(7 * k, 7 * k + 3);
  const around = (half) => ({ middle: [0, 0, 0], half });
  switch (run.about.shapes[k].shape) {
    case "SPHERE": return around([a, a, a]);
    case "ELLIPSOID": return around([a, b, c]);
    case "BOX": return around([a / 2, b / 2, c / 2]);
    case "CYLINDER": return around([a, a, b / 2]);
    case "FRUSTUM": return around([Math.max(a, b), Math.max(a, b), c / 2]);
    case "MESH": return mbsim.meshBox(run, run.arrays.shape_looks[3 * k + 2]);
    default: return around([0, 0, 0]);
  }
};

mbsim.meshBox = function (run, mesh) {
  run.boxes = run.boxes || new Map();
  if (!run.boxes.has(mesh)) {
    run.vertexData = run.vertexData || mbsim.unpack.together(run.arrays.vertices, Float32Array);
    const [vertex, vertices] = run.arrays.meshes.subarray(4 * mesh, 4 * mesh + 2);
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let v = 3 * vertex; v < 3 * (vertex + vertices); v += 1) {
      low[v % 3] = Math.min(low[v % 3], run.vertexData[v]);
      high[v % 3] = Math.max(high[v % 3], run.vertexData[v]);
    }
    run.boxes.set(mesh, {
      middle: low.map((x, c) => 0.5 * (x + high[c])), half: low.map((x, c) => 0.5 * (high[c] - x)),
    });
  }
  return run.boxes.get(mesh);
};

// Distance of a mesh's farthest vertex from its origin.
mbsim.meshRadius = function (run, mesh) {
  run.vertexData = run.vertexData || mbsim.unpack.together(run.arrays.vertices, Float32Array);
  const [vertex, vertices] = run.arrays.meshes.subarray(4 * mesh, 4 * mesh + 2);
  let far = 0;
  for (let v = 3 * vertex; v < 3 * (vertex + vertices); v += 3) {
    far = Math.max(far, Math.hypot(run.vertexData[v], run.vertexData[v + 1], run.vertexData[v + 2]));
  }
  return far;
};

// Shapes of bodies: one instanced mesh for all of a kind, moved by one matrix each.
mbsim.shapes = (function () {
  const CREASE = Math.cos(35 * Math.PI / 180);

  // Light and dark parts by which a round body is seen to turn: octants, or sectors about z.
  function marked(material, how) {
    material.onBeforeCompile = function (shader) {
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec3 vInBody;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvInBody = position;");
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", "#include <common>\nvarying vec3 vInBody;")
        .replace("#include <color_fragment>", `#include <color_fragment>
          vec3 side = clamp(vInBody / max(fwidth(vInBody), 1e-6), -1.0, 1.0);
          diffuseColor.rgb *= 0.80 + 0.20 * ${how === "octants" ? "side.x * side.y * side.z" : "side.x * side.y"};`);
    };
    material.customProgramCacheKey = () => "mbsim-" + how;
    return material;
  }

  // Lines of a grid on the faces of a large box that stands still.
  function gridded(material, cell) {
    material.onBeforeCompile = function (shader) {
      shader.uniforms.cell = { value: cell };
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec3 vInBox;\nvarying vec3 vFace;")
        .replace("#include <begin_vertex>", `#include <begin_vertex>
          vInBox = position * vec3(length(instanceMatrix[0].xyz), length(instanceMatrix[1].xyz), length(instanceMatrix[2].xyz));
          vFace = abs(normal);`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>
          varying vec3 vInBox;
          varying vec3 vFace;
          uniform float cell;
          float lines(float size) {
            vec3 u = vInBox / size, wide = max(fwidth(u), 1e-6);
            vec3 off = abs(fract(u - 0.5) - 0.5) / wide + 10.0 * step(0.5, vFace);
            return (1.0 - min(min(off.x, min(off.y, off.z)), 1.0)) * (1.0 - smoothstep(0.15, 0.6, max(wide.x, max(wide.y, wide.z))));
          }`)
        .replace("#include <color_fragment>", `#include <color_fragment>
          diffuseColor.rgb *= 1.0 - max(0.14 * lines(cell), 0.3 * lines(5.0 * cell));`);
    };
    material.customProgramCacheKey = () => "mbsim-floor";
    return material;
  }

  function material(how, look) {
    const made = mbsim.lit.material({ color: 0xffffff }, how === "floor" ? 0.95 : 0.48, 0.08);
    if (look.ghost) { Object.assign(made, { transparent: true, opacity: 0.42, depthWrite: false }); }
    if (how === "mesh") { made.side = THREE.DoubleSide; }
    if (how === "floor") { return gridded(made, look.cell); }
    return how === "octants" || how === "sectors" ? marked(made, how) : made;
  }

  // Triangles with a normal at each corner: that of faces around it which bend by less than CREASE.
  function meshGeometry(vertices, faces) {
    const count = faces.length / 3;
    // of each face, twice its area as long; and of length 1
    const normals = new Float32Array(3 * count), units = new Float32Array(3 * count);
    for (let f = 0; f < 3 * count; f += 3) {
      const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
      const ux = vertices[b] - vertices[a], uy = vertices[b + 1] - vertices[a + 1], uz = vertices[b + 2] - vertices[a + 2];
      const vx = vertices[c] - vertices[a], vy = vertices[c + 1] - vertices[a + 1], vz = vertices[c + 2] - vertices[a + 2];
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      const size = Math.sqrt(x * x + y * y + z * z) || 1;
      normals[f] = x; normals[f + 1] = y; normals[f + 2] = z;
      units[f] = x / size; units[f + 1] = y / size; units[f + 2] = z / size;
    }
    const first = new Uint32Array(vertices.length / 3 + 1);
    for (const vertex of faces) { first[vertex + 1] += 1; }
    for (let k = 1; k < first.length; k += 1) { first[k] += first[k - 1]; }
    const corners = new Uint32Array(faces.length), filled = first.slice();
    for (let k = 0; k < faces.length; k += 1) { corners[filled[faces[k]]++] = k; }
    // corners of a vertex with the same normal are one: a third of them, or less, is left to be drawn
    const position = new Float32Array(9 * count), normal = new Float32Array(9 * count), index = new Uint32Array(faces.length);
    let made = 0;
    for (let vertex = 0; vertex + 1 < first.length; vertex += 1) {
      // faces of a fan, as of a gear's end, are of one plane: what was found last is theirs too
      const begin = made;
      let last = -1, at = 0;
      for (let m = first[vertex]; m < first[vertex + 1]; m += 1) {
        const k = corners[m], f = k - k % 3;
        const nx = units[f], ny = units[f + 1], nz = units[f + 2];
        if (last < 0 || nx !== units[last] || ny !== units[last + 1] || nz !== units[last + 2]) {
          let x = 0, y = 0, z = 0;
          for (let n = first[vertex]; n < first[vertex + 1]; n += 1) {
            const g = corners[n] - corners[n] % 3;
            if (nx * units[g] + ny * units[g + 1] + nz * units[g + 2] < CREASE) { continue; }
            x += normals[g]; y += normals[g + 1]; z += normals[g + 2];
          }
          const size = Math.sqrt(x * x + y * y + z * z) || 1;
          x /= size; y /= size; z /= size;
          last = f;
          for (at = begin; at < made; at += 1) {
            const alike = x * normal[3 * at] + y * normal[3 * at + 1] + z * normal[3 * at + 2];
            if (alike > 1 - 1e-6) { break; }
          }
          if (at === made) {
            for (let c = 0; c < 3; c += 1) { position[3 * at + c] = vertices[3 * vertex + c]; }
            normal[3 * at] = x; normal[3 * at + 1] = y; normal[3 * at + 2] = z;
            made += 1;
          }
        }
        index[k] = at;
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position.slice(0, 3 * made), 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal.slice(0, 3 * made), 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return geometry;
  }

  // Sides of round bodies, even: a ball of n sides has n * n triangles.
  function sidesOf(count) {
    const most = mbsim.lit.slow ? 1e5 : 6e5;
    return 2 * Math.round(0.5 * Math.min(56, Math.max(10, Math.sqrt(most / Math.max(count, 1)))));
  }

  // Geometry of a kind of shape, how it is marked, and the scale of a shape's instance.
  function kindOf(run, k, round, look) {
    const size = run.arrays.shape_size.subarray(7 * k, 7 * k + 3);
    const [a, b, c] = size;
    switch (run.about.shapes[k].shape) {
      case "SPHERE": return { key: "ball", how: "octants", scale: [a, a, a], make: () => new THREE.SphereGeometry(1, round, round / 2) };
      case "ELLIPSOID": return { key: "ball", how: "octants", scale: [a, b, c], make: () => new THREE.SphereGeometry(1, round, round / 2) };
      case "BOX": return look.floor && run.about.shapes[k].body < 0 ? { key: "floor", how: "floor", scale: [a, b, c], make: () => new THREE.BoxGeometry(1, 1, 1) } : { key: "box", how: "plain", scale: [a, b, c], make: () => new THREE.BoxGeometry(1, 1, 1) };
      case "CYLINDER": return { key: "cylinder", how: "sectors", scale: [a, a, b], make: () => new THREE.CylinderGeometry(1, 1, 1, round).rotateX(Math.PI / 2) };
      case "FRUSTUM": return { key: `frustum ${a} ${b} ${c}`, how: "sectors", scale: [1, 1, 1], make: () => new THREE.CylinderGeometry(b, a, c, round).rotateX(Math.PI / 2) };
      case "MESH": {
        const mesh = run.arrays.shape_looks[3 * k + 2];
        return { key: `mesh ${mesh}`, how: "mesh", scale: [1, 1, 1], make: () => meshOf(run, mesh) };
      }
      default: return null; // planes are the ground's
    }
  }

  function meshOf(run, mesh) {
    if (!run.meshData) {
      const folded = mbsim.unpack.together(run.arrays.faces, Uint32Array);
      const faces = new Uint32Array(folded.length);
      let value = 0;
      folded.forEach((step, k) => { value += step % 2 === 1 ? -(step + 1) / 2 : step / 2; faces[k] = value; });
      run.meshData = { vertices: mbsim.unpack.together(run.arrays.vertices, Float32Array), faces };
    }
    const [vertex, vertices, face, faces] = run.arrays.meshes.subarray(4 * mesh, 4 * mesh + 4);
    return meshGeometry(
      run.meshData.vertices.subarray(3 * vertex, 3 * (vertex + vertices)),
      run.meshData.faces.subarray(3 * face, 3 * (face + faces)),
    );
  }

  function bodyColor(run, body) {
    const { palette, fixed } = run.about;
    return body < 0 ? fixed : palette[body % palette.length];
  }

  function colorOf(run, k, look) {
    if (look.tint !== undefined) { return look.tint; }
    const given = run.arrays.shape_looks[3 * k];
    if (given >= 0) { return given; }
    return bodyColor(run, run.about.shapes[k].body);
  }

  // Product of quaternions (w, x, y, z), the first of an array at an index.
  function fill(matrix, at, run, body, pose, scale) {
    let w = pose[3], x = pose[4], y = pose[5], z = pose[6];
    let px, py, pz;
    if (body >= 0) {
      const q = run.q, i = 4 * body;
      const a = q[i], b = q[i + 1], c = q[i + 2], d = q[i + 3];
      const W = a * w - b * x - c * y - d * z, X = a * x + b * w + c * z - d * y;
      const Y = a * y - b * z + c * w + d * x, Z = a * z + b * y - c * x + d * w;
      const lx = pose[0], ly = pose[1], lz = pose[2];
      const ux = c * lz - d * ly + a * lx, uy = d * lx - b * lz + a * ly, uz = b * ly - c * lx + a * lz;
      px = run.p[3 * body] + lx + 2 * (c * uz - d * uy);
      py = run.p[3 * body + 1] + ly + 2 * (d * ux - b * uz);
      pz = run.p[3 * body + 2] + lz + 2 * (b * uy - c * ux);
      w = W; x = X; y = Y; z = Z;
    } else {
      const o = run.about.centre;
      px = pose[0] - o[0]; py = pose[1] - o[1]; pz = pose[2] - o[2];
    }
    const [sx, sy, sz] = scale;
    matrix[at] = (1 - 2 * (y * y + z * z)) * sx;
    matrix[at + 1] = 2 * (x * y + w * z) * sx;
    matrix[at + 2] = 2 * (x * z - w * y) * sx;
    matrix[at + 3] = 0;
    matrix[at + 4] = 2 * (x * y - w * z) * sy;
    matrix[at + 5] = (1 - 2 * (x * x + z * z)) * sy;
    matrix[at + 6] = 2 * (y * z + w * x) * sy;
    matrix[at + 7] = 0;
    matrix[at + 8] = 2 * (x * z + w * y) * sz;
    matrix[at + 9] = 2 * (y * z - w * x) * sz;
    matrix[at + 10] = (1 - 2 * (x * x + y * y)) * sz;
    matrix[at + 11] = 0;
    matrix[at + 12] = px; matrix[at + 13] = py; matrix[at + 14] = pz; matrix[at + 15] = 1;
  }

  // All shapes of a run as children of `group`; `look`: {ghost, tint}.
  class Shapes {
    constructor(run, group, look) {
      this.run = run;
      this.look = look;
      const shapes = run.about.shapes, sets = new Map();
      const round = sidesOf(shapes.length);
      shapes.forEach((shape, k) => {
        const kind = kindOf(run, k, round, look);
        if (!kind) { return; }
        if (!sets.has(kind.key)) { sets.set(kind.key, { kind, members: [] }); }
        sets.get(kind.key).members.push({ shape: k, body: shape.body, scale: kind.scale, pose: run.arrays.shape_pose.subarray(7 * k, 7 * k + 7) });
      });
      this.addSticks(sets, round);
      this.meshes = [];
      this.triangles = 0;
      const color = new THREE.Color();
      for (const { kind, members } of sets.values()) {
        const geometry = kind.make();
        const mesh = new THREE.InstancedMesh(geometry, material(kind.how, look), members.length);
        mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
        mesh.frustumCulled = false;
        mesh.castShadow = !look.ghost;
        mesh.receiveShadow = !look.ghost;
        mesh.userData.members = members;
        members.forEach((member, i) => mesh.setColorAt(i, color.set(this.colorOf(member))));
        this.triangles += members.length * (geometry.index || geometry.attributes.position).count / 3;
        this.meshes.push(mesh);
        group.add(mesh);
      }
      this.showHidden = false;
    }

    colorOf(member) {
      if (this.look.tint !== undefined) { return this.look.tint; }
      return member.shape < 0 ? bodyColor(this.run, member.body) : colorOf(this.run, member.shape, this.look);
    }

    // Rods from the centre of a body to what belongs to it: markers at which something holds or
    // pushes it, and centres of shapes, where no shape covers both ends. So links are seen.
    addSticks(sets, round) {
      const { run } = this, own = new Map(), ends = new Map();
      const listOf = (map, body) => { if (!map.has(body)) { map.set(body, []); } return map.get(body); };
      run.about.shapes.forEach((shape, k) => {
        if (shape.body < 0) { return; }
        listOf(own, shape.body).push({ p: [...run.arrays.shape_pose.subarray(7 * k, 7 * k + 3)], far: 1.02 * mbsim.radiusOf(run, k) });
      });
      for (const [body, shapes] of own) {
        if (shapes.length <= 24) { listOf(ends, body).push(...shapes.map((shape) => shape.p)); }
      }
      for (const connection of run.about.connections) {
        for (const marker of [connection.i, connection.j]) {
          const body = marker < 0 ? -1 : run.about.markers[marker][1];
          if (body >= 0) { listOf(ends, body).push([...run.arrays.marker_pose.subarray(7 * marker, 7 * marker + 3)]); }
        }
      }
      const balls = [], rods = [], wide = this.look.wide;
      const z = new THREE.Vector3(0, 0, 1), q = new THREE.Quaternion();
      for (const [body, points] of ends) {
        const shapes = own.get(body) || [];
        const covered = (p) => shapes.some((shape) => Math.hypot(...shape.p) < shape.far && Math.hypot(...p.map((x, c) => x - shape.p[c])) < shape.far);
        const seen = new Set();
        for (const p of points) {
          const length = Math.hypot(...p);
          if (seen.has(String(p)) || length < 1e-6 * run.about.size || covered(p)) { continue; }
          seen.add(String(p));
          q.setFromUnitVectors(z, new THREE.Vector3(...p).divideScalar(length));
          rods.push({ shape: -1, body, pose: [p[0] / 2, p[1] / 2, p[2] / 2, q.w, q.x, q.y, q.z], scale: [wide, wide, length] });
          balls.push({ shape: -1, body, pose: [...p, 1, 0, 0, 0], scale: [wide, wide, wide] });
        }
        if (!shapes.length) { balls.push({ shape: -1, body, pose: [0, 0, 0, 1, 0, 0, 0], scale: [1.7 * wide, 1.7 * wide, 1.7 * wide] }); }
      }
      if (rods.length) { sets.set("rods", { kind: { how: "plain", make: () => new THREE.CylinderGeometry(1, 1, 1, 20).rotateX(Math.PI / 2) }, members: rods }); }
      if (balls.length) { sets.set("rod ends", { kind: { how: "plain", make: () => new THREE.SphereGeometry(1, round, round / 2) }, members: balls }); }
    }

    update() {
      for (const mesh of this.meshes) {
        const matrix = mesh.instanceMatrix.array, members = mesh.userData.members;
        for (let i = 0; i < members.length; i += 1) {
          const { shape, body, pose, scale } = members[i];
          if (shape >= 0 && this.run.arrays.shape_looks[3 * shape + 1] && !this.showHidden) {
            matrix.fill(0, 16 * i, 16 * i + 16); // of no size
          } else {
            fill(matrix, 16 * i, this.run, body, pose, scale);
          }
        }
        mesh.instanceMatrix.needsUpdate = true;
      }
    }

    // Let the shapes of one body (by index, null: none) be brighter.
    highlight(body) {
      const color = new THREE.Color(), white = new THREE.Color(0xffffff);
      for (const mesh of this.meshes) {
        mesh.userData.members.forEach((member, i) => {
          color.set(this.colorOf(member));
          if (body !== null && member.body === body) { color.lerp(white, 0.45); }
          mesh.setColorAt(i, color);
        });
        mesh.instanceColor.needsUpdate = true;
      }
    }

    // The nearest shape that a ray meets: {distance, shape, body}.
    hit(raycaster) {
      let best = null;
      for (const mesh of this.meshes) {
        mesh.boundingSphere = null;
        for (const found of raycaster.intersectObject(mesh, false)) {
          if (!best || found.distance < best.distance) {
            const member = mesh.userData.members[found.instanceId];
            best = { distance: found.distance, shape: member.shape, body: member.body };
          }
        }
      }
      return best;
    }
  }
  return { Shapes, bodyColor, fill };
})();
