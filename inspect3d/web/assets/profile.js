"use strict";
/* The section of a part by a plane: where the plane meets the mesh, and the profile drawn beside it. */

export const INKS = ["#1f5f99", "#c2410c", "#2d6a4f", "#7b2d8b", "#8a5c00", "#444b55"];

/* Return where a plane normal * x = offset meets the triangles: for each piece two ends, each on a side from node a to
   node b at a share of it. */
export function cutOf(part, plane) {
  const { nodes, triangles } = part, [nx, ny, nz] = plane.normal, height = new Float32Array(nodes.length / 3);
  for (let k = 0, at = 0; at < nodes.length; k++, at += 3) height[k] = nx * nodes[at] + ny * nodes[at + 1] + nz * nodes[at + 2] - plane.offset;
  const a = [], b = [], share = [];
  for (let m = 0; m < triangles.length; m += 3) {
    const below = [height[triangles[m]] < 0, height[triangles[m + 1]] < 0, height[triangles[m + 2]] < 0];
    if (below[0] === below[1] && below[1] === below[2]) continue;
    for (let k = 0; k < 3; k++) {
      const next = (k + 1) % 3;
      if (below[k] === below[next]) continue;
      const from = triangles[m + k], to = triangles[m + next];
      a.push(from);
      b.push(to);
      share.push(height[from] / (height[from] - height[to]));
    }
  }
  return { a, b, share, count: share.length };
}

export function pointsOf(part, cut) {
  const points = new Float32Array(3 * cut.count), nodes = part.nodes;
  for (let k = 0; k < cut.count; k++)
    for (let axis = 0; axis < 3; axis++) {
      const from = nodes[3 * cut.a[k] + axis];
      points[3 * k + axis] = from + cut.share[k] * (nodes[3 * cut.b[k] + axis] - from);
    }
  return points;
}

/* Return two directions in the plane, to the right and up: from the side from which x, or else y, points to the right. */
function axesOf(normal) {
  const up = Math.abs(normal[2]) > 0.9 ? [0, 1, 0] : [0, 0, 1], right = unit(cross(up, normal));
  const side = Math.sign(Math.abs(right[0]) > 0.3 ? right[0] : right[1]) || 1, facing = right.map((x) => side * x);
  return [facing, unit(up.map((x, k) => x - dot(up, normal) * normal[k]))];
}

export class Profile {
  constructor(canvas, told) {
    this.canvas = canvas;
    this.told = told;
    this.curves = [];
    this.magnification = 1;
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("pointermove", (event) => this.read(event));
    canvas.addEventListener("pointerleave", () => told(""));
  }
  /* curves: { name, ink, part, cut, points, deviation, sigma } of each map */
  show(curves, plane) {
    this.curves = curves;
    this.axes = axesOf(plane.normal);
    this.draw();
  }
  /* Return a magnification that shows the deviations at about a twelfth of the part. */
  suitable(curves, size) {
    const found = [];
    for (const { cut, deviation } of curves) for (let k = 0; k < cut.count; k++) if (Number.isFinite(deviation[cut.a[k]])) found.push(Math.abs(deviation[cut.a[k]]));
    found.sort((one, other) => one - other);
    const most = found[Math.floor(0.98 * found.length)] || 0;
    const wanted = most > 0 ? size / 12 / most : 1, power = 10 ** Math.floor(Math.log10(wanted));
    return Math.max(1, power * [5, 2, 1].find((step) => step * power <= wanted * (1 + 1e-9)));
  }
  draw() {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    this.paint(pen, w, h);
  }
  paint(pen, w, h) {
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, w, h);
    const [right, up] = this.axes || [], all = [];
    let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const { points } of this.curves)
      for (let k = 0; k < points.length; k += 3) {
        const p = [points[k], points[k + 1], points[k + 2]], at = [dot(right, p), dot(up, p)];
        low = low.map((x, axis) => Math.min(x, at[axis]));
        high = high.map((x, axis) => Math.max(x, at[axis]));
      }
    this.placed = all;
    if (!(high[0] >= low[0])) {
      pen.fillStyle = "#565e69";
      pen.font = "13px system-ui, sans-serif";
      pen.fillText("The plane misses the part.", 8, 20);
      return;
    }
    const margin = 30, scale = Math.min((w - 2 * margin) / (high[0] - low[0] || 1), (h - 2 * margin) / (high[1] - low[1] || 1));
    const middle = [0, 1].map((axis) => (low[axis] + high[axis]) / 2);
    const place = (p) => [w / 2 + (dot(right, p) - middle[0]) * scale, h / 2 - (dot(up, p) - middle[1]) * scale];
    this.curves.forEach((curve, which) => {
      const { part, cut, points, deviation, sigma } = curve, nominal = new Path2D(), measured = new Path2D();
      for (let k = 0; k < cut.count; k += 2) {
        const ends = [k, k + 1].map((end) => {
          const a = cut.a[end], b = cut.b[end], share = cut.share[end];
          const lerp = (values) => values[a] + share * (values[b] - values[a]);
          const p = [points[3 * end], points[3 * end + 1], points[3 * end + 2]];
          const normal = [0, 1, 2].map((axis) => part.normals[3 * a + axis] + share * (part.normals[3 * b + axis] - part.normals[3 * a + axis]));
          const length = Math.hypot(...normal) || 1, value = lerp(deviation);
          const moved = p.map((x, axis) => x + (this.magnification * value * normal[axis]) / length);
          return { at: place(p), moved: place(moved), value, sigma: lerp(sigma), name: curve.name };
        });
        if (which === 0 || !curve.shared) { nominal.moveTo(...ends[0].at); nominal.lineTo(...ends[1].at); }
        if (ends.every((end) => Number.isFinite(end.value))) {
          measured.moveTo(...ends[0].moved);
          measured.lineTo(...ends[1].moved);
          all.push(...ends);
        }
      }
      pen.lineWidth = 1;
      pen.strokeStyle = "#8b929b";
      pen.stroke(nominal);
      pen.lineWidth = 1.6;
      pen.strokeStyle = curve.ink;
      pen.stroke(measured);
    });
    const wanted = w / 4 / scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = power * [5, 2, 1].find((step) => step * power <= wanted * (1 + 1e-9));
    pen.strokeStyle = pen.fillStyle = "#1d2127";
    pen.lineWidth = 1.5;
    pen.strokeRect(8, h - 8, length * scale, 0.01);
    pen.font = "11px system-ui, sans-serif";
    pen.fillText(`${Number(length.toPrecision(6))} mm`, 8, h - 13);
    this.curves.forEach((curve, which) => {
      pen.fillStyle = curve.ink;
      pen.fillText(curve.name, 8, 12 + 14 * which, w - 16);
    });
  }
  read(event) {
    const box = this.canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let best = null, nearest = 15;
    for (const each of this.placed || []) {
      const away = Math.min(Math.hypot(each.moved[0] - x, each.moved[1] - y), Math.hypot(each.at[0] - x, each.at[1] - y));
      if (away < nearest) { nearest = away; best = each; }
    }
    this.told(best ? `${best.name}: ${withUncertainty(best.value, best.sigma)}` : "");
  }
}
