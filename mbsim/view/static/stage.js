"use strict";
// What a scene is seen by: renderer, light, ground, camera.
mbsim.Stage = (function () {
  const THEMES = {
    light: { top: 0xf4f6f9, bottom: 0xdfe5ec, paper: 0xf0f2f5, ink: 0x8d99a6, ambient: 0.55, key: 2.1 },
    dark: { top: 0x1b2128, bottom: 0x0e1216, paper: 0x232a32, ink: 0x5d6a78, ambient: 0.32, key: 1.7 },
  };

  // A round number of 1, 2 or 5 times a power of ten below a value.
  function nice(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    const lead = value / power;
    return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
  }

  // Centre and radius of what moves, over rows; of all bodies together, and around their centre.
  function extent(run) {
    const bodies = run.bodies.length, reach = new Float64Array(bodies);
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const fixed = [];
    run.about.shapes.forEach((shape, k) => {
      if (shape.shape === "PLANE") { return; }
      const pose = run.arrays.shape_pose.subarray(7 * k, 7 * k + 7);
      const far = radiusOf(run, k);
      if (shape.body >= 0) {
        reach[shape.body] = Math.max(reach[shape.body], Math.hypot(pose[0], pose[1], pose[2]) + far);
      } else {
        fixed.push({ p: [0, 1, 2].map((c) => pose[c] - run.about.centre[c]), far });
      }
    });
    for (let k = 0; k < run.about.markers.length; k += 1) {
      const [, body] = run.about.markers[k];
      if (body < 0) { continue; }
      const pose = run.arrays.marker_pose.subarray(7 * k, 7 * k + 3);
      reach[body] = Math.max(reach[body], Math.hypot(pose[0], pose[1], pose[2]));
    }
    const every = Math.max(1, Math.floor(run.rows / 80));
    const at = [0, 0, 0], ways = [];
    let together = 0;
    for (let row = 0; row < run.rows; row += every) {
      const middle = [0, 0, 0];
      const here = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
      for (let body = 0; body < bodies; body += 1) {
        run.positionAt(row, body, at);
        for (let c = 0; c < 3; c += 1) {
          here.low[c] = Math.min(here.low[c], at[c] - reach[body]);
          here.high[c] = Math.max(here.high[c], at[c] + reach[body]);
        }
        if (bodies <= 200 || body % Math.ceil(bodies / 200) === 0) { ways.push([...at]); }
      }
      for (let c = 0; c < 3; c += 1) {
        middle[c] = 0.5 * (here.low[c] + here.high[c]);
        low[c] = Math.min(low[c], here.low[c]);
        high[c] = Math.max(high[c], here.high[c]);
      }
      together = Math.max(together, 0.5 * Math.hypot(...[0, 1, 2].map((c) => here.high[c] - here.low[c])));
    }
    const moving = 0.5 * Math.hypot(...[0, 1, 2].map((c) => high[c] - low[c]));
    for (const { p, far } of fixed) {
      if (far > 2.5 * moving && moving > 0) { continue; } // a floor, say
      for (let c = 0; c < 3; c += 1) {
        low[c] = Math.min(low[c], p[c] - far);
        high[c] = Math.max(high[c], p[c] + far);
      }
    }
    const middle = [0, 1, 2].map((c) => 0.5 * (low[c] + high[c]));
    const radius = 0.5 * Math.hypot(...[0, 1, 2].map((c) => high[c] - low[c])) || run.about.size || 1;
    return { middle, radius, low, high, together: together || radius, ways, reach };
  }

  function radiusOf(run, k) {
    const [a, b, c] = run.arrays.shape_size.subarray(7 * k, 7 * k + 3);
    switch (run.about.shapes[k].shape) {
      case "SPHERE": return a;
      case "ELLIPSOID": return Math.max(a, b, c);
      case "BOX": return 0.5 * Math.hypot(a, b, c);
      case "CYLINDER": return Math.hypot(a, b / 2);
      case "FRUSTUM": return Math.hypot(Math.max(a, b), c / 2);
      case "MESH": {
        const mesh = run.arrays.shape_looks[3 * k + 2];
        const [vertex, vertices] = run.arrays.meshes.subarray(4 * mesh, 4 * mesh + 2);
        run.vertexData = run.vertexData || mbsim.unpack.together(run.arrays.vertices, Float32Array);
        let far = 0;
        for (let v = 3 * vertex; v < 3 * (vertex + vertices); v += 3) {
          far = Math.max(far, Math.hypot(run.vertexData[v], run.vertexData[v + 1], run.vertexData[v + 2]));
        }
        return far;
      }
      default: return 0;
    }
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
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
      this.renderer.shadowMap.enabled = true;
      this.renderer.shadowMap.type = THREE.PCFShadowMap;
      this.renderer.toneMapping = THREE.NeutralToneMapping;
      this.renderer.toneMappingExposure = 1.05;
      this.scene = new THREE.Scene();
      const room = new THREE.PMREMGenerator(this.renderer);
      this.scene.environment = room.fromScene(new THREE.RoomEnvironment(), 0.04).texture;
      this.sun = new THREE.DirectionalLight(0xffffff, 2);
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(2048, 2048);
      this.sun.shadow.radius = 3;
      this.scene.add(this.sun, this.sun.target);
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
      // bodies that stay near each other and go far are followed
      this.follows = this.extent.together < 0.42 * this.extent.radius;
      this.view = this.follows ? Math.max(3.2 * this.extent.together, 0.06 * this.extent.radius) : this.extent.radius;
      const far = this.extent.radius + this.view;
      this.camera.near = this.view / 200;
      this.camera.far = 40 * far;
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
        this.floors.push(mbsim.ground.polygon(plane, corners, mbsim.ground.gridMaterial(look)));
      }
      if (!this.floors.length) {
        const plane = { ...mbsim.ground.frameOf(this.up), p: [...middle] };
        let lowest = Infinity;
        for (let k = 0; k < 8; k += 1) {
          const corner = [0, 1, 2].map((c) => ((k >> c) & 1 ? high : low)[c] - middle[c]);
          lowest = Math.min(lowest, corner[0] * this.up[0] + corner[1] * this.up[1] + corner[2] * this.up[2]);
        }
        for (let c = 0; c < 3; c += 1) { plane.p[c] += (lowest - 0.02 * radius) * this.up[c]; }
        const corners = mbsim.ground.cornersOf({ ...plane, bounds: [0, 0, 0, 0] }, [], middle, reach);
        this.floors.push(mbsim.ground.polygon(plane, corners, mbsim.ground.gridMaterial(look)));
      }
      this.ground.add(...this.floors);
      this.scene.add(this.ground);
    }

    setTheme(name) {
      const theme = THEMES[name];
      this.scene.background = new THREE.Color(theme.bottom).lerp(new THREE.Color(theme.top), 0.6);
      this.scene.environmentIntensity = theme.ambient;
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
      const half = Math.min(this.camera.fov, this.camera.fov * Math.max(0.4, this.camera.aspect)) * Math.PI / 360;
      const distance = 1.02 * this.view / Math.sin(half);
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
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
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
