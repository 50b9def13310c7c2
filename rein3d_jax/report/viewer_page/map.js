// The map of the room: x up the page, y to the left.
const LETTER = parseFloat(getComputedStyle(document.documentElement).fontSize); // pixels: grows with the screen
const PIXELS = (matchMedia("(max-width: 640px)").matches ? 7.3 : 12.7) * LETTER; // longer side
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
  const map = byId("map"), sharp = devicePixelRatio;
  const pen = map.getContext("2d", { willReadFrequently: true }); // by the CPU: half the cost of a frame without a GPU
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
  const place = still() ? [0, 0] : [here.x, here.y];
  const [x, y] = toMap(place), half = Math.atan(Math.tan((here.fov * Math.PI) / 360) * camera.aspect);
  const up = -Math.PI / 2 - here.yaw;
  pen.beginPath(); pen.moveTo(x, y); pen.arc(x, y, 26, up - half, up + half);
  pen.fillStyle = "rgb(255 214 102 / 55%)"; pen.fill();
  pen.beginPath(); pen.arc(x, y, 4.5, 0, 7); pen.fillStyle = "#ffd666"; pen.fill();
  pen.strokeStyle = "#1d2226"; pen.lineWidth = 1.5; pen.stroke();
}

byId("map").addEventListener("click", ({ offsetX, offsetY }) => {
  const x = frame.high[0] - offsetY / scale, y = frame.high[1] - offsetX / scale;
  jump(x, y);
});
