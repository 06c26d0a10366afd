"use strict";
// Each `.player` has its data beside it: whole numbers of 16 bits, see cosim/plot/player.py.
(() => {
  const NOWHERE = 65535, TRAIL = 3;
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;

  function start(root, data = JSON.parse(root.querySelector("script").textContent)) {
    const canvas = root.querySelector("canvas"), pen = canvas.getContext("2d");
    const [button, slider, clock, speed] = ["button", "input", "output", "select"].map(q => root.querySelector(q));
    const n = data.count, times = data.times, last = times.length - 1, span = times[last] - times[0];
    const x = new Uint16Array(bytes(data.x)), unit = data.scale / (NOWHERE - 1);
    const references = data.references && new Uint16Array(bytes(data.references));
    const headings = data.headings && new Uint16Array(bytes(data.headings));
    const neighbours = data.neighbours && new Int16Array(bytes(data.neighbours));
    const weights = data.weights && new Uint8Array(bytes(data.weights));
    const width = data.high[0] - data.low[0], height = data.high[1] - data.low[1];
    const LEFT = 46, BOTTOM = 34, TOP = 8, RIGHT = 10;
    const paint = (name, usual) => getComputedStyle(root).getPropertyValue(name).trim() || usual;  // of the page
    let hues = [], at = 0, playing = false, before = 0, simulated = times[0], zoom = 1, w = 0, h = 0;

    slider.max = last;
    for (const factor of [0.25, 0.5, 1, 2, 5, 10]) {
      const option = new Option(`${factor} ×`, factor, factor === 1, factor === 1);
      option.title = "times real time";
      speed.add(option);
    }
    if (span > 60 || span < 2) {  // plays in ten seconds
      const fit = Number((span / 10).toPrecision(2)) || 1;
      speed.add(new Option(`${fit} ×`, fit, true, true));
    }

    const place = (array, k, i) => {
      const a = array[2 * (k * n + i)], b = array[2 * (k * n + i) + 1];
      return a === NOWHERE || b === NOWHERE ? null : [LEFT + a * unit * zoom, h - BOTTOM - b * unit * zoom];
    };

    function resize() {
      const ratio = window.devicePixelRatio || 1, room = canvas.clientWidth || 800;
      zoom = Math.min((room - LEFT - RIGHT) / width, Math.max(240, 0.8 * innerHeight - 80) / height);
      w = room;
      h = Math.round(height * zoom + BOTTOM + TOP);
      canvas.width = w * ratio;
      canvas.height = h * ratio;
      canvas.style.height = `${h}px`;
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      draw();
    }

    function ticks(low, high, room) {
      const rough = (high - low) / Math.max(2, room / 70), power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].find(f => f * power >= rough) * power, found = [];
      for (let t = Math.ceil(low / step); t * step <= high; t++) found.push(Number((t * step).toPrecision(12)));
      return found;
    }

    const hue = i => hues[i % hues.length];

    function frame() {
      const [bw, bh] = [width * zoom, height * zoom], name = data.unit ? ` (${data.unit})` : "";
      pen.clearRect(0, 0, w, h);
      pen.strokeStyle = paint("--grid", "#e2e2e2");
      pen.fillStyle = paint("--soft", "#333");
      pen.lineWidth = 1;
      pen.font = `12px ${getComputedStyle(root).fontFamily}`;
      pen.textAlign = "center";
      for (const t of ticks(data.low[0], data.high[0], bw)) {
        const p = LEFT + (t - data.low[0]) * zoom;
        line([p, h - BOTTOM], [p, TOP]);
        pen.fillText(t, p, h - BOTTOM + 14);
      }
      pen.fillText(`x${name}`, LEFT + bw / 2, h - 4);
      pen.textAlign = "right";
      for (const t of ticks(data.low[1], data.high[1], bh)) {
        const p = h - BOTTOM - (t - data.low[1]) * zoom;
        line([LEFT, p], [LEFT + bw, p]);
        pen.fillText(t, LEFT - 5, p + 4);
      }
      pen.save();
      pen.translate(11, TOP + bh / 2);
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(`y${name}`, 0, 0);
      pen.restore();
      pen.strokeStyle = paint("--soft", "#777");
      pen.strokeRect(LEFT, TOP, bw, bh);
    }

    function line(a, b) {
      pen.beginPath();
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
    }

    function trail(i) {
      pen.beginPath();
      let down = false;
      for (let k = at; k >= 0 && times[at] - times[k] <= TRAIL; k--) {
        const p = place(x, k, i);
        if (p) down ? pen.lineTo(...p) : pen.moveTo(...p);
        down = Boolean(p);
      }
      pen.stroke();
    }

    function edges() {
      for (let i = 0; i < n; i++) for (let s = 0; s < data.capacity; s++) {
        const slot = (at * n + i) * data.capacity + s, j = neighbours[slot];
        const weight = weights ? weights[slot] / 255 : 1;
        const [a, b] = [j >= 0 && place(x, at, j), place(x, at, i)];
        if (!a || !b || !weight) continue;
        const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1, cut = size(i) + 1;
        const u = [(b[0] - a[0]) / length, (b[1] - a[1]) / length], tip = [b[0] - u[0] * cut, b[1] - u[1] * cut];
        pen.globalAlpha = Math.min(1, 0.25 + weight);
        pen.strokeStyle = pen.fillStyle = paint("--soft", "#555");
        line(a, tip);
        pen.beginPath();
        pen.moveTo(...tip);
        pen.lineTo(tip[0] - 7 * u[0] + 3 * u[1], tip[1] - 7 * u[1] - 3 * u[0]);
        pen.lineTo(tip[0] - 7 * u[0] - 3 * u[1], tip[1] - 7 * u[1] + 3 * u[0]);
        pen.fill();
      }
      pen.globalAlpha = 1;
    }

    const size = i => data.radii ? Math.max(data.radii[i] * zoom, 1.5) : 4;

    function cross(i) {
      const q = place(references, at, i);
      pen.strokeStyle = hue(i);
      if (q) { line([q[0] - 4, q[1]], [q[0] + 4, q[1]]); line([q[0], q[1] - 4], [q[0], q[1] + 4]); }
    }

    function body(i) {
      const p = place(x, at, i), colour = hue(i), r = size(i);
      if (!p) return;
      pen.strokeStyle = colour;
      pen.lineWidth = 1.5;
      pen.fillStyle = data.radii && r > 4 ? paint("--card", "white") : colour;
      pen.beginPath();
      pen.arc(...p, r, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
      const turn = headings && headings[at * n + i];
      if (headings && turn !== NOWHERE && r > 4) {
        const angle = turn / (NOWHERE - 1) * 2 * Math.PI, [c, s] = [Math.cos(angle), -Math.sin(angle)];
        line([p[0] + r / 2 * c, p[1] + r / 2 * s], [p[0] + r * c, p[1] + r * s]);
      }
      if (r > 8) {
        pen.fillStyle = paint("--ink", "#111");
        pen.textAlign = "center";
        pen.fillText(i + 1, p[0], p[1] + 4);
      }
    }

    function draw() {
      hues = data.colours.map((usual, k) => paint(`--c${k}`, usual));
      frame();
      pen.save();
      pen.beginPath();
      pen.rect(LEFT, TOP, width * zoom, height * zoom);
      pen.clip();
      for (let i = 0; i < n; i++) {
        pen.strokeStyle = hue(i);
        pen.lineWidth = 1;
        trail(i);
      }
      if (references && n <= 60) for (let i = 0; i < n; i++) cross(i);
      if (neighbours) edges();
      for (let i = 0; i < n; i++) body(i);
      pen.restore();
      slider.value = at;
      clock.textContent = `t = ${times[at].toFixed(span < 1 ? 4 : 2)} s`;
    }

    function show(k) {
      at = Math.max(0, Math.min(last, k));
      simulated = times[at];
      draw();
      tell();
    }

    const tell = () => root.dispatchEvent(new CustomEvent("time", { detail: times[at] }));

    // Goes on from where another player is, of a run before.
    function take(other) {
      if (!other) return;
      speed.value = other.speed;
      const k = times.findIndex(t => t >= other.time - 1e-9);
      at = k < 0 ? last : k;
      simulated = times[at];
      draw();
      play(other.playing);
      other.play(false);
    }

    function step(now) {
      if (!playing) return;
      simulated += (now - before) / 1000 * Number(speed.value);
      before = now;
      while (at < last && times[at + 1] <= simulated) at++;
      draw();
      tell();
      if (at >= last) play(false); else requestAnimationFrame(step);
    }

    function play(on) {
      playing = on && last > 0;
      button.textContent = playing ? "pause" : "play";
      if (!playing) return;
      if (at >= last) show(0);
      before = performance.now();
      requestAnimationFrame(step);
    }

    button.addEventListener("click", () => play(!playing));
    slider.addEventListener("input", () => { play(false); show(Number(slider.value)); });
    new ResizeObserver(() => { if (canvas.clientWidth !== w) resize(); }).observe(canvas);
    resize();
    root.cosim = {
      show, play, take, get at() { return at; }, get playing() { return playing; }, get time() { return times[at]; },
      get speed() { return speed.value; },
    };
  }

  window.startPlayer = start;
  document.querySelectorAll(".player").forEach(root => start(root));
})();
