"use strict";
// A walk through the scenes of the page. World: metres, x forward, y left, z up, its origin the panorama's centre.
// libraries.* is the bundle's (three and Spark).
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const SPEED = 1.2; // metres a second
const TURN = 1.5; // radians a second, by key
const LOOK_LIMIT = 1.5; // radians up and down
const HOME = { x: 0, y: 0, yaw: 0, pitch: 0 };
const here = { ...HOME, fov: 65, shown: -1 }; // yaw turns left, pitch looks up; fov: degrees, vertical
const held = new Set();
let needed = true; // a new picture

// ---- the safe area ----

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

// ---- the picture ----

const bytes = (base64) => Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));

const renderer = createRenderer();
const scene = new libraries.Scene();
const camera = new libraries.PerspectiveCamera(here.fov, 1, 0.01, 200);
camera.up.set(0, 0, 1);
const spark = renderer && addSpark();

function createRenderer() {
  try {
    const made = new libraries.WebGLRenderer({ canvas: byId("view"), antialias: false });
    made.setClearColor(new libraries.Color().setRGB(...data.backdrop, libraries.SRGBColorSpace));
    return made;
  } catch {
    byId("message").textContent = "This browser shows no WebGL 2, which the scene needs. Try another browser or computer.";
  }
}

function addSpark() {
  // blurAmount: the pixels^2 by which rein3d_jax widens a splat on the screen, its opacity scaled to match.
  const added = new libraries.SparkRenderer({ renderer, onDirty: () => (needed = true), accumExtSplats: true,
    blurAmount: data.filterVariance, minAlpha: 1 / 255 });
  scene.add(added);
  return added;
}

// Each view: what to call it, and its object in the scene, made when it is first looked at.
const views = data.scenes.map(({ name, spz, url }) => ({ name, make: () => splats(spz, url) }));
if (data.panorama) views.unshift({ name: "Input panorama", still: true, make: sphere });

async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
}

async function splats(spz, url) {
  const fileBytes = url ? await fetched(url) : bytes(spz);
  const mesh = new libraries.SplatMesh({ fileBytes, fileType: libraries.SplatFileType.SPZ, extSplats: true });
  mesh.quaternion.set(1, 0, 0, 0); // an SPZ file holds y and z flipped: half a turn about x
  await mesh.initialized;
  return mesh;
}

async function sphere() {
  const texture = await new libraries.TextureLoader().loadAsync(data.panorama);
  texture.colorSpace = libraries.NoColorSpace; // sRGB in, sRGB out
  texture.generateMipmaps = false;
  texture.minFilter = texture.magFilter;
  const material = new libraries.ShaderMaterial({
    uniforms: { panorama: { value: texture } },
    side: libraries.BackSide,
    vertexShader: "varying vec3 ray; void main() { ray = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: `uniform sampler2D panorama; varying vec3 ray;
      void main() {
        vec3 d = normalize(ray);
        vec2 place = vec2(atan(-d.y, d.x) / 6.283185307 + 0.5, asin(clamp(d.z, -1.0, 1.0)) / 3.141592654 + 0.5);
        gl_FragColor = vec4(texture2D(panorama, place).rgb, 1.0);
      }`,
  });
  return new libraries.Mesh(new libraries.SphereGeometry(50, 64, 32), material);
}

async function show(index) {
  const view = views[index];
  if (!renderer || !view || index === here.shown) return;
  here.shown = index;
  [...byId("scenes").children].forEach((button, i) => button.setAttribute("aria-pressed", i === index));
  byId("message").textContent = view.made ? "" : "Loading";
  await new Promise((done) => setTimeout(done)); // let the page say so
  view.made ??= view.make();
  let made;
  try {
    made = await view.made;
  } catch (error) {
    byId("message").textContent = `${view.name} could not be shown (${error.message}). Write the page again.`;
    return;
  }
  if (here.shown !== index) return; // another was chosen meanwhile
  if (!made.parent) scene.add(made);
  for (const each of views) if (each.object) each.object.visible = false;
  view.object = made;
  made.visible = true;
  byId("message").textContent = "";
  needed = true;
}

function draw() {
  const { clientWidth: width, clientHeight: height } = byId("view");
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  if (camera.aspect !== width / height || renderer.domElement.width !== Math.floor(width * renderer.getPixelRatio())) {
    renderer.setSize(width, height, false);
  }
  Object.assign(camera, { aspect: width / height, fov: here.fov });
  camera.updateProjectionMatrix();
  const still = views[here.shown]?.still; // a panorama is seen from where it was taken
  camera.position.set(still ? 0 : here.x, still ? 0 : here.y, 0);
  const { x, y, z } = camera.position, level = Math.cos(here.pitch);
  camera.lookAt(x + Math.cos(here.yaw) * level, y + Math.sin(here.yaw) * level, z + Math.sin(here.pitch));
  renderer.render(scene, camera);
}

// ---- the map: x up the page, y to the left ----

const PIXELS = matchMedia("(max-width: 640px)").matches ? 110 : 190; // longer side
const frame = bounds([...data.walls, ...data.safe, [0, 0]]);
const scale = PIXELS / Math.max(frame.high[0] - frame.low[0], frame.high[1] - frame.low[1]);
const toMap = ([x, y]) => [(frame.high[1] - y) * scale, (frame.high[0] - x) * scale];

function bounds(points) {
  const far = 5 * median(points.map((p) => Math.hypot(...p))); // seen through a door or window: may leave the map
  const near = points.filter((p) => Math.hypot(...p) <= far);
  const end = (pick, axis) => pick(...near.map((p) => p[axis])) + (pick === Math.min ? -0.3 : 0.3);
  return { low: [end(Math.min, 0), end(Math.min, 1)], high: [end(Math.max, 0), end(Math.max, 1)] };
}

function median(values) {
  return values.sort((a, b) => a - b)[values.length >> 1];
}

function trace(pen, points) {
  pen.beginPath();
  points.map(toMap).forEach(([x, y]) => pen.lineTo(x, y));
}

function drawMap() {
  const map = byId("map"), pen = map.getContext("2d"), sharp = devicePixelRatio;
  const size = [0, 1].map((axis) => (frame.high[1 - axis] - frame.low[1 - axis]) * scale);
  [map.style.width, map.style.height] = size.map((s) => `${s}px`);
  [map.width, map.height] = size.map((s) => Math.round(s * sharp));
  pen.scale(sharp, sharp);
  const fill = (points, colour) => { trace(pen, points); pen.closePath(); pen.fillStyle = colour; pen.fill(); };
  fill(data.walls, "rgb(255 255 255 / 22%)");
  pen.strokeStyle = "#c9d2d6"; pen.lineWidth = 1.5; pen.stroke();
  fill(data.safe, "rgb(127 209 194 / 55%)");
  pen.strokeStyle = "rgb(18 32 29 / 60%)"; pen.lineWidth = 1;
  for (const path of data.paths) { trace(pen, path); pen.stroke(); }
  const place = views[here.shown]?.still ? [0, 0] : [here.x, here.y];
  const [x, y] = toMap(place), half = Math.atan(Math.tan((here.fov * Math.PI) / 360) * camera.aspect);
  const up = -Math.PI / 2 - here.yaw;
  pen.beginPath(); pen.moveTo(x, y); pen.arc(x, y, 26, up - half, up + half);
  pen.fillStyle = "rgb(255 214 102 / 55%)"; pen.fill();
  pen.beginPath(); pen.arc(x, y, 4.5, 0, 7); pen.fillStyle = "#ffd666"; pen.fill();
  pen.strokeStyle = "#1d2226"; pen.lineWidth = 1.5; pen.stroke();
}

byId("map").addEventListener("click", ({ offsetX, offsetY }) => {
  const x = frame.high[0] - offsetY / scale, y = frame.high[1] - offsetX / scale;
  if (allowed(x, y)) Object.assign(here, { x, y });
  else warn();
  needed = true;
});

// ---- hands ----

const KEYS = { KeyW: "forward", ArrowUp: "forward", KeyS: "back", ArrowDown: "back", KeyA: "left", KeyD: "right",
  ArrowLeft: "turnLeft", ArrowRight: "turnRight", ShiftLeft: "fast", ShiftRight: "fast" };

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code);
  if (digit) show(digit[1] - 1);
  if (event.code === "Home") Object.assign(here, HOME);
  if (KEYS[event.code]) held.add(KEYS[event.code]);
  if (event.code.startsWith("Arrow") || event.code === "Home") event.preventDefault();
  needed = true;
});
addEventListener("keyup", ({ code }) => held.delete(KEYS[code]));
addEventListener("blur", () => held.clear());
addEventListener("resize", () => (needed = true));

const view = byId("view");
view.addEventListener("pointerdown", (event) => view.setPointerCapture(event.pointerId));
view.addEventListener("pointermove", (event) => {
  if (!event.isPrimary || !view.hasPointerCapture(event.pointerId)) return;
  const radians = (here.fov * Math.PI) / 180 / view.clientHeight; // the point under the finger stays there
  here.yaw += event.movementX * radians;
  here.pitch = Math.max(-LOOK_LIMIT, Math.min(LOOK_LIMIT, here.pitch + event.movementY * radians));
  needed = true;
});
view.addEventListener("wheel", (event) => {
  event.preventDefault();
  here.fov = Math.max(30, Math.min(90, here.fov + Math.sign(event.deltaY) * 3));
  needed = true;
}, { passive: false });

for (const [arrow, name, column, row] of [["▲", "forward", 2, 1], ["◀", "left", 1, 2], ["▼", "back", 2, 2], ["▶", "right", 3, 2]]) {
  const button = Object.assign(document.createElement("button"), { textContent: arrow, ariaLabel: name });
  Object.assign(button.style, { gridColumn: column, gridRow: row });
  button.addEventListener("pointerdown", () => held.add(name));
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) button.addEventListener(end, () => held.delete(name));
  byId("pad").append(button);
}

views.forEach(({ name }, index) => {
  const button = Object.assign(document.createElement("button"), { textContent: name });
  button.addEventListener("click", () => show(index));
  byId("scenes").append(button);
});

// ---- time ----

let warned;
function warn() {
  byId("edge").hidden = false;
  clearTimeout(warned);
  warned = setTimeout(() => (byId("edge").hidden = true), 900);
}

function move(seconds) {
  const pace = SPEED * seconds * (held.has("fast") ? 2 : 1);
  const ahead = held.has("forward") - held.has("back"), aside = held.has("left") - held.has("right");
  here.yaw += TURN * seconds * (held.has("turnLeft") - held.has("turnRight"));
  const length = Math.hypot(ahead, aside);
  if (length && !views[here.shown]?.still) {
    const c = (Math.cos(here.yaw) * pace) / length, s = (Math.sin(here.yaw) * pace) / length;
    if (walk(c * ahead - s * aside, s * ahead + c * aside)) warn();
  }
  needed ||= held.size > 0;
}

let before = performance.now();
function tick(now) {
  move(Math.min(0.1, Math.max(0, now - before) / 1000));
  before = now;
  if (needed) {
    needed = false;
    draw();
    drawMap();
  }
  requestAnimationFrame(tick);
}

// For tests and for curious consoles: where one is, and whether the picture is complete.
globalThis.viewer = { here, held, show, allowed, walk, redraw: () => (needed = true),
  settled: () => !needed && !byId("message").textContent && (views[here.shown].still ||
    (spark.activeSplats > 0 && !spark.sorting && !spark.sortDirty && !spark.dirty)) };

if (renderer) {
  show(views.length - 1);
  requestAnimationFrame(tick);
}
