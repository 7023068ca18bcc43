"use strict";
// Points of contact as dots, and forces there as arrows, coloured by slip or pressure.
mbsim.Contacts = (function () {
  // Colours from little to much: blue, teal, yellow, orange, red.
  const SCALE = [0x4a78dc, 0x2fa3bd, 0x7cc36a, 0xf2c14e, 0xec7a33, 0xc9302c].map((hex) => new THREE.Color(hex));

  function colorAt(share, into) {
    const at = Math.min(1, Math.max(0, share)) * (SCALE.length - 1);
    const k = Math.min(SCALE.length - 2, Math.floor(at));
    return into.copy(SCALE[k]).lerp(SCALE[k + 1], at - k);
  }

  // The value below which a share of the numbers is.
  function quantile(numbers, share) {
    const sorted = Float64Array.from(numbers).filter((x) => x > 0 && Number.isFinite(x)).sort();
    return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : 0;
  }

  class Contacts {
    constructor(run, group, view) {
      this.run = run;
      this.view = view;
      this.by = "slip";
      this.scale = 1;
      const most = (first) => { let found = 0; for (let k = 1; k < first.length; k += 1) { found = Math.max(found, first[k] - first[k - 1]); } return found; };
      const instanced = (geometry, material, count) => {
        const mesh = new THREE.InstancedMesh(geometry, material, Math.max(1, count));
        mesh.frustumCulled = false;
        mesh.count = 0;
        mesh.renderOrder = 3;
        group.add(mesh);
        return mesh;
      };
      const plain = () => new THREE.MeshBasicMaterial({ color: 0xffffff, depthTest: false, transparent: true, toneMapped: false });
      this.dots = instanced(new THREE.SphereGeometry(1, 12, 8), plain(), most(run.dots.first));
      this.dots.material.color.set(0xe8413c);
      const count = most(run.arrows.first);
      const shaft = new THREE.CylinderGeometry(1, 1, 1, 10).translate(0, 0.5, 0);
      const head = new THREE.ConeGeometry(1, 1, 16).translate(0, 0.5, 0);
      this.shafts = instanced(shaft, plain(), count);
      this.heads = instanced(head, plain(), count);
      this.sizes = new Float64Array(run.arrowForce.length / 3);
      for (let k = 0; k < this.sizes.length; k += 1) {
        this.sizes[k] = Math.hypot(run.arrowForce[3 * k], run.arrowForce[3 * k + 1], run.arrowForce[3 * k + 2]);
      }
      this.typical = quantile(this.sizes, 0.5) || 1;
      this.pressures = Float64Array.from(this.sizes, (force, k) => (run.arrowArea[k] > 0 ? force / run.arrowArea[k] : 0));
      this.hasArea = this.pressures.some((p) => p > 0);
      this.most = { slip: quantile(run.arrowSlip, 0.98) || 1, force: quantile(this.sizes, 0.98) || 1, pressure: quantile(this.pressures, 0.98) || 1 };
    }

    valueOf(k) {
      if (this.by === "slip") { return this.run.arrowSlip[k]; }
      return this.by === "pressure" && this.hasArea ? this.pressures[k] : this.sizes[k];
    }

    get top() { return this.most[this.by === "pressure" && !this.hasArea ? "force" : this.by]; }

    update(showDots, showArrows) {
      const { run, view } = this, step = run.about.step, row = run.row;
      const matrix = new THREE.Matrix4(), p = new THREE.Vector3(), q = new THREE.Quaternion(), s = new THREE.Vector3();
      const first = run.dots.first[row], last = run.dots.first[row + 1];
      const many = last - first > 200;
      const size = view * (many ? 0.006 : 0.011);
      this.dots.count = showDots ? last - first : 0;
      for (let k = 0; k < this.dots.count; k += 1) {
        const at = 3 * (first + k);
        p.set(run.dots.steps[at] * step, run.dots.steps[at + 1] * step, run.dots.steps[at + 2] * step);
        this.dots.setMatrixAt(k, matrix.makeScale(size, size, size).setPosition(p));
      }
      this.dots.instanceMatrix.needsUpdate = true;
      const begin = run.arrows.first[row], end = run.arrows.first[row + 1];
      this.shafts.count = this.heads.count = showArrows ? end - begin : 0;
      const y = new THREE.Vector3(0, 1, 0), way = new THREE.Vector3(), color = new THREE.Color();
      for (let k = 0; k < this.shafts.count; k += 1) {
        const at = begin + k;
        way.set(run.arrowForce[3 * at], run.arrowForce[3 * at + 1], run.arrowForce[3 * at + 2]);
        const force = this.sizes[at];
        // as long as half the view at most: an impact is a thousand weights
        const length = view * Math.min(0.9, 0.3 * this.scale * force / this.typical) || 0;
        const wide = Math.min(view * 0.0085, 0.10 * length) * (many ? 0.6 : 1);
        q.setFromUnitVectors(y, way.multiplyScalar(force > 0 ? 1 / force : 0));
        p.set(run.arrows.steps[3 * at] * step, run.arrows.steps[3 * at + 1] * step, run.arrows.steps[3 * at + 2] * step);
        const head = Math.min(4.2 * wide, 0.5 * length);
        this.shafts.setMatrixAt(k, matrix.compose(p, q, s.set(wide, Math.max(0, length - head), wide)));
        p.addScaledVector(way, length - head);
        this.heads.setMatrixAt(k, matrix.compose(p, q, s.set(2.4 * wide, head, 2.4 * wide)));
        colorAt(this.valueOf(at) / this.top, color);
        this.shafts.setColorAt(k, color);
        this.heads.setColorAt(k, color);
      }
      for (const mesh of [this.shafts, this.heads]) {
        mesh.instanceMatrix.needsUpdate = true;
        if (mesh.instanceColor) { mesh.instanceColor.needsUpdate = true; }
      }
    }
  }
  Contacts.colorAt = colorAt;
  return Contacts;
})();
