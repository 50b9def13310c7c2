// What is shown, and how sharp.

// Each view: what to call it, and its object in the scene, made when it is first looked at.
const views = data.scenes.map(({ name, spz, url }) => ({ name, make: () => splats(spz, url) }));
if (data.panorama) views.unshift({ name: "Input panorama", still: true, make: sphere });
const still = () => !!views[here.shown]?.still; // a panorama is seen from where it was taken

function say(text, loading = false) {
  byId("message").textContent = text;
  byId("bar").hidden = !loading;
  byId("notice").hidden = !text;
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
  say(view.object ? "" : "Loading", true);
  await new Promise((done) => setTimeout(done)); // let the page say so
  view.made ??= view.make();
  let made;
  try {
    made = await view.made;
  } catch (error) {
    say(`${view.name} could not be shown (${error.message}). Write the page again.`);
    return;
  }
  if (here.shown !== index) return; // another was chosen meanwhile
  if (!made.parent) scene.add(made);
  for (const each of views) if (each.object) each.object.visible = false;
  view.object = made;
  made.visible = true;
  say("");
  needed = true;
}

// While one moves, and frames are slow, the picture has a share of its pixels, and splats end sooner; at rest it has all.
const SHARES = [1, 0.7, 0.5, 0.35];
const FRAME = { hopeless: 1 / 5, slow: 1 / 15, fast: 1 / 50 }; // seconds
const EXTENT = { sharp: Math.sqrt(8), coarse: Math.sqrt(5) }; // standard deviations to which a splat is drawn: Spark's own
const REST = 0.25; // seconds without a move
const sharpness = { level: 0, drawn: 0 };

// `seconds`: since the frame before, or 0 where that one drew nothing.
function adapt(seconds) {
  const last = SHARES.length - 1;
  if (seconds > FRAME.hopeless) sharpness.level = last;
  else if (seconds > FRAME.slow) sharpness.level = Math.min(last, sharpness.level + 1);
  else if (seconds && seconds < FRAME.fast) sharpness.level = Math.max(0, sharpness.level - 1);
}

function draw(level = 0) {
  const { clientWidth: width, clientHeight: height } = byId("view");
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * SHARES[level]);
  if (camera.aspect !== width / height || renderer.domElement.width !== Math.floor(width * renderer.getPixelRatio())) {
    renderer.setSize(width, height, false);
  }
  sharpness.drawn = level;
  spark.maxStdDev = level ? EXTENT.coarse : EXTENT.sharp;
  Object.assign(camera, { aspect: width / height, fov: here.fov });
  camera.updateProjectionMatrix();
  camera.position.set(still() ? 0 : here.x, still() ? 0 : here.y, 0);
  const { x, y, z } = camera.position, flat = Math.cos(here.pitch);
  camera.lookAt(x + Math.cos(here.yaw) * flat, y + Math.sin(here.yaw) * flat, z + Math.sin(here.pitch));
  camera.updateMatrixWorld();
  keepOrder();
  renderer.render(scene, camera);
}

const settled = () => !needed && byId("notice").hidden && sharpness.drawn === 0 && (still() ||
  (spark.activeSplats > 0 && !spark.sorting && !spark.sortDirty && !spark.dirty));
