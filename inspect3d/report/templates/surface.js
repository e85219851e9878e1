"use strict";
/* A part in three dimensions on a canvas: no library, no network. Units mm; parts are centred on the origin.
   `Eye` is where one looks from, and may be shared: panes with one eye turn together. `Surface` draws and reads a part.
   `steer` lets mouse, touch and keyboard move an eye. */

const RESTING = 180; /* ms without a change, after which a part is drawn in full again */
const LARGE = 200000; /* triangles from which smooth edges cost more than they show */
const SLOW = 45; /* ms from picture to picture above which a part is drawn with half the pixels while it moves */

function cross(a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; }
function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
function unit(a) { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); }

class Eye {
  /* nodes: of the part that fills the window, xyz one after the other */
  constructor(nodes) {
    this.nodes = nodes;
    this.watchers = [];
    this.moving = false;
    this.timer = 0;
    this.radius = 0;
    for (let k = 0; k < nodes.length; k += 3) this.radius = Math.max(this.radius, Math.hypot(nodes[k], nodes[k + 1], nodes[k + 2]));
    this.radius = this.radius || 1;
    this.look([1, 1, 1]);
  }
  look(direction) {
    const near = unit(direction), up = Math.abs(near[2]) > 0.999 ? [0, 1, 0] : [0, 0, 1], right = unit(cross(up, near));
    this.turn = [right, cross(near, right), near]; /* rows: right, up and towards the viewer, in the frame of the part */
    const nodes = this.nodes;
    this.fit = [0, 1].map((axis) => {
      const [x, y, z] = this.turn[axis];
      let span = 0;
      for (let k = 0; k < nodes.length; k += 3) span = Math.max(span, Math.abs(x * nodes[k] + y * nodes[k + 1] + z * nodes[k + 2]));
      return span;
    });
    this.shift = [0, 0];
    this.zoom = 1;
    this.changed();
  }
  rotate(axis, angle) { /* about 0 right, 1 up, 2 the line of sight */
    const c = Math.cos(angle), s = Math.sin(angle), [a, b] = [(axis + 1) % 3, (axis + 2) % 3], t = this.turn;
    const first = t[a].map((x, k) => c * x - s * t[b][k]), second = t[a].map((x, k) => s * x + c * t[b][k]);
    t[a] = unit(first);
    t[b] = unit(second);
    this.changed();
  }
  pixel(canvas) { /* mm per CSS pixel */
    const w = canvas.clientWidth || 1, h = canvas.clientHeight || 1;
    return Math.max((2.25 * this.fit[0]) / w, (2.25 * this.fit[1]) / h, 1e-9) / this.zoom;
  }
  move(dx, dy, canvas) { /* by CSS pixels to the right and down */
    const p = this.pixel(canvas);
    this.shift[0] += dx * p;
    this.shift[1] -= dy * p;
    this.changed();
  }
  enlarge(factor, x, y, canvas) { /* about a place of the canvas, CSS pixels */
    const p = this.pixel(canvas), dx = x - canvas.clientWidth / 2, dy = canvas.clientHeight / 2 - y;
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.2), 400);
    const q = this.pixel(canvas);
    this.shift[0] += dx * (q - p);
    this.shift[1] += dy * (q - p);
    this.changed();
  }
  watch(watcher) { this.watchers.push(watcher); }
  unwatch(watcher) { this.watchers = this.watchers.filter((each) => each !== watcher); }
  changed() {
    this.moving = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { this.moving = false; for (const watcher of this.watchers) watcher(); }, RESTING);
    for (const watcher of this.watchers) watcher();
  }
}

const VERTEX = `#version 300 es
  uniform mat3 turn; uniform vec2 shift; uniform vec3 size; uniform float raise; uniform bool points; uniform float dot_;
  in vec3 node; in vec3 normal; in float crease; in float value; in float shown;
  out vec3 place; out vec3 eye; out vec3 direction; out float sharp; out float seen; out float amount; out vec3 low; out vec3 high;
  void main() {
    place = node;
    eye = turn * node;
    direction = turn * normal;
    if (points && direction.z < 0.0) direction = -direction;
    sharp = crease;
    seen = shown;
    amount = shown > 0.5 ? value : 0.0;
    float class_ = shown > 0.5 ? floor(value + 0.5) : 0.0;
    low = vec3(class_ == 0.0, class_ == 1.0, class_ == 2.0);
    high = vec3(class_ == 3.0, class_ == 4.0, class_ == 5.0);
    gl_PointSize = dot_;
    gl_Position = vec4((eye.xy + shift) * size.xy, -eye.z * size.z - raise, 1.0);
  }`;
const PIXEL = `#version 300 es
  precision highp float;
  uniform sampler2D scale; uniform vec2 limits; uniform bool classes; uniform bool plain; uniform vec4 ink;
  uniform vec3 palette[6]; uniform vec3 back; uniform vec4 cut;
  in vec3 place; in vec3 eye; in vec3 direction; in float sharp; in float seen; in float amount; in vec3 low; in vec3 high;
  out vec4 colour;
  vec3 field() {
    if (classes) {
      float most = max(max(max(low.x, low.y), low.z), max(max(high.x, high.y), high.z));
      return most == low.x ? palette[0] : most == low.y ? palette[1] : most == low.z ? palette[2]
           : most == high.x ? palette[3] : most == high.y ? palette[4] : palette[5];
    }
    if (seen < 0.5) return palette[0];
    return texture(scale, vec2(clamp((amount / seen - limits.x) / (limits.y - limits.x), 0.002, 0.998), 0.5)).rgb;
  }
  void main() {
    if (plain) { colour = ink; return; }
    if (dot(cut.xyz, place) > cut.w) discard;
    vec3 facet = normalize(cross(dFdx(eye), dFdy(eye)));
    vec3 n = normalize(mix(normalize(direction + 1e-6), gl_FrontFacing ? facet : -facet, clamp(sharp, 0.0, 1.0)));
    float light = 0.76 + 0.18 * max(n.z, 0.0) + 0.12 * max(dot(n, normalize(vec3(-0.4, 0.8, 0.9))), 0.0);
    colour = vec4((gl_FrontFacing ? field() : back) * min(light, 1.04), 1.0);
  }`;

class Surface {
  /* part: nodes, triangles, edges, normals (127 for one), crease, and coarse, the triangles to draw while the eye moves;
     without triangles the nodes are drawn as points.
     look: colours 0 to 255 of what is not measured and of the inside */
  constructor(canvas, part, eye, look) {
    this.canvas = canvas;
    this.part = part;
    this.eye = eye;
    this.look = look;
    this.count = part.nodes.length / 3;
    this.field = { limits: [0, 1], classes: [] };
    this.lines = []; /* { points: ends of lines xyz one after the other, ink: [r, g, b, a] 0 to 1, hidden: drawn through the part } */
    this.plane = null; /* { normal, offset }: what lies beyond it is cut away */
    this.after = null; /* called after each picture */
    this.queued = false;
    this.swift = false;
    this.pace = 0; /* ms from picture to picture while the eye moves, smoothed */
    this.last = 0;
    const gl = canvas.getContext("webgl2", { antialias: part.triangles.length < 3 * LARGE, preserveDrawingBuffer: true });
    this.gl = gl;
    if (!gl) return;
    this.program = gl.createProgram();
    gl.attachShader(this.program, this.compiled(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(this.program, this.compiled(gl.FRAGMENT_SHADER, PIXEL));
    gl.linkProgram(this.program);
    gl.useProgram(this.program);
    this.places = {};
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.attribute("node", 3, gl.FLOAT, false, part.nodes);
    this.attribute("normal", 3, gl.BYTE, true, part.normals);
    this.attribute("crease", 1, gl.UNSIGNED_BYTE, false, part.crease);
    this.values = this.attribute("value", 1, gl.FLOAT, false, new Float32Array(this.count));
    this.shown = this.attribute("shown", 1, gl.UNSIGNED_BYTE, false, new Uint8Array(this.count));
    this.faces = this.indices(part.triangles);
    this.edges = this.indices(part.edges);
    this.coarse = part.coarse && part.coarse.length ? this.indices(part.coarse) : null;
    this.lineArray = gl.createVertexArray();
    gl.bindVertexArray(this.lineArray);
    this.lineBuffer = this.attribute("node", 3, gl.FLOAT, false, new Float32Array(0));
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.clearColor(1, 1, 1, 1);
    this.watcher = () => this.draw();
    eye.watch(this.watcher);
    new ResizeObserver(this.watcher).observe(canvas);
  }
  close() {
    this.eye.unwatch(this.watcher);
    const lose = this.gl && this.gl.getExtension("WEBGL_lose_context");
    if (lose) lose.loseContext();
  }
  compiled(kind, code) {
    const gl = this.gl, shader = gl.createShader(kind);
    gl.shaderSource(shader, code);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  }
  place(name) { return (this.places[name] ??= this.gl.getUniformLocation(this.program, name)); }
  attribute(name, size, kind, normalised, values) {
    const gl = this.gl, buffer = gl.createBuffer(), index = gl.getAttribLocation(this.program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, size, kind, normalised, 0, 0);
    return buffer;
  }
  indices(values) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, values, gl.STATIC_DRAW);
    return buffer;
  }
  /* field: values and shown (1 where there is one) of the nodes, limits, classes (words), and colours: of 256 steps one
     after the other, or [r, g, b] of each class */
  show(field) {
    const gl = this.gl;
    this.field = field;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.values);
    gl.bufferData(gl.ARRAY_BUFFER, field.values.map((v) => (Number.isFinite(v) ? v : 0)), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.shown);
    gl.bufferData(gl.ARRAY_BUFFER, field.shown, gl.STATIC_DRAW);
    if (!field.classes.length) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, field.colours);
    this.draw();
  }
  draw() {
    if (!this.queued) { this.queued = true; requestAnimationFrame(() => this.painted()); }
  }
  /* Return by how much to divide the pixels: a computer without a graphics card turns a coarser picture. */
  sharpness() {
    const now = performance.now(), gap = now - this.last;
    this.last = now;
    if (!this.eye.moving) return 1;
    if (gap < 1000) this.pace = this.pace ? 0.7 * this.pace + 0.3 * gap : gap;
    this.swift ||= this.pace > SLOW;
    return this.swift ? 0.5 : 1;
  }
  painted() {
    this.queued = false;
    const gl = this.gl, canvas = this.canvas, part = this.part, look = this.look, field = this.field;
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = (window.devicePixelRatio || 1) * this.sharpness();
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const t = this.eye.turn, p = this.eye.pixel(canvas);
    gl.uniformMatrix3fv(this.place("turn"), false, [0, 1, 2].flatMap((k) => [t[0][k], t[1][k], t[2][k]]));
    gl.uniform2f(this.place("shift"), this.eye.shift[0], this.eye.shift[1]);
    gl.uniform3f(this.place("size"), 2 / (w * p), 2 / (h * p), 0.98 / this.eye.radius);
    gl.uniform2f(this.place("limits"), field.limits[0], field.limits[1]);
    gl.uniform1i(this.place("classes"), field.classes.length ? 1 : 0);
    const palette = [look.unmeasured, ...(field.classes.length ? field.colours : [])];
    while (palette.length < 6) palette.push(look.unmeasured);
    gl.uniform3fv(this.place("palette"), palette.flat().map((c) => c / 255));
    gl.uniform3fv(this.place("back"), look.back.map((c) => c / 255));
    gl.uniform4fv(this.place("cut"), this.plane ? [...this.plane.normal, this.plane.offset] : [0, 0, 0, 1]);
    gl.uniform1i(this.place("plain"), 0);
    gl.uniform1f(this.place("raise"), 0);
    gl.uniform1i(this.place("points"), part.triangles.length ? 0 : 1);
    gl.uniform1f(this.place("dot_"), ratio * (look.dot || 2));
    gl.bindVertexArray(this.array);
    const coarse = this.eye.moving && this.coarse;
    if (!part.triangles.length) gl.drawArrays(gl.POINTS, 0, this.count);
    else this.drawn(gl.TRIANGLES, coarse ? this.coarse : this.faces, coarse ? part.coarse : part.triangles);
    gl.uniform1i(this.place("plain"), 1);
    gl.uniform1f(this.place("raise"), 0.002);
    gl.uniform4f(this.place("ink"), 0.23, 0.25, 0.28, 1);
    if (!this.plane) this.drawn(gl.LINES, this.edges, part.edges);
    this.drawLines();
    if (this.after) this.after(p);
  }
  /* Take edges and coarse triangles of the part that have come after the rest. */
  refine() {
    this.gl.bindVertexArray(this.array);
    this.edges = this.indices(this.part.edges);
    this.coarse = this.part.coarse && this.part.coarse.length ? this.indices(this.part.coarse) : null;
    this.draw();
  }
  drawn(kind, buffer, values) {
    this.gl.bindBuffer(this.gl.ELEMENT_ARRAY_BUFFER, buffer);
    this.gl.drawElements(kind, values.length, this.gl.UNSIGNED_INT, 0);
  }
  drawLines() {
    const gl = this.gl;
    if (!this.lines.length) return;
    gl.bindVertexArray(this.lineArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.enable(gl.BLEND);
    for (const each of this.lines) {
      gl.bufferData(gl.ARRAY_BUFFER, each.points, gl.DYNAMIC_DRAW);
      gl.uniform4fv(this.place("ink"), each.ink);
      if (each.hidden) gl.disable(gl.DEPTH_TEST);
      gl.drawArrays(each.filled ? gl.TRIANGLES : gl.LINES, 0, each.points.length / 3);
      gl.enable(gl.DEPTH_TEST);
    }
    gl.disable(gl.BLEND);
  }
  /* Return where a point of the part lies on the canvas, CSS pixels, and how near it is, mm. */
  onScreen(point) {
    const p = this.eye.pixel(this.canvas), t = this.eye.turn;
    return [this.canvas.clientWidth / 2 + (dot(t[0], point) + this.eye.shift[0]) / p,
      this.canvas.clientHeight / 2 - (dot(t[1], point) + this.eye.shift[1]) / p, dot(t[2], point)];
  }
  node(k) { return [this.part.nodes[3 * k], this.part.nodes[3 * k + 1], this.part.nodes[3 * k + 2]]; }
  cutAway(point) { return this.plane !== null && dot(this.plane.normal, point) > this.plane.offset; }
  /* Return what lies under a place of the canvas: the point, its nearest node and how near it is; null for nothing or the inside. */
  hit(x, y) {
    const { nodes, triangles } = this.part, p = this.eye.pixel(this.canvas), t = this.eye.turn;
    const sx = (x - this.canvas.clientWidth / 2) * p - this.eye.shift[0], sy = (this.canvas.clientHeight / 2 - y) * p - this.eye.shift[1];
    const along = (axis, k) => axis[0] * nodes[3 * k] + axis[1] * nodes[3 * k + 1] + axis[2] * nodes[3 * k + 2];
    const [right, up, near] = t;
    let found = null, top = -Infinity;
    for (let m = 0; m < triangles.length; m += 3) {
      const a = triangles[m], b = triangles[m + 1], c = triangles[m + 2];
      const ax = along(right, a) - sx, bx = along(right, b) - sx, cx = along(right, c) - sx;
      if ((ax < 0 && bx < 0 && cx < 0) || (ax > 0 && bx > 0 && cx > 0)) continue;
      const ay = along(up, a) - sy, by = along(up, b) - sy, cy = along(up, c) - sy;
      if ((ay < 0 && by < 0 && cy < 0) || (ay > 0 && by > 0 && cy > 0)) continue;
      const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, sum = wa + wb + wc;
      if (sum === 0 || wa * sum < 0 || wb * sum < 0 || wc * sum < 0) continue;
      const z = (wa * along(near, a) + wb * along(near, b) + wc * along(near, c)) / sum;
      if (z <= top) continue;
      const point = right.map((_, k) => right[k] * sx + up[k] * sy + near[k] * z);
      if (this.cutAway(point)) continue;
      top = z;
      found = sum < 0 ? null : { point, node: wa >= wb && wa >= wc ? a : wb >= wc ? b : c, near: z };
    }
    return found;
  }
}

/* Let mouse, touch and keyboard move the eye of a canvas. told: { hover(x, y), leave(), click(x, y, event), start: the
   direction to look from at the beginning } */
function steer(canvas, eye, told) {
  const touching = new Map();
  let travelled = 0;
  const here = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    touching.set(event.pointerId, here(event));
    travelled = 0;
    told.leave();
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = here(event), last = touching.get(event.pointerId);
    if (!last) { told.hover(x, y, event); return; }
    const dx = x - last[0], dy = y - last[1];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (touching.size === 2) {
      const other = [...touching.entries()].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(last[0] - other[0], last[1] - other[1]), after = Math.hypot(x - other[0], y - other[1]);
      eye.enlarge(after / (before || 1), (x + other[0]) / 2, (y + other[1]) / 2, canvas);
      eye.move(dx / 2, dy / 2, canvas);
    } else if (event.shiftKey || event.buttons & 6) eye.move(dx, dy, canvas);
    else {
      eye.rotate(1, dx * 0.008);
      eye.rotate(0, dy * 0.008);
    }
    touching.set(event.pointerId, [x, y]);
  });
  for (const kind of ["pointerup", "pointercancel"])
    canvas.addEventListener(kind, (event) => {
      const last = touching.get(event.pointerId);
      touching.delete(event.pointerId);
      if (kind === "pointerup" && last && travelled < 4 && event.button === 0) told.click(...last, event);
    });
  canvas.addEventListener("pointerleave", () => told.leave());
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    told.leave();
    eye.enlarge(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...here(event), canvas);
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const middle = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (arrow && event.shiftKey) eye.move(30 * arrow[0], 30 * arrow[1], canvas);
    else if (arrow) { eye.rotate(1, 0.1 * arrow[0]); eye.rotate(0, 0.1 * arrow[1]); }
    else if (event.key === "+" || event.key === "=") eye.enlarge(1.15, ...middle, canvas);
    else if (event.key === "-") eye.enlarge(1 / 1.15, ...middle, canvas);
    else if (event.key === "0" || event.key === "Home") eye.look(told.start);
    else if (event.key === "Enter") told.click(...middle, event);
    else return;
    event.preventDefault();
  });
}
