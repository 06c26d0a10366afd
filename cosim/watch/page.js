// The page: shows each state that the server tells of, and tells the server what a person wants.
// All texts of diagrams are set as text, never as markup; the drawing alone is markup, which the server has escaped.

import { Plot, Span, hue, isDashed, short } from "./plots.js";

const $ = id => document.getElementById(id);
const MOST_LINES = 12, FIRST = 6, STEPS = 200;
let state = null, drawn = "", slid = 0, moving = 0, openBlock = "";
const plots = new Map();  // by signal: what is shown, and how
let chosen = null;  // the signals that a person has chosen to see

function el(tag, about = {}, ...inside) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(about)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...inside.flat().filter(part => part !== null && part !== undefined && part !== ""));
  return made;
}

const get = async path => (await fetch(path)).json();
const post = async (path, body) => (await fetch(path, { method: "POST", body: JSON.stringify(body) })).json();

// ---- what is wrong ----

function mistake(one, kind) {
  const width = String(one.line + 9).length, row = [];
  for (const [number, text] of one.lines) {
    const here = number === one.line;
    row.push(el("i", {}, `${String(number).padStart(width)} │ `), here ? el("b", {}, text) : text, "\n");
    if (here && one.column) {
      const before = text.slice(0, one.column - 1).replace(/[^\t]/g, " ");
      row.push(el("i", {}, `${" ".repeat(width)} │ `), before, el("em", {}, "^"), "\n");
    }
  }
  return el("div", { className: "mistake" },
    el("p", {}, one.place ? el("code", { className: "place" }, `${one.place}: `) : "", el("b", {}, `${kind}: `), one.message),
    row.length ? el("pre", {}, row) : "", one.fix ? el("p", { className: "fix" }, `fix: ${one.fix}`) : "");
}

function showMistakes() {
  const found = [...state.mistakes, ...(state.mistakes.length ? [] : state.run?.errors ?? [])];
  $("mistakes").replaceChildren(...found.map(one => mistake(one, "error")),
    ...(state.mistakes.length && state.run ? [el("p", { className: "soft" }, "Below is the last diagram that could run.")] : []));
  $("mistakes").hidden = !found.length;
}

const duration = s => s < 1 ? `${Math.ceil(1000 * s)} ms` : `${s.toPrecision(3)} s`;

function showHead() {
  const { run, sketch, advance } = state;
  const title = sketch?.title || state.path;
  $("title").textContent = title;
  $("path").textContent = state.path;
  document.title = `${state.mistakes.length ? "✗ " : ""}${title}`;
  $("said").textContent = advance?.text || (run
    ? `${short(run.time)} s in ${run.steps} steps · took ${duration(run.seconds.solve)}${run.compiled ? ` · ${run.compiled} kernels compiled` : ""}` : "");
  const [word, kind] = advance?.text ? ["running", "busy"] : state.mistakes.length ? ["has mistakes", "bad"]
    : run ? [run.status, run.status === "completed" ? "good" : "bad"] : ["waiting", ""];
  $("status").textContent = word;
  $("status").className = `pill ${kind}`;
  $("bar").hidden = !advance?.text;
  $("bar").firstElementChild.style.width = `${100 * (advance?.part ?? 0)}%`;
}

// ---- the diagram ----

async function showDrawing() {
  if (!state.sketch || state.sketch.drawing === drawn) return markBlock();
  drawn = state.sketch.drawing;
  const text = await (await fetch("drawing")).text();
  const parsed = new DOMParser().parseFromString(text.slice(text.indexOf("<svg")), "text/html");
  const svg = parsed.querySelector("svg");
  for (const box of svg.querySelectorAll("[data-block]")) {
    box.setAttribute("tabindex", "0");
    box.setAttribute("role", "button");
    box.setAttribute("aria-label", box.dataset.block);
  }
  $("drawing").replaceChildren(svg);
  $("drawing").classList.toggle("large", svg.width.baseVal.value > 2600);
  markBlock();
}

function markBlock() {
  for (const box of $("drawing").querySelectorAll("[data-block]")) {
    box.classList.toggle("chosen", box.dataset.block === openBlock);
  }
}

$("drawing").addEventListener("click", event => {
  const box = event.target.closest("[data-block]");
  open(box ? box.dataset.block : "");
});

$("drawing").addEventListener("keydown", event => {
  if (event.key === "Enter" && event.target.dataset.block) open(event.target.dataset.block);
});

function open(name) {
  openBlock = name === openBlock ? "" : name;
  $("filter").value = openBlock ? `${openBlock}.` : "";
  filterSliders();
  markBlock();
  showBlock();
}

async function showBlock() {
  const block = openBlock ? await get(`block?name=${encodeURIComponent(openBlock)}`) : null;
  $("block").hidden = !block;
  if (!block) return;
  const many = block.parts.length > 1;
  $("block").replaceChildren(
    el("h2", {}, block.name, el("small", {}, block.time === null ? "" : `values at t = ${short(block.time)} s`),
      el("span", { className: "tools" }, el("button", { type: "button", onclick: () => open(openBlock) }, "close"))),
    el("div", { className: "scroll" }, block.parts.map(part => blockPart(part, many))));
}

function blockPart(part, many) {
  const of = part.count ? `${part.count} × ` : "", due = part.due ? `, ${part.due}` : "";
  const rows = (ports, value) => ports.map(p => el("tr", {}, el("td", { className: "name" }, p.name),
    el("td", { className: "value" }, value(p)), el("td", { className: "soft" }, [p.shape, p.unit].filter(Boolean).join(" ")),
    el("td", { className: "soft" }, p.about)));
  const table = (title, ports, value) => ports.length ? [el("h3", {}, title), el("table", {}, rows(ports, value))] : [];
  const box = p => el("label", { title: p.recorded ? "show its plot" : "record it, and show its plot" },
    el("input", { type: "checkbox", checked: plots.has(p.signal), onchange: e => choose(p.signal, e.target.checked, p.recorded) }), " ", p.value || "—");
  return el("div", {}, many ? el("h3", {}, part.name) : "", el("p", {}, `${of}${part.type}${due}`, part.about ? `\n${part.about}` : ""),
    part.expressions.length ? el("pre", {}, part.expressions.join("\n")) : "",
    el("div", { className: "ports" }, el("div", {}, table("outputs, states and locals: tick to plot", part.signals, box)),
      el("div", {}, table("inputs", part.inputs, p => p.source)), el("div", {}, table("parameters", part.parameters, p => p.value))));
}

// ---- figures ----

const cells = (row, tag = "td") => el("tr", {}, row.map(([text, kind]) => el(tag, { className: kind || "" }, text)));
const named = (name, about) => el("div", {}, name, about ? el("div", { className: "soft" }, about) : "");

function showFigures() {
  const run = state.run, beside = run?.before ? (state.chosen.length ? "beside the file as it stands" : "beside the save before") : "";
  $("beside").textContent = beside;
  const changed = text => text && text !== "same" ? "number changed" : "number soft";
  const head = [["", ""], ["value", "number"], ["unit", ""], ...(beside ? [["before", "number"], ["change", "number"]] : [])];
  const rows = (run?.metrics ?? []).map(m => cells([[named(m.name, m.window), "name"], [m.value, "number"], [m.unit, "soft"],
    ...(beside ? [[m.before, "number soft"], [m.change, changed(m.change)]] : [])]));
  $("metrics").querySelector("table").replaceChildren(...(rows.length ? [cells(head, "th"), ...rows]
    : [cells([[run ? "the diagram has no metrics" : "no run yet", "soft"]])]));
  const judged = run?.requirements ?? [];
  $("requirements").hidden = !judged.length;
  const top = [["", ""], ["", ""], ["margin", "number"], ["unit", ""], ...(beside ? [["before", "number"], ["change", "number"]] : [])];
  $("requirements").querySelector("table").replaceChildren(cells(top, "th"), ...judged.map(r => {
    const row = cells([[named(r.name, r.place), "name"], [r.word, r.holds === true ? "good" : r.holds === false ? "bad" : "soft"], [r.margin, "number"],
      [r.unit, "soft"], ...(beside ? [[r.before, "number soft"], [r.change, changed(r.change)]] : [])]);
    row.title = r.formula;
    return row;
  }));
}

function showChecks() {
  const { sketch, run } = state;
  if (!sketch) return;
  const known = new Set(), warnings = [...(run?.warnings ?? []), ...sketch.warnings]
    .filter(w => !known.has(w.place + w.message) && known.add(w.place + w.message));
  const findings = [...sketch.check.findings, ...(run?.findings ?? [])].filter(f => f.holds !== false);  // those are warned of
  const open = findings.filter(f => f.holds === null).length, holding = findings.length - open;
  $("checks").querySelector("div").replaceChildren(
    el("ul", {}, sketch.check.said.map(text => el("li", {}, text)), run?.ended ? el("li", {}, run.ended) : "",
      (run?.events ?? []).map(text => el("li", {}, text))),
    ...warnings.map(w => el("details", { className: "warning" },
      el("summary", {}, el("b", {}, "warning: "), w.message), mistake(w, "warning"))),
    findings.length ? el("details", {}, el("summary", {}, `conditions: ${holding} hold${open ? `, ${open} open` : ""}`),
      el("ul", {}, findings.map(f => el("li", {}, el("span", { className: `word ${f.holds ? "good" : "soft"}` }, f.word), ` ${f.text}`)))) : "",
    el("details", {}, el("summary", {}, "order of evaluation"), sketch.check.order.join(", ")));
}

// ---- plots ----

const span = new Span(() => refresh());

function layoutOf(name) { return state.run?.signals.find(signal => signal.name === name); }

// The signals that are shown: chosen ones, else those of metrics and a few more.
function shownSignals() {
  const known = state.run?.signals ?? [];
  if (chosen) return known.filter(s => chosen.includes(s.name));
  const first = state.run.first.map(layoutOf).filter(Boolean);
  const rest = known.filter(s => !s.whole && !first.includes(s));
  const more = [...rest.filter(s => s.output), ...rest.filter(s => !s.output)];
  return [...first.filter(s => !s.whole), ...first.filter(s => s.whole), ...more].slice(0, FIRST);
}

async function choose(name, on, recorded = true) {
  const now = shownSignals().map(s => s.name);
  chosen = on ? [...now, name] : now.filter(other => other !== name);
  if (on && !recorded) await post("show", { signal: name });
  else { arrange(); await refresh(); }
}

function arrange() {
  const wanted = shownSignals();
  for (const [name, plot] of plots) {
    const kept = wanted.find(s => s.name === name);
    if (kept && JSON.stringify(kept) === plot.mark) continue;
    plot.canvas.remove();
    plot.root.remove();
    plots.delete(name);
  }
  for (const layout of wanted) if (!plots.has(layout.name)) plots.set(layout.name, card(layout));
  $("plots").replaceChildren(...(wanted.length ? wanted.map(s => plots.get(s.name).root)
    : [el("p", { className: "soft" }, "Nothing is shown: choose signals, or click a block and tick one of its ports.")]));
  showChoices();
}

function showChoices() {
  if ($("choices").hidden) return;
  $("choices").replaceChildren(...(state.run?.signals ?? []).map(s => el("label", { title: s.about },
    el("input", { type: "checkbox", checked: plots.has(s.name), onchange: e => choose(s.name, e.target.checked) }), ` ${s.name}`)));
}

$("choose").addEventListener("click", () => {
  $("choices").hidden = !$("choices").hidden;
  $("choose").setAttribute("aria-expanded", String(!$("choices").hidden));
  showChoices();
});
$("whole").addEventListener("click", () => span.reset());

function card(layout) {
  const canvas = el("canvas", { "aria-label": `plot of ${layout.name}`, role: "img" }), legend = el("div", { className: "legend" });
  const made = { layout, mark: JSON.stringify(layout), canvas, legend, channel: 0, first: 0 };
  const log = el("button", { type: "button", title: "logarithmic", onclick: () => {
    made.plot.log = !made.plot.log;
    made.plot.range = null;
    log.classList.toggle("on", made.plot.log);
    made.plot.draw();
  } }, "log");
  const channels = layout.channels.length ? el("select", { "aria-label": "channel", onchange: e => { made.channel = Number(e.target.value); refresh(); } },
    layout.channels.map((name, k) => el("option", { value: k }, name))) : "";
  const from = layout.lines > MOST_LINES ? el("input", { type: "number", min: 1, max: layout.lines, value: 1, title: `the first of ${MOST_LINES} of ${layout.lines}`,
    onchange: e => { made.first = Math.max(0, Math.min(layout.lines - 1, Number(e.target.value) - 1)); refresh(); } }) : "";
  made.root = el("div", { className: "plot" }, el("h3", {}, layout.name, el("span", { className: "about", title: layout.about }, layout.about), from, channels, log), canvas, legend);
  made.plot = new Plot(canvas, span, values => tell(made, values));
  return made;
}

// The legend: which line is which, and their values at the cursor.
function tell(made, values) {
  const { layout, legend, first } = made, count = Math.min(layout.lines - first, MOST_LINES), [now, before] = values ?? [];
  legend.replaceChildren(now ? el("span", {}, `t = ${short(now.time)} s`) : "", ...Array.from({ length: count }, (_, k) => {
    const name = layout.names[first + k] ?? `${layout.word} ${first + k + 1}`, value = now?.values[k], old = before?.values[k];
    if (layout.lines === 1 && value === undefined) return "";
    return el("span", {}, layout.lines > 1 ? [swatch(k), name, " "] : "", value === undefined ? "" : el("b", {}, short(value)),
      old === undefined || value === undefined ? "" : ` (${short(old)})`);
  }));
}

function swatch(k) {
  const made = el("i", { className: isDashed(k) ? "dashed" : "" });
  made.style.borderColor = hue(k);
  return made;
}

// Does something once at a time, and once more for all who wished it meanwhile: the newest wish counts.
function once(task) {
  let busy = false, again = false;
  return async () => {
    again = true;
    if (busy) return;
    busy = true;
    try {
      while (again) {
        again = false;
        await task();
      }
    } finally { busy = false; }
  };
}

const refresh = once(ask);

async function ask() {
  const run = state?.run, several = [...plots.values()];
  if (!run) return;
  const numbers = run.before ? [run.number, run.before] : [run.number];
  const width = Math.round(Math.max(300, ...several.map(p => p.canvas.clientWidth)) * (window.devicePixelRatio || 1));
  const wanted = several.map(p => ({ name: p.layout.name, channel: p.channel, first: p.first, count: MOST_LINES }));
  const found = await post("curves", { runs: numbers, span: span.shown, width, plots: wanted });
  if (found.runs.some(r => !r.plots)) return;  // another run has taken its place, of which the next state tells
  const spans = found.runs.map(r => r.span).filter(Boolean);
  if (!spans.length) spans.push([0, 1]);
  span.whole = [Math.min(...spans.map(s => s[0])), Math.max(...spans.map(s => s[1]))];
  if (span.whole[0] === span.whole[1]) span.whole[1] += 1;
  if (span.shown && (span.shown[0] >= span.whole[1] || span.shown[1] <= span.whole[0])) span.shown = null;
  several.forEach((p, k) => p.plot.set(found.runs.map(r => r.plots[k] ?? null), p.layout.units[p.channel] ?? ""));
  $("span").textContent = span.shown ? `${short(span.shown[0])} – ${short(span.shown[1])} s` : "";
  $("whole").hidden = !span.shown;
  $("ghosted").hidden = numbers.length < 2;
  document.body.dataset.plotted = run.number;
}

// ---- motion ----

async function showMotion() {
  const run = state.run;
  if (!run?.moving) { $("moving").hidden = true; return; }
  if (run.number === moving) return;
  moving = run.number;
  const data = await get(`motion?run=${run.number}`);
  if (!data || run.number !== moving) return;
  const before = $("player").querySelector(".player")?.cosim;
  const root = el("div", { className: "player" }, el("canvas", { role: "img", "aria-label": "bodies that move" }),
    el("div", { className: "controls" }, el("button", { type: "button" }, "play"),
      el("input", { type: "range", min: 0, value: 0, step: 1, "aria-label": "time" }), el("output"), el("select", { "aria-label": "speed" })));
  $("moving").hidden = false;
  $("player").replaceChildren(root);
  window.startPlayer(root, data);
  root.addEventListener("time", e => span.point(e.detail));
  root.cosim.take(before);
}

// ---- sliders ----

let values = {};  // what sliders say, by path
const rows = new Map();  // by path

async function showSliders() {
  if (state.slid !== slid) {
    slid = state.slid;
    dragging = "";
    const sliders = await get("sliders");
    rows.clear();
    $("sliders").replaceChildren(...[...grouped(sliders)].map(([name, own]) =>
      el("fieldset", {}, el("legend", {}, name), own.map(slider))));
    if (!sliders.length) $("sliders").append(el("p", { className: "soft" }, "no parameter is a number"));
    filterSliders();
  }
  if (!dragging) {
    values = Object.fromEntries(state.chosen.map(one => [one.path, one.value]));
    for (const row of rows.values()) row.put(values[row.slider.path] ?? row.slider.value);
  }
  showKept();
}

function grouped(sliders) {
  const found = new Map();
  for (const s of sliders) found.set(s.block, [...(found.get(s.block) ?? []), s]);
  return found;
}

function showKept() {
  if (!state.chosen.length) { $("kept").replaceChildren(); return; }
  const yaml = state.chosen.map(one => one.yaml).join("\n"), options = state.chosen.map(one => one.option).join(" ");
  const copy = text => el("button", { type: "button", onclick: e => {
    navigator.clipboard.writeText(text).then(() => { e.target.textContent = "copied"; });
  } }, "copy");
  const kept = (said, text) => [el("div", { className: "row" }, el("span", {}, said), copy(text)), el("pre", {}, el("code", {}, text))];
  $("kept").replaceChildren(
    ...(state.path.endsWith(".fmu") ? [] : kept("to keep this, write in the diagram", yaml)), ...kept("or on the command line", options),
    el("div", { className: "row" }, el("span", { className: "soft" }, "a save puts all sliders back"),
      el("button", { type: "button", onclick: () => { values = {}; send(); } }, "back to the file")));
}

// A slider's ends: those of the file, of the value itself where that lies beyond, or decades around it.
function ends(s, value) {
  if (isLog(s)) return [Math.log10(s.value / 100), Math.log10(s.value * 100)];
  return [Math.min(s.low, value), Math.max(s.high, value)];
}
const isLog = s => $("log").checked && s.value > 0 && !s.integer;

// With the digits of a slider's step.
function rounded(s, value) {
  if (s.integer) return Math.round(value);
  if (isLog(s)) return Number(value.toPrecision(3));
  const step = (s.high - s.low) / STEPS;
  return Number(value.toFixed(Math.max(0, Math.min(15, -Math.floor(Math.log10(step))))));
}

let dragging = "";

function slider(s) {
  const range = el("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": s.path });
  const box = el("input", { type: "number", step: "any", "aria-label": `${s.path}, as a number` });
  const label = el("label", { title: [s.path, s.about].filter(Boolean).join("\n") }, s.name);
  const row = el("div", { className: "slider" }, label, range, box, el("span", { className: "soft" }, s.unit),
    el("button", { type: "button", title: `back to ${s.value}`, onclick: () => take(undefined) }, "×"));
  row.dataset.path = s.path;
  let value = s.value, [low, high] = [0, 1];
  const put = now => {
    value = now;
    [low, high] = ends(s, value);
    range.value = Math.round(STEPS * ((isLog(s) ? Math.log10(value) : value) - low) / (high - low || 1));
    if (document.activeElement !== box) box.value = String(Number(value.toPrecision(6)));
    row.classList.toggle("moved", s.path in values);
  };
  const take = now => {
    if (now === undefined || now === s.value) delete values[s.path]; else values[s.path] = now;
    put(now ?? s.value);
    send();
  };
  range.addEventListener("input", () => {
    dragging = s.path;
    const part = low + (high - low) * Number(range.value) / STEPS, at = Number(range.value);
    const now = rounded(s, isLog(s) ? 10 ** part : part);
    if (now === s.value) delete values[s.path]; else values[s.path] = now;
    value = now;
    box.value = String(now);
    range.value = at;
    row.classList.toggle("moved", s.path in values);
    send();
  });
  range.addEventListener("change", () => { dragging = ""; });
  box.addEventListener("change", () => { if (box.value !== "" && Number.isFinite(Number(box.value))) take(Number(box.value)); });
  rows.set(s.path, { slider: s, put, row });
  put(s.value);
  return row;
}

$("log").addEventListener("change", () => rows.forEach(row => row.put(values[row.slider.path] ?? row.slider.value)));
$("filter").addEventListener("input", filterSliders);

function filterSliders() {
  const wanted = $("filter").value.toLowerCase();
  for (const group of $("sliders").querySelectorAll("fieldset")) {
    let any = false;
    for (const row of group.querySelectorAll(".slider")) {
      const { block, name } = rows.get(row.dataset.path).slider;
      row.hidden = !`${block}.${name}`.toLowerCase().includes(wanted);
      any ||= !row.hidden;
    }
    group.hidden = !any;
  }
}

const send = once(() => post("slide", { values }));

// ---- the state ----

async function show(new_) {
  const before = state?.run, sketched = state?.sketch?.sketched;
  state = new_;
  showHead();
  showMistakes();
  showFigures();
  const another = state.run && (state.run.number !== before?.number || state.run.before !== before?.before);
  if (another) {
    arrange();
    await refresh();
    document.body.dataset.run = state.run.number;  // its figures and plots are drawn
  }
  await Promise.all([showSliders(), showDrawing()]);
  if (another || state.sketch?.sketched !== sketched) showChecks();
  if (another && openBlock) await showBlock();
  if (another) await showMotion();
}

let newest = null;
const take = once(() => show(newest));

const events = new EventSource("events");
events.onmessage = event => { newest = JSON.parse(event.data); take(); };
events.onerror = () => {
  $("status").textContent = "cosim watch has ended";
  $("status").className = "pill bad";
};
addEventListener("resize", () => span.drawAll());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => span.drawAll());
