"use strict";
/* Pairs: a point of the CAD and where the measurement shows it. */
import { ask, askArrays, say, tell, trying, watchServer } from "./server.js";
import { Picture } from "./picture.js";
import { Solid } from "./solid.js";

const get = (id) => document.getElementById(id);
const jobChoice = get("job"), snapPicture = get("snapPicture");
let about = null, job = null, cad = null, pictures = [], cloud = null;
let pairs = [], active = null, history = [], saved = "", fitted = null, asked = 0;
/* pairs: { name, cad: [x, y, z] or null, kind, shown: [place or null of each picture; or of the cloud] } */

const shift = (point, by, sign) => point.map((x, k) => x + sign * by[k]);
const complete = (pair) => pair.cad !== null && pair.shown.every((place) => place !== null);
const places = () => (job.kind === "cloud" ? 1 : job.images.length);

async function begin() {
  about = await ask("jobs");
  document.title = `${about.part} – inspect3d pick`;
  get("part").textContent = about.part;
  get("save").title = `Ctrl+S: save the pairs as landmarks in ${about.recipe}`;
  jobChoice.replaceChildren(...about.jobs.map((each, k) => { const option = document.createElement("option"); option.value = k; option.textContent = each.name; return option; }));
  get("jobLabel").hidden = about.jobs.length < 2;
  const part = await askArrays("cad"), none = new Uint32Array(0), count = part.nodes.length / 3;
  const body = { nodes: part.nodes, triangles: part.triangles, edges: none, normals: new Int8Array(part.nodes.length), crease: new Uint8Array(count).fill(1) };
  cad = new Solid(get("cad"), "CAD", body, { unmeasured: about.plain, back: about.back }, {
    pick: (found) => place((pair) => { pair.cad = shift(found.point, about.centre, 1); pair.kind = found.kind; }, (pair) => pair.cad !== null),
  });
  cad.setTargets(part);
  cad.snapping = () => get("snapCad").value === "on";
  for (const button of document.querySelectorAll("[data-view]"))
    button.addEventListener("click", () => cad.eye.look(button.dataset.view.split(" ").map(Number)));
  await choose(0);
  document.body.dataset.ready = "all";
}

/* ---- a measurement ---- */
async function choose(index) {
  job = about.jobs[index];
  pairs = job.pairs.map((pair, k) => ({ kind: "", ...pair, name: pair.name || `P${k + 1}` }));
  active = null;
  history = [];
  fitted = null;
  saved = JSON.stringify(pairs);
  get("shots").replaceChildren();
  get("snapLabel").hidden = job.kind === "cloud";
  pictures = [];
  cloud = null;
  if (job.kind === "cloud") await showCloud();
  else showPictures();
  showCandidates();
  changed();
}
function showPictures() {
  const count = job.images.length, columns = count < 3 ? 1 : Math.ceil(Math.sqrt(count));
  get("shots").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
  pictures = job.images.map((image, k) => {
    const box = document.createElement("div");
    box.className = "shot";
    get("shots").append(box);
    const address = `picture?${new URLSearchParams({ job: job.name, picture: k })}`;
    return new Picture(box, image, address, { pick: (x, y, event) => pickInPicture(k, x, y, event) });
  });
}
async function showCloud() {
  const points = await askArrays("cloud", { job: job.name }), none = new Uint32Array(0), box = document.createElement("div");
  box.className = "solid pane";
  get("shots").style.gridTemplateColumns = "minmax(0, 1fr)";
  get("shots").append(box);
  const part = { ...points, triangles: none, edges: none, crease: new Uint8Array(points.nodes.length / 3) };
  cloud = new Solid(box, job.name, part, { unmeasured: about.plain, back: about.back, dot: 2 }, {
    pick: (found) => place((pair) => { pair.shown[0] = shift(found.point, job.centre, 1); }, (pair) => pair.shown[0] !== null),
  });
}
jobChoice.addEventListener("change", () => trying(() => choose(Number(jobChoice.value))));

/* ---- picking ---- */
async function pickInPicture(k, x, y, event) {
  const image = job.images[k], picture = pictures[k];
  if (x < -0.5 || y < -0.5 || x > image.width - 0.5 || y > image.height - 0.5) return;
  const pair = active !== null ? pairs[active] : null;
  const wanted = { as: { corner: "corner", "circle centre": "ellipse" }[pair && pair.kind] || "", corner: "corner", ellipse: "ellipse" }[snapPicture.value] || "";
  let at = [x, y];
  picture.ellipse = null;
  if (wanted && !(event.altKey && event.type !== "keydown")) {
    const found = await trying(() => ask("snap", { job: job.name, picture: k, x, y, to: wanted }));
    if (found) {
      at = [found.x, found.y];
      picture.ellipse = found.ellipse ? found : null;
    } else say(`No ${wanted} found there: taken as clicked.`);
  }
  place((each) => { each.shown[k] = at; }, (each) => each.shown[k] !== null);
}
/* Put a click into the pair that is being made; into a new one, if there is none or it was left unchosen and has it. */
function place(put, has) {
  remember();
  if (active === null || (!pairs[active].chosen && has(pairs[active]))) {
    const taken = new Set(pairs.map((pair) => pair.name));
    let number = 1;
    while (taken.has(`P${number}`)) number++;
    pairs.push({ name: `P${number}`, cad: null, kind: "", shown: Array(places()).fill(null) });
    active = pairs.length - 1;
  }
  const pair = pairs[active];
  put(pair);
  if (complete(pair) && !pair.chosen) active = null;
  changed();
}
function remember() {
  history.push(JSON.stringify({ pairs, active }));
  if (history.length > 200) history.shift();
}
function undo() {
  if (!history.length) { say("There is nothing to undo."); return; }
  ({ pairs, active } = JSON.parse(history.pop()));
  changed();
}
function select(index) {
  for (const pair of pairs) delete pair.chosen;
  active = index;
  if (index !== null) pairs[index].chosen = complete(pairs[index]);
  show();
}
function remove(index) {
  remember();
  pairs.splice(index, 1);
  active = null;
  changed();
}

/* ---- what the pairs say ---- */
async function changed() {
  fitted = fitted && { ...fitted, stale: true };
  show();
  const count = pairs.filter(complete).length, mine = ++asked;
  if (count < job.fewest) { fitted = null; show(); return; }
  const sent = { job: job.name, pairs };
  try {
    const answer = await tell("fit", sent);
    if (mine !== asked) return;
    fitted = answer;
  } catch (error) {
    if (mine !== asked) return;
    fitted = null;
    say(error.message, true);
  }
  show();
}
function errorsOf(index) {
  const row = fitted ? fitted.numbers.indexOf(index) : -1;
  return row < 0 ? null : { each: fitted.errors[row], outlier: fitted.outlier === row, row };
}
function show() {
  get("pairs").replaceChildren(...pairs.map(rowOf));
  get("undo").disabled = !history.length;
  document.body.dataset.pairs = pairs.filter(complete).length;
  document.body.dataset.rms = fitted && !fitted.stale ? fitted.rms : "";
  get("advice").textContent = advice();
  const marks = pairs.map((pair, k) => ({ name: pair.name, active: k === active, outlier: Boolean(errorsOf(k)?.outlier) }));
  cad.show(pairs.flatMap((pair, k) => (pair.cad ? [{ ...marks[k], point: shift(pair.cad, about.centre, -1) }] : [])));
  pictures.forEach((picture, which) => {
    picture.lines = fitted ? fitted.outlines[which] : [];
    picture.marks = pairs.flatMap((pair, k) => {
      const at = pair.shown[which], found = errorsOf(k);
      return at ? [{ ...marks[k], x: at[0], y: at[1], seen: found ? fitted.seen[which][found.row] : null }] : [];
    });
    picture.draw();
  });
  if (!cloud) return;
  cloud.show(pairs.flatMap((pair, k) => (pair.shown[0] ? [{ ...marks[k], point: shift(pair.shown[0], job.centre, -1) }] : [])));
  showOutline(fitted && fitted.measured_from_cad);
}
/* Draw the edges of the CAD over the cloud, by a pose measured from CAD. */
function showOutline(matrix) {
  const lines = cad.targets.lines, moved = new Float32Array(lines.length);
  cloud.surface.lines = [];
  if (matrix) {
    for (let k = 0; k < lines.length; k += 3) {
      const point = [0, 1, 2].map((axis) => lines[k + axis] + about.centre[axis]);
      for (let axis = 0; axis < 3; axis++) moved[k + axis] = dot(matrix[axis], point) + matrix[axis][3] - job.centre[axis];
    }
    cloud.surface.lines = [{ points: moved, ink: [0, 0.45, 0.75, 1], hidden: true }];
  }
  cloud.surface.draw();
}
function advice() {
  if (active !== null && !complete(pairs[active])) {
    const pair = pairs[active], missing = pair.cad ? [] : ["on the CAD"];
    pair.shown.forEach((at, k) => { if (!at) missing.push(job.kind === "cloud" ? "on the cloud" : `in ${job.images[k].name}`); });
    return `${pair.name}: click the same point ${missing.join(" and ")}.`;
  }
  const count = pairs.filter(complete).length;
  if (count < job.fewest) return `${count} of at least ${job.fewest} pairs. Click a point of the CAD that you recognise, then the same point ${job.kind === "cloud" ? "on the cloud" : "in every picture"}.`;
  if (!fitted) return "";
  if (fitted.stale) return "Fitting …";
  const out = fitted.outlier === null ? "" : ` ${pairs[fitted.numbers[fitted.outlier]].name} does not belong to the others: pick it again or delete it.`;
  return `${count} pairs fit within ${fitted.rms.toPrecision(2)} ${fitted.unit} rms.${out} ${fitted.words}`;
}
function rowOf(pair, index) {
  const row = document.createElement("div"), name = document.createElement("input"), words = document.createElement("button"), close = document.createElement("button");
  const found = errorsOf(index);
  row.className = `pair${index === active ? " active" : ""}${found?.outlier ? " outlier" : ""}`;
  name.value = pair.name;
  name.setAttribute("aria-label", `name of pair ${index + 1}`);
  name.addEventListener("change", () => { remember(); pair.name = name.value.trim() || pair.name; show(); });
  words.type = close.type = "button";
  words.className = "words";
  const state = complete(pair) ? "" : `${pair.cad ? "CAD" : ""} ${pair.shown.map((at, k) => (at ? (job.kind === "cloud" ? "cloud" : k + 1) : "")).join(" ")} …`;
  words.textContent = found ? `${found.each.map((error) => error.toFixed(fitted.unit === "px" ? 2 : 3)).join(" | ")} ${fitted.unit}${found.outlier ? " off" : ""}` : state.trim() || "complete";
  words.title = `${pair.kind ? `${pair.kind}; ` : ""}click to pick it again`;
  words.addEventListener("click", () => select(index === active ? null : index));
  close.textContent = "\u00d7";
  close.title = "delete this pair";
  close.addEventListener("click", () => remove(index));
  row.append(name, words, close);
  return row;
}

/* ---- candidates of an ambiguous start ---- */
function showCandidates() {
  get("candidates").hidden = !job.candidates.length;
  get("why").textContent = job.reason;
  get("starts").replaceChildren(...job.candidates.map((candidate, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = candidate.residual === null ? `${k + 1}` : `${k + 1}: ${candidate.residual.toPrecision(3)} mm`;
    button.title = "click to start from this pose; rest on it to see it";
    button.addEventListener("pointerenter", () => showCandidate(k));
    button.addEventListener("focus", () => showCandidate(k));
    button.addEventListener("pointerleave", show);
    button.addEventListener("click", async () => {
      const answer = await trying(() => tell("choose", { job: job.name, candidate: k }));
      if (!answer) return;
      say(answer.words);
      for (const other of get("starts").children) other.classList.toggle("chosen", other === button);
    });
    return button;
  }));
}
async function showCandidate(k) {
  const found = await trying(() => ask("candidate", { job: job.name, candidate: k }));
  if (!found) return;
  if (cloud) showOutline(found.measured_from_cad);
  pictures.forEach((picture, which) => { picture.lines = found.outlines[which]; picture.draw(); });
}

/* ---- saving, keyboard ---- */
async function save() {
  const unfinished = pairs.filter((pair) => !complete(pair)).length;
  const answer = await trying(() => tell("save", { job: job.name, pairs }));
  if (!answer) return;
  saved = JSON.stringify(pairs);
  say(unfinished ? `${answer.words} (${unfinished} unfinished left out)` : answer.words);
  document.body.dataset.saved = pairs.filter(complete).length;
}
get("save").addEventListener("click", save);
get("undo").addEventListener("click", undo);
get("fresh").addEventListener("click", () => select(null));
addEventListener("beforeunload", (event) => { if (job && JSON.stringify(pairs) !== saved) event.preventDefault(); });
addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && key === "s") { event.preventDefault(); save(); return; }
  if (/^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
  if ((event.ctrlKey || event.metaKey) && key === "z") undo();
  else if (event.ctrlKey || event.metaKey || event.altKey) return;
  else if (key === "n" || key === "escape") select(null);
  else if (key === "delete" && active !== null) remove(active);
  else return;
  event.preventDefault();
});

watchServer();
trying(begin);
