"use strict";
/* The 3-D views of the report, side by side on panes (pane.js) with one eye: which map and field each shows. */
(() => {
  const MOST = 6; /* views that a page holds at once */
  const root = document.getElementById("viewer");
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  if (!document.createElement("canvas").getContext("webgl2") || !data.maps.length) {
    root.classList.add("without");
    return;
  }

  function unpacked(text, Kind) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    return new Kind(bytes.buffer);
  }
  /* Whole numbers of two bytes as the values they stand for; the largest stands for none. */
  function valuesOf(packed) {
    return Float32Array.from(unpacked(packed.codes, Uint16Array), (code) => (code === 65535 ? NaN : packed.low + packed.step * code));
  }
  function interleaved(columns) {
    const [x, y, z] = columns.map(valuesOf), all = new Float32Array(3 * x.length);
    for (let k = 0; k < x.length; k++) { all[3 * k] = x[k]; all[3 * k + 1] = y[k]; all[3 * k + 2] = z[k]; }
    return all;
  }
  const part = {
    centre: data.centre,
    nodes: interleaved(data.nodes),
    triangles: Uint32Array.from(unpacked(data.triangles, Uint16Array)),
    edges: Uint32Array.from(unpacked(data.edges, Uint16Array)),
    normals: unpacked(data.normals, Int8Array),
    crease: unpacked(data.crease, Uint8Array),
  };
  const shared = {}; /* for each kind of field the limits that hold all maps */
  for (const map of data.maps)
    for (const field of map.fields) {
      field.values = valuesOf(field.values);
      field.shown = Uint8Array.from(field.values, (v) => (Number.isFinite(v) ? 1 : 0));
      if (!field.classes.length) field.colours = unpacked(field.colours, Uint8Array);
      field.fixed = field.limits.slice();
      const limits = (shared[field.key] ??= field.limits.slice());
      shared[field.key] = [Math.min(limits[0], field.limits[0]), Math.max(limits[1], field.limits[1])];
    }
  const fixed = structuredClone(shared);

  const eye = new Eye(part.nodes), stage = root.querySelector(".stage");
  const choice = root.querySelector(".tools .field"), same = root.querySelector(".same");
  const lowest = root.querySelector(".low"), highest = root.querySelector(".high");
  let views = [], lead = null;

  function filled(select, words) {
    select.replaceChildren(...words.map((each, k) => {
      const option = made("option", "", each);
      option.value = k;
      return option;
    }));
  }
  function show(view, field) {
    if (same.checked && !field.classes.length) field.limits = shared[field.key].slice();
    view.field = field;
    view.fieldChoice.value = view.map.fields.indexOf(field);
    view.pane.show(field);
    view.pane.canvas.dataset.shows = `${view.map.name}: ${field.title}`;
  }
  function redraw() {
    for (const view of views) show(view, view.field);
    const field = lead.field, plain = field.classes.length > 0;
    for (const input of [lowest, highest]) input.disabled = plain;
    [lowest.value, highest.value] = plain ? ["", ""] : field.limits;
    root.querySelector(".unit").textContent = field.unit;
    choice.value = keys.indexOf(field.key);
  }
  function chooseMap(view, map) {
    const key = view.field && view.field.key;
    view.map = map;
    view.mapChoice.value = data.maps.indexOf(map);
    filled(view.fieldChoice, map.fields.map((each) => each.title));
    view.pane.setMap(map);
    show(view, map.fields.find((each) => each.key === key) || map.fields[0]);
  }
  function add(map) {
    const cell = made("div", "cell"), head = made("div", "head"), holder = made("div", "pane"), close = made("button", "", "\u00d7");
    const view = { cell, mapChoice: made("select", "map"), fieldChoice: made("select", "field"), field: null };
    view.mapChoice.setAttribute("aria-label", "map of this view");
    view.fieldChoice.setAttribute("aria-label", "field of this view");
    filled(view.mapChoice, data.maps.map((each) => each.name));
    close.type = "button";
    close.title = "close this view";
    head.append(view.mapChoice, view.fieldChoice, close);
    cell.append(head, holder);
    stage.append(cell);
    view.pane = new Pane(holder, part, eye, data, {
      start: data.start,
      click: (node) => { for (const each of views) each.pane.pin(node, ""); },
      hovered: (found) => {
        for (const { pane } of views)
          if (pane !== view.pane) pane.tell(found, ...(found ? pane.surface.onScreen(found.point) : []));
      },
      removed: (pin) => { for (const each of views) if (each !== view) each.pane.unpin(pin.node, pin.name); },
    });
    views.push(view);
    chooseMap(view, map);
    view.mapChoice.addEventListener("change", () => { lead = view; chooseMap(view, data.maps[view.mapChoice.value]); redraw(); });
    view.fieldChoice.addEventListener("change", () => { lead = view; view.field = view.map.fields[view.fieldChoice.value]; redraw(); });
    close.addEventListener("click", () => {
      views = views.filter((each) => each !== view);
      if (lead === view) lead = views[0];
      cell.remove();
      view.pane.close();
      arrange();
    });
    for (const kind of ["pointerleave", "pointerdown", "wheel"])
      view.pane.canvas.addEventListener(kind, () => { for (const each of views) if (each !== view) each.pane.leave(); }, { passive: true });
    return view;
  }
  function arrange() {
    stage.dataset.views = views.length;
    root.querySelector(".another").disabled = views.length >= MOST;
    redraw();
  }

  const titles = new Map(data.maps.flatMap((map) => map.fields.map((field) => [field.key, field])));
  const keys = [...titles.keys()];
  filled(choice, keys.map((key) => (key.startsWith("sigma of") ? "uncertainty of the difference" : titles.get(key).title)));
  choice.addEventListener("change", () => {
    const key = keys[choice.value];
    for (const view of views) {
      const field = view.map.fields.find((each) => each.key === key);
      if (field) { view.field = field; lead = view; }
    }
    if (lead.field.key !== key) chooseMap(lead, data.maps.find((map) => map.fields.some((field) => field.key === key)));
    lead.field = lead.map.fields.find((field) => field.key === key);
    redraw();
  });
  for (const input of [lowest, highest])
    input.addEventListener("change", () => {
      const asked = [Number(lowest.value), Number(highest.value)];
      if (asked[0] < asked[1]) { lead.field.limits = asked; if (same.checked) shared[lead.field.key] = asked; }
      redraw();
    });
  root.querySelector(".limits-back").addEventListener("click", () => {
    shared[lead.field.key] = fixed[lead.field.key].slice();
    lead.field.limits = lead.field.fixed.slice();
    redraw();
  });
  same.addEventListener("change", () => {
    if (!same.checked) for (const map of data.maps) for (const field of map.fields) field.limits = field.fixed.slice();
    redraw();
  });
  for (const button of root.querySelectorAll("[data-view]"))
    button.addEventListener("click", () => eye.look(button.dataset.view.split(" ").map(Number)));
  root.querySelector(".another").addEventListener("click", () => {
    const shown = new Set(views.map((view) => view.map));
    add(data.maps.find((map) => !shown.has(map)) || data.maps[0]);
    arrange();
  });
  for (const each of root.querySelectorAll(".together")) each.hidden = data.maps.length < 2;
  root.querySelector(".detail").textContent = data.detail;
  eye.look(data.start);
  for (const map of data.maps.slice(0, data.methods === 2 ? 3 : Math.min(data.methods, 4))) add(map);
  lead = views[0];
  arrange();
})();
