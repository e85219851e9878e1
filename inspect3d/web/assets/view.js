"use strict";
/* Maps side by side, turning together: fields, limits, colours, a section, flags, and a picture of it all. */
import { ask, askArrays, say, tell, trying, watchServer } from "./server.js";
import { INKS, Profile, cutOf, pointsOf } from "./profile.js";

const get = (id) => document.getElementById(id);
const fieldChoice = get("field"), lowest = get("low"), highest = get("high"), paletteChoice = get("palette");
const sectionChoice = get("section"), open = get("open"), magnify = get("magnify");
const views = []; /* { map, part, pane, fields, geometry, handle } of each map */
const limits = {}; /* by the key of a field: what the user has set */
let about = null, eye = null, fieldKey = "", plane = null, flags = [], changed = false;
const profile = new Profile(document.querySelector("#profile canvas"), (words) => { get("profileValue").textContent = words; });

async function begin() {
  about = await ask("maps");
  document.title = `${about.part} – inspect3d view`;
  get("part").textContent = about.part;
  get("part").title = `${about.part} (${about.cad})`;
  get("save").disabled = !about.recipe;
  get("save").title = about.recipe ? `Ctrl+S: save the flags in ${about.recipe}` : "Start with --recipe to save flags in it";
  flags = about.labels.map((label) => ({ ...label, node: -1 }));
  const count = about.maps.length, columns = count < 4 ? count : Math.ceil(Math.sqrt(count));
  get("maps").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
  for (const none of about.without) say(`${none.name} has no map: ${none.reason}`, true);
  const places = about.maps.map((map) => {
    const box = made("article", "map"), header = made("header"), pane = made("div", "pane"), nothing = made("div", "nothing", "loading …");
    header.append(made("strong", "", map.name), made("span", "", map.words ? `${map.method}: ${map.words}` : map.method));
    pane.append(nothing);
    box.append(header, pane);
    get("maps").append(box);
    return { pane, nothing };
  });
  for (let k = 0; k < count; k++) await load(k, places[k]);
  for (const { geometry, part } of views) {
    if (part.edges.length || part.complete) continue;
    Object.assign(part, await askArrays("lines", { map: geometry }), { complete: true });
    for (const view of views) if (view.part === part) view.pane.surface.refine();
  }
}

async function load(k, place) {
  const { geometry, fields } = await ask("map", { map: k });
  let part = views.find((view) => view.geometry === geometry)?.part;
  if (!part) {
    const none = new Uint32Array(0);
    part = { centre: about.centre, edges: none, ...(await askArrays("geometry", { map: geometry })) };
  }
  fields.forEach((field, index) => Object.assign(field, { index, map: k, fixed: field.limits.slice() }));
  eye ??= new Eye(part.nodes);
  await Promise.all(fields.slice(0, 3).map(loadValues));
  place.nothing.remove();
  const pane = new Pane(place.pane, part, eye, about, {
    start: [1, 1, 1],
    click: (node) => addFlag(part, node),
    removed: (pin) => removeFlag(pin.flag_),
  });
  const view = { map: about.maps[k], part, pane, fields, geometry };
  pane.setMap({ name: view.map.name, fields, labels: [] });
  pane.bar.remove();
  views.push(view);
  addHandle(view);
  if (views.length === 1) { eye.look([1, 1, 1]); listFields(); }
  await show(view);
  showFlags();
}

async function loadValues(field) {
  if (field.values) return;
  const { values } = await askArrays("field", { map: field.map, field: field.index });
  field.values = values;
  field.shown = new Uint8Array(values.length);
  for (let k = 0; k < values.length; k++) field.shown[k] = Number.isFinite(values[k]) && !(field.classes.length && values[k] === 0) ? 1 : 0;
}

/* ---- fields, limits and colours ---- */
function listFields() {
  const chosen = fieldKey || "deviation", known = new Map();
  for (const view of views) for (const field of view.fields) known.set(field.key, field.title);
  fieldChoice.replaceChildren(...[...known].map(([key, title]) => { const option = made("option", "", title); option.value = key; return option; }));
  fieldKey = fieldChoice.value = known.has(chosen) ? chosen : [...known.keys()][0];
  listPalettes();
}
function chosenField() { return views.map((view) => view.fields.find((each) => each.key === fieldKey)).find(Boolean); }
function listPalettes() {
  const field = chosenField(), known = field.classes.length ? [] : about.palettes[field.signed ? "signed" : "rising"];
  const before = paletteChoice.value;
  paletteChoice.replaceChildren(...known.map((each) => made("option", "", each.name)));
  paletteChoice.disabled = !known.length;
  if (known.some((each) => each.name === before)) paletteChoice.value = before;
}
function limitsOf(key) {
  if (limits[key]) return limits[key];
  if (key === "deviation" && about.limits) return about.limits;
  const all = views.map((view) => view.fields.find((field) => field.key === key)).filter(Boolean).map((field) => field.fixed);
  return [Math.min(...all.map((each) => each[0])), Math.max(...all.map((each) => each[1]))];
}
/* Return 256 colours from the lower to the upper limit; those of a field with a sign have their middle at zero. */
function coloursOf(field, [low, high]) {
  const known = about.palettes[field.signed ? "signed" : "rising"];
  const palette = (known.find((each) => each.name === paletteChoice.value) || known[0]).colours;
  if (!field.signed) return Uint8Array.from(palette);
  const most = Math.max(Math.abs(low), Math.abs(high)), colours = new Uint8Array(768);
  for (let k = 0; k < 256; k++) {
    const from = 3 * Math.round(255 * (0.5 + (0.5 * (low + ((high - low) * k) / 255)) / most));
    for (let c = 0; c < 3; c++) colours[3 * k + c] = palette[from + c];
  }
  return colours;
}
/* Show a map without any colour: it has no such field. */
function blank(view) {
  const count = view.part.nodes.length / 3;
  view.pane.field = null;
  view.pane.surface.show({ values: new Float32Array(count), shown: new Uint8Array(count), limits: [0, 1], classes: [], colours: new Uint8Array(768) });
}
async function show(view) {
  const field = view.fields.find((each) => each.key === fieldKey);
  if (!field) { blank(view); return; }
  try {
    await loadValues(field);
  } catch (error) {
    blank(view);
    throw error;
  }
  field.limits = field.classes.length ? field.limits : limitsOf(field.key);
  if (!field.classes.length) field.colours = coloursOf(field, field.limits);
  view.pane.show(field);
  get("bar").replaceChildren(view.pane.bar);
}
async function showAll() {
  await trying(() => Promise.all(views.map(show)));
  const field = chosenField();
  for (const input of [lowest, highest]) input.disabled = field.classes.length > 0;
  [lowest.value, highest.value] = field.classes.length ? ["", ""] : limitsOf(fieldKey).map((value) => Number(value.toPrecision(6)));
  document.body.dataset.shown = fieldKey;
}
fieldChoice.addEventListener("change", () => { fieldKey = fieldChoice.value; listPalettes(); showAll(); });
paletteChoice.addEventListener("change", showAll);
for (const input of [lowest, highest])
  input.addEventListener("change", () => {
    const asked = [Number(lowest.value), Number(highest.value)];
    if (asked[0] < asked[1]) limits[fieldKey] = asked;
    else say("The lower limit of the colours lies below the upper one.", true);
    showAll();
  });
get("reset").addEventListener("click", () => { delete limits[fieldKey]; showAll(); });
for (const button of document.querySelectorAll("[data-view]"))
  button.addEventListener("click", () => eye.look(button.dataset.view.split(" ").map(Number)));

/* ---- the section ---- */
function extent(normal) {
  let low = Infinity, high = -Infinity;
  const { nodes } = views[0].part;
  for (let k = 0; k < nodes.length; k += 3) {
    const at = normal[0] * nodes[k] + normal[1] * nodes[k + 1] + normal[2] * nodes[k + 2];
    low = Math.min(low, at);
    high = Math.max(high, at);
  }
  return [low, high];
}
function chooseSection() {
  const value = sectionChoice.value;
  get("profile").hidden = !value;
  get("openLabel").hidden = !value;
  if (!value) plane = null;
  else {
    const normal = value === "seen" ? eye.turn[2].slice() : [0, 1, 2].map((axis) => (axis === Number(value) ? 1 : 0));
    const [low, high] = extent(normal);
    plane = { normal, low, high, offset: (low + high) / 2 + 0.001 * (high - low) };
    const magnification = profile.suitable(curves(), eye.radius * 2);
    magnify.replaceChildren(...[1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].map((each) => { const option = made("option", "", `× ${each}`); option.value = each; return option; }));
    magnify.value = profile.magnification = Math.min(magnification, 5000);
  }
  showSection();
}
function curves() {
  const cuts = new Map();
  return views.map((view, k) => {
    const shared = cuts.has(view.part);
    if (!shared) {
      const cut = cutOf(view.part, plane);
      cuts.set(view.part, { cut, points: pointsOf(view.part, cut) });
    }
    const [deviation, sigma] = view.fields;
    return { name: view.map.name, ink: INKS[k % INKS.length], part: view.part, shared, ...cuts.get(view.part), deviation: deviation.values, sigma: sigma.values };
  });
}
function showSection() {
  for (const view of views) view.handle.hidden = !plane;
  if (!plane) {
    for (const { pane } of views) { pane.surface.lines = []; pane.surface.plane = null; }
    eye.changed();
    return;
  }
  const found = curves(), sheet = corners();
  views.forEach(({ pane }, k) => {
    pane.surface.plane = open.checked ? plane : null;
    pane.surface.lines = [{ points: sheet.lines, ink: [0.12, 0.37, 0.6, 1] }, { points: found[k].points, ink: [0.05, 0.05, 0.05, 1], hidden: true }];
  });
  const axis = ["x", "y", "z"][plane.normal.indexOf(1)];
  const at = plane.offset + dot(plane.normal, about.centre);
  get("profileTitle").textContent = minus(axis ? `Section ${axis} = ${at.toFixed(2)} mm` : `Section at ${at.toFixed(2)} mm`);
  profile.show(found, plane);
  for (const view of views) {
    view.handle.setAttribute("aria-valuenow", at.toFixed(3));
    view.handle.setAttribute("aria-valuetext", `${at.toFixed(2)} mm`);
  }
  eye.changed();
}
/* Return the frame of the plane, a square about the part, and the place of its handle. */
function corners() {
  const up = Math.abs(plane.normal[2]) > 0.9 ? [0, 1, 0] : [0, 0, 1], right = unit(cross(up, plane.normal)), top = cross(plane.normal, right);
  const middle = plane.normal.map((x) => x * plane.offset), r = eye.radius * 0.85;
  const corner = (a, b) => middle.map((x, k) => x + r * (a * right[k] + b * top[k]));
  const round = [corner(1, 1), corner(-1, 1), corner(-1, -1), corner(1, -1)];
  return { lines: new Float32Array(round.flatMap((p, k) => [...p, ...round[(k + 1) % 4]])), handle: corner(0.5, 1) };
}
function addHandle(view) {
  const handle = made("button", "handle", "\u21d5"), { pane } = view;
  handle.type = "button";
  handle.hidden = !plane;
  handle.setAttribute("role", "slider");
  handle.setAttribute("aria-label", "section plane: drag it, or move it with the arrow keys");
  pane.overlay.after(handle);
  view.handle = handle;
  const placed = pane.surface.after;
  pane.surface.after = (pixel) => {
    placed(pixel);
    if (!plane) return;
    const [x, y] = pane.surface.onScreen(corners().handle), w = pane.canvas.clientWidth, h = pane.canvas.clientHeight;
    handle.style.transform = `translate(${Math.min(Math.max(x, 14), w - 14)}px, ${Math.min(Math.max(y, 14), h - 14)}px)`;
  };
  const move = (by) => {
    plane.offset = Math.min(Math.max(plane.offset + by, plane.low), plane.high);
    showSection();
  };
  let last = null;
  handle.addEventListener("pointerdown", (event) => { handle.setPointerCapture(event.pointerId); last = [event.clientX, event.clientY]; });
  handle.addEventListener("pointermove", (event) => {
    if (!last) return;
    const on = [dot(eye.turn[0], plane.normal), -dot(eye.turn[1], plane.normal)], length = Math.hypot(...on);
    const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
    last = [event.clientX, event.clientY];
    /* A plane that is seen face on moves with the pointer's way up. */
    move(eye.pixel(pane.canvas) * (length > 0.1 ? (dx * on[0] + dy * on[1]) / length ** 2 : -dy));
  });
  for (const kind of ["pointerup", "pointercancel"]) handle.addEventListener(kind, () => { last = null; });
  handle.addEventListener("keydown", (event) => {
    const step = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!step) return;
    event.preventDefault();
    move((step * (plane.high - plane.low)) / (event.shiftKey ? 2000 : 200));
  });
}
sectionChoice.addEventListener("change", chooseSection);
open.addEventListener("change", showSection);
magnify.addEventListener("change", () => { profile.magnification = Number(magnify.value); profile.draw(); });

/* ---- flags ---- */
function nodeNear(part, point) {
  const at = point.map((x, k) => x - about.centre[k]), { nodes } = part;
  let best = 0, least = Infinity;
  for (let k = 0; k < nodes.length; k += 3) {
    const away = (nodes[k] - at[0]) ** 2 + (nodes[k + 1] - at[1]) ** 2 + (nodes[k + 2] - at[2]) ** 2;
    if (away < least) { least = away; best = k / 3; }
  }
  return best;
}
function addFlag(part, node) {
  const taken = new Set(flags.map((flag) => flag.name));
  let number = 1;
  while (taken.has(`P${number}`)) number++;
  flags.push({ name: `P${number}`, point: [0, 1, 2].map((k) => part.nodes[3 * node + k] + about.centre[k]) });
  flagsChanged();
}
function removeFlag(flag) { flags = flags.filter((other) => other !== flag); flagsChanged(); }
function flagsChanged() { changed = true; showFlags(); }
function showFlags() {
  for (const { pane, part } of views) {
    for (const pin of pane.pins) pin.flag.remove();
    pane.pins = [];
    for (const flag of flags) {
      pane.pin(nodeNear(part, flag.point), flag.name);
      pane.pins.at(-1).flag_ = flag;
    }
  }
  get("flags").replaceChildren(...flags.map((flag) => {
    const row = made("div", "flag"), name = made("input"), close = made("button", "", "\u00d7");
    const values = views.map(({ pane, part }) => pane.words(nodeNear(part, flag.point), false));
    name.value = flag.name;
    name.setAttribute("aria-label", "name of the flag");
    name.addEventListener("change", () => { flag.name = name.value; flagsChanged(); });
    close.type = "button";
    close.title = "remove this flag";
    close.addEventListener("click", () => removeFlag(flag));
    const words = made("span", "", values.join(" | "));
    words.title = values.join("\n");
    row.append(name, words, close);
    return row;
  }));
  if (!flags.length) get("flags").replaceChildren(made("div", "hint", "Click on the part to flag a point, or press Enter for the middle of a map."));
}
async function save() {
  if (get("save").disabled) { say(get("save").title, true); return; }
  const answer = await trying(() => tell("labels", { labels: flags.map(({ name, point }) => ({ name, point })) }));
  if (answer) { changed = false; say(answer.words); }
}
get("save").addEventListener("click", save);
addEventListener("beforeunload", (event) => { if (changed) event.preventDefault(); });

/* ---- a picture of it all ---- */
function picture() {
  const boxes = views.map(({ pane }) => pane.canvas.getBoundingClientRect()), area = get("maps").getBoundingClientRect();
  const ratio = 2, head = 44, side = 190, below = profile.curves.length && plane ? 260 : 0;
  const sheet = document.createElement("canvas"), pen = sheet.getContext("2d");
  sheet.width = ratio * (area.width + side);
  sheet.height = ratio * (area.height + head + below);
  pen.scale(ratio, ratio);
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.fillStyle = "#1d2127";
  pen.font = "600 18px system-ui, sans-serif";
  pen.fillText(`${about.part}: ${fieldChoice.selectedOptions[0].textContent}`, 12, 28);
  views.forEach(({ map, pane }, k) => {
    const x = boxes[k].left - area.left, y = boxes[k].top - area.top + head;
    pen.drawImage(pane.canvas, x, y, boxes[k].width, boxes[k].height);
    pen.font = "600 14px system-ui, sans-serif";
    pen.fillStyle = "#1d2127";
    pen.fillText(map.name, x + 10, y - 8, boxes[k].width - 20);
    pen.font = "12px system-ui, sans-serif";
    for (const pin of pane.pins) {
      if (pin.flag.hidden) continue;
      const [px, py] = pane.surface.onScreen(pane.surface.node(pin.node)), tag = pin.tag.getBoundingClientRect(), words = pin.text.textContent;
      const left = tag.left - boxes[k].left + x, top = tag.top - boxes[k].top + y;
      pen.fillStyle = "#fff";
      pen.strokeStyle = "#1d2127";
      pen.beginPath();
      pen.arc(x + px, y + py, 4, 0, 7);
      pen.fill();
      pen.stroke();
      pen.fillRect(left, top, pen.measureText(words).width + 12, 20);
      pen.strokeRect(left, top, pen.measureText(words).width + 12, 20);
      pen.fillStyle = "#1d2127";
      pen.fillText(words, left + 6, top + 14);
    }
  });
  paintBar(pen, area.width + 16, head + 16, Math.min(area.height - 90, 420));
  if (below) {
    pen.save();
    pen.translate(0, area.height + head);
    profile.paint(pen, area.width + side, below);
    pen.fillStyle = "#1d2127";
    pen.fillText(`${get("profileTitle").textContent}, deviations \u00d7 ${profile.magnification}`, 200, 14);
    pen.restore();
    profile.draw();
  }
  sheet.toBlob((blob) => {
    const link = document.createElement("a"), address = URL.createObjectURL(blob);
    link.href = address;
    link.download = `${about.part}_${fieldKey}.png`.replace(/[^\p{L}\p{N}._ -]/gu, "_");
    link.click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
    say(`Picture saved as ${link.download} where your browser keeps downloads.`);
  }, "image/png");
}
function paintBar(pen, x, y, height) {
  const field = chosenField();
  pen.fillStyle = "#1d2127";
  pen.font = "600 13px system-ui, sans-serif";
  pen.fillText(field.unit ? `${field.title}, ${field.unit}` : field.title, x, y, 165);
  pen.font = "12px system-ui, sans-serif";
  const patches = field.classes.map((words, k) => [words, field.colours[k]]).reverse();
  if (!field.classes.length) {
    for (let k = 0; k < 256; k++) {
      pen.fillStyle = `rgb(${[...field.colours.slice(3 * k, 3 * k + 3)].join()})`;
      pen.fillRect(x, y + 14 + ((255 - k) * height) / 256, 26, height / 256 + 0.7);
    }
    pen.strokeStyle = pen.fillStyle = "#1d2127";
    pen.strokeRect(x, y + 14, 26, height);
    for (const [value, words] of ticks(field.limits))
      pen.fillText(words, x + 34, y + 18 + height * (1 - (value - field.limits[0]) / (field.limits[1] - field.limits[0])));
    y += height + 20;
  }
  for (const [words, colour] of [...patches, ["not measured", about.unmeasured]]) {
    y += 22;
    pen.fillStyle = `rgb(${colour.join()})`;
    pen.fillRect(x, y - 11, 14, 14);
    pen.strokeRect(x, y - 11, 14, 14);
    pen.fillStyle = "#1d2127";
    pen.fillText(words, x + 22, y);
  }
}
get("picture").addEventListener("click", picture);

/* ---- keyboard ---- */
function next(choice) { choice.selectedIndex = (choice.selectedIndex + 1) % choice.length; choice.dispatchEvent(new Event("change")); }
addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); save(); return; }
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
  if (event.key === "f") next(fieldChoice);
  else if (event.key === "s") next(sectionChoice);
  else if (event.key === "p") picture();
  else return;
  event.preventDefault();
});

watchServer();
get("openLabel").hidden = true;
trying(async () => {
  await begin();
  listFields();
  await showAll();
  document.body.dataset.ready = "all";
});
