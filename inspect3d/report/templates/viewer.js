"use strict";
/* The 3-D map of the report: no library, no network. Units mm; the part is centred on the origin. */
(() => {
  const root = document.getElementById("viewer");
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const canvas = root.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl || !data.maps.length) {
    root.classList.add("without");
    return;
  }

  function unpacked(text, Kind) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    return new Kind(bytes.buffer);
  }
  const nodes = unpacked(data.nodes, Float32Array), triangles = unpacked(data.triangles, Uint32Array);
  const edges = unpacked(data.edges, Uint32Array), count = nodes.length / 3;
  const normals = unpacked(data.normals, Int8Array), crease = unpacked(data.crease, Uint8Array);
  let radius = 0;
  for (let k = 0; k < count; k++) radius = Math.max(radius, Math.hypot(nodes[3 * k], nodes[3 * k + 1], nodes[3 * k + 2]));
  radius = radius || 1;
  for (const map of data.maps)
    for (const field of map.fields) {
      field.values = unpacked(field.values, Float32Array);
      field.shown = Float32Array.from(field.values, (v) => (Number.isFinite(v) && !(field.classes.length && v === 0) ? 1 : 0));
      if (!field.classes.length) field.colours = unpacked(field.colours, Uint8Array);
      field.fixed = field.limits.slice();
    }

  /* ---- the program on the graphics card ---- */
  const vertexCode = `#version 300 es
    uniform mat3 turn; uniform vec2 shift; uniform vec3 size; uniform float raise;
    in vec3 node; in vec3 normal; in float crease; in float value; in float shown;
    out vec3 eye; out vec3 direction; out float sharp; out float seen; out float amount; out vec3 low; out vec3 high;
    void main() {
      eye = turn * node;
      direction = turn * normal;
      sharp = crease;
      seen = shown;
      amount = shown > 0.5 ? value : 0.0;
      float class_ = shown > 0.5 ? floor(value + 0.5) : 0.0;
      low = vec3(class_ == 0.0, class_ == 1.0, class_ == 2.0);
      high = vec3(class_ == 3.0, class_ == 4.0, class_ == 5.0);
      gl_Position = vec4((eye.xy + shift) * size.xy, -eye.z * size.z - raise, 1.0);
    }`;
  const pixelCode = `#version 300 es
    precision highp float;
    uniform sampler2D scale; uniform vec2 limits; uniform bool classes; uniform bool line;
    uniform vec3 palette[6]; uniform vec3 back;
    in vec3 eye; in vec3 direction; in float sharp; in float seen; in float amount; in vec3 low; in vec3 high;
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
      if (line) { colour = vec4(0.23, 0.25, 0.28, 1.0); return; }
      vec3 facet = normalize(cross(dFdx(eye), dFdy(eye)));
      vec3 n = normalize(mix(normalize(direction + 1e-6), gl_FrontFacing ? facet : -facet, clamp(sharp, 0.0, 1.0)));
      float light = 0.76 + 0.18 * max(n.z, 0.0) + 0.12 * max(dot(n, normalize(vec3(-0.4, 0.8, 0.9))), 0.0);
      colour = vec4((gl_FrontFacing ? field() : back) * min(light, 1.04), 1.0);
    }`;
  function compiled(kind, code) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, code);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  }
  const program = gl.createProgram();
  gl.attachShader(program, compiled(gl.VERTEX_SHADER, vertexCode));
  gl.attachShader(program, compiled(gl.FRAGMENT_SHADER, pixelCode));
  gl.linkProgram(program);
  gl.useProgram(program);
  const place = (name) => gl.getUniformLocation(program, name);
  function attribute(name, size, kind, normalised, values) {
    const buffer = gl.createBuffer(), index = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    if (index >= 0) {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, size, kind, normalised, 0, 0);
    }
    return buffer;
  }
  attribute("node", 3, gl.FLOAT, false, nodes);
  attribute("normal", 3, gl.BYTE, true, normals);
  attribute("crease", 1, gl.UNSIGNED_BYTE, false, crease);
  const valueBuffer = attribute("value", 1, gl.FLOAT, false, new Float32Array(count));
  const shownBuffer = attribute("shown", 1, gl.FLOAT, false, new Float32Array(count));
  function indices(values) {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, values, gl.STATIC_DRAW);
    return buffer;
  }
  const faceBuffer = indices(triangles), edgeBuffer = indices(edges);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(1, 1, 1, 1);

  /* ---- what is shown ---- */
  const view = { turn: null, shift: [0, 0], zoom: 1 };
  let map = data.maps[0], field = map.fields[0], pins = [], queued = false;

  function cross(a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; }
  function unit(a) { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); }
  function look(direction) {
    const near = unit(direction), up = Math.abs(near[2]) > 0.999 ? [0, 1, 0] : [0, 0, 1];
    const right = unit(cross(up, near));
    view.turn = [right, cross(near, right), near];
    let span = [0, 0];
    for (let k = 0; k < count; k++)
      for (const axis of [0, 1]) {
        const r = view.turn[axis];
        span[axis] = Math.max(span[axis], Math.abs(r[0] * nodes[3 * k] + r[1] * nodes[3 * k + 1] + r[2] * nodes[3 * k + 2]));
      }
    view.fit = span;
    view.shift = [0, 0];
    view.zoom = 1;
    draw();
  }
  function turned(axis, angle) {
    const c = Math.cos(angle), s = Math.sin(angle), [a, b] = [(axis + 1) % 3, (axis + 2) % 3], t = view.turn;
    const first = t[a].map((x, k) => c * x - s * t[b][k]), second = t[a].map((x, k) => s * x + c * t[b][k]);
    t[a] = unit(first);
    t[b] = unit(second);
  }
  function pixel() { /* mm per CSS pixel */
    const w = canvas.clientWidth, h = canvas.clientHeight;
    return Math.max((2.25 * view.fit[0]) / w, (2.25 * view.fit[1]) / h, 1e-9) / view.zoom;
  }
  function onScreen(k) {
    const p = pixel(), t = view.turn, x = nodes[3 * k], y = nodes[3 * k + 1], z = nodes[3 * k + 2];
    return [canvas.clientWidth / 2 + (t[0][0] * x + t[0][1] * y + t[0][2] * z + view.shift[0]) / p,
      canvas.clientHeight / 2 - (t[1][0] * x + t[1][1] * y + t[1][2] * z + view.shift[1]) / p,
      t[2][0] * x + t[2][1] * y + t[2][2] * z];
  }
  function draw() {
    if (!queued) { queued = true; requestAnimationFrame(painted); }
  }
  function painted() {
    queued = false;
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const t = view.turn, p = pixel();
    gl.uniformMatrix3fv(place("turn"), false, [0, 1, 2].flatMap((k) => [t[0][k], t[1][k], t[2][k]]));
    gl.uniform2f(place("shift"), view.shift[0], view.shift[1]);
    gl.uniform3f(place("size"), 2 / (w * p), 2 / (h * p), 0.98 / radius);
    gl.uniform2f(place("limits"), field.limits[0], field.limits[1]);
    gl.uniform1i(place("classes"), field.classes.length ? 1 : 0);
    const palette = [data.unmeasured, ...(field.classes.length ? field.colours : [])];
    while (palette.length < 6) palette.push(data.unmeasured);
    gl.uniform3fv(place("palette"), palette.flat().map((c) => c / 255));
    gl.uniform3fv(place("back"), data.back.map((c) => c / 255));
    gl.uniform1i(place("line"), 0);
    gl.uniform1f(place("raise"), 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faceBuffer);
    gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
    gl.uniform1i(place("line"), 1);
    gl.uniform1f(place("raise"), 0.002);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, edgeBuffer);
    gl.drawElements(gl.LINES, edges.length, gl.UNSIGNED_INT, 0);
    placePins();
    placeCompass(p);
  }

  /* ---- words around the picture ---- */
  const minus = (text) => text.replace(/-/g, "\u2212");
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
  function made(kind, name, text) {
    const element = document.createElement(kind);
    element.className = name;
    if (text !== undefined) element.textContent = text;
    return element;
  }
  const bar = root.querySelector(".bar");
  function showBar() {
    bar.replaceChildren(made("strong", "", field.classes.length ? field.title : `${field.title}, ${field.unit}`));
    const key = made("div", field.classes.length ? "classes" : "ramp");
    bar.append(key);
    if (field.classes.length) {
      field.classes.forEach((words, k) => {
        const row = made("div", "class", words), patch = made("i", "");
        patch.style.background = `rgb(${field.colours[k]})`;
        row.prepend(patch);
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
    const none = made("div", "class", "not measured"), patch = made("i", "");
    patch.style.background = `rgb(${data.unmeasured})`;
    none.prepend(patch);
    bar.append(none);
  }
  function words(node, judged) {
    const value = map.fields[0].values[node], sigma = map.fields[1].values[node];
    if (!Number.isFinite(value)) return crease[node] ? "on an edge: no deviation" : "not measured";
    const expanded = 2 * sigma, leading = Math.floor(Math.log10(Number(expanded.toPrecision(2))));
    const places = Math.min(Math.max(1 - leading, 0), 6), text = value.toFixed(places);
    const verdict = judged && map.fields[2] && map.fields[2].shown[node] ? `, ${map.fields[2].classes[map.fields[2].values[node] - 1]}` : "";
    return minus(`${Number(text) > 0 ? "+" : ""}${text} \u00b1 ${expanded.toFixed(places)} mm`) + verdict;
  }
  function position(node) {
    return [0, 1, 2].map((k) => minus((nodes[3 * node + k] + data.centre[k]).toFixed(2))).join(", ");
  }

  /* ---- the node under the pointer ---- */
  function nodeAt(x, y) {
    const p = pixel(), t = view.turn, w = canvas.clientWidth / 2, h = canvas.clientHeight / 2;
    const sx = (x - w) * p - view.shift[0], sy = (h - y) * p - view.shift[1];
    let best = -1, top = -Infinity;
    const X = (k) => t[0][0] * nodes[3 * k] + t[0][1] * nodes[3 * k + 1] + t[0][2] * nodes[3 * k + 2] - sx;
    const Y = (k) => t[1][0] * nodes[3 * k] + t[1][1] * nodes[3 * k + 1] + t[1][2] * nodes[3 * k + 2] - sy;
    const Z = (k) => t[2][0] * nodes[3 * k] + t[2][1] * nodes[3 * k + 1] + t[2][2] * nodes[3 * k + 2];
    for (let m = 0; m < triangles.length; m += 3) {
      const a = triangles[m], b = triangles[m + 1], c = triangles[m + 2];
      const ax = X(a), bx = X(b), cx = X(c);
      if ((ax < 0 && bx < 0 && cx < 0) || (ax > 0 && bx > 0 && cx > 0)) continue;
      const ay = Y(a), by = Y(b), cy = Y(c);
      const wa = bx * cy - by * cx, wb = cx * ay - cy * ax, wc = ax * by - ay * bx, sum = wa + wb + wc;
      if (sum === 0 || wa * sum < 0 || wb * sum < 0 || wc * sum < 0) continue;
      const z = (wa * Z(a) + wb * Z(b) + wc * Z(c)) / sum;
      if (z > top) { top = z; best = sum < 0 ? -1 : wa >= wb && wa >= wc ? a : wb >= wc ? b : c; }
    }
    return best;
  }
  const probe = root.querySelector(".probe"), overlay = root.querySelector(".overlay");
  function showProbe(x, y) {
    const node = nodeAt(x, y);
    probe.hidden = node < 0;
    if (node < 0) return;
    probe.replaceChildren(made("strong", "", words(node, true)), made("span", "", `at ${position(node)} mm`));
    const left = x + 16 + probe.offsetWidth > canvas.clientWidth ? x - 12 - probe.offsetWidth : x + 16;
    probe.style.transform = `translate(${Math.max(left, 0)}px, ${Math.max(y - 52, 0)}px)`;
  }
  function pin(node, name) {
    const flag = made("div", "pin"), tag = made("div", "tag"), text = made("span", "");
    const close = made("button", "", "\u00d7");
    close.title = "remove this flag";
    close.addEventListener("click", () => { pins = pins.filter((each) => each.flag !== flag); flag.remove(); });
    tag.append(text, close);
    flag.append(tag);
    overlay.append(flag);
    pins.push({ node, name, flag, tag, text });
    draw();
  }
  function placePins() {
    const t = view.turn, taken = [];
    for (const each of pins) {
      const k = each.node, [x, y] = onScreen(k);
      const facing = t[2][0] * normals[3 * k] + t[2][1] * normals[3 * k + 1] + t[2][2] * normals[3 * k + 2] > 0;
      each.flag.hidden = !facing || x < 0 || y < 0 || x > canvas.clientWidth || y > canvas.clientHeight;
      each.text.textContent = (each.name ? `${each.name}: ` : "") + words(k, false);
      each.flag.classList.toggle("flipped", x > 0.7 * canvas.clientWidth);
      each.flag.style.transform = `translate(${x}px, ${y}px)`;
      if (each.flag.hidden) continue;
      const width = each.tag.offsetWidth + 6, height = each.tag.offsetHeight + 3;
      const left = x > 0.7 * canvas.clientWidth ? x - 9 - width : x + 9;
      let top = y - 28;
      const meets = (other) => left < other[0] + other[2] && other[0] < left + width && Math.abs(top - other[1]) < height;
      for (let found = taken.find(meets); found; found = taken.find(meets)) top = found[1] + height;
      taken.push([left, top, width]);
      each.tag.style.top = `${top - y}px`;
    }
  }
  function placeCompass(p) {
    const svg = root.querySelector(".compass");
    const arms = ["x", "y", "z"].map((name, k) => ({ name, k, x: view.turn[0][k], y: -view.turn[1][k], z: view.turn[2][k] }));
    arms.sort((a, b) => a.z - b.z);
    for (const arm of arms) {
      const group = svg.querySelector(`.${arm.name}`), l = Math.hypot(arm.x, arm.y);
      svg.append(group);
      group.querySelector("line").setAttribute("x2", 30 * arm.x);
      group.querySelector("line").setAttribute("y2", 30 * arm.y);
      group.querySelector("text").setAttribute("x", l > 0.05 ? (30 + 10 / Math.max(l, 0.3)) * arm.x : -9);
      const nearer = arms.some((other) => other.z > arm.z && Math.hypot(other.x - arm.x, other.y - arm.y) < 0.4);
      group.querySelector("text").setAttribute("y", (l > 0.05 ? (30 + 10 / Math.max(l, 0.3)) * arm.y : 11) + (nearer ? 12 : 0));
    }
    const wanted = 150 * p, power = 10 ** Math.floor(Math.log10(wanted));
    const length = power * [5, 2, 1].find((step) => step * power <= wanted * (1 + 1e-9));
    const scale = root.querySelector(".length");
    scale.style.width = `${length / p}px`;
    scale.textContent = `${Number(length.toPrecision(6))} mm`;
  }

  /* ---- choosing ---- */
  const mapChoice = root.querySelector(".map"), fieldChoice = root.querySelector(".field");
  const lowest = root.querySelector(".low"), highest = root.querySelector(".high");
  function chooseField(index) {
    field = map.fields[index] || map.fields[0];
    gl.bindBuffer(gl.ARRAY_BUFFER, valueBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, field.values.map((v) => (Number.isFinite(v) ? v : 0)), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, shownBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, field.shown, gl.STATIC_DRAW);
    if (!field.classes.length) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, field.colours);
    for (const input of [lowest, highest]) input.disabled = field.classes.length > 0;
    [lowest.value, highest.value] = field.classes.length ? ["", ""] : field.limits;
    showBar();
    draw();
  }
  function chooseMap(index) {
    map = data.maps[index];
    fieldChoice.replaceChildren(...map.fields.map((each, k) => {
      const option = made("option", "", each.title);
      option.value = k;
      return option;
    }));
    for (const each of pins) each.flag.remove();
    pins = [];
    for (const label of map.labels) pin(label.node, label.name);
    chooseField(0);
  }
  data.maps.forEach((each, k) => { const option = made("option", "", each.name); option.value = k; mapChoice.append(option); });
  mapChoice.parentElement.hidden = data.maps.length < 2;
  mapChoice.addEventListener("change", () => chooseMap(Number(mapChoice.value)));
  fieldChoice.addEventListener("change", () => chooseField(Number(fieldChoice.value)));
  for (const input of [lowest, highest])
    input.addEventListener("change", () => {
      const asked = [Number(lowest.value), Number(highest.value)];
      if (asked[0] < asked[1]) field.limits = asked;
      [lowest.value, highest.value] = field.limits;
      showBar();
      draw();
    });
  root.querySelector(".limits-back").addEventListener("click", () => {
    field.limits = field.fixed.slice();
    chooseField(map.fields.indexOf(field));
  });
  for (const button of root.querySelectorAll("[data-view]"))
    button.addEventListener("click", () => look(button.dataset.view.split(" ").map(Number)));

  /* ---- mouse, touch and keyboard ---- */
  const touching = new Map();
  let moved = 0;
  function zoom(factor, x, y) {
    const p = pixel(), dx = x - canvas.clientWidth / 2, dy = canvas.clientHeight / 2 - y;
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.2), 200);
    const q = pixel();
    view.shift[0] += dx * (q - p);
    view.shift[1] += dy * (q - p);
    draw();
  }
  function here(event) { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; }
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    touching.set(event.pointerId, here(event));
    moved = 0;
    probe.hidden = true;
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = here(event), last = touching.get(event.pointerId);
    if (!last) { showProbe(x, y); return; }
    const dx = x - last[0], dy = y - last[1];
    moved += Math.abs(dx) + Math.abs(dy);
    if (touching.size === 2) {
      const other = [...touching.entries()].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(last[0] - other[0], last[1] - other[1]), after = Math.hypot(x - other[0], y - other[1]);
      zoom(after / (before || 1), (x + other[0]) / 2, (y + other[1]) / 2);
    }
    if (touching.size === 2 || event.shiftKey || event.buttons & 6) {
      const share = touching.size === 2 ? 0.5 : 1;
      view.shift[0] += dx * pixel() * share;
      view.shift[1] -= dy * pixel() * share;
    } else {
      turned(1, dx * 0.008);
      turned(0, dy * 0.008);
    }
    touching.set(event.pointerId, [x, y]);
    draw();
  });
  for (const kind of ["pointerup", "pointercancel"])
    canvas.addEventListener(kind, (event) => {
      const last = touching.get(event.pointerId);
      touching.delete(event.pointerId);
      if (kind === "pointerup" && last && moved < 4 && event.button === 0) {
        const node = nodeAt(...last);
        if (node >= 0) pin(node, "");
      }
    });
  canvas.addEventListener("pointerleave", () => { probe.hidden = true; });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    probe.hidden = true;
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...here(event));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = 0.1, far = 30 * pixel();
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrows && event.shiftKey) { view.shift[0] += arrows[0] * far; view.shift[1] -= arrows[1] * far; }
    else if (arrows) { turned(1, arrows[0] * step); turned(0, arrows[1] * step); }
    else if (event.key === "+" || event.key === "=") view.zoom *= 1.15;
    else if (event.key === "-") view.zoom /= 1.15;
    else if (event.key === "0" || event.key === "Home") { look(data.start); }
    else return;
    event.preventDefault();
    draw();
  });
  new ResizeObserver(draw).observe(canvas);
  look(data.start);
  chooseMap(0);
})();
