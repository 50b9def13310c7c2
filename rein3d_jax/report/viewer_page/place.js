"use strict";
// Where the visitor is, and may go. World: metres, x forward, y left, z up, its origin the panorama's centre.
// The page's files are one script, in viewer.py's order; libraries.* is the bundle's (three and Spark).
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const LOOK_LIMIT = 1.5; // radians up and down
const FOV = { least: 30, first: 65, most: 90 }; // degrees, vertical
const HOME = { x: 0, y: 0, yaw: 0, pitch: 0 };
const here = { ...HOME, fov: FOV.first, shown: -1 }; // yaw turns left, pitch looks up, radians; shown: of views
let needed = true; // a new picture

const between = (low, value, high) => Math.max(low, Math.min(high, value));

function look(left, up) {
  here.yaw += left;
  here.pitch = between(-LOOK_LIMIT, here.pitch + up, LOOK_LIMIT);
  needed = true;
}

function zoom(degrees) {
  here.fov = between(FOV.least, here.fov + degrees, FOV.most);
  needed = true;
}

function inside(polygon, x, y) {
  let odd = false;
  polygon.forEach(([ax, ay], i) => {
    const [bx, by] = polygon[(i + 1) % polygon.length];
    if (ay > y !== by > y && x < ax + ((bx - ax) * (y - ay)) / (by - ay)) odd = !odd;
  });
  return odd;
}

const allowed = (x, y) => Math.hypot(x, y) < 0.01 || inside(data.safe, x, y);

// Walks by (dx, dy); at the edge of the safe area less far, or along it. True if it had to.
const WAYS = [[1, 0], [0.5, 0], [0.25, 0], [0.12, 0], ...[0.35, 0.7, 1.05].flatMap((a) => [[Math.cos(a), a], [Math.cos(a), -a]])];

function walk(dx, dy) {
  for (const [share, angle] of WAYS) {
    const c = Math.cos(angle) * share, s = Math.sin(angle) * share;
    const x = here.x + c * dx - s * dy, y = here.y + s * dx + c * dy;
    if (allowed(x, y)) {
      Object.assign(here, { x, y });
      return share < 1;
    }
  }
  return true;
}

function jump(x, y) {
  if (allowed(x, y)) Object.assign(here, { x, y });
  else warn();
  needed = true;
}

let warned;
function warn() {
  byId("edge").hidden = false;
  clearTimeout(warned);
  warned = setTimeout(() => (byId("edge").hidden = true), 900);
}
