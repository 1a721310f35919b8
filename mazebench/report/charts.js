"use strict";
// Charts and tables of the report. All text from results goes through textContent.

const data = JSON.parse(document.getElementById("data").textContent);
const chosen = { metric: "success_rate", hidden: new Set() };
// The looks of agents, in the order of looks.py. Markers reach from -1 to 1.
const MARKERS = [
  "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0z", // a circle
  "M-.9-.9H.9V.9H-.9z", // a square
  "M0-1.2L1.1.9H-1.1z", // triangles and a diamond
  "M0-1.3L1 0 0 1.3-1 0z",
  "M0 1.2L1.1-.9H-1.1z",
  "M-1.2 0L.9-1.1V1.1z",
  "M1.2 0L-.9-1.1V1.1z",
  "M-.4-1.1H.4V-.4H1.1V.4H.4V1.1H-.4V.4H-1.1V-.4H-.4z", // a plus and an X
  "M-1.1-.5L-.5-1.1 0-.6 .5-1.1 1.1-.5 .6 0 1.1.5 .5 1.1 0 .6-.5 1.1-1.1.5-.6 0z",
  "M0-1.2L1.1-.4.7 1H-.7L-1.1-.4z", // a pentagon, a star and a hexagon
  "M0-1.4L.4-.5 1.3-.4.6.2.8 1.1 0 .6-.8 1.1-.6.2-1.3-.4-.4-.5z",
  "M0-1.2L1-.6V.6L0 1.2-1 .6V-.6z",
];
// Strokes, of what the paper printed.
const PAPER_MARKERS = {
  "MMN (paper)": "M-1-1L1 1M1-1L-1 1",
  "MAH (paper)": "M-1.2 0H1.2M0-1.2V1.2",
  "DQN (paper)": "M0 0V1.3M0 0L-1.1-.7M0 0L1.1-.7",
  "Random (paper)": "M0 0V-1.3M0 0L-1.1 .7M0 0L1.1 .7",
};
const DASHES = ["none", "7 3", "9 3 2 3"];
const PAPER_DASH = "2 4";
const MIN_CURVE = 4; // points of a curve with bands, as in figures/curves.py

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

// A name in which a line may end behind marks, but not in a number.
function breakable(name) {
  return name.match(/(?:[^.:_/\\-]|[.:_/\\-]\d)*[.:_/\\-]*/g).filter(Boolean).flatMap((part) => [part, element("wbr")]);
}

// How an agent, or what the paper printed of one, is drawn.
function lookOf(label) {
  const place = data.labels.indexOf(label);
  if (place < 0) {
    const color = "var(--ink)";
    return { color, dash: PAPER_DASH, marker: { d: PAPER_MARKERS[label], fill: "none", stroke: color }, width: 1.2, half: 3.5 };
  }
  const count = data.palette.length;
  const rank = place % count;
  const color = data.palette[rank];
  const dash = DASHES[Math.min(Math.floor(place / count), DASHES.length - 1)];
  const marker = { d: MARKERS[place % MARKERS.length], fill: color };
  // The later an agent is drawn, the finer its line: where two agree, both are seen.
  return { color, dash, marker, width: 2.8 - 0.25 * rank, half: 4.6 - 0.3 * rank };
}

function mark({ marker, half }, x, y) {
  return shape("path", { ...marker, transform: `translate(${x} ${y}) scale(${half})`, "stroke-width": 1.6, "vector-effect": "non-scaling-stroke" });
}

function polyline({ color, dash, width }, points) {
  return shape("polyline", { points, fill: "none", stroke: color, "stroke-width": width, "stroke-dasharray": dash });
}

// A piece of an agent's line, for keys.
function sample(label) {
  const look = lookOf(label);
  return shape("svg", { class: "sample", viewBox: "0 0 30 14", "aria-hidden": "true" }, polyline(look, "0,7 30,7"), mark(look, 15, 7));
}

function formatCell(cell) {
  if (!cell) return "";
  const [value, low, high, , runs, untrainedScale] = cell;
  const interval = low === null ? "" : ` [${low.toFixed(2)},\u00a0${high.toFixed(2)}]`;
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
  let lines = [[table.rowName, ...columns.map(({ label }) => label)]];
  table.rows.forEach((row, index) => lines.push([row, ...columns.map(({ cells }) => formatCell(cells[chosen.metric][index]))]));
  if (table.isTurned) lines = lines[0].map((_, index) => lines.map((line) => line[index]));
  const [head, ...body] = lines;
  const rowOf = ([name, ...cells]) =>
    element("tr", {}, element("th", { scope: "row" }, ...breakable(name)), ...cells.map((text) => element("td", { class: "value" }, text)));
  const names = head.map((name) => element("th", { scope: "col" }, ...breakable(name)));
  const caption = element("caption", { class: "hidden" }, `${table.title}: ${data.metrics[chosen.metric]}`);
  return element("div", { class: "scroll" }, element("table", {}, caption, element("thead", {}, element("tr", {}, ...names)), element("tbody", {}, ...body.map(rowOf))));
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

// The points of a column on a chart, as [x, value, low, high].
function pointsOf(table, column, shift) {
  return table.x.flatMap((x, index) => {
    const cell = column.cells[chosen.metric][index];
    return cell ? [[x + shift, ...cell]] : [];
  });
}

function drawColumn({ svg, across, up }, column, points, band) {
  const look = lookOf(column.label);
  const at = (x, y) => `${across(x).toFixed(1)},${up(y).toFixed(1)}`;
  const hasIntervals = points.every((point) => point[2] !== null);
  if (hasIntervals && band) {
    const edge = [...points.map(([x, , , high]) => at(x, high)), ...points.map(([x, , low]) => at(x, low)).reverse()];
    svg.append(shape("polygon", { points: edge.join(" "), fill: look.color, opacity: band }));
  }
  svg.append(polyline(look, points.map(([x, value]) => at(x, value)).join(" ")));
  for (const [x, value, low, high, , , untrainedScale] of points) {
    if (hasIntervals && !band) {
      svg.append(shape("line", { x1: across(x), x2: across(x), y1: up(low), y2: up(high), stroke: look.color, "stroke-width": 1.5 }));
    }
    svg.append(mark(look, across(x), up(value)));
    if (untrainedScale) svg.append(shape("text", { x: across(x) + 6, y: up(value) + 2 }, "*"));
  }
}

function drawChart(host, table) {
  const isCurve = table.rowName === "distance" && table.x.length >= MIN_CURVE;
  const step = table.x.length > 1 ? Math.min(...table.x.slice(1).map((x, index) => x - table.x[index])) : 1;
  const margin = isCurve ? 0.3 : 0.4 * step;
  const low = table.x[0] - margin;
  const high = table.x[table.x.length - 1] + margin;
  const ticks = table.x.map((x, index) => [x, table.rows[index]]);
  const view = frame(Math.max(host.clientWidth, 260), 270, low, high, ticks, table.rowName);
  const columns = visibleColumns(table);
  const ours = columns.filter((column) => !column.paper);
  const dodge = Math.min(0.12, 0.72 / ours.length) * step;
  const band = isCurve ? Math.min(0.16, 0.9 / ours.length) : 0;
  for (const column of columns) {
    const shift = isCurve || column.paper ? 0 : (ours.indexOf(column) - (ours.length - 1) / 2) * dodge;
    drawColumn(view, column, pointsOf(table, column, shift), band);
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
      if (cell) tip.append(element("div", {}, sample(column.label), element("span", {}, ...breakable(`${column.label}: `), formatCell(cell))));
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
  const { color } = lookOf(panel.label);
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
      panels.append(element("div", {}, element("h4", {}, ...breakable(panel.label)), host));
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
    document.getElementById("agents").append(element("label", {}, input, sample(label), element("span", {}, ...breakable(label))));
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

function counted(count, noun) {
  return `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
}

function buildHead() {
  const agents = data.labels.length > 6 ? `${data.labels.length} agents` : data.labels.join(", ");
  const count = data.results.reduce((sum, result) => sum + result.episodes, 0);
  document.getElementById("subtitle").textContent =
    `Benchmark ${data.benchmark}; ${agents}; ${counted(count, "episode")} in ${counted(data.results.length, "result")}.`;
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
  const cell = (text, index) => element("td", { "data-name": head[index] }, ...(text ? [element("span", {}, ...breakable(text))] : []));
  for (const texts of rows) table.tBodies[0].append(element("tr", {}, ...texts.map(cell)));
}

buildHead();
buildCharts();
buildProvenance();
