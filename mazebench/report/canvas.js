"use strict";
// What the explorer draws: maps, paths, what the range sensor measures.

function colors() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

// The colour of a share of the time, as in the figures. On a dark floor the ramp begins brighter.
function timeColor(share) {
  const darkest = matchMedia("(prefers-color-scheme: dark)").matches ? 0.3 : 0;
  return data.timeColors[Math.round((darkest + (1 - darkest) * share) * (data.timeColors.length - 1))];
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

// What is drawn on large mazes is larger, so that it can be seen.
const thickness = (size) => Math.max(1, size / 21);

// A map of side x side pixels, each the share of wall in it; null is drawn as an empty floor.
function drawMap(pen, map, side, color) {
  const wall = color("wall");
  pen.fillStyle = color("floor");
  pen.fillRect(0, 0, side, side);
  (map || []).forEach((share, cell) => {
    pen.globalAlpha = share;
    if (share) fillCell(pen, cell, side, wall);
  });
  pen.globalAlpha = 1;
}

// The start as a disc and the goal as a star, told apart without colours too; nothing where the map marks no cell, -1.
function drawEnds(pen, start, goal, side, radius, color) {
  const centre = (cell) => [(cell % side) + 0.5, Math.floor(cell / side) + 0.5];
  pen.beginPath();
  if (start >= 0) pen.arc(...centre(start), radius, 0, 2 * Math.PI);
  pen.fillStyle = color("start");
  pen.fill();
  pen.beginPath();
  const [x, y] = centre(goal);
  for (let corner = 0; goal >= 0 && corner < 10; corner++) {
    const [length, angle] = [(corner % 2 ? 0.55 : 1.3) * radius, (corner * Math.PI) / 5];
    pen.lineTo(x + length * Math.sin(angle), y - length * Math.cos(angle));
  }
  pen.fillStyle = color("goal");
  pen.fill();
}

// Where a pose lies on a canvas whose unit is a cell: there, y goes down from the upper edge of the maze.
const placeOf = ({ x, y }, time, size) => [x[time] / data.units.position, size - y[time] / data.units.position];
const angleOf = ({ yaw }, time) => (2 * Math.PI * yaw[time]) / data.units.yaw; // counter-clockwise

// A path up to a time in the colours of time, and behind it the rest, and the body.
function drawPath(pen, path, time, size, color) {
  const count = path.x.length;
  const place = (index) => placeOf(path, index, size);
  const scale = thickness(size);
  pen.lineCap = "round";
  pen.lineWidth = 0.05 * scale;
  pen.strokeStyle = color("ahead");
  pen.beginPath();
  for (let index = time; index < count; index++) pen.lineTo(...place(index));
  pen.stroke();
  pen.lineWidth = 0.14 * scale;
  for (let index = 1; index <= time; index++) {
    pen.strokeStyle = timeColor(index / Math.max(count - 1, 1));
    pen.beginPath();
    pen.moveTo(...place(index - 1));
    pen.lineTo(...place(index));
    pen.stroke();
  }
  drawBody(pen, ...place(time), -angleOf(path, time), scale, color);
}

// A disc and a nose for the body; the canvas has y down, so the angle comes negated.
function drawBody(pen, x, y, angle, scale, color) {
  pen.beginPath();
  pen.arc(x, y, 0.15 * scale, 0, 2 * Math.PI);
  pen.fillStyle = color("body");
  pen.fill();
  pen.lineWidth = 0.08 * scale;
  pen.strokeStyle = color("body");
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + 0.36 * scale * Math.cos(angle), y + 0.36 * scale * Math.sin(angle));
  pen.stroke();
}

// What a range sensor measures, in cells: the first ray points straight ahead, the others follow counter-clockwise.
function rangesOf(walls, size, path, time, { rays, range }) {
  const at = [path.x[time] / data.units.position, path.y[time] / data.units.position];
  const angle = (ray) => angleOf(path, time) + (2 * Math.PI * ray) / rays;
  return Array.from({ length: rays }, (_, ray) => rayLength(walls, size, at, angle(ray), range));
}

// The distance to the nearest wall along a ray, from cell to cell (Amanatides and Woo 1987); at most the range.
function rayLength(walls, size, at, angle, range) {
  const direction = [Math.cos(angle), Math.sin(angle)];
  const cell = at.map(Math.floor);
  const spacing = direction.map((part) => 1 / Math.max(Math.abs(part), 1e-9));
  const crossing = direction.map((part, axis) => (part > 0 ? cell[axis] + 1 - at[axis] : at[axis] - cell[axis]) * spacing[axis]);
  for (;;) {
    const axis = crossing[0] < crossing[1] ? 0 : 1;
    const length = crossing[axis];
    cell[axis] += Math.sign(direction[axis]);
    if (length >= range) return range;
    if (cell.some((place) => place < 0 || place >= size) || walls[(size - 1 - cell[1]) * size + cell[0]]) return length;
    crossing[axis] += spacing[axis];
  }
}

// Rays from a pose, with a dot where each one meets a wall, which is nearer than the sensor's range.
function drawRays(pen, path, time, size, ranges, range, color) {
  const [x, y] = placeOf(path, time, size);
  pen.strokeStyle = pen.fillStyle = color("ray");
  pen.lineWidth = 0.03 * thickness(size);
  ranges.forEach((length, ray) => {
    const turned = angleOf(path, time) + (2 * Math.PI * ray) / ranges.length;
    const end = [x + length * Math.cos(turned), y - length * Math.sin(turned)];
    pen.globalAlpha = 0.6;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(...end);
    pen.stroke();
    pen.globalAlpha = 1;
    if (length === range) return;
    pen.beginPath();
    pen.arc(...end, 0.08 * thickness(size), 0, 2 * Math.PI);
    pen.fill();
  });
}

// A path up to a time as a dashed line.
function drawDashed(pen, path, time, size, color) {
  pen.lineWidth = 0.08 * thickness(size);
  pen.strokeStyle = color;
  pen.setLineDash([0.2, 0.2]);
  pen.beginPath();
  for (let index = 0; index <= time; index++) pen.lineTo(...placeOf(path, index, size));
  pen.stroke();
  pen.setLineDash([]);
}
