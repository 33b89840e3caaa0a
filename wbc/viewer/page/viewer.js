"use strict";
// The page beside viser's scene: tells and is told in the message format of docs/viewer.md, nothing else.
const $ = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);
const bare = query.has("bare"); // the scene alone, for pictures
let me = Math.random().toString(36).slice(2, 12), hello = null, state = null, operator = "";
let dragging = new Set(), told = 0, firstControl = true, rows = {};
const seen = { states: 0, since: performance.now(), rate: 0 };
window.wbc = { get state() { return state; }, get hello() { return hello; }, get operator() { return operator; }, get me() { return me; }, get open() { return open; }, get software() { return software; }, patience, seen, send, drop() { link.postMessage({ close: true }); } };

function send(message) { link.postMessage({ text: JSON.stringify({ wbc: 1, ...message }) }); }
function set(item, values) { send({ type: "set", item, values }); }
function make(tag, fields = {}, ...children) { const e = Object.assign(document.createElement(tag), fields); e.append(...children); return e; }
function number(x, unit) {
  if (x === null || x === undefined) return "–";
  const a = Math.abs(x);
  if (unit === "m" || unit === "rad") return a < 0.0995 ? `${(1e3 * x).toFixed(a < 0.00995 ? 2 : 1)} m${unit}` : `${x.toFixed(3)} ${unit}`;
  return `${Number(x.toPrecision(3))} ${unit || ""}`;
}

const link = new Worker("link.js");
let open = false;
link.onmessage = (event) => {
  if (event.data.text) { const message = JSON.parse(event.data.text); if (message.type === "state") { newest = message; seen.states += 1; } else take(message); return; }
  open = event.data.link === "open";
  if (!open) { pill("no connection", "gone"); operator = ""; who(); }
};
link.postMessage({ address: `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/wbc/${me}` });
setInterval(() => link.postMessage({ patience: patience() }), 100);
// One state a picture: what came in between is old
let newest = null;
function draw() { requestAnimationFrame(draw); paced(); if (newest) { const message = newest; newest = null; take(message); } }
requestAnimationFrame(draw);

// Without a graphics card a picture takes up to seconds, in which nothing else runs here: that is slow, not silent
const LONGEST = 20000, software = drawsBySoftware();
let slowest = 0, drawn = performance.now();
function drawsBySoftware() {
  const gl = make("canvas").getContext("webgl");
  const told = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return !gl || /swiftshader|llvmpipe|softpipe|software|basic render/i.test(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}
function paced() { const now = performance.now(); slowest = Math.max(now - drawn, 0.98 * slowest); drawn = now; }
function patience() { return Math.max(hello ? 2500 * hello.silence : LONGEST, software ? LONGEST : Math.min(4 * slowest, LONGEST)); }

function take(message) {
  if (message.type === "hello") { hello = message; operator = message.operator; me = message.you; build(); }
  else if (message.type === "state") { state = message; show(); }
  else if (message.type === "operator") { operator = message.name; who(); }
  else if (message.type === "refused") notice(message.reason);
  else if (message.type === "ended") notice(message.reason);
}

function notice(text) { const n = $("notice"); n.textContent = text; n.hidden = false; clearTimeout(n.timer); n.timer = setTimeout(() => { n.hidden = true; }, 5000); }
function pill(text, kind) { $("status").textContent = text; $("status").className = `pill ${kind}`; }
function who() {
  const mine = operator === me;
  $("operator").textContent = mine ? "you have control" : operator ? "somebody else has control, you watch" : "nobody has control";
  $("control").textContent = mine ? "Release control" : "Take control";
  $("control").disabled = !mine && operator !== "";
}

function build() {
  $("robot").textContent = hello.robot;
  document.title = `${hello.robot} – wbc viewer`;
  if (!$("scene").src) $("scene").src = `scene/${me}`;
  for (const id of ["tasks", "constraints", "postures", "driven"]) $(id).replaceChildren();
  rows = {};
  for (const item of hello.items) {
    const on = make("input", { type: "checkbox", checked: true, title: "on or off" });
    on.onchange = () => set(item.name, { enabled: on.checked });
    const reading = make("td", { className: "n" }), row = make("tr", { id: `item-${item.name}`, title: `${item.kind}${item.form === "task" ? `, level ${item.level}` : ""}` });
    row.append(make("td", {}, on), make("td", {}, item.name), reading);
    const entry = { row, on, reading, sliders: [] };
    if (item.form === "task") {
      const weight = make("input", { type: "range", className: "weight", min: -8, max: 4, step: 0.25, title: "weight, powers of ten" });
      weight.oninput = () => { dragging.add(weight); set(item.name, { weight: 10 ** Number(weight.value) }); };
      weight.onchange = () => dragging.delete(weight);
      row.append(make("td", {}, weight));
      entry.weight = weight;
      $("tasks").append(row);
      if (item.inputs.some((i) => i.name === "target" && i.rate)) $("driven").append(make("option", { value: item.name }, item.name));
      const target = item.inputs.find((i) => i.name === "target");
      if (item.posture && target.kind === "configuration") posture(item, entry);
      else if (target && target.size === 1) dial(item, target, entry);
    } else $("constraints").append(row);
    rows[item.name] = entry;
  }
  $("driving").hidden = !$("driven").length || hello.walk || !!hello.pairs;
  $("pairing").hidden = !hello.pairs;
  if (hello.pairs) $("pair").replaceChildren(...hello.pairs.map((p) => make("option", { value: p.name }, p.name)));
  commanded = null;
  $("walking").hidden = !hello.walk;
  if (hello.walk) {
    $("stick").hidden = false;
    $("arm").replaceChildren(make("option", { value: "" }, "the body"), ...hello.arms.map((name) => make("option", { value: name }, name)));
  }
  who();
  if (software) notice(`This browser draws by software: pictures are few, and the robot is stopped only after ${patience() / 1000} s without one.`);
  const auto = hello.live && firstControl && operator === "" && !query.has("watch");
  if (auto) { firstControl = false; send({ type: "operate" }); }
  $("control").hidden = $("stop").hidden = !hello.live;
  $("live").hidden = !hello.live;
  document.body.classList.toggle("bare", bare);
}

function slide(label, low, high, unit, write) {
  const input = make("input", { type: "range", min: low, max: high, step: "any" }), out = make("output");
  input.oninput = () => { dragging.add(input); out.textContent = number(Number(input.value), unit); write(Number(input.value)); };
  input.onchange = () => setTimeout(() => dragging.delete(input), 300);
  return { input, out, unit, element: make("div", { className: "slide" }, make("span", { title: label }, label), input, out) };
}
function posture(item, entry) {
  const box = make("details", { open: hello.joints.length < 12 }, make("summary", {}, `${item.name}: joints`));
  for (const joint of hello.joints) {
    if (joint.place < 0 || joint.low === null || joint.high === null) continue;
    const one = slide(joint.name, joint.low, joint.high, joint.unit, (value) => {
      const target = state.items[item.name].values.target.slice(); target[joint.place] = value; set(item.name, { target });
    });
    one.read = (values) => values.target[joint.place];
    entry.sliders.push(one); box.append(one.element);
  }
  $("postures").append(box);
}
function dial(item, target, entry) {
  const span = target.unit === "rad" ? Math.PI : 1;
  const one = slide(`${item.name} target`, -span, span, target.unit, (value) => set(item.name, { target: value }));
  one.read = (values) => values.target;
  entry.sliders.push(one); $("postures").prepend(one.element);
}

// Rates of what the active pair commands, as parts of full speed; a slider that is let go asks for rest
let commanded = null, driving = [];
function pairing() {
  if (commanded !== state.pair) {
    commanded = state.pair;
    const about = hello.pairs.find((p) => p.name === commanded);
    $("pair").value = commanded;
    $("swap").disabled = !about.swapped;
    driving = about.rows.map((row, k) => {
      const unit = about.units[k], full = hello.fastest[unit === "m" ? 0 : 1];
      const one = slide(row, -1, 1, "", () => { one.out.textContent = `${number(full * one.input.value, unit)}/s`; });
      one.input.value = 0;
      one.input.onchange = () => { one.input.value = 0; one.out.textContent = ""; };
      return one;
    });
    $("rows").replaceChildren(...driving.map((one) => one.element));
  }
  $("sigma").textContent = `${state.sigma.toPrecision(2)}; the task gives way below ${state.least.toPrecision(2)}`;
  $("warning").textContent = state.warning;
  $("warning").hidden = !state.warning;
}

function show() {
  if (hello.pairs) pairing();
  const stopped = state.stopped || "";
  if (stopped) pill(`stopped: ${stopped}${state.speed > 1e-4 ? ", braking" : ""}`, "stopped");
  else if (state.previewed) pill("self-motion is shown, not commanded", "relaxed");
  else pill(state.ended ? "the loop has ended" : state.status, state.ended ? "gone" : state.status);
  $("resume").hidden = !stopped;
  $("approve").hidden = !state.waits;
  if (state.walk) {
    if (document.activeElement !== $("arm")) $("arm").value = state.walk.arm;
    $("approve").textContent = state.walk.waiting ? `Lift ${state.walk.waiting}` : "Lift the limb";
    $("reason").textContent = state.walk.reason;
  }
  const now = performance.now();
  if (now - seen.since > 1000) { seen.rate = (1e3 * seen.states) / (now - seen.since); seen.states = 0; seen.since = now; }
  $("rates").textContent = `${seen.rate.toFixed(0)} states/s${state.sentence_rate ? `, sentence ${state.sentence_rate.toFixed(0)}/s` : ""}`;
  for (const [name, about] of Object.entries(state.items)) {
    const entry = rows[name];
    if (!entry) continue;
    entry.row.className = `${about.on ? "" : "off"} ${about.binds ? "binds" : ""}`;
    entry.row.hidden = !!hello.pairs && !about.on;
    if (document.activeElement !== entry.on) entry.on.checked = about.on;
    entry.reading.textContent = about.residual ? Object.entries(about.residual).map(([u, x]) => number(x, u)).join(", ")
      : about.margin !== undefined ? `${number(about.margin, about.unit)}` : about.binds ? "binds" : "";
    entry.reading.title = about.row ? `least: ${about.row}` : "";
    if (entry.weight && !dragging.has(entry.weight) && about.values.weight > 0) entry.weight.value = Math.log10(about.values.weight);
    for (const one of entry.sliders) {
      if (dragging.has(one.input)) continue;
      const value = one.read(about.values);
      if (Math.abs(Number(one.input.value) - value) > 1e-5) { one.input.value = value; one.out.textContent = number(value, one.unit); }
    }
  }
  $("binding").replaceChildren(...[...state.binding, ...state.relaxed.map((r) => `gave way: ${r}`)].slice(0, 14).map((text) => make("li", {}, text)));
  if (state.sentences && state.sentences.join("\n") !== told) {
    told = state.sentences.join("\n");
    $("why").replaceChildren(...state.sentences.slice(0, 2).map((text, k) => make("p", { className: k ? "" : "first" }, text)));
  }
  const line = state.timeline;
  if (line) {
    $("slider").min = line.begin; $("slider").max = Math.max(line.end, line.begin + 0.1);
    if (!dragging.has($("slider"))) $("slider").value = line.at;
    $("clock").textContent = `${line.at.toFixed(2)} / ${line.end.toFixed(2)} s`;
    $("play").textContent = line.playing ? "Pause" : "Play";
    $("live").disabled = !!line.live;
  }
}

$("stop").onclick = () => send({ type: "stop" });
$("resume").onclick = () => { if (operator !== me) send({ type: "operate" }); send({ type: "resume" }); };
$("control").onclick = () => send({ type: operator === me ? "release" : "operate" });
$("slider").oninput = () => { dragging.add($("slider")); send({ type: "seek", time: Number($("slider").value) }); };
$("slider").onchange = () => setTimeout(() => dragging.delete($("slider")), 200);
$("play").onclick = () => send({ type: "play", speed: state.timeline.playing ? 0 : Number($("speed").value) });
$("speed").onchange = () => send({ type: "play", speed: Number($("speed").value) });
for (const what of ["reach", "follow"]) $(what).onchange = () => send({ type: "show", what, on: $(what).checked });
$("selfmotion").onclick = () => send({ type: "show", what: "self-motion", on: !state.previewed });
$("ask").onchange = () => send({ type: "ask", on: $("ask").checked });
$("approve").onclick = () => send({ type: "approve" });
$("arm").onchange = () => { send({ type: "arm", name: $("arm").value }); $("arm").blur(); };
$("pair").onchange = () => { send({ type: "pair", name: $("pair").value }); $("pair").value = commanded; };
$("swap").onclick = () => send({ type: "swap" });
$("live").onclick = () => send({ type: "live" });
$("showstick").onchange = () => { $("stick").hidden = !$("showstick").checked; };

// Rates: from keys, the stick and a gamepad; half a metre and one radian a second at the most
const FAST = 0.25, TURN = 0.8, keys = new Set(), stick = { x: 0, y: 0 };
function pressed(event, down) {
  if (["INPUT", "SELECT"].includes(event.target.tagName) && event.target.type !== "range" && event.target.type !== "checkbox") return;
  if (event.code === "Space") { if (down) send({ type: "stop" }); event.preventDefault(); return; }
  if (down) keys.add(event.code); else keys.delete(event.code);
}
addEventListener("keydown", (event) => pressed(event, true));
addEventListener("keyup", (event) => pressed(event, false));
addEventListener("blur", () => keys.clear());
// Keys reach the scene's frame while it has the focus; it is of this origin
$("scene").addEventListener("load", () => {
  const inner = $("scene").contentWindow;
  // viser's panel, which holds its tree of the scene alone, cannot be left out by its server
  inner.document.head.append(make("style", { textContent: "[data-floating-window] { display: none !important; }" }));
  inner.addEventListener("keydown", (event) => pressed(event, true), true);
  inner.addEventListener("keyup", (event) => pressed(event, false), true);
  inner.addEventListener("blur", () => keys.clear());
});
const knob = $("knob");
knob.onpointerdown = (event) => { knob.setPointerCapture(event.pointerId); stick.id = event.pointerId; };
knob.onpointermove = (event) => {
  if (stick.id !== event.pointerId) return;
  const box = $("stick").getBoundingClientRect(), x = event.clientX - box.left - 65, y = event.clientY - box.top - 63, r = Math.max(1, Math.hypot(x, y) / 50);
  stick.x = x / r / 50; stick.y = y / r / 50; knob.style.left = `${48 + 50 * stick.x}px`; knob.style.top = `${46 + 50 * stick.y}px`;
};
knob.onpointerup = knob.onpointercancel = () => { stick.id = undefined; stick.x = stick.y = 0; knob.style.left = "48px"; knob.style.top = "46px"; };
$("lift").onchange = () => { $("lift").value = 0; };
const axis = (plus, minus) => (keys.has(plus) ? 1 : 0) - (keys.has(minus) ? 1 : 0);
const dead = (x) => (Math.abs(x) < 0.15 ? 0 : x);
let rating = false;
setInterval(() => {
  if (!hello || operator !== me) return;
  if (hello.pairs) {
    const rates = driving.map((one) => Number(one.input.value)), some = rates.some((x) => x);
    if (some || rating) send({ type: "drive", rates });
    rating = some;
    return;
  }
  const pad = (navigator.getGamepads ? [...navigator.getGamepads()] : []).find((p) => p && p.connected);
  const a = pad ? pad.axes.map(dead) : [];
  if (pad && pad.buttons[1] && pad.buttons[1].pressed) send({ type: "stop" });
  const move = [axis("KeyW", "KeyS") - stick.y - (a[1] || 0), axis("KeyA", "KeyD") - stick.x - (a[0] || 0), axis("KeyR", "KeyF") + Number($("lift").value) - (a[3] || 0)];
  const turn = axis("KeyQ", "KeyE") - (a[2] || 0);
  const any = move.some((x) => x) || turn;
  if (!any && !rating) return;
  rating = !!any;
  const most = (x) => Math.max(-1, Math.min(1, x));
  if (hello.walk && state && state.walk && state.walk.arm) { send({ type: "hand", rates: [most(-move[1]), most(move[0]), most(move[2]), most(turn)] }); return; }
  if (hello.walk) { send({ type: "steer", rates: [most(-move[1]), most(move[0]), most(turn)] }); return; }
  const name = $("driven").value, item = hello.items.find((i) => i.name === name);
  if (!item) return;
  const target = item.inputs.find((i) => i.name === "target");
  let rate = null;
  if (target.kind === "pose") rate = [...move.map((x) => FAST * x), 0, 0, TURN * turn];
  else if (target.kind === "rotation") rate = [0, 0, TURN * turn];
  else if (target.kind === "vector" && target.size === 3) rate = move.map((x) => FAST * x);
  else if (target.size === 1) rate = TURN * (turn || move[1]);
  if (rate !== null) send({ type: "rate", item: name, rate });
}, 50);

if (bare) document.documentElement.classList.add("bare");
