"use strict";
// What a scene is seen by: renderer, light, ground, camera.
mbsim.Stage = (function () {
  const THEMES = {
    light: { top: 0xf4f6f9, bottom: 0xdfe5ec, paper: 0xf0f2f5, ink: 0x7d8996, ambient: 2.3, below: 0xb8b4ac, key: 2.2 },
    dark: { top: 0x1b2128, bottom: 0x0e1216, paper: 0x3a444f, ink: 0x7d8b99, ambient: 2.6, below: 0xa09c94, key: 2.2 },
  };

  // A round number of 1, 2 or 5 times a power of ten below a value.
  function nice(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    const lead = value / power;
    return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
  }

  // A box along the axes around all shapes, markers and centres of moving bodies at the time that
  // `run` shows, and around those of what stands still.
  function boxOf(run, fixed) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const matrix = new Float32Array(16);
    const add = (middle, half) => {
      for (let c = 0; c < 3; c += 1) {
        low[c] = Math.min(low[c], middle[c] - half[c]);
        high[c] = Math.max(high[c], middle[c] + half[c]);
      }
    };
    run.about.shapes.forEach((shape, k) => {
      if (shape.shape === "PLANE" || (shape.body < 0) !== fixed) { return; }
      const { middle, half } = mbsim.localBox(run, k);
      const pose = run.arrays.shape_pose.subarray(7 * k, 7 * k + 7);
      mbsim.shapes.fill(matrix, 0, run, shape.body, pose, [1, 1, 1]);
      const at = [0, 1, 2].map((c) => matrix[12 + c] + matrix[c] * middle[0] + matrix[4 + c] * middle[1] + matrix[8 + c] * middle[2]);
      add(at, [0, 1, 2].map((c) => Math.abs(matrix[c]) * half[0] + Math.abs(matrix[4 + c]) * half[1] + Math.abs(matrix[8 + c]) * half[2]));
    });
    if (!fixed) {
      for (let body = 0; body < run.bodies.length; body += 1) { add(run.p.subarray(3 * body, 3 * body + 3), [0, 0, 0]); }
      const at = [0, 0, 0];
      for (const connection of run.about.connections.slice(0, 2000)) {
        for (const marker of [connection.i, connection.j]) {
          if (marker < 0 || run.about.markers[marker][1] < 0) { continue; }
          const p = run.arrays.marker_pose.subarray(7 * marker, 7 * marker + 3);
          add(run.place(run.about.markers[marker][1], p[0], p[1], p[2], at), [0, 0, 0]);
        }
      }
    }
    return { low, high };
  }

  const halfOf = (low, high) => [0, 1, 2].map((c) => 0.5 * (high[c] - low[c]));

  // Boxes of what moves over all rows: where it gets to, and how large it is at once.
  function extent(run) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const together = [0, 0, 0], ways = [];
    const every = Math.max(1, Math.floor(run.rows / 60)), stride = Math.ceil(run.bodies.length / 200);
    const merge = (box) => {
      for (let c = 0; c < 3; c += 1) { low[c] = Math.min(low[c], box.low[c]); high[c] = Math.max(high[c], box.high[c]); }
    };
    for (let row = 0; row < run.rows; row += every) {
      run.set(run.time[row]);
      const box = boxOf(run, false), half = halfOf(box.low, box.high);
      merge(box);
      for (let c = 0; c < 3; c += 1) { together[c] = Math.max(together[c], half[c]); }
      for (let body = 0; body < run.bodies.length; body += stride) { ways.push([...run.p.subarray(3 * body, 3 * body + 3)]); }
    }
    run.set(run.start);
    const moving = Math.hypot(...halfOf(low, high)), fixed = boxOf(run, true);
    // a floor that is far larger is no part of what is looked at
    const near = fixed.low[0] <= fixed.high[0] && Math.hypot(...halfOf(fixed.low, fixed.high)) <= 2.5 * moving;
    if (near) { merge(fixed); }
    const half = halfOf(low, high);
    const radius = Math.hypot(...half) || run.about.size || 1;
    return { middle: [0, 1, 2].map((c) => 0.5 * (low[c] + high[c])), half, radius, low, high, together, largeFloor: !near, ways };
  }

  // The horizontal direction along which points are spread most.
  function widest(points, up) {
    const { x, y } = mbsim.ground.frameOf(up);
    let a = 0, b = 0, c = 0, mx = 0, my = 0;
    const flat = points.map((p) => [p[0] * x[0] + p[1] * x[1] + p[2] * x[2], p[0] * y[0] + p[1] * y[1] + p[2] * y[2]]);
    for (const [u, v] of flat) { mx += u / flat.length; my += v / flat.length; }
    for (const [u, v] of flat) { a += (u - mx) ** 2; b += (u - mx) * (v - my); c += (v - my) ** 2; }
    const angle = 0.5 * Math.atan2(2 * b, a - c);
    const spread = Math.hypot(a - c, 2 * b);
    if (!(spread > 1e-3 * (a + c))) { return null; }
    return [0, 1, 2].map((k) => Math.cos(angle) * x[k] + Math.sin(angle) * y[k]);
  }

  class Stage {
    constructor(canvas, run) {
      // where a processor draws, smooth edges of many triangles take it longer than all else
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !mbsim.lit.slow });
      // whether half the pixels in width and height are drawn, as they are there while things move
      this.coarse = mbsim.lit.slow;
      this.renderer.shadowMap.enabled = true;
      this.renderer.shadowMap.type = THREE.PCFShadowMap;
      this.renderer.toneMapping = THREE.NeutralToneMapping;
      this.renderer.toneMappingExposure = 1.05;
      this.scene = new THREE.Scene();
      // light from all around by a formula: a map of surroundings takes seconds where a processor draws
      this.sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 1);
      this.sky.position.set(...run.about.up);
      this.sun = new THREE.DirectionalLight(0xffffff, 2);
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(2048, 2048);
      this.sun.shadow.radius = 3;
      this.scene.add(this.sky, this.sun, this.sun.target);
      this.camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
      this.up = run.about.up;
      this.camera.up.set(...this.up);
      this.controls = new THREE.OrbitControls(this.camera, canvas);
      this.controls.enableDamping = true;
      this.controls.dampingFactor = 0.12;
      this.controls.zoomToCursor = true;
      this.measure(run);
      this.makeGround(run);
      this.home();
    }

    measure(run) {
      this.extent = extent(run);
      const { radius } = this.extent, together = Math.hypot(...this.extent.together) || radius;
      // bodies that stay near each other and go far are followed
      this.follows = together < 0.3 * radius;
      this.view = this.follows ? Math.max(2.2 * together, 0.03 * radius) : radius;
      this.half = this.follows ? this.extent.together.map((x) => 1.6 * x) : this.extent.half;
      this.camera.near = this.view / 200;
      this.camera.far = 40 * (radius + this.view);
      const box = 1.5 * this.view;
      Object.assign(this.sun.shadow.camera, { left: -box, right: box, top: box, bottom: -box, near: 0.1 * this.view, far: 9 * this.view });
      this.sun.shadow.camera.updateProjectionMatrix();
      this.sun.shadow.normalBias = this.view / 400;
      this.sun.shadow.bias = -2e-4;
      this.cell = nice(this.view / 2.5);
    }

    makeGround(run) {
      this.ground = new THREE.Group();
      this.floors = [];
      this.planes = mbsim.ground.planesOf(run).filter((plane) => plane.body < 0);
      const { middle, radius, low, high } = this.extent;
      const walls = this.planes.length > 1;
      const reach = walls ? 1.25 * radius : Math.max(2.2 * radius, 9 * this.view);
      const rim = walls ? 4 * radius : Math.max(1.4 * radius, 7 * this.view);
      const look = { paper: 0xffffff, ink: 0x888888, cell: this.cell, rim };
      for (const plane of this.planes) {
        const corners = mbsim.ground.cornersOf(plane, this.planes, middle, reach);
        if (corners.length < 3) { continue; }
        const material = mbsim.ground.gridMaterial(look);
        // what passes behind a plane, as through a guide, stays in sight
        if (this.extent.ways.some((at) => mbsim.ground.depthOf(plane, at) > 0)) { Object.assign(material, { opacity: 0.35, depthWrite: false }); }
        this.floors.push(mbsim.ground.polygon(plane, corners, material));
      }
      if (!this.floors.length) {
        const plane = { ...mbsim.ground.frameOf(this.up), p: [...middle] };
        let lowest = Infinity;
        for (let k = 0; k < 8; k += 1) {
          const corner = [0, 1, 2].map((c) => ((k >> c) & 1 ? high : low)[c] - middle[c]);
          lowest = Math.min(lowest, corner[0] * this.up[0] + corner[1] * this.up[1] + corner[2] * this.up[2]);
        }
        for (let c = 0; c < 3; c += 1) { plane.p[c] += (lowest - 0.03 * this.view) * this.up[c]; }
        const corners = mbsim.ground.cornersOf({ ...plane, bounds: [0, 0, 0, 0] }, [], middle, reach);
        this.floors.push(mbsim.ground.polygon(plane, corners, mbsim.ground.gridMaterial(look)));
      }
      this.ground.add(...this.floors);
      this.scene.add(this.ground);
    }

    setTheme(name) {
      const theme = THEMES[name];
      this.scene.background = new THREE.Color(theme.bottom).lerp(new THREE.Color(theme.top), 0.6);
      this.sky.intensity = theme.ambient;
      this.sky.groundColor.set(theme.below);
      this.sun.intensity = theme.key;
      for (const floor of this.floors) {
        floor.material.color.set(theme.paper);
        floor.material.userData.uniforms.ink.value.set(theme.ink);
      }
    }

    // The first camera: what moves goes from left to right, seen from a little above.
    home() {
      const up = new THREE.Vector3(...this.up);
      const along = widest(this.extent.ways, this.up);
      const side = new THREE.Vector3();
      if (along) {
        const way = new THREE.Vector3(...along);
        const first = this.extent.ways[0], last = this.extent.ways[this.extent.ways.length - 1];
        const travel = new THREE.Vector3(last[0] - first[0], last[1] - first[1], last[2] - first[2]);
        if (travel.dot(way) < -1e-6 * this.extent.radius) { way.negate(); }
        side.crossVectors(way, up).normalize().addScaledVector(way, this.follows ? -0.55 : 0.3);
      } else {
        const { x, y } = mbsim.ground.frameOf(this.up);
        side.set(...x).addScaledVector(new THREE.Vector3(...y), -1.6);
      }
      side.normalize().multiplyScalar(0.93).addScaledVector(up, 0.38).normalize();
      const inside = this.floors.length > 1 ? 1 : 0;
      if (inside) { side.addScaledVector(up, 0.35).normalize(); }
      this.look(side, new THREE.Vector3(...this.extent.middle));
    }

    look(direction, target) {
      // as near as the box of what is looked at allows
      const sight = new THREE.Vector3().crossVectors(new THREE.Vector3(...this.up), direction);
      if (sight.lengthSq() < 1e-9) { sight.set(direction.y, direction.z, direction.x); }
      sight.normalize();
      const above = new THREE.Vector3().crossVectors(direction, sight);
      const wide = (axis) => Math.abs(axis.x) * this.half[0] + Math.abs(axis.y) * this.half[1] + Math.abs(axis.z) * this.half[2];
      const slope = Math.tan(this.camera.fov * Math.PI / 360);
      const distance = wide(direction) + Math.max(1.3 * wide(above) / slope, 1.12 * wide(sight) / (slope * (this.free || this.camera.aspect)), 0.2 * this.view);
      this.controls.target.copy(target);
      this.camera.position.copy(target).addScaledVector(direction, distance);
      this.camera.updateProjectionMatrix();
      this.controls.update();
    }

    // Let camera and light move along with a target.
    moveTo(target) {
      const step = target.clone().sub(this.controls.target);
      this.camera.position.add(step);
      this.controls.target.copy(target);
    }

    resize(width, height, ratio) {
      this.ratio = ratio;
      this.renderer.setPixelRatio(this.coarse ? ratio / 2 : ratio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
    }

    // Draw with all pixels from now on, or with half of them in width and height.
    setCoarse(coarse) {
      if (coarse === this.coarse) { return; }
      this.coarse = coarse;
      this.renderer.setPixelRatio(coarse ? this.ratio / 2 : this.ratio);
    }

    render() {
      const target = this.follows || this.following ? this.controls.target : new THREE.Vector3(...this.extent.middle);
      const up = new THREE.Vector3(...this.up);
      const { x, y } = mbsim.ground.frameOf(this.up);
      this.sun.target.position.copy(target);
      this.sun.position.copy(target).addScaledVector(up, 3.4 * this.view)
        .addScaledVector(new THREE.Vector3(...x), 1.5 * this.view).addScaledVector(new THREE.Vector3(...y), -1.9 * this.view);
      for (const floor of this.floors) { floor.material.userData.uniforms.middle.value.copy(target); }
      this.renderer.render(this.scene, this.camera);
    }
  }
  return Stage;
})();
