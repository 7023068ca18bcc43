"use strict";
// A run: poses of its bodies at any time, points of contact, forces, and signals.
mbsim.Run = (function () {
  const { fromPlanes, together } = mbsim.unpack;

  class Run {
    constructor(pack) {
      const { about, arrays } = pack;
      // `factor`: what lengths and times of this run are multiplied with to be those of the first
      Object.assign(this, { about, arrays, factor: about.factor });
      const rows = about.rows, bodies = about.bodies.length;
      this.rows = rows;
      this.bodies = about.bodies;
      const time = arrays.time;
      this.time = new Float64Array(time.slice().buffer);
      this.steps = fromPlanes(arrays.p, about.p.planes, about.p.order, rows, 3 * bodies);
      this.turns = fromPlanes(arrays.q, about.q.planes, about.q.order, rows, 4 * bodies);
      this.start = this.time[0];
      this.end = this.time[rows - 1];
      // of the time shown: positions (3 a body) from `about.centre`, and unit quaternions, w first
      this.p = new Float64Array(3 * bodies);
      this.q = new Float64Array(4 * bodies);
      this.row = 0;
      this.dots = this.points("dots");
      this.arrows = this.points("arrows");
      this.arrowForce = together(arrays.arrow_force, Float32Array);
      this.arrowSlip = together(arrays.arrow_slip, Float32Array);
      this.arrowArea = together(arrays.arrow_area, Float32Array);
      this.readChannels();
      this.set(this.start);
    }

    points(name) {
      const { count, planes, order } = this.about[name];
      return {
        first: this.arrays[name + "_first"],
        steps: fromPlanes(this.arrays[name], planes, order, count, 3),
      };
    }

    readChannels() {
      const values = together(this.arrays.channels, Float32Array);
      const rows = this.arrays.channel_rows;
      let at = 0, kept = 0;
      this.channels = new Map();
      for (const channel of this.about.channels) {
        const found = { ...channel, values: values.subarray(at, at + channel.rows), index: null };
        at += channel.rows;
        if (!channel.all) {
          found.index = rows.subarray(kept, kept + channel.rows);
          kept += channel.rows;
        }
        this.channels.set(channel.name, found);
      }
    }

    // The last kept row that is not behind a time, of this run's own.
    rowAt(time) {
      let low = 0, high = this.rows - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.time[middle] <= time) { low = middle; } else { high = middle - 1; }
      }
      return low;
    }

    // Let poses be those of a time, linear between rows as `mbsim/view/motion.py` has them.
    set(time) {
      const k = this.rowAt(time);
      const next = Math.min(k + 1, this.rows - 1);
      const span = this.time[next] - this.time[k];
      const s = span > 0 ? Math.min(1, Math.max(0, (time - this.time[k]) / span)) : 0;
      this.row = s > 0.5 ? next : k;
      const step = this.about.step, bodies = this.bodies.length;
      const a = 3 * bodies * k, b = 3 * bodies * next;
      for (let c = 0; c < 3 * bodies; c += 1) {
        const from = this.steps[a + c];
        this.p[c] = step * (from + s * (this.steps[b + c] - from));
      }
      const qa = 4 * bodies * k, qb = 4 * bodies * next;
      for (let i = 0; i < bodies; i += 1) {
        let sum = 0;
        for (let c = 4 * i; c < 4 * i + 4; c += 1) {
          const from = this.turns[qa + c];
          const value = from + s * (this.turns[qb + c] - from);
          this.q[c] = value;
          sum += value * value;
        }
        const length = Math.sqrt(sum) || 1;
        for (let c = 4 * i; c < 4 * i + 4; c += 1) { this.q[c] /= length; }
      }
    }

    // Position of a body at a kept row from `about.centre`, into an array.
    positionAt(row, body, into) {
      const at = 3 * (this.bodies.length * row + body);
      for (let c = 0; c < 3; c += 1) { into[c] = this.about.step * this.steps[at + c]; }
      return into;
    }

    // A point fixed in a body (-1: at rest, global) from `about.centre`, at the time shown.
    place(body, x, y, z, into) {
      const o = this.about.centre;
      if (body < 0) {
        into[0] = x - o[0]; into[1] = y - o[1]; into[2] = z - o[2];
        return into;
      }
      const w = this.q[4 * body], a = this.q[4 * body + 1], b = this.q[4 * body + 2], c = this.q[4 * body + 3];
      const ux = b * z - c * y + w * x, uy = c * x - a * z + w * y, uz = a * y - b * x + w * z;
      into[0] = this.p[3 * body] + x + 2 * (b * uz - c * uy);
      into[1] = this.p[3 * body + 1] + y + 2 * (c * ux - a * uz);
      into[2] = this.p[3 * body + 2] + z + 2 * (a * uy - b * ux);
      return into;
    }

    // Names of all signals: those of the channels, magnitudes, and what poses tell.
    names() {
      if (this.allNames) { return this.allNames; }
      const found = [];
      for (const name of this.channels.keys()) {
        found.push(name);
        const whole = name.slice(0, -1);
        if (name.endsWith("/z") && this.channels.has(whole + "x") && !this.channels.has(whole + "mag")) { found.push(whole + "mag"); }
      }
      for (const body of this.bodies) {
        for (const part of ["x", "y", "z"]) { found.push(`bodies/${body.id}/position/${part}`); }
      }
      this.allNames = found;
      return found;
    }

    // A signal over time: {time, values, unit, quantity}, null where there is none.
    signal(name) {
      this.cache = this.cache || new Map();
      if (!this.cache.has(name)) { this.cache.set(name, this.findSignal(name)); }
      return this.cache.get(name);
    }

    findSignal(name) {
      const channel = this.channels.get(name);
      if (channel) { return { time: this.timesOf(channel), values: channel.values, unit: channel.unit, quantity: channel.quantity }; }
      const parts = name.split("/");
      const last = parts.pop();
      if (last === "mag") { return this.magnitude(parts.join("/")); }
      if (parts.length === 3 && parts[0] === "bodies" && parts[2] === "position") {
        const body = this.bodies.findIndex((each) => String(each.id) === parts[1]);
        const part = ["x", "y", "z"].indexOf(last);
        if (body < 0 || part < 0) { return null; }
        const values = new Float64Array(this.rows);
        for (let r = 0; r < this.rows; r += 1) {
          values[r] = this.factor.length * (this.about.centre[part] + this.about.step * this.steps[3 * (this.bodies.length * r + body) + part]);
        }
        return { time: this.time, values, unit: this.about.shown.position, quantity: "Position" };
      }
      return null;
    }

    timesOf(channel) {
      const times = this.arrays.channel_time;
      if (!channel.index) { return times; }
      return Float32Array.from(channel.index, (row) => times[row]);
    }

    magnitude(whole) {
      const parts = ["x", "y", "z"].map((part) => this.channels.get(`${whole}/${part}`));
      if (parts.some((part) => !part)) { return null; }
      const [x, y, z] = parts;
      const values = Float64Array.from(x.values, (value, k) => Math.hypot(value, y.values[k], z.values[k]));
      return { time: this.timesOf(x), values, unit: x.unit, quantity: x.quantity };
    }

    // The value of a signal at a time, NaN where there is none.
    valueAt(name, time) {
      const found = this.signal(name);
      if (!found || !found.values.length) { return NaN; }
      const { time: times, values } = found;
      let low = 0, high = times.length - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (times[middle] <= time) { low = middle; } else { high = middle - 1; }
      }
      const next = Math.min(low + 1, times.length - 1);
      const span = times[next] - times[low];
      const s = span > 0 ? Math.min(1, Math.max(0, (time - times[low]) / span)) : 0;
      return values[low] + s * (values[next] - values[low]);
    }
  }
  return Run;
})();
