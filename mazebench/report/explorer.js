"use strict";
// The episode explorer. Text from results goes through textContent. A result's episodes and paths are packed and unpacked only when picked.

const MAX_LISTED = 2000;
const OF_EPISODES = ["start", "goal", "distance", "success", "onTime", "steps", "oracle", "driven", "shortest", "spl", "splGrid", "seed"];
const data = JSON.parse(document.getElementById("data").textContent);

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

const byId = (id) => document.getElementById(id);
const inUnit = (distance) => `${distance} ${data.results[view.result].unit}`.replace(/^1 cells$/, "1 cell");
const unpacked = new Map(); // promises by the number of a result
const view = { result: -1, episode: -1, time: 0, timer: 0, packed: null };

const bytesOfBase64 = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));

// A promise of the episodes of a result by columns, and of its poses.
function unpack(number) {
  if (!unpacked.has(number)) unpacked.set(number, join(number));
  return unpacked.get(number);
}

async function join(number) {
  const [trials, outcomes] = await Promise.all(data.results[number].columns.map(inflate));
  const columns = { ...trials, ...outcomes };
  const maps = bytesOfBase64(columns.maps || "");
  return { columns, maps, path: posesOf(columns.path), observed: columns.observed && posesOf(columns.observed) };
}

function inflate(number) {
  const bytes = bytesOfBase64(byId(`columns-${number}`).textContent);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
}

// All x, all y and all yaw from the change of each from the pose before.
function posesOf(changes = [[], [], []]) {
  const [x, y, yaw] = changes.map((axis) => {
    let sum = 0;
    return axis.map((change) => (sum += change));
  });
  return { x, y, yaw };
}

function wallsOf(bytes, size) {
  return Array.from({ length: size * size }, (_, cell) => (bytes[cell >> 3] >> (7 - (cell & 7))) & 1);
}

function partOf(path, first, count) {
  return Object.fromEntries(Object.entries(path).map(([name, values]) => [name, values.slice(first, first + count)]));
}

// Everything about one episode, by names.
function episodeOf(packed, number, index) {
  const result = data.results[number];
  const { columns } = packed;
  const maze = data.mazes[result.mazes[columns.maze[index]]];
  const first = columns.steps.slice(0, index).reduce((sum, steps) => sum + steps + 1, 0);
  const poses = columns.path ? columns.steps[index] + 1 : 0;
  const real = maze.walls ? wallsOf(bytesOfBase64(maze.walls), result.size) : null;
  return {
    size: result.size,
    cellSize: result.cellSize,
    sensor: { rays: data.rays, range: result.lidar / result.cellSize }, // in cells
    maze: maze.name,
    real,
    ...shownMap(packed, result, index, real),
    ...Object.fromEntries(OF_EPISODES.map((name) => [name, columns[name][index]])),
    doors: columns.doors ? columns.doors[index] : [],
    landmarks: columns.landmarks ? columns.landmarks[index] : [],
    path: partOf(packed.path, first, poses),
    observed: packed.observed && partOf(packed.observed, first, poses),
    lidar: result.lidar > 0 && real !== null,
    groups: result.groups.filter((group) => columns.groups[group][index]),
  };
}

// The map as the agent was shown it: the share of wall in each of `side` x `side` pixels, where start and goal are marked
// (-1: not marked), and whether the pixels are not the maze's cells.
function shownMap({ columns, maps }, result, index, real) {
  const side = result.picture || result.size;
  const count = result.picture ? side * side : Math.ceil((side * side) / 8);
  const map = maps.subarray(index * count, (index + 1) * count);
  const recorded = () => (result.picture ? Array.from(map, (value) => value / 255) : wallsOf(map, side));
  return {
    side,
    shown: maps.length ? recorded() : result.exact ? real : null,
    shownStart: (columns.shownStart || columns.start)[index],
    shownGoal: (columns.shownGoal || columns.goal)[index],
    isDrawn: result.picture > 0,
  };
}

function fill(select, options, value) {
  select.replaceChildren(...options.map(([key, text]) => new Option(text, key)));
  const keys = options.map(([key]) => String(key));
  select.value = keys.includes(String(value)) ? String(value) : keys[0];
}

function resultsOf(setting) {
  return data.results.flatMap((result, number) => (result.setting === setting ? [number] : []));
}

async function openResult(number, episode = null, group = null) {
  stop();
  const result = data.results[number];
  byId("setting").value = String(result.setting);
  fill(byId("agent"), resultsOf(result.setting).map((other) => [other, data.results[other].label]), number);
  view.result = number;
  const packed = await unpack(number);
  if (view.result !== number) return;
  view.packed = packed;
  const { columns } = packed;
  fill(byId("maze"), [["", "all"], ...result.mazes.map((maze, index) => [index, data.mazes[maze].name])], byId("maze").value);
  const distances = [...new Set(columns.distance)].sort((a, b) => a - b);
  fill(byId("distance"), [["", "all"], ...distances.map((distance) => [distance, inUnit(distance)])], byId("distance").value);
  fill(byId("group"), [["", "all"], ...result.groups.map((group) => [group, group])], byId("group").value);
  byId("group-label").hidden = !result.groups.length;
  if (episode !== null && !listed().includes(episode)) {
    for (const id of ["maze", "distance", "group"]) byId(id).value = "";
    byId("failures").checked = false;
  }
  if (group !== null) byId("group").value = result.groups[group];
  listEpisodes(episode);
}

// Failures come first, the nearest goal before others, and then what took longest by the oracle's steps.
function worstFirst({ success, steps, oracle, shortest }) {
  const rank = (index) => (success[index] ? -steps[index] / (oracle[index] || Infinity) : shortest[index] - 1e9);
  return (one, other) => rank(one) - rank(other) || one - other;
}

function verdictOf({ success, onTime }, index) {
  return !success[index] ? "✗ failed" : onTime[index] ? "✓ on time" : "✓ late";
}

const timesOracle = (steps, oracle) => (oracle ? `${(steps / oracle).toFixed(2)} ×` : "");

function listed() {
  const { columns } = view.packed;
  const [maze, distance, group] = ["maze", "distance", "group"].map((id) => byId(id).value);
  const failures = byId("failures").checked;
  return columns.success.flatMap((success, index) => {
    const isHere = (maze === "" || columns.maze[index] === Number(maze)) && (distance === "" || columns.distance[index] === Number(distance));
    const fits = isHere && (group === "" || columns.groups[group][index]);
    return fits && !(failures && success) ? [index] : [];
  });
}

function listEpisodes(episode) {
  const { columns } = view.packed;
  const found = listed().sort(worstFirst(columns));
  const result = data.results[view.result];
  const text = (index) =>
    `${verdictOf(columns, index)} · ${index} · ${data.mazes[result.mazes[columns.maze[index]]].name} · ${inUnit(columns.distance[index])} · ${columns.steps[index]} steps`;
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
  for (const id of ["numbers", "others", "shown", "driven", "lidar-label"]) byId(id).hidden = true;
  byId("key").replaceChildren();
}

function openEpisode(index) {
  stop();
  view.episode = index;
  view.current = episodeOf(view.packed, view.result, index);
  const { current } = view;
  const poses = current.path.x.length;
  byId("time").max = String(Math.max(poses - 1, 0));
  byId("time").disabled = byId("play").disabled = poses < 2;
  for (const id of ["numbers", "others", "shown", "driven"]) byId(id).hidden = false;
  byId("lidar-label").hidden = !current.lidar || !poses;
  writeOutcome();
  writeNumbers();
  writeKey();
  writeOthers();
  moveTo(Math.max(poses - 1, 0));
  history.replaceState(null, "", `#episode=${view.result}-${index}`);
}

function writeOutcome() {
  const { current } = view;
  const verdict = element("strong", { class: current.success ? "reached" : "failed" }, current.success ? `reached the goal ${current.onTime ? "on time" : "late"}` : "did not reach the goal");
  byId("outcome").replaceChildren(data.results[view.result].label, " ", verdict, ` in maze ${current.maze}, ${current.steps} steps, ${current.driven.toFixed(2)} m driven.`);
}

function writeNumbers() {
  const { current } = view;
  const cell = (index) => `row ${Math.floor(index / current.size)}, column ${index % current.size}`;
  const rows = [
    ["episode", String(view.episode)],
    ["from", cell(current.start)],
    ["to", cell(current.goal)],
    ["grid distance", inUnit(current.distance)],
    ["shortest path", `${current.shortest.toFixed(2)} m`],
    ["driven", `${current.driven.toFixed(2)} m`],
    ["time", `${current.steps} steps, ${(current.steps * data.units.step).toFixed(1)} s`],
    ["oracle's time", current.oracle ? `${current.oracle} steps, of which this is ${timesOracle(current.steps, current.oracle)}` : "does not arrive"],
    ["SPL", current.spl.toFixed(2)],
    ["SPL by grid distance", current.splGrid.toFixed(2)],
    ["seed", String(current.seed)],
    ...(current.groups.length ? [["groups", current.groups.join(", ")]] : []),
  ];
  byId("numbers").tBodies[0].replaceChildren(
    ...rows.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", { class: "number" }, value))),
  );
}

const keyOf = ({ maze, start, goal, seed }, index, mazes) => [data.mazes[mazes[maze[index]]].name, start[index], goal[index], seed[index]].join(" ");

async function writeOthers() {
  const { result, episode } = view;
  const rows = [];
  const wanted = keyOf(view.packed.columns, episode, data.results[result].mazes);
  for (const number of resultsOf(data.results[result].setting)) {
    const { columns } = await unpack(number);
    if (view.result !== result || view.episode !== episode) return;
    const index = columns.success.findIndex((_, other) => keyOf(columns, other, data.results[number].mazes) === wanted);
    if (index < 0) continue;
    const button = element("button", { type: "button", class: "link" }, data.results[number].label);
    if (number === result) button.setAttribute("aria-current", "true");
    button.addEventListener("click", () => openResult(number, index));
    const texts = [verdictOf(columns, index), String(columns.steps[index]), timesOracle(columns.steps[index], columns.oracle[index]), columns.spl[index].toFixed(2)];
    rows.push(element("tr", {}, element("td", {}, button), ...texts.map((text) => element("td", { class: "number" }, text))));
  }
  byId("others").tBodies[0].replaceChildren(...rows);
}

function writeKey() {
  const { current } = view;
  const entries = [["start", "start"], ["goal", "goal"]];
  if (current.observed) entries.push(["odometry", "odometry, laid on the first pose"]);
  if (current.landmarks.length) entries.push(["landmark", "landmarks"]);
  if (differs(current)) entries.push(["false-wall", "wall on the map only"], ["lost-wall", "wall missing on the map"]);
  const items = entries.map(([name, text]) => {
    const swatch = element("span", { class: `swatch ${name}`, "aria-hidden": "true" });
    swatch.style.background = `var(--${name})`;
    return element("li", {}, swatch, text);
  });
  byId("key").replaceChildren(...items, element("li", {}, "Path: from violet (start) to yellow (end)"));
}

function differs(current) {
  return !current.isDrawn && current.shown && current.real && current.shown.some((wall, cell) => wall !== current.real[cell]);
}

// The walls at a time, after the doors that have moved until then.
function wallsAt({ real, doors }, time) {
  if (!real || !doors.length) return real;
  const walls = real.slice();
  for (const [step, ...cells] of doors) if (step <= time) for (const cell of cells) walls[cell] = 1 - walls[cell];
  return walls;
}

function draw() {
  if (view.episode < 0) return;
  const current = { ...view.current, real: wallsAt(view.current, view.time) };
  const color = colors();
  const ranges = current.lidar && current.path.x.length && byId("lidar").checked ? rangesOf(current.real, current.size, current.path, view.time, current.sensor) : [];
  drawShown(current, color);
  drawDriven(current, ranges, color);
  describe();
}

function drawShown(current, color) {
  const { side } = current;
  const pen = prepare(byId("shown"), side);
  drawMap(pen, current.shown, side, color);
  if (!current.isDrawn) current.landmarks.forEach((cell) => fillCell(pen, cell, side, color("landmark")));
  const radius = (0.36 * thickness(current.size) * side) / current.size;
  drawEnds(pen, current.shownStart, current.shownGoal, side, radius, color);
}

function drawDriven(current, ranges, color) {
  const { size, path } = current;
  const pen = prepare(byId("driven"), size);
  drawMap(pen, current.real || (current.isDrawn ? null : current.shown), size, color);
  for (const cell of current.landmarks) fillCell(pen, cell, size, color("landmark"));
  drawEnds(pen, current.start, current.goal, size, 0.36 * thickness(size), color);
  // Small squares where map and maze disagree; the map itself is drawn beside it as it was shown.
  if (differs(current)) {
    current.real.forEach((wall, cell) => {
      if (current.shown[cell] === wall) return;
      pen.fillStyle = color(wall ? "lost-wall" : "false-wall");
      pen.fillRect((cell % size) + 0.25, Math.floor(cell / size) + 0.25, 0.5, 0.5);
    });
  }
  if (!path.x.length) return;
  drawRays(pen, path, view.time, size, ranges, current.sensor.range, color);
  drawPath(pen, path, view.time, size, color);
  if (current.observed) drawDashed(pen, current.observed, view.time, size, color("odometry"));
}

function describe() {
  const { current } = view;
  const shown = data.results[view.result].hidden ? "The map, which was hidden from the agent" : "The map that the agent was shown";
  byId("shown-caption").textContent = current.shown ? shown : "The map that the agent was shown was not recorded";
  byId("driven-caption").textContent = !current.path.x.length
    ? "The maze. The path was not recorded, which eval --record does"
    : current.real ? "The maze, and the path driven in it" : "The true maze is not in the results; the path driven, on the map";
  byId("shown").setAttribute("aria-label", `Map of ${current.side} by ${current.side} pixels as shown to the agent`);
  byId("driven").setAttribute("aria-label", `Maze ${current.maze} with the path driven up to step ${view.time} of ${current.steps}`);
}

function moveTo(time) {
  const { current } = view;
  const { x, y, yaw } = current.path;
  view.time = Math.max(0, Math.min(x.length - 1, time));
  byId("time").value = String(view.time);
  const metres = (value) => ((current.cellSize * value) / data.units.position).toFixed(2);
  const turn = (yaw[view.time] || 0) / data.units.yaw; // counts whole turns too
  const degrees = Math.round(360 * (turn - Math.floor(turn + 0.5)));
  const text = x.length
    ? `step ${view.time} of ${current.steps}, ${(view.time * data.units.step).toFixed(2)} s, x ${metres(x[view.time])} y ${metres(y[view.time])} m, heading ${degrees}°`
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
  if (view.timer) return stop();
  const from = view.time >= view.current.path.x.length - 1 ? 0 : view.time;
  const began = performance.now();
  byId("play").textContent = "Pause";
  const frame = (now) => {
    const steps = ((now - began) / 1000 / data.units.step) * Number(byId("speed").value);
    moveTo(from + Math.floor(Math.max(steps, 0)));
    if (view.time < view.current.path.x.length - 1) view.timer = requestAnimationFrame(frame);
    else stop();
  };
  view.timer = requestAnimationFrame(frame);
}

// The table of results has the values of all metrics, of which it shows one, in the columns that have some.
function showMetric() {
  const [head, ...rows] = byId("values").rows;
  for (const value of document.querySelectorAll("#values [data-metric]")) value.hidden = value.dataset.metric !== byId("metric").value;
  for (let column = 1; column < head.cells.length; column++) {
    const isEmpty = !rows.some((row) => row.cells[column].querySelector("[data-metric]:not([hidden])"));
    for (const row of [head, ...rows]) row.cells[column].hidden = isEmpty;
  }
}

function showFiner() {
  for (const row of document.querySelectorAll("#values .finer")) row.hidden = !byId("finer").checked;
}

function listen() {
  const on = (id, event, action) => byId(id).addEventListener(event, action);
  on("setting", "change", () => {
    for (const id of ["maze", "distance", "group"]) byId(id).value = "";
    const numbers = resultsOf(Number(byId("setting").value));
    const sameAgent = numbers.find((number) => data.results[number].label === data.results[view.result].label);
    openResult(sameAgent === undefined ? numbers[0] : sameAgent);
  });
  on("agent", "change", () => openResult(Number(byId("agent").value)));
  for (const id of ["maze", "distance", "group", "failures"]) on(id, "change", () => listEpisodes(null));
  on("episodes", "change", () => openEpisode(Number(byId("episodes").value)));
  on("time", "input", () => {
    stop();
    moveTo(Number(byId("time").value));
  });
  on("play", "click", play);
  on("lidar", "change", draw);
  if (byId("values")) on("metric", "change", showMetric);
  if (byId("finer")) on("finer", "change", showFiner);
  new ResizeObserver(draw).observe(byId("driven"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

// An address may name an episode, and the group to list it in: #episode=RESULT-EPISODE or #episode=RESULT-EPISODE-GROUP.
function linkedBy(address) {
  const found = /^#episode=(\d+)-(\d+)(?:-(\d+))?$/.exec(address);
  const [result, episode, group] = found ? found.slice(1).map((text) => (text === undefined ? null : Number(text))) : [];
  return found && episode < (data.results[result] || { episodes: 0 }).episodes ? [result, episode, group] : null;
}

if (byId("values")) showMetric();
const linked = linkedBy(location.hash);
const [first, ...rest] = linked || linkedBy(data.opens) || [data.first];
fill(byId("setting"), data.settings.map((name, setting) => [setting, name]), data.results[first].setting);
listen();
const opening = openResult(first, ...rest).then(() => linked && byId("explorer").scrollIntoView());
addEventListener("hashchange", async () => {
  const wanted = linkedBy(location.hash);
  await opening;
  if (wanted) openResult(...wanted).then(() => byId("explorer").scrollIntoView());
});
