"use strict";
// The episode explorer. A result's episodes and paths are packed and unpacked only when picked.

const POSITION_UNITS = 32; // a metre
const YAW_UNITS = 256; // a turn
const STEP_SECONDS = 0.16;
const MAX_LISTED = 2000;
const PLASMA = [[13, 8, 135], [126, 3, 168], [204, 71, 120], [248, 149, 64], [240, 220, 50]];

const byId = (id) => document.getElementById(id);
const inCells = (count) => `${count} ${count === 1 ? "cell" : "cells"}`;
const trials = new Map(); // promises by number
const drives = new Map();
const view = { result: -1, episode: -1, time: 0, timer: 0, packed: null };

function bytesOfBase64(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let index = 0; index < bytes.length; index++) bytes[index] = characters.charCodeAt(index);
  return bytes;
}

// Columns of numbers, and the bytes behind them.
async function inflate(id) {
  const bytes = bytesOfBase64(byId(id).textContent);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const content = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(content.buffer).getUint32(0, true);
  return [JSON.parse(new TextDecoder().decode(content.subarray(4, 4 + length))), content.subarray(4 + length)];
}

function once(known, key, make) {
  if (!known.has(key)) known.set(key, make());
  return known.get(key);
}

// The episodes of a result in columns, and its poses. What all agents share, the trials, is packed once for all.
function unpack(number) {
  return once(drives, number, async () => {
    const result = data.results[number];
    const [trial, maps] = await once(trials, result.trials, () => inflate(`trials-${result.trials}`));
    const [drive, bytes] = await inflate(`drives-${number}`);
    const columns = { ...trial, ...drive };
    columns.spl = columns.success.map((_, index) => splOf(columns, index, columns.shortest[index]));
    columns.splGrid = columns.success.map((_, index) => splOf(columns, index, columns.distance[index]));
    return { columns, maps, ...unpackPoses(bytes, result.poses) };
  });
}

function splOf(columns, index, shortest) {
  if (!columns.success[index]) return 0;
  return shortest > 0 ? shortest / Math.max(shortest, columns.driven[index]) : 1;
}

// Poses are differences from one to the next: a byte plane each of low and high bytes of x and y (zigzag), then yaw.
function unpackPoses(bytes, poses) {
  const x = new Int32Array(poses);
  const y = new Int32Array(poses);
  const yaw = new Uint8Array(poses);
  const difference = (plane, index) => {
    const value = bytes[plane * poses + index] | (bytes[(plane + 1) * poses + index] << 8);
    return (value >>> 1) ^ -(value & 1);
  };
  for (let index = 0, dx = 0, dy = 0, turn = 0; index < poses; index++) {
    x[index] = dx += difference(0, index);
    y[index] = dy += difference(2, index);
    yaw[index] = turn += bytes[4 * poses + index];
  }
  return { x, y, yaw };
}

function wallsOf(bytes, size) {
  return Array.from({ length: size * size }, (_, cell) => (bytes[cell >> 3] >> (7 - (cell & 7))) & 1);
}

function sumBefore(counts, index) {
  let sum = 0;
  for (let other = 0; other < index; other++) sum += counts[other];
  return sum;
}

// Everything about one episode, by names.
function episodeOf(packed, number, index) {
  const result = data.results[number];
  const { columns } = packed;
  const maze = data.mazes[result.mazes[columns.maze[index]]];
  const first = columns.steps.slice(0, index).reduce((sum, steps) => sum + steps + 1, 0);
  const poses = result.poses ? columns.steps[index] + 1 : 0;
  const firstLandmark = sumBefore(columns.landmarkCounts, index);
  const ownMap = packed.maps.length > 0;
  const mapBytes = Math.ceil((result.size * result.size) / 8);
  const map = packed.maps.subarray(index * mapBytes, (index + 1) * mapBytes);
  const real = maze.walls ? wallsOf(bytesOfBase64(maze.walls), result.size) : null;
  return {
    size: result.size,
    maze: maze.name,
    real,
    shown: ownMap ? wallsOf(map, result.size) : result.perturbed ? null : real,
    start: columns.start[index],
    goal: columns.goal[index],
    shownStart: columns.shownStart ? columns.shownStart[index] : columns.start[index],
    shownGoal: columns.shownGoal ? columns.shownGoal[index] : columns.goal[index],
    isWarped: Boolean(columns.shownStart),
    landmarks: columns.landmarks.slice(firstLandmark, firstLandmark + (columns.landmarkCounts[index] || 0)),
    x: packed.x.subarray(first, first + poses),
    y: packed.y.subarray(first, first + poses),
    yaw: packed.yaw.subarray(first, first + poses),
    distance: columns.distance[index],
    success: Boolean(columns.success[index]),
    steps: columns.steps[index],
    driven: columns.driven[index],
    shortest: columns.shortest[index],
    spl: columns.spl[index],
    splGrid: columns.splGrid[index],
    seed: columns.seed[index],
  };
}

// --- choosing an episode ---

function fill(select, options, value) {
  select.replaceChildren(...options.map(([key, text]) => new Option(text, key)));
  const keys = options.map(([key]) => String(key));
  select.value = keys.includes(String(value)) ? String(value) : keys[0];
}

function resultsOf(setting) {
  return data.results.flatMap((result, number) => (result.setting === setting ? [number] : []));
}

function chooseResult(number) {
  const { setting } = data.results[number];
  byId("setting").value = String(setting);
  fill(byId("agent"), resultsOf(setting).map((other) => [other, data.results[other].label]), number);
}

async function openResult(number, episode = null) {
  stop();
  view.result = number;
  const packed = await unpack(number);
  if (view.result !== number) return;
  view.packed = packed;
  const { columns } = packed;
  const result = data.results[number];
  fill(byId("maze"), [["", "all"], ...result.mazes.map((maze, index) => [index, data.mazes[maze].name])], byId("maze").value);
  const distances = [...new Set(columns.distance)].sort((a, b) => a - b);
  fill(byId("distance"), [["", "all"], ...distances.map((distance) => [distance, inCells(distance)])], byId("distance").value);
  if (episode !== null && !listed().includes(episode)) {
    for (const id of ["maze", "distance"]) byId(id).value = "";
    byId("failures").checked = false;
  }
  listEpisodes(episode);
}

function listed() {
  const { columns } = view.packed;
  const maze = byId("maze").value;
  const distance = byId("distance").value;
  const failures = byId("failures").checked;
  return columns.success.flatMap((success, index) => {
    const fits = (maze === "" || columns.maze[index] === Number(maze)) && (distance === "" || columns.distance[index] === Number(distance));
    return fits && !(failures && success) ? [index] : [];
  });
}

function listEpisodes(episode) {
  const found = listed();
  const { columns } = view.packed;
  const result = data.results[view.result];
  const text = (index) =>
    `${columns.success[index] ? "✓" : "✗"} ${index} · ${data.mazes[result.mazes[columns.maze[index]]].name} · ${inCells(columns.distance[index])} · ${columns.steps[index]} steps`;
  const shown = found.slice(0, MAX_LISTED);
  const total = columns.success.length;
  const more = found.length > shown.length ? `, the first ${shown.length} listed` : "";
  byId("count").textContent = `${found.length} of ${total} episodes${more}`;
  const wanted = episode === null ? view.episode : episode;
  fill(byId("episodes"), shown.map((index) => [index, text(index)]), shown.includes(wanted) ? wanted : shown[0]);
  if (shown.length) openEpisode(Number(byId("episodes").value));
  else showNothing("No episode fits the filters.");
}

function showNothing(text) {
  stop();
  view.episode = -1;
  byId("outcome").textContent = text;
  byId("clock").value = "";
  byId("time").disabled = byId("play").disabled = true;
  for (const id of ["numbers", "others"]) byId(id).hidden = true;
  for (const id of ["shown", "driven"]) byId(id).hidden = true;
  byId("key").replaceChildren();
}

function openEpisode(index) {
  stop();
  view.episode = index;
  view.current = episodeOf(view.packed, view.result, index);
  const { current } = view;
  const poses = current.x.length;
  byId("time").max = String(Math.max(poses - 1, 0));
  byId("time").disabled = byId("play").disabled = poses < 2;
  for (const id of ["numbers", "others", "shown", "driven"]) byId(id).hidden = false;
  writeOutcome();
  writeNumbers();
  writeKey();
  writeOthers();
  moveTo(Math.max(poses - 1, 0));
  const options = byId("episodes").options;
  byId("previous").disabled = byId("episodes").selectedIndex <= 0;
  byId("next").disabled = byId("episodes").selectedIndex >= options.length - 1;
  remember();
}

function remember() {
  history.replaceState(null, "", `#episode=${view.result}-${view.episode}`);
}

// --- words and numbers ---

function writeOutcome() {
  const { current } = view;
  const verdict = element("strong", { class: current.success ? "reached" : "failed" }, current.success ? "reached the goal" : "did not reach the goal");
  byId("outcome").replaceChildren(`${data.results[view.result].label} `, verdict, ` in maze ${current.maze}, ${current.steps} steps, ${current.driven.toFixed(2)} m driven.`);
}

function writeNumbers() {
  const { current } = view;
  const cell = (index) => `row ${Math.floor(index / current.size)}, column ${index % current.size}`;
  const rows = [
    ["episode", String(view.episode)],
    ["from", cell(current.start)],
    ["to", cell(current.goal)],
    ["distance", inCells(current.distance)],
    ["shortest path", `${current.shortest.toFixed(2)} m`],
    ["driven", `${current.driven.toFixed(2)} m`],
    ["time", `${current.steps} steps, ${(current.steps * STEP_SECONDS).toFixed(1)} s`],
    ["SPL", current.spl.toFixed(2)],
    ["SPL by grid distance", current.splGrid.toFixed(2)],
    ["seed", String(current.seed)],
  ];
  byId("numbers").tBodies[0].replaceChildren(
    ...rows.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", { class: "number" }, value))),
  );
}

function keyOf(columns, index, mazes) {
  return [data.mazes[mazes[columns.maze[index]]].name, columns.start[index], columns.goal[index], columns.seed[index]].join(" ");
}

async function writeOthers() {
  const { result, episode } = view;
  const rows = [];
  const wanted = keyOf(view.packed.columns, episode, data.results[result].mazes);
  for (const number of resultsOf(data.results[result].setting)) {
    const { columns } = await unpack(number);
    if (view.result !== result || view.episode !== episode) return;
    const isSame = data.results[number].trials === data.results[result].trials;
    const index = isSame ? episode : columns.success.findIndex((_, other) => keyOf(columns, other, data.results[number].mazes) === wanted);
    if (index >= 0) rows.push(otherRow(number, index, columns));
  }
  const names = ["agent", "outcome", "steps", "SPL"].map((name) => element("th", { scope: "col" }, name));
  byId("others").tHead.replaceChildren(element("tr", {}, ...names));
  byId("others").tBodies[0].replaceChildren(...rows);
}

function otherRow(number, index, columns) {
  const button = element("button", { type: "button", class: "link" }, data.results[number].label);
  if (number === view.result) button.setAttribute("aria-current", "true");
  button.addEventListener("click", () => {
    chooseResult(number);
    openResult(number, index);
  });
  const texts = [columns.success[index] ? "✓ reached" : "✗ failed", String(columns.steps[index]), columns.spl[index].toFixed(2)];
  return element("tr", {}, element("td", {}, button), ...texts.map((text) => element("td", { class: "number" }, text)));
}

function writeKey() {
  const { current } = view;
  const entries = [["--start", "start"], ["--goal", "goal"]];
  if (current.landmarks.length) entries.push(["--landmark", "landmarks"]);
  if (differs(current)) entries.push(["--false-wall", "wall on the map only"], ["--lost-wall", "wall missing on the map"]);
  const items = entries.map(([color, text]) => {
    const mark = element("span", { class: "swatch", "aria-hidden": "true" });
    mark.style.background = `var(${color})`;
    return element("li", {}, mark, text);
  });
  byId("key").replaceChildren(...items, element("li", {}, "Path: from violet (start) to yellow (end)"));
}

function differs(current) {
  return !current.isWarped && current.shown && current.real && current.shown.some((wall, cell) => wall !== current.real[cell]);
}

// --- drawing ---

function colors() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

// On a dark floor the ramp begins brighter.
function plasma(share) {
  const darkest = matchMedia("(prefers-color-scheme: dark)").matches ? 0.3 : 0;
  const at = Math.min(darkest + (1 - darkest) * share, 0.9999) * (PLASMA.length - 1);
  const [low, high] = [PLASMA[Math.floor(at)], PLASMA[Math.floor(at) + 1]];
  return `rgb(${low.map((value, index) => Math.round(value + (at % 1) * (high[index] - value))).join(",")})`;
}

function prepare(canvas, size) {
  const cellPixels = Math.max(1, Math.round((canvas.clientWidth * (window.devicePixelRatio || 1)) / size));
  const side = cellPixels * size; // whole pixels, so that no seams show between cells
  if (canvas.width !== side) canvas.width = canvas.height = side;
  const pen = canvas.getContext("2d");
  pen.setTransform(side / size, 0, 0, side / size, 0, 0);
  return pen;
}

function fillCell(pen, cell, size, color) {
  pen.fillStyle = color;
  pen.fillRect(cell % size, Math.floor(cell / size), 1, 1);
}

function drawMap(pen, walls, other, current, color, ends) {
  const { size } = current;
  for (let cell = 0; cell < size * size; cell++) {
    const isWall = walls ? walls[cell] : 0;
    const differing = other && walls && other[cell] !== isWall;
    fillCell(pen, cell, size, differing ? color(isWall ? "false-wall" : "lost-wall") : color(isWall ? "wall" : "floor"));
  }
  if (!current.isWarped || walls === current.real) {
    for (const cell of current.landmarks) fillCell(pen, cell, size, color("landmark"));
  }
  for (const [cell, name] of ends) {
    pen.beginPath();
    pen.arc((cell % size) + 0.5, Math.floor(cell / size) + 0.5, 0.36, 0, 2 * Math.PI);
    pen.fillStyle = color(name);
    pen.fill();
  }
}

function drawPath(pen, current, color) {
  const { size, x, y, yaw } = current;
  const place = (index) => [x[index] / POSITION_UNITS, size - y[index] / POSITION_UNITS];
  pen.lineCap = "round";
  pen.lineWidth = 0.05;
  pen.strokeStyle = color("ahead");
  pen.beginPath();
  for (let index = view.time; index < x.length; index++) pen.lineTo(...place(index));
  pen.stroke();
  pen.lineWidth = 0.14;
  for (let index = 1; index <= view.time; index++) {
    pen.strokeStyle = plasma(index / Math.max(x.length - 1, 1));
    pen.beginPath();
    pen.moveTo(...place(index - 1));
    pen.lineTo(...place(index));
    pen.stroke();
  }
  drawBody(pen, ...place(view.time), (-2 * Math.PI * yaw[view.time]) / YAW_UNITS, color);
}

// A disc of the body's radius and its nose; the canvas has y down, so the angle comes negated.
function drawBody(pen, x, y, angle, color) {
  pen.beginPath();
  pen.arc(x, y, 0.15, 0, 2 * Math.PI);
  pen.fillStyle = color("body");
  pen.fill();
  pen.lineWidth = 0.08;
  pen.strokeStyle = color("body");
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + 0.36 * Math.cos(angle), y + 0.36 * Math.sin(angle));
  pen.stroke();
}

function draw() {
  const { current } = view;
  if (view.episode < 0) return;
  const color = colors();
  const shown = byId("shown");
  const driven = byId("driven");
  const known = current.real || (current.isWarped ? null : current.shown);
  drawMap(prepare(shown, current.size), current.shown, null, current, color, [[current.shownStart, "start"], [current.shownGoal, "goal"]]);
  const pen = prepare(driven, current.size);
  drawMap(pen, known, null, current, color, [[current.start, "start"], [current.goal, "goal"]]);
  if (differs(current)) markDifferences(pen, current, color);
  if (current.x.length) drawPath(pen, current, color);
  describe(shown, driven);
}

// Small squares where map and maze disagree; the map itself is drawn beside it as it was shown.
function markDifferences(pen, current, color) {
  const { size } = current;
  current.real.forEach((wall, cell) => {
    if (current.shown[cell] === wall) return;
    pen.fillStyle = color(wall ? "lost-wall" : "false-wall");
    pen.fillRect((cell % size) + 0.25, Math.floor(cell / size) + 0.25, 0.5, 0.5);
  });
}

function describe(shown, driven) {
  const { current } = view;
  byId("shown-caption").textContent = current.shown ? "The map that the agent was shown" : "The map that the agent was shown was not recorded";
  byId("driven-caption").textContent = !current.x.length
    ? "The maze; the path was not recorded (eval --record)"
    : current.real ? "The maze, and the path driven in it" : "The true maze is not in the results; the path driven, on the map";
  shown.setAttribute("aria-label", `Map of ${current.size} by ${current.size} cells as shown to the agent`);
  driven.setAttribute("aria-label", `Maze ${current.maze} with the path driven up to step ${view.time} of ${current.steps}`);
}

// --- time ---

function moveTo(time) {
  const { current } = view;
  view.time = Math.max(0, Math.min(current.x.length - 1, time));
  byId("time").value = String(view.time);
  const metres = (value) => (value / POSITION_UNITS).toFixed(2);
  const degrees = ((Math.round((360 * (current.yaw[view.time] || 0)) / YAW_UNITS) + 180) % 360) - 180;
  const text = current.x.length
    ? `step ${view.time} of ${current.steps}, ${(view.time * STEP_SECONDS).toFixed(2)} s, x ${metres(current.x[view.time])} y ${metres(current.y[view.time])} m, heading ${degrees}°`
    : "no path recorded";
  byId("clock").value = text;
  byId("time").setAttribute("aria-valuetext", text);
  draw();
}

function stop() {
  cancelAnimationFrame(view.timer);
  view.timer = 0;
  byId("play").textContent = "Play";
}

function play() {
  if (view.timer) {
    stop();
    return;
  }
  const from = view.time >= view.current.x.length - 1 ? 0 : view.time;
  const began = performance.now();
  byId("play").textContent = "Pause";
  const frame = (now) => {
    const steps = ((now - began) / 1000 / STEP_SECONDS) * Number(byId("speed").value);
    moveTo(from + Math.floor(Math.max(steps, 0)));
    if (view.time < view.current.x.length - 1) view.timer = requestAnimationFrame(frame);
    else stop();
  };
  view.timer = requestAnimationFrame(frame);
}

function step(by) {
  const list = byId("episodes");
  const place = list.selectedIndex + by;
  if (place < 0 || place >= list.options.length) return;
  list.selectedIndex = place;
  openEpisode(Number(list.value));
}

// --- the start ---

function linkedEpisode() {
  const found = /^#episode=(\d+)-(\d+)$/.exec(location.hash);
  const result = found && data.results[Number(found[1])];
  return result && Number(found[2]) < result.episodes ? [Number(found[1]), Number(found[2])] : null;
}

function listen() {
  const on = (id, event, action) => byId(id).addEventListener(event, action);
  on("setting", "change", () => {
    const numbers = resultsOf(Number(byId("setting").value));
    const sameAgent = numbers.find((number) => data.results[number].label === data.results[view.result].label);
    const number = sameAgent === undefined ? numbers[0] : sameAgent;
    for (const id of ["maze", "distance"]) byId(id).value = "";
    chooseResult(number);
    openResult(number);
  });
  on("agent", "change", () => openResult(Number(byId("agent").value)));
  for (const id of ["maze", "distance", "failures"]) on(id, "change", () => listEpisodes(null));
  on("episodes", "change", () => openEpisode(Number(byId("episodes").value)));
  on("previous", "click", () => step(-1));
  on("next", "click", () => step(1));
  on("time", "input", () => {
    stop();
    moveTo(Number(byId("time").value));
  });
  on("play", "click", play);
  new ResizeObserver(draw).observe(byId("driven"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

function startExplorer() {
  if (typeof DecompressionStream === "undefined") {
    byId("explorer").replaceChildren(byId("explorer-title"), element("p", { class: "notice" }, "This browser is too old for the episode explorer, which needs DecompressionStream (Chrome 80, Firefox 113, Safari 16.4). The charts and tables are complete."));
    return;
  }
  const linked = linkedEpisode();
  const [result, episode] = linked || [data.first, null];
  const settings = [...new Set(data.results.map(({ setting }) => setting))].sort((a, b) => a - b);
  fill(byId("setting"), settings.map((setting) => [setting, data.settings[setting]]), data.results[result].setting);
  listen();
  chooseResult(result);
  openResult(result, episode).then(() => linked && byId("explorer").scrollIntoView());
}

startExplorer();
