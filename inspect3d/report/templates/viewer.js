"use strict";
/* The 3-D map of the report, on a pane (pane.js): which map and field it shows. */
(() => {
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
  const part = {
    centre: data.centre,
    nodes: unpacked(data.nodes, Float32Array),
    triangles: unpacked(data.triangles, Uint32Array),
    edges: unpacked(data.edges, Uint32Array),
    normals: unpacked(data.normals, Int8Array),
    crease: unpacked(data.crease, Uint8Array),
  };
  for (const map of data.maps)
    for (const field of map.fields) {
      field.values = unpacked(field.values, Float32Array);
      field.shown = Uint8Array.from(field.values, (v) => (Number.isFinite(v) && !(field.classes.length && v === 0) ? 1 : 0));
      if (!field.classes.length) field.colours = unpacked(field.colours, Uint8Array);
      field.fixed = field.limits.slice();
    }
  const eye = new Eye(part.nodes);
  const pane = new Pane(root.querySelector(".stage"), part, eye, data, {
    start: data.start,
    click: (node, clicked) => clicked.pin(node, ""),
  });
  let map = data.maps[0];

  const mapChoice = root.querySelector(".map"), fieldChoice = root.querySelector(".field");
  const lowest = root.querySelector(".low"), highest = root.querySelector(".high");
  function show(field) {
    pane.show(field);
    for (const input of [lowest, highest]) input.disabled = field.classes.length > 0;
    [lowest.value, highest.value] = field.classes.length ? ["", ""] : field.limits;
  }
  function chooseMap(index) {
    map = data.maps[index];
    fieldChoice.replaceChildren(...map.fields.map((each, k) => {
      const option = made("option", "", each.title);
      option.value = k;
      return option;
    }));
    pane.setMap(map);
    show(map.fields[0]);
  }
  data.maps.forEach((each, k) => { const option = made("option", "", each.name); option.value = k; mapChoice.append(option); });
  mapChoice.parentElement.hidden = data.maps.length < 2;
  mapChoice.addEventListener("change", () => chooseMap(Number(mapChoice.value)));
  fieldChoice.addEventListener("change", () => show(map.fields[Number(fieldChoice.value)]));
  for (const input of [lowest, highest])
    input.addEventListener("change", () => {
      const asked = [Number(lowest.value), Number(highest.value)];
      if (asked[0] < asked[1]) pane.field.limits = asked;
      show(pane.field);
    });
  root.querySelector(".limits-back").addEventListener("click", () => {
    pane.field.limits = pane.field.fixed.slice();
    show(pane.field);
  });
  for (const button of root.querySelectorAll("[data-view]"))
    button.addEventListener("click", () => eye.look(button.dataset.view.split(" ").map(Number)));
  eye.look(data.start);
  chooseMap(0);
})();
