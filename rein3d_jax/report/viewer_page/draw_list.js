// What Spark draws of its splats: those in sight, in its order, many at once. On OpenGL in software, where each splat
// costs 2 us however few its pixels, and 15 us as an instance of its own, a picture takes a tenth of the time.
const BATCH = 256; // splats an instance

// Splats are drawn in the order of their distance, which no turn changes: Spark need not sort for a new direction.
function keepOrder() {
  camera.getWorldDirection(spark.sortedDir);
}

// A geometry of BATCH splats an instance, their number within it in z; `list`: the uniforms count and, of the splats to
// draw, their numbers.
function drawInBatches(added, list) {
  const slots = [...Array(BATCH).keys()], batch = new libraries.InstancedBufferGeometry();
  const corners = slots.flatMap((slot) => [-1, -1, slot, 1, -1, slot, 1, 1, slot, -1, 1, slot]);
  batch.setAttribute("position", new libraries.BufferAttribute(new Float32Array(corners), 3));
  batch.setIndex(slots.flatMap((slot) => [0, 1, 2, 0, 2, 3].map((corner) => 4 * slot + corner)));
  added.geometry = batch;
  added.material.vertexShader = added.material.vertexShader.replaceAll("gl_InstanceID", "slot").replace(
    "ivec2 orderingCoord", `int slot = gl_InstanceID * ${BATCH} + int(position.z);
      if (slot >= count) return;
      ivec2 orderingCoord`).replace("void main()", "uniform int count;\nvoid main()");
  const { onBeforeRender } = added;
  added.onBeforeRender = (...asked) => {
    onBeforeRender.apply(added, asked);
    list.update(added, asked[2]);
    added.uniforms.count.value = list.count;
    if (list.texture) added.uniforms.ordering.value = list.texture;
    batch.instanceCount = Math.ceil(list.count / BATCH);
  };
}

class DrawList {
  count = 0;
  texture = null; // Spark's empty one, until it has sorted
  #order = new Uint32Array(0); // the numbers of all splats, farthest first
  #clip = new libraries.Matrix4(); // of the last update

  update(added, eye) {
    const mesh = added.display.mapping[0]?.node;
    const clip = new libraries.Matrix4().multiplyMatrices(eye.projectionMatrix, eye.matrixWorldInverse);
    if (mesh) clip.multiply(mesh.matrixWorld);
    if (added.orderingTexture) this.#take(added);
    else if (!this.texture || clip.equals(this.#clip)) return;
    this.#clip = clip;
    const seen = this.texture.image.data;
    if (renderer.xr.isPresenting) seen.set(this.#order.subarray(0, (this.count = added.activeSplats))); // for both eyes
    else this.count = mesh ? inSight(this.#order.subarray(0, added.activeSplats), mesh, clip, seen) : 0;
    this.texture.needsUpdate = true;
  }

  // Spark's order becomes the list's; Spark makes itself another one with its next sort.
  #take(added) {
    const { data, width, height } = added.orderingTexture.image;
    this.#order = data;
    added.orderingTexture.dispose();
    added.orderingTexture = null;
    if (this.texture?.image.data.length === data.length) return;
    this.texture?.dispose();
    this.texture = new libraries.DataTexture(new Uint32Array(data.length), width, height,
      libraries.RGBAIntegerFormat, libraries.UnsignedIntType);
    this.texture.internalFormat = "RGBA32UI";
  }
}

// How many of a mesh's splats have their centres in sight, by the same test as Spark's shader; their numbers in `seen`.
function inSight(order, mesh, { elements: e }, seen) {
  const [words] = mesh.extSplats.extArrays, at = new Float32Array(words.buffer, words.byteOffset, words.length);
  let count = 0;
  for (const splat of order) {
    const x = at[4 * splat], y = at[4 * splat + 1], z = at[4 * splat + 2];
    const edge = spark.clipXY * (e[3] * x + e[7] * y + e[11] * z + e[15]);
    if (Math.abs(e[0] * x + e[4] * y + e[8] * z + e[12]) > edge) continue;
    if (Math.abs(e[1] * x + e[5] * y + e[9] * z + e[13]) <= edge) seen[count++] = splat;
  }
  return count;
}
