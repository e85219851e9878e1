"use strict";
/* A photograph on a canvas: zoom, a cross for the keyboard, a loupe, and what is drawn over it. Pixel (0, 0) is the
   centre of the top-left pixel. */

const LOUPE = 132, TIMES = 11; /* CSS pixels of its side, and by which it magnifies a picture shown at full size */

export class Picture {
  /* told: { pick(x, y, event) } */
  constructor(root, info, address, told) {
    this.info = info;
    this.told = told;
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("aria-label", `photograph ${info.name}: arrow keys move the cross, Enter picks, + and \u2212 zoom, 0 shows all`);
    this.caption = document.createElement("div");
    this.caption.className = "caption";
    root.append(this.canvas, this.caption);
    this.marks = []; /* { x, y, name, active, outlier, seen: [x, y] or null } */
    this.lines = []; /* ends of the outline, xy one after the other */
    this.ellipse = null;
    this.pointer = null;
    this.scale = 0;
    this.image = new Image();
    this.image.addEventListener("load", () => this.whole());
    this.image.src = address;
    new ResizeObserver(() => (this.scale > this.least() * 1.001 ? this.draw() : this.whole())).observe(this.canvas);
    this.listen();
    this.say();
  }
  least() { return Math.min(this.canvas.clientWidth / this.info.width, this.canvas.clientHeight / this.info.height) || 1; }
  whole() {
    this.scale = this.least();
    this.offset = [(this.canvas.clientWidth - this.info.width * this.scale) / 2, (this.canvas.clientHeight - this.info.height * this.scale) / 2];
    this.draw();
  }
  onScreen(x, y) { return [this.offset[0] + (x + 0.5) * this.scale, this.offset[1] + (y + 0.5) * this.scale]; }
  pixelAt(sx, sy) { return [(sx - this.offset[0]) / this.scale - 0.5, (sy - this.offset[1]) / this.scale - 0.5]; }
  enlarge(factor, sx, sy) {
    const before = this.pixelAt(sx, sy);
    this.scale = Math.min(Math.max(this.scale * factor, this.least() * 0.8), 64);
    const after = this.onScreen(...before);
    this.offset[0] += sx - after[0];
    this.offset[1] += sy - after[1];
    this.draw();
  }
  listen() {
    const canvas = this.canvas;
    let last = null, travelled = 0;
    const here = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); last = here(event); travelled = 0; });
    canvas.addEventListener("pointermove", (event) => {
      const [sx, sy] = here(event);
      if (last) {
        travelled += Math.abs(sx - last[0]) + Math.abs(sy - last[1]);
        if (travelled >= 4) { this.offset[0] += sx - last[0]; this.offset[1] += sy - last[1]; }
        last = [sx, sy];
      }
      this.pointer = this.pixelAt(sx, sy);
      this.draw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (last && travelled < 4 && event.button === 0) this.told.pick(...this.pixelAt(...here(event)), event);
      last = null;
    });
    canvas.addEventListener("pointercancel", () => { last = null; });
    canvas.addEventListener("pointerleave", () => { this.pointer = null; this.draw(); });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.enlarge(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...here(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey) return;
      this.pointer ??= this.pixelAt(canvas.clientWidth / 2, canvas.clientHeight / 2);
      const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      const step = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
      if (arrow) { this.pointer = this.pointer.map((x, k) => x + step * arrow[k]); this.follow(); }
      else if (event.key === "Enter") this.told.pick(...this.pointer, event);
      else if (event.key === "+" || event.key === "=") this.enlarge(1.5, ...this.onScreen(...this.pointer));
      else if (event.key === "-") this.enlarge(1 / 1.5, ...this.onScreen(...this.pointer));
      else if (event.key === "0" || event.key === "Home") this.whole();
      else return;
      event.preventDefault();
      this.draw();
    });
  }
  follow() { /* keep the cross on the canvas */
    const [sx, sy] = this.onScreen(...this.pointer), margin = 20;
    this.offset[0] += Math.max(margin - sx, 0) - Math.max(sx - this.canvas.clientWidth + margin, 0);
    this.offset[1] += Math.max(margin - sy, 0) - Math.max(sy - this.canvas.clientHeight + margin, 0);
  }
  say() {
    const at = this.pointer ? ` \u00b7 ${this.pointer.map((x) => x.toFixed(1)).join(", ")} px` : "";
    this.caption.textContent = `${this.info.name}${at}`.replace(/-(?=\d)/g, "\u2212");
  }
  draw() {
    this.say(); /* at once: words need no frame of their own */
    if (!this.queued) { this.queued = true; requestAnimationFrame(() => { this.queued = false; this.painted(); }); }
  }
  painted() {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h || !this.scale) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = "#30343a";
    pen.fillRect(0, 0, w, h);
    this.paint(pen, this.scale, this.offset);
    if (this.pointer) {
      const [sx, sy] = this.onScreen(...this.pointer);
      this.cross(pen, sx, sy, 9);
      if (this.scale < TIMES * 0.8) this.loupe(pen, sx, sy, w, h);
    }
  }
  loupe(pen, sx, sy, w, h) {
    const left = sx > w / 2 ? 8 : w - LOUPE - 8, top = sy > h / 2 ? 30 : h - LOUPE - 8, scale = Math.max(TIMES, this.scale * 3);
    pen.save();
    pen.beginPath();
    pen.rect(left, top, LOUPE, LOUPE);
    pen.clip();
    pen.fillStyle = "#30343a";
    pen.fill();
    const middle = [left + LOUPE / 2, top + LOUPE / 2];
    this.paint(pen, scale, [0, 1].map((k) => middle[k] - (this.pointer[k] + 0.5) * scale));
    this.cross(pen, ...middle, LOUPE);
    pen.restore();
    pen.strokeStyle = "#fff";
    pen.lineWidth = 2;
    pen.strokeRect(left, top, LOUPE, LOUPE);
  }
  cross(pen, x, y, size) {
    for (const [ink, width] of [["rgba(255, 255, 255, .8)", 3], ["#c2410c", 1]]) {
      pen.strokeStyle = ink;
      pen.lineWidth = width;
      pen.beginPath();
      pen.moveTo(x - size, y);
      pen.lineTo(x + size, y);
      pen.moveTo(x, y - size);
      pen.lineTo(x, y + size);
      pen.stroke();
    }
  }
  paint(pen, scale, offset) {
    const place = (x, y) => [offset[0] + (x + 0.5) * scale, offset[1] + (y + 0.5) * scale];
    pen.imageSmoothingEnabled = scale < 2;
    if (this.image.complete && this.image.naturalWidth) pen.drawImage(this.image, offset[0], offset[1], this.info.width * scale, this.info.height * scale);
    pen.strokeStyle = "#00d0ff";
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (let k = 0; k < this.lines.length; k += 4) {
      pen.moveTo(...place(this.lines[k], this.lines[k + 1]));
      pen.lineTo(...place(this.lines[k + 2], this.lines[k + 3]));
    }
    pen.stroke();
    if (this.ellipse) {
      const { x, y, ellipse } = this.ellipse;
      pen.strokeStyle = "#ffd400";
      pen.beginPath();
      pen.ellipse(...place(x, y), (ellipse[0] / 2) * scale, (ellipse[1] / 2) * scale, (ellipse[2] * Math.PI) / 180, 0, 7);
      pen.stroke();
    }
    pen.font = "600 12px system-ui, sans-serif";
    for (const mark of this.marks) {
      const [x, y] = place(mark.x, mark.y), ink = mark.outlier ? "#ff3b3b" : mark.active ? "#ff9a3d" : "#ffe000";
      if (mark.seen) {
        pen.strokeStyle = ink;
        pen.lineWidth = 1.5;
        pen.beginPath();
        pen.moveTo(x, y);
        pen.lineTo(...place(...mark.seen));
        pen.stroke();
      }
      for (const [colour, width] of [["rgba(0, 0, 0, .75)", 4], [ink, 1.8]]) {
        pen.strokeStyle = colour;
        pen.lineWidth = width;
        pen.beginPath();
        pen.moveTo(x - 7, y - 7);
        pen.lineTo(x + 7, y + 7);
        pen.moveTo(x - 7, y + 7);
        pen.lineTo(x + 7, y - 7);
        pen.stroke();
      }
      pen.lineWidth = 3;
      pen.strokeStyle = "rgba(0, 0, 0, .75)";
      pen.strokeText(mark.name, x + 10, y - 8);
      pen.fillStyle = ink;
      pen.fillText(mark.name, x + 10, y - 8);
    }
  }
}
