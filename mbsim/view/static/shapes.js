"use strict";
// Shapes of bodies: one instanced mesh for all of a kind, moved by one matrix each.
mbsim.shapes = (function () {
  const COLORS = [0x3f7fd0, 0xe0813a, 0x4fa66a, 0xc9556b, 0x8a6fc4, 0x3aa6a6, 0xd0a52f, 0x9a7b5f, 0xd57fb0, 0x7d93ab];
  const FIXED = 0x9aa4ad;
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

  function material(how, look) {
    const made = new THREE.MeshStandardMaterial({ color: 0xffffff, roughness: 0.48, metalness: 0.08 });
    if (look.ghost) { Object.assign(made, { transparent: true, opacity: 0.42, depthWrite: false }); }
    if (how === "mesh") { made.side = THREE.DoubleSide; }
    return how === "octants" || how === "sectors" ? marked(made, how) : made;
  }

  // Triangles with a normal at each corner: that of faces around it which bend by less than CREASE.
  function meshGeometry(vertices, faces) {
    const count = faces.length / 3;
    const normals = new Float32Array(3 * count);
    for (let f = 0; f < count; f += 1) {
      const a = 3 * faces[3 * f], b = 3 * faces[3 * f + 1], c = 3 * faces[3 * f + 2];
      const ux = vertices[b] - vertices[a], uy = vertices[b + 1] - vertices[a + 1], uz = vertices[b + 2] - vertices[a + 2];
      const vx = vertices[c] - vertices[a], vy = vertices[c + 1] - vertices[a + 1], vz = vertices[c + 2] - vertices[a + 2];
      normals[3 * f] = uy * vz - uz * vy;
      normals[3 * f + 1] = uz * vx - ux * vz;
      normals[3 * f + 2] = ux * vy - uy * vx;
    }
    const first = new Uint32Array(vertices.length / 3 + 1);
    for (const vertex of faces) { first[vertex + 1] += 1; }
    for (let k = 1; k < first.length; k += 1) { first[k] += first[k - 1]; }
    const of = new Uint32Array(faces.length), filled = first.slice();
    faces.forEach((vertex, k) => { of[filled[vertex]] = Math.floor(k / 3); filled[vertex] += 1; });
    const position = new Float32Array(9 * count), normal = new Float32Array(9 * count);
    for (let k = 0; k < faces.length; k += 1) {
      const vertex = faces[k], f = Math.floor(k / 3);
      const nx = normals[3 * f], ny = normals[3 * f + 1], nz = normals[3 * f + 2];
      const own = Math.hypot(nx, ny, nz) || 1;
      let x = 0, y = 0, z = 0;
      for (let m = first[vertex]; m < first[vertex + 1]; m += 1) {
        const g = 3 * of[m];
        const length = Math.hypot(normals[g], normals[g + 1], normals[g + 2]) || 1;
        if (nx * normals[g] + ny * normals[g + 1] + nz * normals[g + 2] < CREASE * own * length) { continue; }
        x += normals[g]; y += normals[g + 1]; z += normals[g + 2];
      }
      const size = Math.hypot(x, y, z) || 1;
      position.set([vertices[3 * vertex], vertices[3 * vertex + 1], vertices[3 * vertex + 2]], 3 * k);
      normal.set([x / size, y / size, z / size], 3 * k);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    return geometry;
  }

  // Geometry of a kind of shape, how it is marked, and the scale of a shape's instance.
  function kindOf(run, k, round) {
    const size = run.arrays.shape_size.subarray(7 * k, 7 * k + 3);
    const [a, b, c] = size;
    switch (run.about.shapes[k].shape) {
      case "SPHERE": return { key: "ball", how: "octants", scale: [a, a, a], make: () => new THREE.SphereGeometry(1, round, round / 2) };
      case "ELLIPSOID": return { key: "ball", how: "octants", scale: [a, b, c], make: () => new THREE.SphereGeometry(1, round, round / 2) };
      case "BOX": return { key: "box", how: "plain", scale: [a, b, c], make: () => new THREE.BoxGeometry(1, 1, 1) };
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

  function colorOf(run, k, look) {
    if (look.tint !== undefined) { return look.tint; }
    const given = run.arrays.shape_looks[3 * k];
    if (given >= 0) { return given; }
    const body = run.about.shapes[k].body;
    return body < 0 ? FIXED : COLORS[body % COLORS.length];
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
      const round = shapes.length > 3000 ? 14 : shapes.length > 400 ? 24 : 56;
      shapes.forEach((shape, k) => {
        const kind = kindOf(run, k, round);
        if (!kind) { return; }
        if (!sets.has(kind.key)) { sets.set(kind.key, { kind, members: [] }); }
        sets.get(kind.key).members.push({ shape: k, body: shape.body, scale: kind.scale, pose: run.arrays.shape_pose.subarray(7 * k, 7 * k + 7) });
      });
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
        members.forEach((member, i) => mesh.setColorAt(i, color.set(colorOf(run, member.shape, look))));
        this.triangles += members.length * (geometry.index || geometry.attributes.position).count / 3;
        this.meshes.push(mesh);
        group.add(mesh);
      }
      this.showHidden = false;
    }

    update() {
      for (const mesh of this.meshes) {
        const matrix = mesh.instanceMatrix.array, members = mesh.userData.members;
        for (let i = 0; i < members.length; i += 1) {
          const { shape, body, pose, scale } = members[i];
          if (this.run.arrays.shape_looks[3 * shape + 1] && !this.showHidden) {
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
          color.set(colorOf(this.run, member.shape, this.look));
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
  return { Shapes, COLORS, fill };
})();
