"use strict";
// The view: runs on a stage, with time, selection, curves and keys. `mbsim.mount` makes one.
mbsim.View = (function () {
  // Times real time: 1, 2, 5 and their powers of ten.
  const SPEEDS = Array.from({ length: 37 }, (_, k) => Number(`${[1, 2, 5][k % 3]}e${Math.floor(k / 3) - 6}`));
  const SWITCHES = [
    ["shapes", "shapes", true], ["ground", "ground", true], ["dots", "contact points", true], ["forces", "contact forces", true],
    ["joints", "joints", true], ["links", "springs, forces", true], ["markers", "markers", false], ["paths", "paths", true],
    ["shadows", "shadows", true], ["hidden", "hidden shapes", false], ["second", "second run", true], ["loop", "repeat", true],
  ];
  const KEYS = [
    ["space", "play or pause"], ["← →", "one row back or on (with shift: ten)"], ["Home End", "first or last row"],
    ["+ −", "faster, slower"], ["F", "follow the selected body"], ["R", "first camera"], ["X Y Z", "look along an axis"],
    ["C A J M T G S", "contact points, forces, joints, markers, paths, ground, shadows"], ["Esc", "nothing selected"],
    ["D P ?", "dark or light, panel, these keys"],
  ];
  const ACTIONS = { home: "goHome", theme: "themeNext", help: "help", panel: "panel", play: "play" };
  // Milliseconds without a change after which a slow machine draws with all pixels.
  const STILL_AFTER = 250;
  const TINT = 0xe0782f;
  const { shown } = mbsim.Curves;

  class View {
    constructor(root, packs, settings) {
      this.root = root;
      this.settings = settings;
      this.parts = {};
      for (const part of root.querySelectorAll("[data-is]")) { this.parts[part.dataset.is] = part; }
      this.canvas = root.querySelector("canvas.scene");
      this.on = Object.fromEntries(SWITCHES.map(([name, , start]) => [name, start]));
      this.playing = false;
      this.selected = null;
      this.followed = null;
      this.frameTimes = [];
      this.theme = settings.theme || kept("mbsim-theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
      this.fill(packs);
      this.listen();
      this.setTheme(this.theme);
      this.resize();
      this.stage.home();
      this.follow(this.stage.follows ? "all" : "none");
      this.setTime(this.span[0]);
      requestAnimationFrame((now) => this.loop(now));
    }

    // Let the runs be those of packs; camera, time and choices stay where there are some.
    fill(packs) {
      const before = this.runs;
      this.runs = packs.map((pack) => new mbsim.Run(pack));
      const first = this.runs[0];
      this.span = [
        Math.min(...this.runs.map((run) => run.start * run.factor.time)),
        Math.max(...this.runs.map((run) => run.end * run.factor.time)),
      ];
      if (before) { this.clear(); } else { this.stage = new mbsim.Stage(this.canvas, first); }
      this.groups = this.runs.map((run, k) => {
        const group = new THREE.Group();
        group.scale.setScalar(run.factor.length);
        group.position.set(...[0, 1, 2].map((c) => run.about.centre[c] * run.factor.length - first.about.centre[c]));
        const wide = 0.012 * this.stage.view / run.factor.length;
        const look = k > 0 ? { wide, ghost: true, tint: TINT } : { wide, floor: this.stage.extent.largeFloor, cell: this.stage.cell };
        run.shapes = new mbsim.shapes.Shapes(run, group, look);
        run.contacts = new mbsim.Contacts(run, group, this.stage.view / run.factor.length);
        run.extras = new mbsim.extras.Extras(run, group, this.stage.view / run.factor.length);
        this.stage.scene.add(group);
        return group;
      });
      if (!before && (mbsim.lit.slow || first.shapes.triangles > 4e6)) { this.on.shadows = false; }
      this.describe();
      if (before) {
        this.curves.runs = this.runs;
        this.curves.span = this.span;
        this.curves.build();
      } else {
        this.curves = new mbsim.Curves(this.parts, this.runs, (time) => { this.pause(); this.setTime(time); });
        this.curves.span = this.span;
        this.firstCurves();
      }
      this.tracePaths();
    }

    clear() {
      for (const group of this.groups) {
        this.stage.scene.remove(group);
        group.traverse((each) => { if (each.geometry) { each.geometry.dispose(); } if (each.material) { each.material.dispose(); } });
      }
    }

    firstCurves() {
      const names = this.runs[0].names();
      const wanted = this.runs[0].about.asked;
      const guess = [names.find((n) => /^contacts\/\d+\/force\/mag$/.test(n)), names.find((n) => n === "energy/kinetic")];
      const asked = names.filter((name) => wanted.some((each) => name === each || name.startsWith(each + "/")));
      for (const name of asked.length ? asked.slice(0, 8) : guess.filter(Boolean)) { this.curves.add(name); }
    }

    // Words of the panel that do not change with time.
    describe() {
      const { about } = this.runs[0], { parts } = this;
      parts.name.textContent = this.runs.map((run) => run.about.name).join(" and ");
      parts.state.textContent = this.runs.map((run) => run.about.status).join(", ");
      const pick = parts.pick;
      pick.textContent = "";
      pick.append(new Option("nothing selected", ""));
      about.bodies.slice(0, 5000).forEach((body, k) => pick.append(new Option(`body ${body.id}${body.label ? " – " + body.label : ""}`, k)));
      pick.value = this.selected === null ? "" : this.selected;
      const follow = parts.follow, chosen = follow.value;
      follow.textContent = "";
      follow.append(new Option("nothing", "none"), new Option("all bodies", "all"), new Option("selected body", "selected"));
      if (chosen) { follow.value = chosen; }
      parts.about.textContent = "";
      const say = (text, kind) => { const p = document.createElement("p"); p.textContent = text; if (kind) { p.className = kind; } parts.about.append(p); };
      for (const run of this.runs) {
        say(`${run.about.name}: ${run.about.model}`);
        say(`mbsim ${run.about.version}, ${run.about.status}, ${run.about.rows_of_file} rows` + (run.about.rows < run.about.rows_of_file ? `, ${run.about.rows} shown` : ""));
        if (run.about.audit) { say(run.about.audit); }
        for (const warning of [...run.about.audit_warnings, ...run.about.warnings]) { say(warning, "warning"); }
        if (run.about.left_out) { say(`${run.about.left_out} signals are not in this page; mbsim view --signals NAME puts them there`); }
        if (!run.about.arrows_at_points) { say("Forces are resultants of contacts between two bodies. Forces at every point are shown of runs with --contact-points."); }
      }
      parts.switches.textContent = "";
      for (const [name, words] of SWITCHES) {
        if (name === "second" && this.runs.length < 2) { continue; }
        const label = document.createElement("label"), box = document.createElement("input");
        box.type = "checkbox";
        box.checked = this.on[name];
        box.dataset.switch = name;
        box.addEventListener("change", () => this.turn(name, box.checked));
        label.append(box, words);
        parts.switches.append(label);
      }
      if (!parts.speed.options.length) {
        this.realTime = about.second;
        const seconds = (this.span[1] - this.span[0]) / about.second;
        // by which a run is seen in half a second to some minutes, and real time; slow where it is short
        const speeds = SPEEDS.filter((speed) => speed === 1 || (seconds / speed > 0.5 && seconds / speed < 400));
        const first = speeds.slice().reverse().find((speed) => seconds / speed >= 2.5) || speeds[0];
        for (const speed of speeds) { parts.speed.append(new Option(`${speed}×`, speed)); }
        parts.speed.value = seconds > 400 ? first : Math.min(1, first);
      }
      const rows = KEYS.map(([key, what]) => {
        const row = document.createElement("tr"), a = document.createElement("th"), b = document.createElement("td");
        for (const each of key.split(" ")) { const kbd = document.createElement("kbd"); kbd.textContent = each; a.append(kbd, " "); }
        b.textContent = what;
        row.append(a, b);
        return row;
      });
      const table = document.createElement("table");
      table.append(...rows);
      parts.help.textContent = "";
      parts.help.append(table);
    }

    listen() {
      const { root, parts, canvas } = this;
      root.addEventListener("click", (event) => {
        const button = event.target.closest("[data-do]");
        if (button) { this[ACTIONS[button.dataset.do]](); }
      });
      parts.scrub.addEventListener("input", () => { this.pause(); this.setTime(this.span[0] + parts.scrub.value * (this.span[1] - this.span[0])); });
      parts.pick.addEventListener("change", () => this.select(parts.pick.value === "" ? null : Number(parts.pick.value)));
      parts.follow.addEventListener("change", () => this.follow(parts.follow.value));
      parts.colour.addEventListener("change", () => { for (const run of this.runs) { run.contacts.by = parts.colour.value; } this.changed = true; this.legend(); });
      parts.length.addEventListener("input", () => { for (const run of this.runs) { run.contacts.scale = 10 ** parts.length.value; } this.changed = true; });
      let from = null;
      canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; });
      canvas.addEventListener("pointerup", (event) => {
        if (from && Math.hypot(event.clientX - from[0], event.clientY - from[1]) < 5) { this.pick(event.clientX, event.clientY); }
        from = null;
      });
      this.stage.controls.addEventListener("change", () => { this.changed = true; });
      new ResizeObserver(() => this.resize()).observe(root);
      const target = root.classList.contains("whole") ? document : root;
      target.addEventListener("keydown", (event) => this.key(event));
      window.addEventListener("beforeprint", () => this.draw());
      if (innerWidth <= 760) { root.classList.add("folded"); }
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT)$/.test(event.target.tagName) && event.target.type !== "range" && event.target.type !== "checkbox") { return; }
      const many = event.shiftKey ? 10 : 1;
      const keys = {
        " ": () => this.play(), ArrowLeft: () => this.step(-many), ArrowRight: () => this.step(many),
        Home: () => this.setTime(this.span[0]), End: () => this.setTime(this.span[1]),
        "+": () => this.faster(1), "=": () => this.faster(1), "-": () => this.faster(-1),
        f: () => this.follow(this.followed === "selected" ? "none" : "selected"), r: () => this.goHome(), Escape: () => { this.parts.help.hidden = true; this.select(null); },
        c: () => this.turn("dots"), a: () => this.turn("forces"), j: () => this.turn("joints"), m: () => this.turn("markers"),
        t: () => this.turn("paths"), g: () => this.turn("ground"), s: () => this.turn("shadows"),
        d: () => this.themeNext(), p: () => this.panel(), "?": () => this.help(),
        x: () => this.along(0), y: () => this.along(1), z: () => this.along(2),
      };
      const done = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!done || event.target.tagName === "BUTTON" && event.key === " ") { return; }
      event.preventDefault();
      done();
    }

    themeNext() { this.setTheme(this.theme === "dark" ? "light" : "dark"); keep("mbsim-theme", this.theme); }
    panel() { this.root.classList.toggle("folded"); this.curves.draw(); this.frame(); }
    help() { this.parts.help.hidden = !this.parts.help.hidden; }
    play() { if (this.playing) { this.pause(); } else { this.start(); } }

    start() {
      if (this.time >= this.span[1]) { this.setTime(this.span[0]); }
      this.playing = true;
      this.last = null;
      this.showPlay();
    }

    pause() { this.playing = false; this.showPlay(); }

    showPlay() { this.root.querySelector("[data-do=play]").textContent = this.playing ? "❚❚" : "▶"; }

    faster(way) {
      const { speed } = this.parts;
      speed.selectedIndex = Math.min(speed.options.length - 1, Math.max(0, speed.selectedIndex + way));
    }

    step(count) {
      this.pause();
      const run = this.runs[0], k = Math.min(run.rows - 1, Math.max(0, run.rowAt(this.time / run.factor.time) + count));
      this.setTime(run.time[k] * run.factor.time);
    }

    turn(name, value) {
      this.on[name] = value === undefined ? !this.on[name] : value;
      const box = this.parts.switches.querySelector(`[data-switch=${name}]`);
      if (box) { box.checked = this.on[name]; }
      if (name === "paths") { this.tracePaths(); }
      if (name === "second") { this.runs.slice(1).forEach((run) => { run.off = !this.on.second; }); this.curves.draw(); }
      this.changed = true;
    }

    setTheme(name) {
      this.theme = name;
      this.root.dataset.theme = name;
      this.stage.setTheme(name);
      if (this.curves) { this.curves.draw(); }
      this.marks();
      this.legend();
      this.changed = true;
    }

    follow(what) {
      this.followed = what === "none" ? null : what;
      this.stage.following = Boolean(this.followed);
      this.parts.follow.value = what;
      if (this.followed) { this.stage.moveTo(this.target()); }
      this.changed = true;
    }

    // What is followed now, on the stage.
    target() {
      const run = this.runs[0], bodies = run.bodies.length;
      if (this.followed === "selected" && this.selected !== null) {
        return new THREE.Vector3(...run.p.subarray(3 * this.selected, 3 * this.selected + 3));
      }
      if (this.followed === "selected") { return this.stage.controls.target.clone(); }
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let k = 0; k < 3 * bodies; k += 1) {
        low[k % 3] = Math.min(low[k % 3], run.p[k]);
        high[k % 3] = Math.max(high[k % 3], run.p[k]);
      }
      return new THREE.Vector3(...[0, 1, 2].map((c) => 0.5 * (low[c] + high[c])));
    }

    goHome() {
      this.stage.home();
      if (this.followed) { this.stage.moveTo(this.target()); }
      this.changed = true;
    }

    along(axis) {
      const direction = new THREE.Vector3().setComponent(axis, 1);
      // not quite along up, where the camera could not say what is above
      if (Math.abs(direction.dot(new THREE.Vector3(...this.stage.up))) > 0.999) { direction.setComponent((axis + 1) % 3, -1e-3).normalize(); }
      this.stage.look(direction, this.stage.controls.target.clone());
      this.changed = true;
    }

    pick(x, y) {
      const box = this.canvas.getBoundingClientRect();
      const at = new THREE.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height);
      const ray = new THREE.Raycaster();
      ray.setFromCamera(at, this.stage.camera);
      const hit = this.runs[0].shapes.hit(ray);
      this.select(hit && hit.body >= 0 ? hit.body : null);
    }

    select(body) {
      this.selected = body;
      this.parts.pick.value = body === null ? "" : body;
      for (const run of this.runs.slice(0, 1)) { run.shapes.highlight(body); }
      this.tracePaths();
      this.numbers();
      this.changed = true;
    }

    tracePaths() {
      this.runs.forEach((run) => {
        const all = run.bodies.length <= 12 ? run.bodies.map((_, k) => k) : this.selected === null ? [] : [this.selected];
        run.extras.trace(this.on.paths ? all.filter((k) => k < run.bodies.length) : []);
      });
    }

    numbers() {
      const { numbers, hint } = this.parts, run = this.runs[0];
      numbers.textContent = "";
      if (this.selected === null) {
        hint.textContent = "Click a body, or choose one.";
        return;
      }
      hint.textContent = "";
      const body = run.bodies[this.selected], time = this.time / run.factor.time, { units } = run.about;
      const add = (name, values, unit) => {
        const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td"), last = document.createElement("td");
        head.textContent = name;
        cell.textContent = values.map(shown).join("  ");
        last.textContent = unit;
        last.className = "unit";
        row.append(head, cell, last);
        numbers.append(row);
      };
      const k = this.selected, centre = run.about.centre;
      add("position", [0, 1, 2].map((c) => run.p[3 * k + c] + centre[c]), units.position);
      add("quaternion", [...run.q.subarray(4 * k, 4 * k + 4)].map((x) => Math.round(1e4 * x) / 1e4), "");
      for (const [name, unit] of [["velocity", units.velocity], ["angular_velocity", units.spin], ["acceleration", units.acceleration]]) {
        const values = ["x", "y", "z"].map((part) => run.valueAt(`bodies/${body.id}/${name}/${part}`, time));
        if (values.some(Number.isFinite)) {
          add(name.replace("_", " "), values, unit);
          if (name === "velocity") { add("speed", [Math.hypot(...values)], unit); }
        }
      }
    }

    legend() {
      const { legend } = this.parts, contacts = this.runs && this.runs[0].contacts;
      if (!contacts || !legend) { return; }
      legend.textContent = "";
      if (!contacts.sizes.length) { return; }
      const colors = [0, 0.2, 0.4, 0.6, 0.8, 1].map((share) => "#" + mbsim.Contacts.colorAt(share, new THREE.Color()).getHexString());
      const ramp = document.createElement("div");
      ramp.className = "ramp";
      ramp.style.background = `linear-gradient(90deg, ${colors.join(", ")})`;
      const ends = document.createElement("div");
      ends.className = "ends";
      const units = this.runs[0].about.units;
      const by = contacts.by === "pressure" && !contacts.hasArea ? "force" : contacts.by;
      const unit = { slip: units.velocity, force: units.force, pressure: units.pressure }[by];
      for (const text of ["0", { slip: "slip speed", force: "force", pressure: "pressure" }[by], `${shown(contacts.top)} ${unit}`]) {
        const span = document.createElement("span");
        span.textContent = text;
        ends.append(span);
      }
      legend.append(ramp, ends);
      if (contacts.by === "pressure" && !contacts.hasArea) {
        const note = document.createElement("div");
        note.textContent = "These contacts have no area, so the force is shown.";
        legend.append(note);
      }
    }

    // Events as ticks above the slider.
    marks() {
      const { marks } = this.parts, width = marks.clientWidth;
      if (!width || !this.runs) { return; }
      const ratio = devicePixelRatio || 1;
      marks.width = width * ratio;
      marks.height = 10 * ratio;
      const pen = marks.getContext("2d"), style = getComputedStyle(this.root);
      pen.scale(ratio, ratio);
      pen.fillStyle = style.getPropertyValue("--soft");
      for (const [time, kind] of this.runs[0].about.events) {
        if (kind !== "touch") { continue; }
        const share = (time * this.runs[0].factor.time - this.span[0]) / (this.span[1] - this.span[0] || 1);
        pen.fillRect(8 + share * (width - 16), 2, 1, 6);
      }
    }

    resize() {
      const width = this.root.clientWidth, height = this.root.clientHeight;
      const size = [width, height, Math.min(2, devicePixelRatio || 1)];
      // an observer tells the size once at its start, where nothing has changed
      if (!width || !height || String(size) === String(this.size)) { return; }
      this.size = size;
      this.stage.resize(...size);
      this.frame();
      this.marks();
      this.curves.draw();
      this.changed = true;
    }

    // Let the scene be in the middle of what the panel leaves free.
    frame() {
      const width = this.root.clientWidth, height = this.root.clientHeight;
      const free = width > 760 && !this.root.classList.contains("folded") && !this.root.classList.contains("still");
      this.stage.free = (free ? width - 332 : width) / height;
      if (free) { this.stage.camera.setViewOffset(width + 332, height, 332, 0, width, height); } else {
        // an offset has set the aspect to that of its whole, and keeps it
        this.stage.camera.aspect = width / height;
        this.stage.camera.clearViewOffset();
      }
      this.changed = true;
    }

    setTime(time) {
      this.time = Math.min(this.span[1], Math.max(this.span[0], time));
      const began = performance.now();
      for (const run of this.runs) { run.set(this.time / run.factor.time); }
      if (this.followed) { this.stage.moveTo(this.target()); }
      this.setupTime = performance.now() - began;
      this.parts.scrub.value = (this.time - this.span[0]) / (this.span[1] - this.span[0] || 1);
      this.clock();
      this.changed = true;
    }

    clock() {
      const digits = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10((this.span[1] - this.span[0]) / 3 || 1))));
      const { clock } = this.parts;
      clock.textContent = this.time.toFixed(digits);
      const of = document.createElement("span");
      of.className = "of";
      of.textContent = ` / ${this.span[1].toFixed(digits)} ${this.runs[0].about.units.time}`;
      clock.append(of);
    }

    // Draw one frame; the time that the script takes is remembered.
    draw() {
      const began = performance.now();
      this.stage.renderer.shadowMap.enabled = this.on.shadows;
      this.stage.sun.castShadow = this.on.shadows;
      this.stage.ground.visible = this.on.ground;
      this.runs.forEach((run, k) => {
        this.groups[k].visible = k === 0 || this.on.second;
        run.shapes.showHidden = this.on.hidden;
        for (const mesh of run.shapes.meshes) { mesh.visible = this.on.shapes; }
        run.extras.joints.visible = this.on.joints;
        run.extras.lines.visible = this.on.links;
        run.extras.axes.visible = this.on.markers;
        run.extras.paths.visible = this.on.paths;
        run.shapes.update();
        run.contacts.update(this.on.dots, this.on.forces);
        run.extras.update();
      });
      this.stage.render();
      this.changed = false;
      this.frameTimes.push(performance.now() - began + (this.setupTime || 0));
      if (this.frameTimes.length > 600) { this.frameTimes.shift(); }
    }

    loop(now) {
      requestAnimationFrame((next) => this.loop(next));
      if (this.playing) {
        const passed = this.last === null ? 0 : Math.min(0.25, (now - this.last) / 1000);
        this.last = now;
        let time = this.time + passed * this.parts.speed.value * (this.realTime || 1);
        if (time >= this.span[1]) {
          if (this.on.loop) { time = this.span[0]; } else { time = this.span[1]; this.pause(); }
        }
        this.setTime(time);
      }
      this.stage.controls.update();
      if (this.changed) {
        this.stage.setCoarse(mbsim.lit.slow);
        this.moved = now;
      } else if (!this.stage.coarse || now - this.moved < STILL_AFTER) {
        return;
      } else {
        this.stage.setCoarse(false);
      }
      this.draw();
      this.curves.cursor(this.time);
      if (this.selected !== null) { this.numbers(); }
    }

    // For pictures and tests: a body's position as shown, in units of its run, global.
    positionOf(id, run = this.runs[0]) {
      const k = run.bodies.findIndex((body) => body.id === id);
      return [0, 1, 2].map((c) => run.p[3 * k + c] + run.about.centre[c]);
    }

    // For pictures: the scene at a time as a PNG's data address; the page stays without controls.
    still(time) {
      if (!this.root.classList.contains("still")) {
        this.root.classList.add("still");
        this.pause();
        this.frame();
        this.goHome();
      }
      this.setTime(time);
      this.draw();
      return this.canvas.toDataURL("image/png");
    }
  }

  function kept(name) { try { return localStorage.getItem(name); } catch (error) { return null; } }
  function keep(name, value) { try { localStorage.setItem(name, value); } catch (error) { /* a page without storage */ } }
  return View;
})();
