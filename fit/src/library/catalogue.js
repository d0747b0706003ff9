"use strict";
// MATERIALS are the materials, ALIKE is how many like one are listed, PIXELS the height of a picture.
const PAGE = 120;
const element = (id) => document.getElementById(id);
let shown = PAGE;
// The material that others are compared with, if any.
let like = null;

// Features with unit variance over the library, so that none counts for its unit alone.
const fitted = MATERIALS.filter((material) => material.asset);
const length = fitted.length ? fitted[0].asset.features.length : 0;
for (let i = 0; i < length; i++) {
  const values = fitted.map((material) => material.asset.features[i]);
  const mean = values.reduce((sum, x) => sum + x, 0) / values.length;
  const variance = values.reduce((sum, x) => sum + (x - mean) ** 2, 0) / values.length;
  const scale = variance > 1e-12 ? 1 / Math.sqrt(variance) : 0;
  fitted.forEach((material) => (material.asset.features[i] = (material.asset.features[i] - mean) * scale));
}
const distance = (a, b) => a.asset.features.reduce((sum, x, i) => sum + (x - b.asset.features[i]) ** 2, 0);

const size = (bytes) => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(2)} MB`);

function chosen() {
  if (like) {
    const others = fitted.filter((material) => material !== like).sort((a, b) => distance(a, like) - distance(b, like));
    return [like, ...others.slice(0, ALIKE)];
  }
  const words = element("find").value.toLowerCase().split(/\s+/).filter(Boolean);
  const status = element("status").value;
  const found = MATERIALS.filter((material) => {
    const text = `${material.name} ${material.asset ? material.asset.families : ""}`.toLowerCase();
    return (!status || material.status === status) && words.every((word) => text.includes(word));
  });
  const key = element("sort").value;
  const sign = element("descending").checked ? -1 : 1;
  if (key === "name") return sign > 0 ? found : found.reverse();
  // What has no such figure comes last, whichever way it is sorted.
  const figure = (material) => (material.asset && material.asset[key] !== null ? sign * material.asset[key] : Infinity);
  return found.sort((a, b) => (figure(a) === figure(b) ? 0 : figure(a) < figure(b) ? -1 : 1));
}

function line(parent, tag, text, name) {
  const child = document.createElement(tag);
  child.textContent = text;
  if (name) child.className = name;
  return parent.appendChild(child);
}

function card(material) {
  const card = document.createElement("div");
  card.className = "material";
  const asset = material.asset;
  if (asset) {
    const picture = card.appendChild(document.createElement("img"));
    picture.alt = `${material.name} on three shapes`;
    picture.height = PIXELS;
    picture.src = `data:image/jpeg;base64,${asset.picture}`;
  }
  line(card, "b", material.name);
  if (material.status !== "fitted") line(card, "span", material.reason ? `${material.status}: ${material.reason}` : material.status, "reason");
  if (asset) {
    const error = asset.psnr === null ? "exact" : `${asset.psnr.toFixed(2)} dB`;
    line(card, "span", `${size(asset.bytes)}, ${error}, energy × ${asset.energy.toFixed(3)}`);
    line(card, "span", `${asset.size.join(" × ")} texels, ${asset.layers === 1 ? "1 layer" : `${asset.layers} layers`}, ${asset.seconds.toFixed(1)} s`);
    line(card, "span", asset.families);
    asset.remarks.forEach((remark) => line(card, "span", remark, "reason"));
    const button = line(card, "button", like === material ? "Back to all" : "Materials like this one");
    button.onclick = () => {
      like = like === material ? null : material;
      shown = PAGE;
      draw();
      scrollTo(0, 0);
    };
  }
  return card;
}

function draw() {
  const found = chosen();
  element("materials").replaceChildren(...found.slice(0, shown).map(card));
  element("more").hidden = found.length <= shown;
  element("told").textContent = like ? `the most like ${like.name}` : `${found.length} of ${MATERIALS.length}`;
}

for (const id of ["find", "sort", "descending", "status"]) {
  element(id).addEventListener("input", () => {
    like = null;
    shown = PAGE;
    draw();
  });
}
element("more").onclick = () => {
  shown += PAGE;
  draw();
};
draw();
