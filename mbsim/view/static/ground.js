"use strict";
// Planes: those of the deck, each cut off where another one is its wall, else a grid to see by.
mbsim.ground = (function () {
  // Lines of a grid that fade towards the rim, on a material that takes light and shadow.
  function gridMaterial(look) {
    const made = mbsim.lit.material({ color: look.paper, transparent: true }, 0.95, 0);
    made.userData.uniforms = {
      cell: { value: look.cell }, ink: { value: new THREE.Color(look.ink) },
      middle: { value: new THREE.Vector3() }, rim: { value: look.rim },
    };
    made.onBeforeCompile = function (shader) {
      Object.assign(shader.uniforms, made.userData.uniforms);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute vec2 onPlane;\nvarying vec2 vOnPlane;\nvarying vec3 vAt;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvOnPlane = onPlane;\nvAt = (modelMatrix * vec4(position, 1.0)).xyz;");
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>
          varying vec2 vOnPlane;
          varying vec3 vAt;
          uniform float cell, rim;
          uniform vec3 ink, middle;
          float lines(float size) {
            vec2 u = vOnPlane / size;
            vec2 wide = max(fwidth(u), 1e-6);
            vec2 off = abs(fract(u - 0.5) - 0.5) / wide;
            float near = 1.0 - min(min(off.x, off.y), 1.0);
            return near * (1.0 - smoothstep(0.15, 0.6, max(wide.x, wide.y)));
          }`)
        .replace("#include <color_fragment>", `#include <color_fragment>
          diffuseColor.rgb = mix(diffuseColor.rgb, ink, max(0.34 * lines(cell), 0.75 * lines(5.0 * cell)));
          float far = distance(vAt, middle) / rim;
          diffuseColor.a *= 1.0 - smoothstep(0.35, 1.0, far);`);
    };
    return made;
  }

  // A polygon of a plane as a fan of triangles; `corners` are [u, v] along its axes.
  function polygon(plane, corners, material) {
    const position = [], onPlane = [], normal = [], index = [];
    for (const [u, v] of corners) {
      for (let c = 0; c < 3; c += 1) { position.push(plane.p[c] + u * plane.x[c] + v * plane.y[c]); }
      onPlane.push(u, v);
      normal.push(...plane.z);
    }
    for (let k = 1; k + 1 < corners.length; k += 1) { index.push(0, k, k + 1); }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(normal, 3));
    geometry.setAttribute("onPlane", new THREE.Float32BufferAttribute(onPlane, 2));
    geometry.setIndex(index);
    const mesh = new THREE.Mesh(geometry, material);
    mesh.receiveShadow = true;
    mesh.renderOrder = -1;
    return mesh;
  }

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  // What of a polygon is on the free side of another plane.
  function clipped(plane, corners, other) {
    const side = ([u, v]) => {
      const at = [0, 1, 2].map((c) => plane.p[c] + u * plane.x[c] + v * plane.y[c] - other.p[c]);
      return dot(at, other.z);
    };
    const found = [];
    corners.forEach((corner, k) => {
      const next = corners[(k + 1) % corners.length];
      const a = side(corner), b = side(next);
      if (a >= 0) { found.push(corner); }
      if ((a >= 0) !== (b >= 0)) {
        const s = a / (a - b);
        found.push([corner[0] + s * (next[0] - corner[0]), corner[1] + s * (next[1] - corner[1])]);
      }
    });
    return found;
  }

  // The planes of a run that stand still: origin from `about.centre`, axes, bounds.
  function planesOf(run) {
    const found = [];
    run.about.shapes.forEach((shape, k) => {
      if (shape.shape !== "PLANE") { return; }
      const pose = run.arrays.shape_pose.subarray(7 * k, 7 * k + 7);
      const matrix = new Float32Array(16);
      const body = shape.body;
      mbsim.shapes.fill(matrix, 0, run, body, pose, [1, 1, 1]);
      found.push({
        shape: k, body,
        p: [...matrix.slice(12, 15)], x: [...matrix.slice(0, 3)], y: [...matrix.slice(4, 7)], z: [...matrix.slice(8, 11)],
        bounds: [...run.arrays.shape_size.subarray(7 * k + 3, 7 * k + 7)],
      });
    });
    return found;
  }

  // Corners of a plane's picture: its bounds, else a square around the scene, cut by other planes.
  function cornersOf(plane, others, middle, reach) {
    const [x0, x1, y0, y1] = plane.bounds;
    if (x1 > x0 && y1 > y0) { return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]; }
    const arm = [0, 1, 2].map((c) => middle[c] - plane.p[c]);
    const u = dot(arm, plane.x), v = dot(arm, plane.y);
    let corners = [[u - reach, v - reach], [u + reach, v - reach], [u + reach, v + reach], [u - reach, v + reach]];
    for (const other of others) {
      if (other !== plane && Math.abs(dot(other.z, plane.z)) < 0.99 && corners.length) { corners = clipped(plane, corners, other); }
    }
    return corners;
  }

  // Axes of a plane with a normal.
  function frameOf(normal) {
    const z = new THREE.Vector3(...normal).normalize();
    const x = new THREE.Vector3(Math.abs(z.x) < 0.9 ? 1 : 0, Math.abs(z.x) < 0.9 ? 0 : 1, 0);
    x.addScaledVector(z, -x.dot(z)).normalize();
    return { x: x.toArray(), y: new THREE.Vector3().crossVectors(z, x).toArray(), z: z.toArray() };
  }

  // How far a point is behind a plane.
  function depthOf(plane, at) {
    return dot(plane.p, plane.z) - dot(at, plane.z);
  }

  return { depthOf, gridMaterial, polygon, planesOf, cornersOf, frameOf };
})();
