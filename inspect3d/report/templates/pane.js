"use strict";
/* A map on a pane: the part in colours, with the colour bar, the value under the pointer, flags, axes and a length. */

const minus = (text) => text.replace(/-/g, "\u2212");

function made(kind, name, text) {
  const element = document.createElement(kind);
  if (name) element.className = name;
  if (text !== undefined) element.textContent = text;
  return element;
}

/* Return values that read well between two limits, and their words. */
function ticks(limits) {
  const rough = (limits[1] - limits[0]) / 8, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 2.5, 5, 10].find((each) => each * power >= rough * (1 - 1e-9));
  let places = 0;
  while (places < 12 && Math.abs(Number(step.toFixed(places)) - step) > 1e-6 * step) places++;
  const found = [];
  for (let k = Math.ceil(limits[0] / step - 1e-9); k <= Math.floor(limits[1] / step + 1e-9); k++) found.push(k * step);
  return found.map((value) => {
    const text = value.toFixed(places), sign = limits[0] < 0 && Number(text) > 0 ? "+" : "";
    return [value, Number(text) === 0 ? (0).toFixed(places) : minus(sign + text)];
  });
}

/* Return a value and its expanded uncertainty (k = 2), mm, rounded together. */
function withUncertainty(value, sigma) {
  const expanded = 2 * sigma, leading = Math.floor(Math.log10(Number(expanded.toPrecision(2))));
  const places = Math.min(Math.max(1 - leading, 0), 6), text = value.toFixed(places);
  return minus(`${Number(text) > 0 ? "+" : ""}${text} \u00b1 ${expanded.toFixed(places)} mm`);
}

class Pane {
  /* root: an element that becomes the pane. part: see Surface; and centre, mm, of the CAD frame.
     told: { start: direction to look from, click(node, pane, event), hovered(found, pane), removed(pin) } */
  constructor(root, part, eye, look, told) {
    this.part = part;
    this.pins = [];
    this.told = told;
    const area = made("div", "surface"), canvas = made("canvas");
    this.bar = made("div", "bar");
    this.overlay = made("div", "overlay");
    this.probe = made("div", "probe");
    this.probe.hidden = true;
    this.length = made("div", "length");
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "3-D map; arrow keys turn it, shift and arrow keys move it, + and \u2212 zoom, 0 starts over, Enter flags what lies in the middle");
    area.append(canvas, this.overlay, this.probe, this.compass(), this.length);
    root.append(area, this.bar);
    this.canvas = canvas;
    this.surface = new Surface(canvas, part, eye, look);
    this.surface.after = (pixel) => { this.placePins(); this.placeCompass(); this.placeLength(pixel); };
    const looked = {
      start: told.start,
      leave: () => this.leave(),
      hover: (x, y) => this.hover(x, y),
      click: (x, y, event) => {
        const found = this.surface.hit(x, y);
        if (found) told.click(found.node, this, event);
      },
    };
    steer(canvas, eye, looked);
  }
  compass() {
    const arm = (axis) => `<g class="${axis}"><line/><text>${axis}</text></g>`;
    const drawn = `<svg class="compass" viewBox="-48 -48 96 96" aria-hidden="true">${["x", "y", "z"].map(arm).join("")}</svg>`;
    const svg = document.createRange().createContextualFragment(drawn).firstChild;
    this.arms = [...svg.children].map((group) => ({ group, line: group.firstChild, text: group.lastChild }));
    return svg;
  }
  /* map: { name, fields, labels }; the first two fields are deviation and its uncertainty, a third may be classes of a tolerance. */
  setMap(map) {
    this.map = map;
    for (const each of this.pins) each.flag.remove();
    this.pins = [];
    for (const label of map.labels) this.pin(label.node, label.name);
  }
  show(field) {
    this.field = field;
    this.surface.show(field);
    this.showBar();
  }
  showBar() {
    const field = this.field, none = made("div", "class", "not measured"), patch = made("i"), key = made("div", field.classes.length ? "classes" : "ramp");
    if (field.classes.length) {
      field.classes.forEach((words, k) => {
        const row = made("div", "class", words), colour = made("i");
        colour.style.background = `rgb(${field.colours[k]})`;
        row.prepend(colour);
        key.prepend(row);
      });
    } else {
      const stops = [];
      for (let k = 0; k < 256; k += 5) stops.push(`rgb(${field.colours.slice(3 * k, 3 * k + 3).join()}) ${(100 * k) / 255}%`);
      key.style.background = `linear-gradient(to top, ${stops.join()})`;
      for (const [value, words] of ticks(field.limits)) {
        const mark = made("span", "", words);
        mark.style.bottom = `${(100 * (value - field.limits[0])) / (field.limits[1] - field.limits[0])}%`;
        key.append(mark);
      }
    }
    patch.style.background = `rgb(${this.surface.look.unmeasured})`;
    none.prepend(patch);
    this.bar.replaceChildren(made("strong", "", field.unit ? `${field.title}, ${field.unit}` : field.title), key, none);
  }
  words(node, judged) {
    const [deviation, sigma, third] = this.map.fields, value = deviation.values[node];
    if (!Number.isFinite(value)) return this.part.crease[node] ? "on an edge: no deviation" : "not measured";
    const verdict = judged && third && third.classes.length && third.values && third.shown[node] ? `, ${third.classes[Math.round(third.values[node]) - 1]}` : "";
    if (!sigma || !sigma.values) return minus(`${value > 0 ? "+" : ""}${value.toFixed(4)} mm`);
    return withUncertainty(value, sigma.values[node]) + verdict;
  }
  position(node) {
    return this.surface.node(node).map((x, k) => minus((x + this.part.centre[k]).toFixed(2))).join(", ");
  }
  leave() { this.probe.hidden = true; this.waiting = null; }
  hover(x, y) {
    const asleep = !this.waiting;
    this.waiting = [x, y];
    if (asleep) requestAnimationFrame(() => {
      const at = this.waiting;
      this.waiting = null;
      if (at) this.showProbe(...at);
    });
  }
  showProbe(x, y) {
    const found = this.surface.hit(x, y);
    this.tell(found, x, y);
    if (this.told.hovered) this.told.hovered(found, this);
  }
  /* Show at a place of the canvas what the map says at a node found; nothing where there is none. */
  tell(found, x, y) {
    const probe = this.probe;
    probe.hidden = !found;
    if (!found) return;
    const lines = [made("strong", "", this.words(found.node, true)), made("span", "", `at ${this.position(found.node)} mm`)];
    const field = this.field, value = field && field.values[found.node];
    if (field && !field.classes.length && this.map.fields.indexOf(field) > 1 && Number.isFinite(value))
      lines.splice(1, 0, made("span", "", minus(`${field.title} ${Number(value.toPrecision(3))}${field.unit ? ` ${field.unit}` : ""}`)));
    probe.replaceChildren(...lines);
    const left = x + 16 + probe.offsetWidth > this.canvas.clientWidth ? x - 12 - probe.offsetWidth : x + 16;
    probe.style.transform = `translate(${Math.max(left, 0)}px, ${Math.max(y - 52, 0)}px)`;
  }
  pin(node, name) {
    const flag = made("div", "pin"), tag = made("div", "tag"), text = made("span"), close = made("button", "", "\u00d7");
    const each = { node, name, flag, tag, text };
    close.type = "button";
    close.title = "remove this flag";
    close.addEventListener("click", () => {
      this.pins = this.pins.filter((other) => other !== each);
      flag.remove();
      if (this.told.removed) this.told.removed(each, this);
    });
    tag.append(text, close);
    flag.append(tag);
    this.overlay.append(flag);
    this.pins.push(each);
    text.textContent = this.pinWords(each);
    this.surface.draw();
  }
  pinWords(each) { return (each.name ? `${each.name}: ` : "") + this.words(each.node, false); }
  unpin(node, name) {
    for (const each of this.pins) if (each.node === node && each.name === name) each.flag.remove();
    this.pins = this.pins.filter((each) => each.flag.isConnected);
  }
  /* Give the graphics card back what the pane took of it. */
  close() { this.surface.close(); }
  placePins() {
    const near = this.surface.eye.turn[2], normals = this.part.normals, taken = [], w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    for (const each of this.pins) {
      const k = each.node, [x, y] = this.surface.onScreen(this.surface.node(k));
      const facing = dot(near, [normals[3 * k], normals[3 * k + 1], normals[3 * k + 2]]) > 0;
      each.flag.hidden = !facing || this.surface.cutAway(this.surface.node(k)) || x < 0 || y < 0 || x > w || y > h;
      each.text.textContent = this.pinWords(each);
      each.flag.style.transform = `translate(${x}px, ${y}px)`;
      if (each.flag.hidden) continue;
      const width = each.tag.offsetWidth + 6, height = each.tag.offsetHeight + 3, left = Math.max(Math.min(x + 9, w - width), 3);
      let top = y - 28;
      const meets = (other) => left < other[0] + other[2] && other[0] < left + width && Math.abs(top - other[1]) < height;
      for (let found = taken.find(meets); found; found = taken.find(meets)) top = found[1] + height;
      taken.push([left, top, width]);
      each.tag.style.top = `${top - y}px`;
      each.tag.style.left = `${left - x}px`;
    }
  }
  placeCompass() {
    const turn = this.surface.eye.turn;
    const arms = this.arms.map((arm, k) => ({ ...arm, x: turn[0][k], y: -turn[1][k], z: turn[2][k] }));
    arms.sort((a, b) => a.z - b.z);
    for (const arm of arms) {
      const l = Math.hypot(arm.x, arm.y), reach = 30 + 10 / Math.max(l, 0.3);
      arm.group.parentNode.append(arm.group);
      arm.line.setAttribute("x2", 30 * arm.x);
      arm.line.setAttribute("y2", 30 * arm.y);
      const nearer = arms.some((other) => other.z > arm.z && Math.hypot(other.x - arm.x, other.y - arm.y) < 0.4);
      arm.text.setAttribute("x", l > 0.05 ? reach * arm.x : -9);
      arm.text.setAttribute("y", (l > 0.05 ? reach * arm.y : 11) + (nearer ? 12 : 0));
    }
  }
  placeLength(pixel) {
    const wanted = 150 * pixel, power = 10 ** Math.floor(Math.log10(wanted));
    const length = power * [5, 2, 1].find((step) => step * power <= wanted * (1 + 1e-9));
    this.length.style.width = `${length / pixel}px`;
    this.length.textContent = `${Number(length.toPrecision(6))} mm`;
  }
}
