"use strict";
// What has no surface: joints and forces between markers, axes of markers, paths of bodies.
mbsim.extras = (function () {
  const AXES = [0xe0524a, 0x53a653, 0x4a7fe0];
  const JOINT = 0xf2b134, LINE = 0x9b6bd3;
  const ROUND = ["SPHERICAL", "UNIVERSAL", "HOOKE", "CONSTANT_VELOCITY"];

  function glyph(type) {
    if (ROUND.includes(type)) { return new THREE.SphereGeometry(0.7, 20, 14); }
    if (["REVOLUTE", "CYLINDRICAL", "SCREW"].includes(type)) { return new THREE.CylinderGeometry(0.55, 0.55, 2.4, 24).rotateX(Math.PI / 2); }
    if (["TRANSLATIONAL", "INLINE"].includes(type)) { return new THREE.BoxGeometry(0.7, 0.7, 3); }
    if (["PLANAR", "INPLANE"].includes(type)) { return new THREE.BoxGeometry(2.2, 2.2, 0.15); }
    return new THREE.BoxGeometry(1, 1, 1);
  }

  const CONSTRAINTS = ["joints", "primitives"];

  class Extras {
    constructor(run, group, view) {
      this.run = run;
      this.size = 0.024 * view;
      this.joints = new THREE.Group();
      this.axes = new THREE.Group();
      this.lines = new THREE.Group();
      this.paths = new THREE.Group();
      this.items = [];
      const segments = [];
      for (const connection of run.about.connections) {
        if (connection.i < 0) { continue; }
        if (CONSTRAINTS.includes(connection.group)) {
          const material = mbsim.lit.material({ color: JOINT, depthTest: false, transparent: true, opacity: 0.9 }, 0.4, 0);
          const mesh = new THREE.Mesh(glyph(connection.type), material);
          mesh.matrixAutoUpdate = false;
          mesh.renderOrder = 2;
          this.joints.add(mesh);
          this.items.push({ mesh, marker: connection.i });
        } else if (connection.j >= 0 && connection.group !== "motions") {
          segments.push([connection.i, connection.j]);
        }
      }
      this.segments = segments;
      const line = new THREE.BufferGeometry();
      line.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * segments.length), 3));
      this.links = new THREE.LineSegments(line, new THREE.LineBasicMaterial({ color: LINE, depthTest: false, transparent: true }));
      this.links.frustumCulled = false;
      this.links.renderOrder = 2;
      this.lines.add(this.links);
      // the axes of up to so many markers
      this.shown = run.about.markers.slice(0, 4000).map((_, k) => k);
      const axes = new THREE.BufferGeometry(), colors = [];
      for (let k = 0; k < this.shown.length; k += 1) {
        for (const hex of AXES) { const c = new THREE.Color(hex); colors.push(c.r, c.g, c.b, c.r, c.g, c.b); }
      }
      axes.setAttribute("position", new THREE.BufferAttribute(new Float32Array(18 * this.shown.length), 3));
      axes.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
      this.triads = new THREE.LineSegments(axes, new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false, transparent: true }));
      this.triads.frustumCulled = false;
      this.triads.renderOrder = 2;
      this.axes.add(this.triads);
      this.axes.visible = false;
      group.add(this.joints, this.lines, this.axes, this.paths);
      this.traced = new Map();
    }

    // Let the paths of these bodies (indices) be shown.
    trace(bodies) {
      for (const [body, line] of this.traced) {
        if (!bodies.includes(body)) { this.paths.remove(line); line.geometry.dispose(); this.traced.delete(body); }
      }
      for (const body of bodies) {
        if (this.traced.has(body)) { continue; }
        const points = new Float32Array(3 * this.run.rows), at = [0, 0, 0];
        for (let row = 0; row < this.run.rows; row += 1) { points.set(this.run.positionAt(row, body, at), 3 * row); }
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
        const color = mbsim.shapes.bodyColor(this.run, body);
        const line = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color, transparent: true, opacity: 0.9 }));
        line.frustumCulled = false;
        this.paths.add(line);
        this.traced.set(body, line);
      }
    }

    update() {
      const { run, size } = this, matrix = new Float32Array(16), into = [0, 0, 0];
      if (this.joints.visible) {
        for (const { mesh, marker } of this.items) {
          const body = run.about.markers[marker][1];
          mbsim.shapes.fill(matrix, 0, run, body, run.arrays.marker_pose.subarray(7 * marker, 7 * marker + 7), [size, size, size]);
          mesh.matrix.fromArray(matrix);
          mesh.matrixWorldNeedsUpdate = true;
        }
      }
      if (this.lines.visible && this.segments.length) {
        const points = this.links.geometry.attributes.position;
        this.segments.forEach(([i, j], k) => {
          [i, j].forEach((marker, end) => {
            const pose = run.arrays.marker_pose.subarray(7 * marker, 7 * marker + 3);
            points.array.set(run.place(run.about.markers[marker][1], pose[0], pose[1], pose[2], into), 6 * k + 3 * end);
          });
        });
        points.needsUpdate = true;
      }
      if (this.axes.visible) {
        const points = this.triads.geometry.attributes.position, s = 2 * size;
        this.shown.forEach((marker, k) => {
          const pose = run.arrays.marker_pose.subarray(7 * marker, 7 * marker + 7);
          mbsim.shapes.fill(matrix, 0, run, run.about.markers[marker][1], pose, [s, s, s]);
          for (let axis = 0; axis < 3; axis += 1) {
            for (let c = 0; c < 3; c += 1) {
              points.array[18 * k + 6 * axis + c] = matrix[12 + c];
              points.array[18 * k + 6 * axis + 3 + c] = matrix[12 + c] + matrix[4 * axis + c];
            }
          }
        });
        points.needsUpdate = true;
      }
      for (const line of this.traced.values()) { line.geometry.setDrawRange(0, run.row + 1); }
    }
  }
  return { Extras };
})();
