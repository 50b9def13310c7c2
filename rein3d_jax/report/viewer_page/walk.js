// Time: one frame after another, drawn where something has changed.
const clock = { before: performance.now(), moved: -Infinity, mapped: -Infinity, place: "", drew: false }; // milliseconds
const MAP_EVERY = 200; // milliseconds; on OpenGL in software the map takes as long as the picture

function tick(now, xrFrame) {
  const seconds = Math.max(0, now - clock.before) / 1000, step = Math.min(0.1, seconds);
  clock.before = now;
  if (renderer.xr.isPresenting) {
    if (xrFrame) visitFrame(xrFrame, step);
    renderer.render(scene, camera);
    return;
  }
  move(step);
  const place = [here.x, here.y, here.yaw, here.pitch, here.fov].join();
  if (place !== clock.place) Object.assign(clock, { place, moved: now });
  const moving = now - clock.moved < 1000 * REST;
  if (moving && clock.drew) adapt(seconds);
  needed ||= !moving && (sharpness.drawn > 0 || clock.mapped < clock.moved);
  clock.drew = needed;
  if (!needed) return;
  needed = false;
  draw(moving ? sharpness.level : 0);
  if (moving && now - clock.mapped < MAP_EVERY) return;
  clock.mapped = now;
  drawMap();
}

// For tests and for curious consoles: where one is, and whether the picture is complete.
globalThis.viewer = { here, held, show, allowed, walk, settled, redraw: () => (needed = true) };

if (renderer) {
  show(follow(location.hash) ?? views.length - 1);
  renderer.setAnimationLoop(tick);
}
