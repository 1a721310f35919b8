"use strict";
// What the server sends is a view with a number; the answer is that number and the keys that are down, named as actions.
// Text goes through textContent.

const KEYS = {
  ArrowUp: "forward", KeyW: "forward", ArrowDown: "backward", KeyS: "backward", ArrowLeft: "look_left", KeyA: "look_left",
  ArrowRight: "look_right", KeyD: "look_right", KeyQ: "strafe_left", KeyE: "strafe_right",
};
const byId = (id) => document.getElementById(id);
const data = { units: { position: 1, yaw: 2 * Math.PI } }; // of canvas.js
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
  byId("has-start").hidden = view.start < 0;
  byId("has-goal").hidden = view.goal < 0;
  byId("you").hidden = !view.trail.length;
  byId("lost").hidden = view.trail.length > 0;
  if (view.camera) byId("camera").src = view.camera;
  for (const span of document.querySelectorAll(".differs")) span.hidden = !(hasEnded && view.changed.length);
  draw();
}

// Marks and walls are drawn by canvas.js, whose unit is a cell.
function draw() {
  if (!view.title) return;
  const color = colors(), pen = prepare(byId("map"), view.side);
  drawMap(pen, sharesOf(view.map), view.side, color);
  drawWay(pen, view.trail, view.side, color("you"));
  drawEnds(pen, view.start, view.goal, view.side, 0.5 * thickness(view.side), color);
  if (view.trail.length) drawArrow(pen, view.trail[view.trail.length - 1], thickness(view.side), color);
  if (view.phase === "end") drawBuilding(color);
  else if (view.ranges) drawLidar(color);
}

// Shares of wall in bytes, row by row; null of a map that is hidden.
function sharesOf(packed) {
  return packed && Array.from(atob(packed), (character) => character.charCodeAt(0) / 255);
}

function drawWay(pen, way, side, color) {
  pen.strokeStyle = color;
  pen.lineWidth = 0.16 * thickness(side);
  pen.lineJoin = "round";
  pen.beginPath();
  for (const [x, y] of way) pen.lineTo(x, y);
  pen.stroke();
}

function drawArrow(pen, [x, y, yaw], scale, color) {
  const at = ([ahead, left]) => [x + scale * (ahead * Math.cos(yaw) - left * Math.sin(yaw)), y - scale * (ahead * Math.sin(yaw) + left * Math.cos(yaw))];
  pen.fillStyle = color("you");
  pen.strokeStyle = color("floor");
  pen.lineWidth = 0.12 * scale;
  pen.beginPath();
  for (const corner of [[0.8, 0], [-0.6, 0.5], [-0.3, 0], [-0.6, -0.5]]) pen.lineTo(...at(corner));
  pen.closePath();
  pen.fill();
  pen.stroke();
}

function drawBuilding(color) {
  const { building, size, ways, ends } = view, pen = prepare(byId("view"), size);
  drawMap(pen, sharesOf(building), size, color);
  for (const [row, column, isWall] of view.changed) {
    pen.fillStyle = color("closed");
    pen.strokeStyle = color("open");
    pen.lineWidth = 0.2;
    if (isWall) pen.fillRect(column, row, 1, 1);
    else pen.strokeRect(column + 0.1, row + 0.1, 0.8, 0.8);
  }
  drawWay(pen, ways[0], size, color("oracle"));
  drawWay(pen, ways[1], size, color("you"));
  drawEnds(pen, ...ends, size, 0.5 * thickness(size), color);
}

// The ranges around the robot, which looks up; in metres.
function drawLidar(color) {
  const side = Math.ceil(2.1 * view.reach), pen = prepare(byId("view"), side), middle = { x: [side / 2], y: [side / 2], yaw: [Math.PI / 2] };
  drawMap(pen, null, side, color);
  drawRays(pen, middle, 0, side, view.ranges, view.reach, color);
  drawBody(pen, side / 2, side / 2, -Math.PI / 2, view.radius / 0.15, color);
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
