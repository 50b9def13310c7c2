// Keys, pointers, fingers and gamepads.
const SPEED = 1.2; // metres a second
const TURN = 1.5; // radians a second
const held = new Set(); // what keys and the pad hold down

const KEYS = { KeyW: "forward", ArrowUp: "forward", KeyS: "back", ArrowDown: "back", KeyA: "left", KeyD: "right",
  ArrowLeft: "turnLeft", ArrowRight: "turnRight", PageUp: "lookUp", PageDown: "lookDown", ShiftLeft: "fast", ShiftRight: "fast" };
const COMMANDS = { Home: () => Object.assign(here, HOME), KeyL: () => copyLink(), KeyP: () => savePicture(),
  Equal: () => zoom(-3), Minus: () => zoom(3) };

addEventListener("keydown", (event) => {
  const { code } = event;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(code);
  if (digit) show(digit[1] - 1);
  if (!event.repeat) COMMANDS[code]?.();
  if (KEYS[code]) held.add(KEYS[code]);
  if (/^(?:Arrow|Home|Page)/.test(code)) event.preventDefault();
  needed = true;
});
addEventListener("keyup", ({ code }) => held.delete(KEYS[code]));
addEventListener("blur", () => held.clear());
addEventListener("resize", () => (needed = true));

// One finger, or the mouse, looks; two walk, and zoom as they part.
const view = byId("view");
const fingers = new Map(); // pointer -> where it is
const STRIDE = 0.006; // metres a pixel of two fingers' way

const middle = (axis) => [...fingers.values()].reduce((sum, at) => sum + at[axis], 0) / fingers.size;
const apart = () => Math.hypot(...["x", "y"].map((axis) => [...fingers.values()].reduce((sum, at) => at[axis] - sum, 0)));

view.addEventListener("pointerdown", (event) => {
  view.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
});
for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, ({ pointerId }) => fingers.delete(pointerId));
view.addEventListener("pointermove", (event) => {
  const at = fingers.get(event.pointerId);
  if (!at) return;
  const radians = (here.fov * Math.PI) / 180 / view.clientHeight; // the point under the finger stays there
  const before = { x: middle("x"), y: middle("y"), apart: apart() };
  Object.assign(at, { x: event.clientX, y: event.clientY });
  const right = middle("x") - before.x, down = middle("y") - before.y;
  if (fingers.size === 1) return look(right * radians, down * radians);
  go(-down * STRIDE, -right * STRIDE);
  if (fingers.size === 2) zoom((before.apart - apart()) * 0.1);
});
view.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.sign(event.deltaY) * 3);
}, { passive: false });

const PAD = { forward: ["▲", 2, 1, 1, 0], left: ["◀", 1, 2, 0, 1], back: ["▼", 2, 2, -1, 0], right: ["▶", 3, 2, 0, -1] };
const PACE = 0.3; // metres, of a press that has no length: by a keyboard or a screen reader

for (const [name, [arrow, column, row, ahead, aside]] of Object.entries(PAD)) {
  const button = addButton("pad", arrow, ({ detail }) => detail === 0 && go(PACE * ahead, PACE * aside));
  button.ariaLabel = `Walk ${name}`;
  Object.assign(button.style, { gridColumn: column, gridRow: row });
  button.addEventListener("pointerdown", () => held.add(name));
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) button.addEventListener(end, () => held.delete(name));
}

function addButton(place, textContent, act) {
  const button = Object.assign(document.createElement("button"), { textContent });
  button.addEventListener("click", act);
  byId(place).append(button);
  return button;
}

views.forEach(({ name }, index) => addButton("scenes", name, () => show(index)));

// What all hands ask for, each from -1 to 1. A gamepad's left stick walks, its right one looks, its first button hurries.
const DEAD = 0.15; // of a stick's way, in which it may rest
const stick = (value = 0) => (Math.abs(value) < DEAD ? 0 : value);

function asked() {
  const pad = [...(navigator.getGamepads?.() ?? [])].find((each) => each?.mapping === "standard");
  const [aside, back, turn, down] = (pad?.axes ?? []).map(stick);
  const both = (plus, minus, axis = 0) => between(-1, held.has(plus) - held.has(minus) + axis, 1);
  return {
    ahead: both("forward", "back", -(back ?? 0)), aside: both("left", "right", -(aside ?? 0)),
    turn: both("turnLeft", "turnRight", -(turn ?? 0)), tilt: both("lookUp", "lookDown", -(down ?? 0)),
    fast: held.has("fast") || !!pad?.buttons[0].pressed,
  };
}

// Goes so many metres ahead and to the left of where one looks.
function go(ahead, aside) {
  if (still()) return;
  const c = Math.cos(here.yaw), s = Math.sin(here.yaw);
  if (walk(c * ahead - s * aside, s * ahead + c * aside)) warn();
  needed = true;
}

function move(seconds) {
  const { ahead, aside, turn, tilt, fast } = asked();
  if (turn || tilt) look(TURN * turn * seconds, TURN * tilt * seconds);
  const length = Math.hypot(ahead, aside), pace = (SPEED * seconds * (fast ? 2 : 1)) / Math.max(1, length);
  if (length) go(ahead * pace, aside * pace);
}
