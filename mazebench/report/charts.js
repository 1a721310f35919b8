"use strict";
// Charts and tables of the report. All text from results goes through textContent.

const data = JSON.parse(document.getElementById("data").textContent);
const chosen = { metric: "success_rate", hidden: new Set() };
const PAPER_DASH = "2 4";
const MARKERS = ["circle", "square", "triangle", "diamond"];

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function shape(tag, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

// The paper's agents have the colours of our agents with the same names.
function colorOf(label) {
  const name = label.endsWith(" (paper)") ? label.slice(0, -" (paper)".length).toLowerCase() : label;
  const place = data.labels.indexOf(name);
  return place < 0 ? "var(--printed)" : `var(--series-${place % 7})`;
}

function swatch(label) {
  const node = element("span", { class: "swatch", "aria-hidden": "true" });
  const isPaper = data.labels.indexOf(label) < 0;
  node.style.background = isPaper ? "transparent" : colorOf(label);
  if (isPaper) node.style.border = `2px dotted ${colorOf(label)}`;
  return node;
}

function formatCell(cell) {
  if (!cell) return "";
  const [value, low, high, , runs, untrainedScale] = cell;
  const interval = low === null ? "" : ` [${low.toFixed(2)}, ${high.toFixed(2)}]`;
  return value.toFixed(2) + (untrainedScale ? "*" : "") + interval + (runs ? `, ${runs} runs` : "");
}

// Columns that have a value of the chosen metric and are not switched off.
function visibleColumns(table) {
  return table.columns.filter((column) => !chosen.hidden.has(column.label) && hasValues(column));
}

function hasValues(column) {
  return (column.cells[chosen.metric] || []).some(Boolean);
}

function tableElement(table) {
  const columns = table.columns.filter((column) => hasValues(column));
  const head = element("tr", {}, element("th", { scope: "col" }, table.rowName));
  for (const column of columns) head.append(element("th", { scope: "col" }, column.label));
  const body = element("tbody");
  table.rows.forEach((row, index) => {
    const line = element("tr", {}, element("th", { scope: "row" }, row));
    for (const column of columns) line.append(element("td", { class: "number" }, formatCell(column.cells[chosen.metric][index])));
    body.append(line);
  });
  const caption = element("caption", { class: "hidden" }, `${table.title}: ${data.metrics[chosen.metric]}`);
  return element("div", { class: "scroll" }, element("table", {}, caption, element("thead", {}, head), body));
}

// A frame with an axis from 0 to 1 upwards, and `ticks` ([position on the axis, text]) along the bottom.
function frame(width, height, low, high, ticks, name) {
  const box = { left: 40, right: width - 12, top: 10, bottom: height - 40 };
  const svg = shape("svg", { viewBox: `0 0 ${width} ${height}`, height });
  const across = (x) => box.left + ((x - low) / (high - low || 1)) * (box.right - box.left);
  const up = (y) => box.bottom - y * (box.bottom - box.top);
  for (const y of [0, 0.25, 0.5, 0.75, 1]) {
    svg.append(shape("line", { class: "axis", x1: box.left, x2: box.right, y1: up(y), y2: up(y) }));
    svg.append(shape("text", { x: box.left - 6, y: up(y) + 4, "text-anchor": "end" }, y.toFixed(2)));
  }
  const room = (box.right - box.left) / Math.max(ticks.length, 1);
  const every = Math.ceil(26 / room);
  ticks.forEach(([x, text], index) => {
    if (index % every === 0) svg.append(shape("text", { x: across(x), y: box.bottom + 16, "text-anchor": "middle" }, text));
  });
  svg.append(shape("text", { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }, name));
  return { svg, across, up, box };
}

function marker(kind, x, y, color, half = 3.5) {
  const paths = {
    square: `M${x - half} ${y - half}h${2 * half}v${2 * half}h${-2 * half}z`,
    triangle: `M${x} ${y - half - 1}l${half + 1} ${2 * half}h${-2 * half - 2}z`,
    diamond: `M${x} ${y - half - 1}l${half + 1} ${half + 1}l${-half - 1} ${half + 1}l${-half - 1} ${-half - 1}z`,
    cross: `M${x - half} ${y - half}l${2 * half} ${2 * half}m0 ${-2 * half}l${-2 * half} ${2 * half}`,
  };
  if (kind === "circle") return shape("circle", { cx: x, cy: y, r: half, fill: color });
  if (kind === "cross") return shape("path", { d: paths.cross, stroke: color, "stroke-width": 1.6, fill: "none" });
  return shape("path", { d: paths[kind], fill: color });
}

// The points of a column on a chart, as [x, value, low, high].
function pointsOf(table, column, shift) {
  return table.x.flatMap((x, index) => {
    const cell = column.cells[chosen.metric][index];
    return cell ? [[x + shift, ...cell]] : [];
  });
}

function drawColumn({ svg, across, up }, column, points, isCurve) {
  const color = colorOf(column.label);
  const line = points.map(([x, value]) => `${across(x).toFixed(1)},${up(value).toFixed(1)}`).join(" ");
  const hasIntervals = points.every((point) => point[2] !== null);
  if (hasIntervals && isCurve) {
    const edge = [...points.map((p) => [p[0], p[3]]), ...points.map((p) => [p[0], p[2]]).reverse()];
    const corners = edge.map(([x, y]) => `${across(x).toFixed(1)},${up(y).toFixed(1)}`).join(" ");
    svg.append(shape("polygon", { points: corners, fill: color, opacity: 0.16 }));
  }
  const rank = data.labels.indexOf(column.label) % 7;
  const dash = column.paper ? { "stroke-dasharray": PAPER_DASH } : {};
  // The later an agent is drawn, the finer its line: where two agree, both are seen.
  const width = column.paper ? 1.2 : 2.8 - 0.25 * rank;
  svg.append(shape("polyline", { points: line, fill: "none", stroke: color, "stroke-width": width, ...dash }));
  const kind = column.paper ? "cross" : MARKERS[rank % MARKERS.length];
  for (const [x, value, low, high, , , untrainedScale] of points) {
    if (hasIntervals && !isCurve) {
      svg.append(shape("line", { x1: across(x), x2: across(x), y1: up(low), y2: up(high), stroke: color, "stroke-width": 1.5 }));
    }
    svg.append(marker(kind, across(x), up(value), color, column.paper ? 3.5 : 4.6 - 0.3 * rank));
    if (untrainedScale) svg.append(shape("text", { x: across(x) + 6, y: up(value) + 2 }, "*"));
  }
}

function drawChart(host, table) {
  const isCurve = table.rowName === "distance";
  const step = table.x.length > 1 ? Math.min(...table.x.slice(1).map((x, index) => x - table.x[index])) : 1;
  const margin = isCurve ? 0.3 : 0.4 * step;
  const low = table.x[0] - margin;
  const high = table.x[table.x.length - 1] + margin;
  const ticks = table.x.map((x, index) => [x, table.rows[index]]);
  const view = frame(Math.max(host.clientWidth, 260), 270, low, high, ticks, table.rowName);
  const columns = visibleColumns(table);
  const ours = columns.filter((column) => !column.paper);
  for (const column of columns) {
    const shift = isCurve || column.paper ? 0 : (ours.indexOf(column) - (ours.length - 1) / 2) * 0.12 * step;
    drawColumn(view, column, pointsOf(table, column, shift), isCurve);
  }
  const metric = data.metrics[chosen.metric];
  view.svg.setAttribute("role", "img");
  view.svg.setAttribute("tabindex", "0");
  view.svg.setAttribute("aria-label", `${table.title}: ${metric} by ${table.rowName}. Use the arrow keys to read it; the table below has all values.`);
  host.replaceChildren(view.svg);
  addReader(host, view, table, columns);
}

// A cursor over the rows, moved by pointer and arrow keys, with the values of all agents at its row.
function addReader(host, { svg, across, box }, table, columns) {
  const tip = element("div", { class: "tip", "aria-live": "polite", hidden: "" });
  const cursor = shape("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  svg.append(cursor);
  host.append(tip);
  let place = -1;
  const show = (index) => {
    place = Math.max(0, Math.min(table.x.length - 1, index));
    const x = across(table.x[place]);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    cursor.setAttribute("visibility", "visible");
    tip.replaceChildren(element("strong", {}, `${table.rowName} ${table.rows[place]}`));
    for (const column of columns) {
      const cell = column.cells[chosen.metric][place];
      if (cell) tip.append(element("div", {}, swatch(column.label), `${column.label}: ${formatCell(cell)}`));
    }
    tip.hidden = false;
    tip.style.top = "8px";
    const isLeft = x < host.clientWidth / 2;
    tip.style.left = isLeft ? `${host.offsetLeft + x + 12}px` : "auto";
    tip.style.right = isLeft ? "auto" : `${host.clientWidth - x + 24}px`;
  };
  const hide = () => {
    tip.hidden = true;
    cursor.setAttribute("visibility", "hidden");
    place = -1;
  };
  svg.addEventListener("pointermove", (event) => {
    const at = event.clientX - svg.getBoundingClientRect().left;
    const gaps = table.x.map((x) => Math.abs(across(x) - at));
    show(gaps.indexOf(Math.min(...gaps)));
  });
  svg.addEventListener("pointerleave", hide);
  svg.addEventListener("blur", hide);
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (event.key === "Escape") hide();
    if (!step) return;
    event.preventDefault();
    show(place < 0 && step < 0 ? table.x.length - 1 : place + step);
  });
}

// A closed outline around each stretch of SPL in which there are episodes.
function violinOutline(density, x, half, up) {
  const height = (place) => up(place / (density.length - 1)).toFixed(1);
  let outline = "";
  for (let first = 0; first < density.length; first++) {
    if (!density[first]) continue;
    let end = first;
    while (end < density.length && density[end]) end++;
    const places = Array.from({ length: end - first }, (_, index) => first + index);
    const side = (sign) => (place) => `${(x + sign * half * (density[place] / 100)).toFixed(1)} ${height(place)}`;
    outline += `M${[...places.map(side(1)), ...places.reverse().map(side(-1))].join("L")}Z`;
    first = end;
  }
  return outline;
}

function drawViolins(host, distribution, panel) {
  const count = distribution.levels.length;
  const ticks = distribution.levels.map((level, index) => [index, String(level)]);
  const view = frame(Math.max(host.clientWidth, 220), 190, -0.6, count - 0.4, ticks, distribution.levelName);
  const color = colorOf(panel.label);
  const half = 0.42 * (view.across(1) - view.across(0));
  panel.violins.forEach((violin, index) => {
    if (!violin) return;
    const x = view.across(index);
    const [value, low, high] = violin.mean;
    const words = `${distribution.levelName} ${distribution.levels[index]}: mean SPL ${formatCell(violin.mean)}`;
    const outline = violinOutline(violin.density, x, half, view.up);
    view.svg.append(
      shape("path", { d: outline, fill: color, "fill-opacity": 0.35, stroke: color }, shape("title", {}, words)),
      shape("line", { x1: x, x2: x, y1: view.up(low), y2: view.up(high), stroke: "var(--ink)", "stroke-width": 2 }),
      shape("circle", { cx: x, cy: view.up(value), r: 3, fill: "var(--ink)" }),
    );
  });
  view.svg.setAttribute("role", "img");
  const means = panel.violins.map((violin, index) => (violin ? `${distribution.levels[index]}: ${violin.mean[0].toFixed(2)}` : ""));
  view.svg.setAttribute("aria-label", `${distribution.title}, ${panel.label}; mean SPL by ${distribution.levelName}: ${means.filter(Boolean).join(", ")}`);
  host.replaceChildren(view.svg);
}

function chartFigure(table) {
  const host = element("div");
  const details = element("details", {}, element("summary", {}, "The values as a table"), element("div"));
  const figure = element("section", { class: "chart" }, element("h3", {}, table.title), host);
  if (table.note) figure.append(element("p", { class: "note" }, table.note));
  if (table.x.length === 0) {
    figure.classList.add("wide");
    details.open = true;
  }
  figure.append(details);
  figure.redraw = () => {
    if (table.x.length && host.clientWidth) drawChart(host, table);
    details.lastElementChild.replaceChildren(tableElement(table));
  };
  return figure;
}

function violinFigure(distribution) {
  const panels = element("div", { class: "panels" });
  const note = `${distribution.note} The width shows the share of episodes; dot and line are the mean and its 95 % interval.`.trim();
  const figure = element("section", { class: "chart wide" }, element("h3", {}, distribution.title), panels, element("p", { class: "note" }, note));
  figure.redraw = () => {
    panels.replaceChildren();
    for (const panel of distribution.panels.filter(({ label }) => !chosen.hidden.has(label))) {
      const host = element("div");
      panels.append(element("div", {}, element("h4", {}, swatch(panel.label), ` ${panel.label}`), host));
      drawViolins(host, distribution, panel);
    }
  };
  return figure;
}

function buildToolbar(redraw) {
  for (const [metric, name] of Object.entries(data.metrics)) {
    const input = element("input", { type: "radio", name: "metric", value: metric });
    input.checked = metric === chosen.metric;
    input.addEventListener("change", () => {
      chosen.metric = metric;
      redraw();
    });
    document.getElementById("metrics").append(element("label", {}, input, name));
  }
  const printed = data.tables.flatMap(({ columns }) => columns.filter(({ paper }) => paper).map(({ label }) => label));
  for (const label of [...data.labels, ...new Set(printed)]) {
    const input = element("input", { type: "checkbox" });
    input.checked = true;
    input.addEventListener("change", () => {
      if (input.checked) chosen.hidden.delete(label);
      else chosen.hidden.add(label);
      redraw();
    });
    document.getElementById("agents").append(element("label", {}, input, swatch(label), label));
  }
}

function buildCharts() {
  const host = document.getElementById("charts");
  const isOverview = ({ x }) => x.length === 0;
  const figures = [
    ...data.tables.filter((table) => !isOverview(table)).map(chartFigure),
    ...data.violins.map(violinFigure),
    ...data.tables.filter(isOverview).map(chartFigure),
  ];
  host.append(...figures);
  const redraw = () => figures.forEach((figure) => figure.redraw());
  buildToolbar(redraw);
  redraw();
  let width = host.clientWidth;
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    redraw();
  }).observe(host);
}

function buildHead() {
  const count = data.results.reduce((sum, result) => sum + result.episodes, 0);
  document.getElementById("subtitle").textContent =
    `Benchmark ${data.benchmark}; ${data.labels.join(", ")}; ${count.toLocaleString("en")} episodes in ${data.results.length} results.`;
  document.getElementById("source").textContent = `The paper: ${data.citation}. ${data.paperNote}`;
  if (data.warnings.length) {
    const warnings = document.getElementById("warnings");
    warnings.hidden = false;
    warnings.querySelector("summary").textContent = `Notes on the results (${data.warnings.length})`;
    warnings.querySelector("ul").append(...data.warnings.map((warning) => element("li", {}, warning)));
  }
}

function buildProvenance() {
  const [head, ...rows] = data.provenance;
  const table = document.getElementById("provenance");
  table.tHead.append(element("tr", {}, ...head.map((name) => element("th", { scope: "col" }, name))));
  for (const texts of rows) table.tBodies[0].append(element("tr", {}, ...texts.map((text) => element("td", {}, text))));
}

buildHead();
buildCharts();
buildProvenance();
