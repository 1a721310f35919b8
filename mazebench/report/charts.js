"use strict";
// Charts and tables of the report: draws the values of figures/figure.py. All text from results goes through textContent.

const data = JSON.parse(document.getElementById("data").textContent);
const chosen = { metric: "success_rate", hidden: new Set() };
const PIXELS = 1.8; // of a pt: on the page, all is drawn larger than on paper

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

function mark({ marker, isFilled, color, size }, x, y) {
  const scale = PIXELS * size;
  const ink = { fill: isFilled ? color : "none", stroke: isFilled ? "none" : color, "stroke-width": 1.6, "vector-effect": "non-scaling-stroke" };
  return shape("path", { d: marker, transform: `translate(${x} ${y}) scale(${scale})`, ...ink });
}

function polyline({ color, dashes, width }, points) {
  const dash = dashes.map((length) => (PIXELS * width * length).toFixed(1)).join(" ") || "none";
  return shape("polyline", { points, fill: "none", stroke: color, "stroke-width": (PIXELS * width).toFixed(2), "stroke-dasharray": dash });
}

// A piece of an agent's line, for keys.
function sample(label) {
  const look = data.looks[label];
  return shape("svg", { class: "sample", viewBox: "0 0 30 14", "aria-hidden": "true" }, polyline(look, "0,7 30,7"), mark(look, 15, 7));
}

// The table of a metric from its texts, line by line; a value and its interval may stand in two lines.
function tableElement({ title, lines }) {
  const [head, ...body] = lines[chosen.metric] || [[]];
  const text = (value) => element("td", { class: "value" }, value.replace(/, (?=[\d.]+\])/, ",\u00a0"));
  const rowOf = ([name, ...cells]) => element("tr", {}, element("th", { scope: "row" }, ...breakable(name)), ...cells.map(text));
  const names = head.map((name) => element("th", { scope: "col" }, ...breakable(name)));
  const caption = element("caption", { class: "hidden" }, `${title}: ${data.metrics[chosen.metric]}`);
  return element("div", { class: "scroll" }, element("table", {}, caption, element("thead", {}, element("tr", {}, ...names)), element("tbody", {}, ...body.map(rowOf))));
}

// The axes of a panel, and where values of x and y lie on them.
function frame(panel, width, height) {
  const box = { left: 40, right: width - 12, top: 10, bottom: height - 40 };
  const svg = shape("svg", { viewBox: `0 0 ${width} ${height}`, height });
  const along = (value, [low, high], from, to) => from + ((value - low) / (high - low)) * (to - from);
  const across = (x) => along(x, panel.x_range, box.left, box.right);
  const up = (y) => along(y, panel.y_range, box.bottom, box.top);
  for (const y of panel.y_ticks) {
    svg.append(shape("line", { class: "axis", x1: box.left, x2: box.right, y1: up(y), y2: up(y) }));
    svg.append(shape("text", { x: box.left - 6, y: up(y) + 4, "text-anchor": "end" }, y.toFixed(1)));
  }
  const every = Math.ceil((26 * panel.ticks.length) / (box.right - box.left));
  panel.ticks.forEach(([x, text], index) => {
    if (index % every === 0) svg.append(shape("text", { x: across(x), y: box.bottom + 16, "text-anchor": "middle" }, text));
  });
  svg.append(shape("text", { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }, panel.x_name));
  return { svg, across, up, box };
}

function drawSeries({ svg, across, up }, series) {
  const look = data.looks[series.label];
  const corners = (points) => points.map(([x, y]) => `${across(x).toFixed(1)},${up(y).toFixed(1)}`).join(" ");
  for (const area of series.areas) {
    const outline = series.outline ? look.color : "none";
    svg.append(shape("polygon", { points: corners(area), fill: look.color, "fill-opacity": series.opacity, stroke: outline, "stroke-width": PIXELS * series.outline }));
  }
  if (series.has_line && series.points.length) svg.append(polyline(look, corners(series.points)));
  for (const [x, value, low, high, , , isStarred] of series.points) {
    if (series.has_bars && low !== null) {
      svg.append(shape("line", { x1: across(x), x2: across(x), y1: up(low), y2: up(high), stroke: look.color, "stroke-width": 1.5 }));
    }
    svg.append(mark(look, across(x), up(value)));
    if (isStarred) svg.append(shape("text", { x: across(x) + 6, y: up(value) + 2 }, "*"));
  }
}

// Draws a panel without the agents that are switched off.
function drawPanel(host, panel, height, name) {
  const view = frame(panel, Math.max(host.clientWidth, 220), height);
  const shown = panel.series.filter(({ label }) => !chosen.hidden.has(label));
  for (const series of shown) drawSeries(view, series);
  view.svg.setAttribute("role", "img");
  view.svg.setAttribute("tabindex", "0");
  view.svg.setAttribute("aria-label", `${name} by ${panel.x_name}. Use the arrow keys to read it.`);
  host.replaceChildren(view.svg);
  addReader(host, view, panel, shown);
}

// A cursor over the ticks, moved by pointer and arrow keys, with the values of all series at its tick.
function addReader(host, { svg, across, box }, { ticks, x_name: name }, series) {
  const tip = element("div", { class: "tip", "aria-live": "polite", hidden: "" });
  const cursor = shape("line", { class: "cursor", y1: box.top, y2: box.bottom, visibility: "hidden" });
  svg.append(cursor);
  host.append(tip);
  let place = -1;
  const show = (index) => {
    place = Math.max(0, Math.min(ticks.length - 1, index));
    const [position, text] = ticks[place];
    const x = across(position);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    cursor.setAttribute("visibility", "visible");
    tip.replaceChildren(element("strong", {}, `${name} ${text}`));
    for (const { label, points } of series) {
      const point = points.find(([, , , , , tick]) => tick === place);
      if (point) tip.append(element("div", {}, sample(label), element("span", {}, ...breakable(`${label}: `), point[4])));
    }
    tip.hidden = false;
    tip.style.top = `${host.offsetTop - 30}px`;
    const isLeft = x < host.clientWidth / 2;
    tip.style.left = isLeft ? `${host.offsetLeft + x + 12}px` : "auto";
    tip.style.right = isLeft ? "auto" : `${host.offsetParent.clientWidth - host.offsetLeft - x + 12}px`;
  };
  const hide = () => {
    tip.hidden = true;
    cursor.setAttribute("visibility", "hidden");
    place = -1;
  };
  svg.addEventListener("pointermove", (event) => {
    const at = event.clientX - svg.getBoundingClientRect().left;
    const gaps = ticks.map(([x]) => Math.abs(across(x) - at));
    show(gaps.indexOf(Math.min(...gaps)));
  });
  svg.addEventListener("pointerleave", hide);
  svg.addEventListener("blur", hide);
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (event.key === "Escape") hide();
    if (!step) return;
    event.preventDefault();
    show(place < 0 && step < 0 ? ticks.length - 1 : place + step);
  });
}

// A table with its figure, of which the panel of the chosen metric is shown.
function chartFigure(chart) {
  const host = element("div");
  const details = element("details", {}, element("summary", {}, "The values as a table"), element("div"));
  const figure = element("section", { class: "chart" }, element("h3", {}, chart.title), host);
  if (chart.note) figure.append(element("p", { class: "note" }, chart.note));
  if (!chart.panels.length) {
    figure.classList.add("wide");
    details.open = true;
  }
  figure.append(details);
  figure.redraw = () => {
    const panel = chart.panels.find(({ metric }) => metric === chosen.metric);
    host.replaceChildren();
    if (panel && host.clientWidth) drawPanel(host, panel, 270, `${chart.title}: ${data.metrics[chosen.metric]}`);
    details.lastElementChild.replaceChildren(tableElement(chart));
  };
  return figure;
}

function violinFigure({ title, note, panels }) {
  const grid = element("div", { class: "panels" });
  const words = `${note} The width shows the share of episodes; dot and line are the mean and its 95 % interval.`.trim();
  const figure = element("section", { class: "chart wide" }, element("h3", {}, title), grid, element("p", { class: "note" }, words));
  figure.redraw = () => {
    grid.replaceChildren();
    for (const panel of panels.filter(({ agent }) => !chosen.hidden.has(agent))) {
      const host = element("div");
      grid.append(element("div", {}, element("h4", {}, ...breakable(panel.agent)), host));
      drawPanel(host, panel, 190, `${title}, ${panel.agent}: ${panel.y_name}`);
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
  for (const label of [...data.labels, ...data.printed]) {
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
  const hasPanels = ({ panels }) => panels.length > 0;
  const figures = [
    ...data.charts.filter(hasPanels).map(chartFigure),
    ...data.violins.map(violinFigure),
    ...data.charts.filter((chart) => !hasPanels(chart)).map(chartFigure),
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
