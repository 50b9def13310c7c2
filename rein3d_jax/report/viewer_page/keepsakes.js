// A link that holds the view, and the picture as a file.
// #at=x,y,yaw,pitch,fov,shown: metres, degrees, and which view from 1.
const DEGREE = Math.PI / 180;

function link() {
  const numbers = [here.x.toFixed(2), here.y.toFixed(2), (here.yaw / DEGREE).toFixed(1), (here.pitch / DEGREE).toFixed(1),
    here.fov.toFixed(0), here.shown + 1];
  return `#at=${numbers.map(Number).join(",")}`;
}

// Goes where the address says, as far as one may. The view that it names, or nothing.
function follow(hash) {
  const numbers = hash.startsWith("#at=") ? hash.slice(4).split(",").map(Number) : [];
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return;
  const [x, y, yaw, pitch, fov, shown] = numbers;
  if (allowed(x, y)) Object.assign(here, { x, y });
  Object.assign(here, { yaw: yaw * DEGREE, pitch: between(-LOOK_LIMIT, pitch * DEGREE, LOOK_LIMIT),
    fov: between(FOV.least, fov, FOV.most) });
  needed = true;
  return views[shown - 1] && shown - 1;
}

addEventListener("hashchange", () => show(follow(location.hash)));

let told;
function tell(text) {
  byId("told").textContent = text;
  clearTimeout(told);
  told = setTimeout(() => (byId("told").textContent = ""), 4000);
}

async function copyLink() {
  history.replaceState(null, "", link());
  try {
    await navigator.clipboard.writeText(location.href);
    tell("A link to this view is copied.");
  } catch {
    tell("The address of this page now holds this view: copy it from there.");
  }
}

function savePicture() {
  if (!renderer || renderer.xr.isPresenting) return;
  draw();
  renderer.domElement.toBlob((png) => { // in the same task as drawing, after which a canvas may be empty
    const save = Object.assign(document.createElement("a"), { href: URL.createObjectURL(png), download: "view.png" });
    save.click();
    setTimeout(() => URL.revokeObjectURL(save.href), 10000);
    tell("The picture is saved as view.png.");
  });
}

addButton("tools", "Copy link", copyLink).title = "A link to this view (L)";
addButton("tools", "Save picture", savePicture).title = "This view as a PNG file (P)";
