// Plots over time on a canvas each: axes, zoom, pan, and a run before behind the one that is shown.
// All plots of a page share a `Span`: the part of the time that they show, and where the mouse is.

const LEFT = 58, RIGHT = 8, TOP = 8, BOTTOM = 22, HUES = 8;

export const style = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const hue = k => `var(--c${k % HUES})`;
export const isDashed = k => Math.floor(k / HUES) % 2 === 1;

// Doubles out of base64.
export function numbers(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return new Float64Array(bytes.buffer);
}

export function ticks(low, high, most) {
  const rough = (high - low) / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(f => f * power).find(s => s >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { step, at: found };
}

// A tick as text: no more digits than the step has, an exponent where there would be many zeros.
export function label(value, step) {
  if (Math.abs(value) < step / 1e6) return "0";
  const size = Math.max(Math.abs(value), step), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  if (size >= 1e5 || size < 1e-3 || digits > 6) {
    return value.toExponential(Math.max(0, Math.min(8, Math.floor(Math.log10(Math.abs(value))) + digits))).replace("e+", "e");
  }
  return value.toFixed(digits);
}

export const short = value => Number.isFinite(value)
  ? (Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(3).replace("e+", "e") : String(Number(value.toPrecision(5))))
  : String(value);

export class Span {
  constructor(changed) {
    this.changed = changed;
    this.plots = new Set();
    this.whole = [0, 1];
    this.shown = null;  // null: all of it
    this.cursor = null;
  }
  get ends() { return this.shown || this.whole; }
  zoom(a, b) {
    const [low, high] = this.whole, least = (high - low) * 1e-7;
    [a, b] = [Math.max(low, Math.min(a, b)), Math.min(high, Math.max(a, b))];
    if (b - a < least) return;
    this.shown = a <= low && b >= high ? null : [a, b];
    this.drawAll();
    this.changed();
  }
  move(by) {
    const [a, b] = this.ends, [low, high] = this.whole;
    by = Math.max(low - a, Math.min(high - b, by));
    this.zoom(a + by, b + by);
  }
  reset() { this.zoom(...this.whole); }
  point(time) {
    if (this.cursor === time) return;
    this.cursor = time;
    this.drawAll();
  }
  drawAll() {
    if (this.due) return;
    this.due = requestAnimationFrame(() => { this.due = 0; this.plots.forEach(plot => plot.draw()); });
  }
}

export class Plot {
  // legend: what is told of the cursor's values; units: of the y axis.
  constructor(canvas, span, pointed) {
    Object.assign(this, { canvas, span, pointed, runs: [], unit: "", log: false, high: null, drag: null });
    this.pen = canvas.getContext("2d");
    span.plots.add(this);
    canvas.tabIndex = 0;
    canvas.addEventListener("pointerdown", e => this.down(e));
    canvas.addEventListener("pointermove", e => this.moved(e));
    canvas.addEventListener("pointerup", e => this.up(e));
    canvas.addEventListener("pointercancel", () => { this.drag = null; });
    canvas.addEventListener("pointerleave", () => span.point(null));
    canvas.addEventListener("dblclick", () => { this.range = null; span.reset(); this.draw(); });
    canvas.addEventListener("wheel", e => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", e => this.key(e));
  }
  remove() { this.span.plots.delete(this); }

  // runs: the one that is shown first, then the one before; each {t, lines: [{low, high}]} or null.
  set(runs, unit) {
    this.runs = runs.map(run => run && unpacked(run));
    this.unit = unit;
    this.draw();
  }

  // ---- the mouse and the keys ----

  at(e) {
    const box = this.canvas.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  }
  time(x) { const [a, b] = this.span.ends; return a + (x - LEFT) / (this.w - LEFT - RIGHT) * (b - a); }
  down(e) {
    if (e.button) return;
    this.canvas.setPointerCapture(e.pointerId);
    this.drag = { from: this.at(e), to: this.at(e), pan: e.shiftKey };
  }
  moved(e) {
    const [x, y] = this.at(e);
    if (this.drag) {
      if (this.drag.pan) this.span.move(this.time(this.drag.to[0]) - this.time(x));
      this.drag.to = [x, y];
      if (!this.drag.pan) this.draw();
    } else this.span.point(x >= LEFT && x <= this.w - RIGHT ? this.time(x) : null);
  }
  up() {
    const drag = this.drag;
    this.drag = null;
    if (!drag || drag.pan) return;
    const [[x, y], [u, v]] = [drag.from, drag.to];
    if (Math.abs(v - y) > 24) this.range = [this.value(Math.max(y, v)), this.value(Math.min(y, v))];
    if (Math.abs(u - x) > 5) this.span.zoom(this.time(x), this.time(u)); else this.draw();
  }
  wheel(e) {
    e.preventDefault();
    const [a, b] = this.span.ends, here = this.time(this.at(e)[0]), factor = Math.exp(e.deltaY * 0.0015);
    if (Math.abs(e.deltaX) > Math.abs(e.deltaY)) this.span.move(e.deltaX / this.w * (b - a));
    else this.span.zoom(here - (here - a) * factor, here + (b - here) * factor);
  }
  key(e) {
    const [a, b] = this.span.ends, by = (b - a) / 5, mid = (a + b) / 2;
    const done = { ArrowLeft: () => this.span.move(-by), ArrowRight: () => this.span.move(by), 0: () => this.span.reset(),
      "+": () => this.span.zoom(mid - by, mid + by), "-": () => this.span.zoom(mid - 5 * by, mid + 5 * by) }[e.key];
    if (done) { e.preventDefault(); done(); }
  }

  // ---- drawing ----

  value(y) {
    const [low, high] = this.limits, part = (this.h - BOTTOM - y) / (this.h - TOP - BOTTOM);
    return low + part * (high - low);
  }
  scaled(v) { return this.log ? (v > 0 ? Math.log10(v) : NaN) : v; }
  place(t, v) {
    const [a, b] = this.span.ends, [low, high] = this.limits;
    return [LEFT + (t - a) / (b - a) * (this.w - LEFT - RIGHT), this.h - BOTTOM - (v - low) / (high - low) * (this.h - TOP - BOTTOM)];
  }

  // The range of what is shown, with a margin.
  extent() {
    const [a, b] = this.span.ends;
    let low = Infinity, high = -Infinity;
    for (const run of this.runs) for (const line of run ? run.lines : []) {
      for (let k = 0; k < run.t.length; k++) {
        if (run.t[k] < a || run.t[k] > b) continue;
        const [p, q] = [this.scaled(line.low[k]), this.scaled(line.high[k])];
        if (p < low && p > -Infinity) low = p;
        if (q > high && q < Infinity) high = q;
      }
    }
    if (low > high) return [0, 1];
    const flat = high - low <= 1e-12 * Math.max(Math.abs(low), Math.abs(high));
    const room = flat ? Math.abs(low) * 0.1 || 1 : (high - low) * 0.06;
    return [low - room, high + room];
  }

  draw() {
    const ratio = window.devicePixelRatio || 1, { canvas, pen } = this;
    this.w = canvas.clientWidth;
    this.h = canvas.clientHeight;
    if (!this.w) return;
    canvas.width = Math.round(this.w * ratio);
    canvas.height = Math.round(this.h * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.limits = this.range || this.extent();
    this.axes();
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, this.w - LEFT - RIGHT, this.h - TOP - BOTTOM);
    pen.clip();
    [...this.runs.entries()].reverse().forEach(([k, run]) => run && this.lines(run, k > 0));
    this.marks();
    pen.restore();
    this.pointed(this.span.cursor === null ? null : this.runs.map(run => run && this.read(run, this.span.cursor)));
  }

  axes() {
    const { pen, w, h } = this, [a, b] = this.span.ends, [low, high] = this.limits;
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    const line = style("--grid"), text = style("--soft");
    const xs = ticks(a, b, (w - LEFT - RIGHT) / 70), ys = ticks(low, high, (h - TOP - BOTTOM) / 30);
    pen.textAlign = "center";
    for (const t of xs.at) {
      const x = Math.round(this.place(t, low)[0]) + 0.5;
      pen.fillStyle = line;
      pen.fillRect(x - 0.5, TOP, 1, h - TOP - BOTTOM);
      pen.fillStyle = text;
      pen.fillText(label(t, xs.step) + (t === xs.at.at(-1) ? " s" : ""), Math.min(x, w - 14), h - 7);
    }
    pen.textAlign = "right";
    for (const v of ys.at) {
      if (this.log && ys.step < 1 && v % 1) continue;
      const y = Math.round(this.place(a, v)[1]) + 0.5;
      pen.fillStyle = line;
      pen.fillRect(LEFT, y - 0.5, w - LEFT - RIGHT, 1);
      pen.fillStyle = text;
      pen.fillText(this.log ? `1e${Math.round(v)}` : label(v, ys.step), LEFT - 6, y + 4);
    }
    if (this.unit) {
      pen.save();
      pen.translate(11, TOP + (h - TOP - BOTTOM) / 2);
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(this.unit, 0, 0);
      pen.restore();
    }
    pen.strokeStyle = style("--line");
    pen.strokeRect(LEFT + 0.5, TOP + 0.5, w - LEFT - RIGHT - 1, h - TOP - BOTTOM - 1);
  }

  lines(run, isGhost) {
    const { pen } = this;
    pen.lineJoin = "round";
    run.lines.forEach((line, k) => {
      pen.strokeStyle = style(`--c${k % HUES}`);
      pen.globalAlpha = isGhost ? 0.35 : 1;
      pen.lineWidth = isGhost ? 2.5 : 1.4;
      pen.setLineDash(isDashed(k) ? [5, 3] : []);
      pen.beginPath();
      let down = false;
      const to = (t, v) => {
        const s = this.scaled(v);
        if (!Number.isFinite(s)) { down = false; return; }
        const [x, y] = this.place(t, s);
        if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
        down = true;
      };
      for (let j = 0; j < run.t.length; j++) {
        to(run.t[j], line.low[j]);
        if (line.high !== line.low) to(run.t[j], line.high[j]);
      }
      pen.stroke();
    });
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  // The cursor, and what is being chosen.
  marks() {
    const { pen, drag } = this;
    if (this.span.cursor !== null) {
      pen.fillStyle = style("--soft");
      pen.fillRect(Math.round(this.place(this.span.cursor, 0)[0]), TOP, 1, this.h);
    }
    if (drag && !drag.pan) {
      const [[x, y], [u, v]] = [drag.from, drag.to], tall = Math.abs(v - y) > 24;
      pen.fillStyle = style("--mark");
      pen.globalAlpha = 0.18;
      pen.fillRect(Math.min(x, u), tall ? Math.min(y, v) : TOP, Math.abs(u - x), tall ? Math.abs(v - y) : this.h);
      pen.globalAlpha = 1;
    }
  }

  // The values of all lines at the sample that is nearest to a time.
  read(run, time) {
    let [low, high] = [0, run.t.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (run.t[middle] <= time) low = middle; else high = middle;
    }
    const k = high >= 0 && time - run.t[low] > run.t[high] - time ? high : low;
    return { time: run.t[k], values: run.lines.map(line => line.high[k]) };
  }
}

function unpacked(run) {
  const t = numbers(run.t), low = numbers(run.low), high = run.high === run.low ? low : numbers(run.high), n = t.length;
  const part = (all, k) => all.subarray(k * n, (k + 1) * n);
  const lines = Array.from({ length: run.lines }, (_, k) => ({ low: part(low, k), high: null }));
  lines.forEach((line, k) => { line.high = high === low ? line.low : part(high, k); });
  return { t, lines };
}
