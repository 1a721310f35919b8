"use strict";
// What the server sends is a view with a number; the answer is that number and the keys that are down, named as actions.
// Text goes through textContent.

const KEYS = {
  ArrowUp: "forward", KeyW: "forward", ArrowDown: "backward", KeyS: "backward", ArrowLeft: "look_left", KeyA: "look_left",
  ArrowRight: "look_right", KeyD: "look_right", KeyQ: "strafe_left", KeyE: "strafe_right",
};
const byId = (id) => document.getElementById(id);
const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);
let view = {}, held = [], socket;

function connect() {
  byId("notice").hidden = true;
  socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
  socket.onmessage = (message) => take(JSON.parse(message.data));
  socket.onclose = () => {
    if (!["over", "elsewhere"].includes(view.phase)) say("mazebench play has ended on this machine. Start it again with --resume, and open its new address.");
  };
}

function take(received) {
  view = received.phase === "elsewhere" ? { ...view, phase: "elsewhere" } : received;
  if (view.phase === "elsewhere") {
    socket.close();
    say("You drive in another tab or window now.", true);
  } else if (view.phase === "over") {
    say(view.words);
  } else if (view.phase !== "wait") {
    show();
    if (view.phase === "drive" && held.length) send();
  }
}

function send(keys = held) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ number: view.number, keys }));
}

function hold(key, isDown) {
  if (held.includes(key) === isDown) return;
  held = held.filter((each) => each !== key);
  if (isDown) held.push(key);
  for (const button of byId("pad").children) button.classList.toggle("down", held.includes(button.dataset.key));
  if (view.phase === "drive") send();
}

function letGo() {
  for (const key of [...held]) hold(key, false);
}

function say(words, canDrive = false) {
  byId("said").textContent = words;
  byId("again").hidden = !canDrive;
  byId("notice").hidden = false;
  byId("end").hidden = true;
}

function show() {
  const hasEnded = view.phase === "end";
  byId("title").textContent = view.title;
  byId("count").textContent = `episode ${view.number_of[0]} of ${view.number_of[1]}`;
  byId("name").textContent = view.name;
  byId("meaning").textContent = view.meaning;

  // The clock.
  const left = Math.max(0, view.limit - view.seconds), share = left / view.limit;
  byId("left").textContent = `${left.toFixed(1)} s`;
  byId("used").textContent = `${view.seconds.toFixed(1)} s`;
  byId("rest").style.width = `${100 * share}%`;
  byId("bar").setAttribute("aria-valuenow", Math.round(100 * share));
  byId("clock").classList.toggle("short", share < 0.2);

  // The end, or the keys.
  byId("end").hidden = !hasEnded;
  byId("pad").hidden = hasEnded;
  byId("help").hidden = hasEnded;
  byId("stands").hidden = view.real_time;
  for (const button of byId("pad").children) button.style.visibility = view.keys.includes(button.dataset.key) ? "visible" : "hidden";
  byId("slides").hidden = !view.keys.includes("strafe_left");
  if (hasEnded) {
    byId("end").className = view.verdict === "On time" ? "good" : "bad";
    byId("verdict").textContent = view.verdict;
    byId("words").textContent = view.words;
    byId("next").textContent = view.number_of[0] === view.number_of[1] ? "Finish" : "Next episode";
    byId("next").focus({ preventScroll: true });
  }

  // The map, and what is seen; at the end, the building.
  byId("camera").hidden = byId("of-camera").hidden = hasEnded || !view.camera;
  byId("of-lidar").hidden = hasEnded || !view.ranges;
  byId("of-building").hidden = !hasEnded;
  byId("view").hidden = !hasEnded && !view.ranges;
  byId("has-start").hidden = !view.start;
  byId("has-goal").hidden = !view.goal;
  byId("you").hidden = !view.trail.length;
  byId("lost").hidden = view.trail.length > 0;
  if (view.camera) byId("camera").src = view.camera;
  for (const span of document.querySelectorAll(".differs")) span.hidden = !(hasEnded && view.changed.length);
  draw();
}

function draw() {
  if (!view.title) return;
  const plane = planeOf(view.map), pen = penOf("map", plane.side);
  drawWalls(pen, plane);
  drawWay(pen, view.trail, plane.side, "you");
  drawEnds(pen, view.start, view.goal, plane.side);
  if (view.trail.length) drawBody(pen, view.trail[view.trail.length - 1], unit(plane.side));
  if (view.phase === "end") drawBuilding();
  else if (view.ranges) drawRanges();
}

// Shares of wall in bytes, row by row.
function planeOf(packed) {
  if (packed === null) return { side: view.side, shares: [] };
  const shares = Uint8Array.from(atob(packed), (character) => character.charCodeAt(0));
  return { side: Math.sqrt(shares.length), shares };
}

// A pen whose unit is a pixel of a plane, on whole pixels of the screen, so that no seams show.
function penOf(id, side) {
  const canvas = byId(id), pixels = Math.max(1, Math.round((canvas.clientWidth * (window.devicePixelRatio || 1)) / side)) * side;
  canvas.width = canvas.height = pixels;
  const pen = canvas.getContext("2d");
  pen.scale(pixels / side, pixels / side);
  pen.lineJoin = pen.lineCap = "round";
  pen.fillStyle = color("floor");
  pen.fillRect(0, 0, side, side);
  return pen;
}

function drawWalls(pen, { side, shares }) {
  pen.fillStyle = color("wall");
  shares.forEach((share, cell) => {
    pen.globalAlpha = share / 255;
    if (share) pen.fillRect(cell % side, Math.floor(cell / side), 1, 1);
  });
  pen.globalAlpha = 1;
}

const unit = (side) => Math.max(1, side / 24); // marks of large maps are larger, so that they can be seen

function drawEnds(pen, start, goal, side) {
  const radius = 0.5 * unit(side);
  if (start) {
    pen.strokeStyle = color("start");
    pen.lineWidth = 0.45 * radius;
    pen.beginPath();
    pen.arc(start[1] + 0.5, start[0] + 0.5, 0.8 * radius, 0, 2 * Math.PI);
    pen.stroke();
  }
  pen.fillStyle = color("goal");
  pen.beginPath();
  for (let corner = 0; goal && corner < 10; corner++) {
    const length = (corner % 2 ? 0.65 : 1.5) * radius, angle = (corner * Math.PI) / 5;
    pen.lineTo(goal[1] + 0.5 + length * Math.sin(angle), goal[0] + 0.5 - length * Math.cos(angle));
  }
  pen.fill();
}

function drawWay(pen, way, side, name) {
  pen.strokeStyle = color(name);
  pen.lineWidth = 0.16 * unit(side);
  pen.beginPath();
  for (const [x, y] of way) pen.lineTo(x, y);
  pen.stroke();
}

function drawBody(pen, [x, y, yaw], scale) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(-yaw);
  pen.scale(scale, scale);
  pen.fillStyle = color("you");
  pen.strokeStyle = color("floor");
  pen.lineWidth = 0.12;
  pen.beginPath();
  for (const [ahead, left] of [[0.8, 0], [-0.6, 0.5], [-0.3, 0], [-0.6, -0.5]]) pen.lineTo(ahead, -left);
  pen.closePath();
  pen.fill();
  pen.stroke();
  pen.restore();
}

function drawBuilding() {
  const plane = planeOf(view.building), pen = penOf("view", plane.side);
  drawWalls(pen, plane);
  for (const [row, column, isWall] of view.changed) {
    pen.fillStyle = color("closed");
    pen.strokeStyle = color("open");
    pen.lineWidth = 0.2;
    if (isWall) pen.fillRect(column, row, 1, 1);
    else pen.strokeRect(column + 0.1, row + 0.1, 0.8, 0.8);
  }
  drawWay(pen, view.ways[0], plane.side, "oracle");
  drawWay(pen, view.ways[1], plane.side, "you");
  drawEnds(pen, ...view.ends, plane.side);
}

// The ranges around the robot, which looks up.
function drawRanges() {
  const side = 2.1 * view.reach, pen = penOf("view", side);
  pen.translate(side / 2, side / 2);
  pen.strokeStyle = color("line");
  pen.lineWidth = 0.03;
  for (let radius = 1; radius <= view.reach; radius++) {
    pen.beginPath();
    pen.arc(0, 0, radius, 0, 2 * Math.PI);
    pen.stroke();
  }
  const ends = view.ranges.map((range, ray) => {
    const angle = (2 * Math.PI * ray) / view.ranges.length;
    return [-range * Math.sin(angle), -range * Math.cos(angle), range < view.reach];
  });
  pen.fillStyle = color("you");
  pen.globalAlpha = 0.15;
  pen.beginPath();
  for (const [x, y] of ends) pen.lineTo(x, y);
  pen.fill();
  pen.globalAlpha = 1;
  pen.fillStyle = color("ink");
  for (const [x, y, isWall] of ends) {
    pen.beginPath();
    if (isWall) pen.arc(x, y, 0.07, 0, 2 * Math.PI);
    pen.fill();
  }
  drawBody(pen, [0, 0, Math.PI / 2], 2.2 * view.radius);
}

addEventListener("keydown", (event) => {
  if (!(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (!event.repeat) hold(KEYS[event.code], true);
});
addEventListener("keyup", (event) => {
  if (event.code in KEYS) hold(KEYS[event.code], false);
});
addEventListener("blur", letGo);
addEventListener("visibilitychange", letGo);
addEventListener("resize", draw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
for (const button of byId("pad").children) {
  button.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    button.setPointerCapture(event.pointerId);
    hold(button.dataset.key, true);
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(name, () => hold(button.dataset.key, false));
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}
byId("next").addEventListener("click", () => send(["next"]));
byId("again").addEventListener("click", connect);
connect();
