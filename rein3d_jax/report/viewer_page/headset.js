// In a headset (WebXR): left thumbstick walks, right one turns by steps; press and release the trigger, or pinch, to go
// where the ray meets the floor. Nothing leaves the safe area: at its edge the world comes along with a real step.
const STEP = Math.PI / 6; // a snap turn
const TELEPORT = 10; // metres at most
const OK = 0x7fd1c2, NO = 0xe2725b;
const visit = { yaw: 0, armed: true, floor: -1.5, aiming: null, at: null, target: null,
  budget: 500_000 }; // splats, what Spark allows a standalone headset; of more it makes a coarser tree

const { Matrix4, Quaternion, Vector3 } = libraries;
// XR's right, up and back in the world: -y, z, -x.
const WORLD_FROM_XR = new Quaternion().setFromRotationMatrix(
  new Matrix4().makeBasis(new Vector3(0, -1, 0), new Vector3(0, 0, 1), new Vector3(-1, 0, 0)));
const UP = new Vector3(0, 0, 1);

function line(points, closed = false) {
  const material = new libraries.LineBasicMaterial({ color: OK, depthTest: false, transparent: true });
  const made = new (closed ? libraries.LineLoop : libraries.Line)(new libraries.BufferGeometry().setFromPoints(points), material);
  made.renderOrder = 1; // after the splats, which write no depth
  return made;
}

const ring = new libraries.Mesh(new libraries.RingGeometry(0.15, 0.2, 32),
  new libraries.MeshBasicMaterial({ depthTest: false, transparent: true, side: libraries.DoubleSide }));
ring.renderOrder = 1;
const edge = line(data.safe.map(([x, y]) => new Vector3(x, y, 0)), true);
for (const sign of [ring, edge]) scene.add(Object.assign(sign, { visible: false }));

for (const index of renderer ? [0, 1] : []) {
  const ray = renderer.xr.getController(index); // moves by itself
  ray.add(line([new Vector3(), new Vector3(0, 0, -1)]));
  ray.addEventListener("selectstart", () => (visit.aiming = ray));
  ray.addEventListener("selectend", () => {
    if (visit.aiming === ray && visit.target && allowed(...visit.target)) [here.x, here.y] = visit.target;
    visit.aiming = null;
  });
  rig.add(ray);
}

// The floor: where most splats of the safe area lie, below the eyes, to 5 cm.
function floorOf(mesh) {
  const shelves = new Map(), stride = Math.ceil(mesh.numSplats / 20_000);
  mesh.forEachSplat((index, { x, y, z }) => {
    if (index % stride || z > -0.5 || !inside(data.safe, x, y)) return;
    const shelf = Math.round(z * 20) / 20;
    shelves.set(shelf, (shelves.get(shelf) ?? 0) + 1);
  });
  return [...shelves].reduce((best, each) => (each[1] > best[1] ? each : best), [-1.5, 0])[0];
}

async function enter() {
  const session = await navigator.xr.requestSession("immersive-vr", { requiredFeatures: ["local-floor"] });
  renderer.xr.enabled = true;
  renderer.xr.setFramebufferScaleFactor(0.5); // as Spark does
  await renderer.xr.setSession(session);
  if (still()) await show(views.length - 1);
  const mesh = await views[here.shown].made;
  if (!renderer.xr.isPresenting) return; // left meanwhile
  Object.assign(visit, { yaw: here.yaw, floor: floorOf(mesh), at: null });
  edge.position.z = ring.position.z = visit.floor + 0.01;
  edge.visible = true;
  headset.textContent = "Leave VR";
  Object.assign(spark, { maxStdDev: EXTENT.coarse, lodSplatCount: visit.budget }); // as Spark advises
  if (mesh.numSplats > visit.budget && !mesh.extSplats.lodSplats) await mesh.createLodSplats();
  mesh.enableLod = true;
}

function leave() {
  rig.position.set(0, 0, 0);
  rig.quaternion.identity();
  edge.visible = ring.visible = false;
  renderer.xr.enabled = false;
  headset.textContent = "Enter VR";
  for (const { object } of views) if (object) object.enableLod = false;
  Object.assign(visit, { at: null, aiming: null, target: null });
  here.pitch = 0;
  needed = true;
}

// One frame in the headset.
function visitFrame(frame, seconds) {
  const pose = frame.getViewerPose(renderer.xr.getReferenceSpace())?.transform;
  if (!pose) return;
  const turned = () => rig.quaternion.setFromAxisAngle(UP, visit.yaw).multiply(WORLD_FROM_XR);
  const head = () => new Vector3().copy(pose.position).applyQuaternion(turned());
  const ahead = new Vector3(0, 0, -1).applyQuaternion(new Quaternion().copy(pose.orientation)).applyQuaternion(turned());
  here.yaw = Math.atan2(ahead.y, ahead.x);
  const at = head();
  if (visit.at) walk(at.x - visit.at.x, at.y - visit.at.y); // a real step
  sticks(seconds);
  visit.at = head(); // after a snap turn about it
  rig.position.set(here.x - visit.at.x, here.y - visit.at.y, visit.floor);
  aim();
}

function sticks(seconds) {
  for (const { handedness, gamepad } of renderer.xr.getSession().inputSources) {
    const [aside = 0, back = 0] = (gamepad?.axes.slice(-2) ?? []).map(stick);
    if (handedness === "left") go(-back * SPEED * seconds, -aside * SPEED * seconds);
    else if (Math.abs(aside) > 0.7 && visit.armed) {
      visit.yaw -= Math.sign(aside) * STEP;
      visit.armed = false;
    } else if (Math.abs(aside) < 0.3) visit.armed = true;
  }
}

function aim() {
  const from = new Vector3(), along = new Vector3(0, 0, -1);
  visit.target = null;
  if (visit.aiming) {
    visit.aiming.getWorldPosition(from);
    along.applyQuaternion(visit.aiming.getWorldQuaternion(new Quaternion()));
    const metres = (visit.floor - from.z) / along.z;
    if (metres > 0 && metres < TELEPORT) visit.target = [from.x + metres * along.x, from.y + metres * along.y];
  }
  ring.visible = !!visit.target;
  if (!visit.target) return;
  [ring.position.x, ring.position.y] = visit.target;
  ring.material.color.set(allowed(...visit.target) ? OK : NO);
}

const headset = addButton("tools", "Enter VR", () => {
  if (renderer.xr.isPresenting) renderer.xr.getSession().end();
  else enter().catch((error) => tell(`The headset did not start: ${error.message}`));
});
renderer?.xr.addEventListener("sessionend", leave);

async function offer() {
  headset.hidden = !renderer || !(await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false));
}
headset.hidden = true;
navigator.xr?.addEventListener("devicechange", offer);
offer();
