"use strict";
// Curves of signals over time, one chart a unit, with a cursor at the time shown.
mbsim.Curves = (function () {
  const COLORS = ["#3f7fd0", "#e0813a", "#4fa66a", "#c9556b", "#8a6fc4", "#3aa6a6", "#b98d17", "#9a7b5f"];

  // A number in about four digits.
  function shown(value) {
    if (!Number.isFinite(value)) { return "–"; }
    const size = Math.abs(value);
    if (size === 0) { return "0"; }
    if (size >= 1e5 || size < 1e-3) { return value.toExponential(2).replace("e+", "e"); }
    return String(Number(value.toPrecision(4)));
  }

  // Round values between two ends, about so many.
  function ticks(low, high, count) {
    const span = high - low;
    if (!(span > 0)) { return [low]; }
    const raw = span / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((each) => each >= raw);
    const found = [];
    for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * span; value += step) {
      found.push(Math.abs(value) < 1e-9 * span ? 0 : value);
    }
    return found;
  }

  class Curves {
    // `seek` is called with a time that is clicked; `runs` are {run, factor} with a common time.
    constructor(parts, runs, seek) {
      Object.assign(this, { parts, runs, seek });
      this.names = [];
      this.charts = [];
      parts.find.addEventListener("input", () => this.offer());
      parts.find.addEventListener("focus", () => this.offer());
      parts.find.addEventListener("keydown", (event) => {
        event.stopPropagation();
        if (event.key === "Escape") { this.parts.hits.hidden = true; parts.find.blur(); }
        if (event.key === "Enter" && parts.hits.firstChild && parts.hits.firstChild.click) { parts.hits.firstChild.click(); }
      });
      parts.find.addEventListener("blur", () => setTimeout(() => { parts.hits.hidden = true; }, 200));
    }

    offer() {
      const words = this.parts.find.value.toLowerCase().split(/[\s/]+/).filter(Boolean);
      const all = this.runs[0].names();
      // names that have the words as they are come first
      const exact = (name) => words.filter((word) => name.toLowerCase().split("/").includes(word)).length;
      const found = all.filter((name) => words.every((word) => name.toLowerCase().includes(word)))
        .sort((a, b) => exact(b) - exact(a)).slice(0, 60);
      this.parts.hits.textContent = "";
      for (const name of found) {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = name;
        button.addEventListener("mousedown", (event) => event.preventDefault());
        button.addEventListener("click", () => { this.add(name); this.parts.find.value = ""; this.parts.hits.hidden = true; });
        this.parts.hits.append(button);
      }
      if (!found.length) {
        const none = document.createElement("p");
        none.className = "hint";
        none.textContent = this.runs[0].about.left_out ? "not in this page; mbsim view --signals NAME puts it there" : "no signal has this name";
        this.parts.hits.append(none);
      }
      this.parts.hits.hidden = false;
    }

    add(name) {
      if (this.names.includes(name) || !this.runs.some((run) => run.signal(name))) { return; }
      this.names.push(name);
      this.build();
    }

    remove(name) {
      this.names = this.names.filter((each) => each !== name);
      this.build();
    }

    build() {
      this.parts.charts.textContent = "";
      const units = new Map();
      this.names.forEach((name, k) => {
        const signal = this.runs.map((run) => run.signal(name)).find(Boolean);
        const key = signal.quantity + signal.unit;
        if (!units.has(key)) { units.set(key, { unit: signal.unit, quantity: signal.quantity, curves: [] }); }
        units.get(key).curves.push({ name, color: COLORS[k % COLORS.length] });
      });
      this.charts = [];
      for (const chart of units.values()) {
        const box = document.createElement("div");
        box.className = "chart";
        const canvas = document.createElement("canvas");
        box.append(canvas);
        chart.values = [];
        for (const curve of chart.curves) {
          const key = document.createElement("div");
          key.className = "key";
          const line = document.createElement("i");
          line.style.background = curve.color;
          const text = document.createElement("span");
          text.textContent = text.title = curve.name;
          const value = document.createElement("b");
          const close = document.createElement("button");
          close.type = "button";
          close.textContent = "×";
          close.title = "Take away";
          close.addEventListener("click", () => this.remove(curve.name));
          key.append(line, text, value, close);
          box.append(key);
          chart.values.push({ name: curve.name, box: value });
        }
        chart.canvas = canvas;
        const seek = (event) => {
          const box = canvas.getBoundingClientRect();
          const share = (event.clientX - box.left - chart.left) / chart.width;
          this.seek(this.span[0] + Math.min(1, Math.max(0, share)) * (this.span[1] - this.span[0]));
        };
        canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); seek(event); });
        canvas.addEventListener("pointermove", (event) => { if (event.buttons) { seek(event); } });
        this.parts.charts.append(box);
        this.charts.push(chart);
      }
      this.draw();
    }

    // Draw all charts anew: size, colours or signals have changed.
    draw() {
      if (!this.span) { return; }
      const style = getComputedStyle(this.parts.charts.closest(".mbsim-view"));
      for (const chart of this.charts) { this.drawChart(chart, style); }
      this.cursor(this.time);
    }

    drawChart(chart, style) {
      const { canvas } = chart, ratio = window.devicePixelRatio || 1;
      const width = canvas.clientWidth || 290, height = canvas.clientHeight || 112;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      const pen = canvas.getContext("2d", { willReadFrequently: true });
      pen.scale(ratio, ratio);
      let low = Infinity, high = -Infinity;
      const lines = [];
      for (const curve of chart.curves) {
        this.runs.forEach((run, k) => {
          const signal = run.signal(curve.name);
          if (!signal || run.off) { return; }
          lines.push({ signal, color: curve.color, dashed: k > 0, factor: run.factor.time });
          for (const value of signal.values) {
            if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
          }
        });
      }
      if (!(low <= high)) { low = 0; high = 1; }
      if (high - low < 1e-9 * Math.max(Math.abs(low), Math.abs(high)) || high === low) {
        const room = Math.abs(high) * 0.1 || 1;
        low -= room; high += room;
      }
      const marks = ticks(low, high, 3);
      pen.font = "11px system-ui, sans-serif";
      const left = Math.max(...marks.map((mark) => pen.measureText(shown(mark)).width)) + 8;
      const top = 16, bottom = height - 6, right = width - 4;
      Object.assign(chart, { left, width: right - left, top, bottom });
      const x = (time) => left + (right - left) * (time - this.span[0]) / (this.span[1] - this.span[0] || 1);
      const y = (value) => bottom - 3 - (bottom - top - 6) * (value - low) / (high - low);
      pen.fillStyle = style.getPropertyValue("--soft");
      pen.fillText(chart.unit ? `${chart.quantity} [${chart.unit}]` : chart.quantity, 0, 10);
      pen.strokeStyle = style.getPropertyValue("--line");
      pen.textAlign = "right";
      pen.textBaseline = "middle";
      for (const mark of marks) {
        pen.beginPath();
        pen.moveTo(left, y(mark));
        pen.lineTo(right, y(mark));
        pen.stroke();
        pen.fillText(shown(mark), left - 5, y(mark));
      }
      for (const { signal, color, dashed, factor } of lines) {
        pen.strokeStyle = color;
        pen.lineWidth = 1.5;
        pen.setLineDash(dashed ? [4, 3] : []);
        pen.beginPath();
        let down = false;
        for (let k = 0; k < signal.values.length; k += 1) {
          if (!Number.isFinite(signal.values[k])) { down = false; continue; }
          if (down) { pen.lineTo(x(signal.time[k] * factor), y(signal.values[k])); } else { pen.moveTo(x(signal.time[k] * factor), y(signal.values[k])); }
          down = true;
        }
        pen.stroke();
      }
      pen.setLineDash([]);
      chart.drawn = pen.getImageData(0, 0, canvas.width, canvas.height);
      chart.x = x;
    }

    // Let the cursors and the values be those of a time.
    cursor(time) {
      this.time = time;
      const style = this.charts.length ? getComputedStyle(this.parts.charts.closest(".mbsim-view")) : null;
      for (const chart of this.charts) {
        if (!chart.drawn) { continue; }
        const pen = chart.canvas.getContext("2d");
        pen.putImageData(chart.drawn, 0, 0);
        pen.strokeStyle = style.getPropertyValue("--ink");
        pen.lineWidth = 1;
        pen.beginPath();
        pen.moveTo(chart.x(time), chart.top);
        pen.lineTo(chart.x(time), chart.bottom);
        pen.stroke();
        for (const { name, box } of chart.values) { box.textContent = shown(this.runs[0].valueAt(name, time)); }
      }
    }
  }
  Curves.shown = shown;
  Curves.ticks = ticks;
  return Curves;
})();
