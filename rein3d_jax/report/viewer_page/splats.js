// Spark, and the splats in it.
const renderer = createRenderer();
const scene = new libraries.Scene();
const camera = new libraries.PerspectiveCamera(here.fov, 1, 0.01, 200);
camera.up.set(0, 0, 1);
const rig = new libraries.Group(); // carries the camera in a headset, else the identity
rig.add(camera);
scene.add(rig);
const spark = renderer && addSpark();

function createRenderer() {
  try {
    const made = new libraries.WebGLRenderer({ canvas: byId("view"), antialias: false });
    made.setClearColor(new libraries.Color().setRGB(...data.backdrop, libraries.SRGBColorSpace));
    return made;
  } catch {
    say("This browser shows no WebGL 2, which the scene needs. Try another browser or computer.");
  }
}

function addSpark() {
  // blurAmount: the pixels^2 by which rein3d_jax widens a splat on the screen, its opacity scaled to match.
  const { kind, variance } = data.pixelFilter;
  const added = new libraries.SparkRenderer({ renderer, onDirty: () => (needed = true), accumExtSplats: true,
    blurAmount: variance, minAlpha: 1 / 255, extraUniforms: { count: { value: 0 } } });
  if (kind === "least") widenToAPixel(added);
  drawInBatches(added, new DrawList());
  scene.add(added);
  return added;
}

// Spark adds a pixel's variance to every splat's a, b, d; this is rein3d_jax.rasterize.pixel_filter's `least`.
function widenToAPixel(added) {
  const sum = /a \+= fullBlurAmount;\s*d \+= fullBlurAmount;\s*float det = a \* d - b \* b;/;
  if (!sum.test(added.material.vertexShader)) throw Error("Spark's shader widens splats in another way");
  added.material.vertexShader = added.material.vertexShader.replace(sum, `
    float size = a + d + fullBlurAmount, v = fullBlurAmount / size, trace = (a + d) / size, q = detOrig / (size * size);
    float squares = max(trace * trace - 2.0 * q, 0.5 * trace * trace);
    float root = sqrt(q * q + v * v * squares + v * v * v * v), rest = v * v - q + root;
    float scale = inversesqrt(squares + 2.0 * v * v + 2.0 * root);
    a = scale * (trace * a + size * rest);
    b = scale * trace * b;
    d = scale * (trace * d + size * rest);
    float det = size * size * root;`);
}

const bytes = (base64) => Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));

async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
  const whole = Number(answer.headers.get("content-length")), parts = [];
  let size = 0;
  for (const reader = answer.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) return new Uint8Array(await new Blob(parts).arrayBuffer());
    parts.push(value);
    if (whole) byId("bar").value = (size += value.length) / whole;
  }
}

async function splats(spz, url) {
  const fileBytes = url ? await fetched(url) : bytes(spz);
  byId("bar").removeAttribute("value"); // Spark does not say how far it is
  const mesh = new libraries.SplatMesh({ fileBytes, fileType: libraries.SplatFileType.SPZ, extSplats: true });
  await mesh.initialized;
  return mesh;
}
