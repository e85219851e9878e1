"use strict";
/* A body in 3-D to click on: the CAD, whose clicks may snap to corners, circles and edges; or a cloud. */

const NEAR = 12, BESIDE = 7; /* CSS pixels within which a click snaps to a point, and to an edge */

export class Solid {
  /* told: { pick({ point, kind }, event) } */
  constructor(root, name, part, look, told) {
    this.told = told;
    this.part = part;
    this.targets = { corners: [], circles: [], lines: new Float32Array(0) };
    this.snapping = () => true;
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("aria-label", `${name}: arrow keys turn it, T steps through corners and circles, Enter picks`);
    this.overlay = document.createElement("div");
    this.overlay.className = "overlay";
    this.caption = document.createElement("div");
    this.caption.className = "caption";
    this.caption.textContent = this.name = name;
    this.target = document.createElement("div");
    this.target.className = "target";
    this.target.hidden = true;
    this.target.append(document.createElement("span"));
    root.append(this.canvas, this.overlay, this.target, this.caption);
    this.eye = new Eye(part.nodes);
    this.surface = new Surface(this.canvas, part, this.eye, look);
    this.surface.after = () => { this.placeMarks(); this.placeTarget(); };
    this.marks = []; /* { point, name, active, outlier } */
    this.found = null;
    this.step = -1;
    const told_ = {
      start: [1, 1, 1],
      leave: () => { this.waiting = null; this.aim(null); },
      hover: (x, y) => {
        const asleep = !this.waiting;
        this.waiting = [x, y];
        if (asleep) requestAnimationFrame(() => {
          const at = this.waiting;
          this.waiting = null;
          if (at) this.aim(this.under(...at));
        });
      },
      click: (x, y, event) => {
        const found = event.type === "keydown" && this.found ? this.found : this.under(x, y, event.altKey);
        if (found) told.pick(found, event);
      },
    };
    steer(this.canvas, this.eye, told_);
    this.canvas.addEventListener("keydown", (event) => {
      if (event.key.toLowerCase() !== "t" || event.ctrlKey || event.metaKey) return;
      const known = this.visible();
      if (!known.length) return;
      event.preventDefault();
      event.stopPropagation();
      this.step = (this.step + (event.shiftKey ? known.length - 1 : 1)) % known.length;
      this.aim(known[this.step]);
    });
    this.eye.look([1, 1, 1]);
  }
  /* corners: xyz one after the other; circles: centre, normal and radius; lines: ends of edges */
  setTargets({ corners, circles, lines }) {
    const rows = (values, width) => Array.from({ length: values.length / width }, (_, k) => Array.from(values.slice(width * k, width * (k + 1))));
    this.targets = { corners: rows(corners, 3), circles: rows(circles, 7), lines };
    this.surface.lines = [{ points: lines, ink: [0.16, 0.18, 0.21, 1] }];
    this.eye.changed();
  }
  /* Return whether nothing of the part lies before a point. */
  clear(point) {
    const [x, y, near] = this.surface.onScreen(point), hit = this.surface.hit(x, y);
    return !hit || hit.near < near + 0.01 * this.eye.radius;
  }
  under(x, y, plain) {
    if (!this.part.triangles.length) return this.pointUnder(x, y);
    const away = (point) => { const [u, v] = this.surface.onScreen(point); return Math.hypot(u - x, v - y); };
    if (!plain && this.snapping()) {
      const points = this.candidates().map((each) => ({ ...each, away: away(each.point) })).filter((each) => each.away < NEAR);
      points.sort((a, b) => a.away - b.away);
      const found = points.find((each) => this.clear(each.point)) || this.onEdge(x, y);
      if (found) return found;
    }
    const hit = this.surface.hit(x, y);
    return hit && { point: hit.point, kind: "surface" };
  }
  candidates() {
    return [...this.targets.corners.map((point) => ({ point, kind: "corner" })),
      ...this.targets.circles.map((circle) => ({ point: circle.slice(0, 3), kind: "circle centre", circle }))];
  }
  visible() {
    const w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    return this.candidates().filter(({ point }) => {
      const [x, y] = this.surface.onScreen(point);
      return x > 0 && y > 0 && x < w && y < h && this.clear(point);
    });
  }
  onEdge(x, y) {
    const lines = this.targets.lines, found = [];
    for (let k = 0; k < lines.length; k += 6) {
      const a = [lines[k], lines[k + 1], lines[k + 2]], b = [lines[k + 3], lines[k + 4], lines[k + 5]];
      const [ax, ay] = this.surface.onScreen(a), [bx, by] = this.surface.onScreen(b), length = (bx - ax) ** 2 + (by - ay) ** 2;
      const share = length > 0 ? Math.min(Math.max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0), 1) : 0;
      const away = Math.hypot(ax + share * (bx - ax) - x, ay + share * (by - ay) - y);
      if (away < BESIDE) found.push({ point: a.map((p, axis) => p + share * (b[axis] - p)), kind: "edge", away });
    }
    found.sort((one, other) => one.away - other.away);
    return found.find((each) => this.clear(each.point)) || null;
  }
  /* Return the point of a cloud nearest to a place, of those in front. */
  pointUnder(x, y) {
    const { nodes } = this.part, near = [], reach = 8;
    for (let k = 0; k < nodes.length; k += 3) {
      const point = [nodes[k], nodes[k + 1], nodes[k + 2]], [u, v, depth] = this.surface.onScreen(point), away = Math.hypot(u - x, v - y);
      if (away < reach) near.push({ point, kind: "point", away, depth });
    }
    if (!near.length) return null;
    const front = Math.max(...near.map((each) => each.depth)) - 3 * reach * this.eye.pixel(this.canvas);
    return near.filter((each) => each.depth > front).sort((a, b) => a.away - b.away)[0];
  }
  aim(found) {
    this.found = found;
    this.target.hidden = !found;
    this.canvas.dataset.aim = found ? found.kind : "";
    if (found) this.target.firstChild.textContent = found.kind;
    const ring = found && found.circle ? this.ring(found.circle) : null;
    this.surface.lines = this.surface.lines.filter((line) => !line.ring);
    if (ring) this.surface.lines.push({ points: ring, ink: [0.76, 0.25, 0.05, 1], hidden: true, ring: true });
    this.surface.draw();
  }
  ring(circle) {
    const centre = circle.slice(0, 3), normal = circle.slice(3, 6), radius = circle[6], points = [];
    const right = unit(cross(normal, Math.abs(normal[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1])), up = cross(normal, right);
    const at = (k) => centre.map((x, axis) => x + radius * (Math.cos((k * Math.PI) / 32) * right[axis] + Math.sin((k * Math.PI) / 32) * up[axis]));
    for (let k = 0; k < 64; k++) points.push(...at(k), ...at(k + 1));
    return new Float32Array(points);
  }
  show(marks) {
    this.marks = marks;
    this.overlay.replaceChildren(...marks.map((mark) => {
      const flag = document.createElement("div"), name = document.createElement("span");
      flag.className = `mark${mark.active ? " active" : ""}${mark.outlier ? " outlier" : ""}`;
      name.textContent = mark.name;
      flag.append(name);
      return flag;
    }));
    this.surface.draw();
  }
  placeMarks() {
    this.marks.forEach((mark, k) => {
      const [x, y] = this.surface.onScreen(mark.point), flag = this.overlay.children[k];
      flag.style.transform = `translate(${x}px, ${y}px)`;
      flag.classList.toggle("flipped", x > 0.85 * this.canvas.clientWidth);
      if (!this.eye.moving) flag.classList.toggle("behind", !this.clear(mark.point));
    });
  }
  placeTarget() {
    if (!this.found) return;
    const [x, y] = this.surface.onScreen(this.found.point);
    this.target.style.transform = `translate(${x}px, ${y}px)`;
  }
}
