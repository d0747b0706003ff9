// The material, the loader and the plugin for three.js in a real Chromium: a sphere looks as btf-view draws it.

import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtemp, readFile, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import { promisify } from 'node:util';
import { Site, launch, native, pictures, skip } from './site.mjs';

const SIZE = 128;
const PAGE = `<!doctype html><link rel="icon" href="data:,"><script type="importmap">${JSON.stringify({
  imports: {
    three: '/npm/three/build/three.webgpu.js',
    'three/webgpu': '/npm/three/build/three.webgpu.js',
    'three/tsl': '/npm/three/build/three.tsl.js',
    'three/addons/': '/npm/three/examples/jsm/',
    'three/examples/jsm/': '/npm/three/examples/jsm/',
    'three-mesh-bvh': '/npm/three-mesh-bvh/src/index.js',
    'three-mesh-bvh/webgpu': '/npm/three-mesh-bvh/src/webgpu/index.js',
    'three-gpu-pathtracer/webgpu': '/npm/three-gpu-pathtracer/src/webgpu/index.js',
    'three-gpu-pathtracer/src/': '/npm/three-gpu-pathtracer/src/',
    // A denoiser, which nothing here asks for.
    'oidn-web': 'data:text/javascript,export const initUNetFromURL = undefined;',
    'btf-runtime/': '/package/',
  },
})}</script>`;
const WEAVE = new URL('../../src/scene/builtin/weave.spmm', import.meta.url);

let site;
let browser;

before(async () => {
  if (!skip) {
    site = await new Site().start();
    site.files.set('/three.html', Buffer.from(PAGE));
    site.files.set('/weave.spmm', await readFile(WEAVE));
    browser = await launch();
  }
});

after(async () => {
  await browser?.close();
  site?.stop();
});

async function open() {
  const page = await browser.newPage();
  page.errors = [];
  page.on('pageerror', (error) => page.errors.push(String(error)));
  page.on('console', (message) => message.type() === 'error' && page.errors.push(message.text()));
  await page.goto(`${site.url}three.html`);
  await page.evaluate((size) => {
    // Returns a renderer, and the camera and the light of the scene below around an object.
    window.stage = async (THREE, object) => {
      const renderer = new THREE.WebGPURenderer({ antialias: false });
      renderer.setSize(size, size);
      await renderer.init();
      const scene = new THREE.Scene();
      scene.background = new THREE.Color(0, 0, 0);
      const light = new THREE.PointLight(0xffffff, 30);
      light.position.set(2, 3, 4);
      scene.add(object, light);
      const camera = new THREE.PerspectiveCamera(40, 1, 0.1, 100);
      camera.position.set(0.5, 0.6, 3.4);
      camera.lookAt(0, 0, 0);
      scene.updateMatrixWorld(true);
      camera.updateMatrixWorld(true);
      return { renderer, scene, camera };
    };
    window.draw = async (THREE, object) => {
      const { renderer, scene, camera } = await window.stage(THREE, object);
      return window.read(THREE, renderer, () => renderer.render(scene, camera));
    };
    // Returns what is drawn, 8-bit sRGB.
    window.read = async (THREE, renderer, draw) => {
      const target = new THREE.RenderTarget(size, size, { type: THREE.FloatType });
      renderer.setRenderTarget(target);
      draw();
      const linear = await renderer.readRenderTargetPixelsAsync(target, 0, 0, size, size);
      const encode = (x) => Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
      const pixels = [];
      for (let i = 0; i < 4 * size * size; i += 4) {
        pixels.push(...[0, 1, 2].map((channel) => encode(Math.min(Math.max(linear[i + channel], 0), 1))));
      }
      renderer.dispose();
      return pixels;
    };
    window.pixelsOf = async (url) => {
      const bitmap = await createImageBitmap(await (await fetch(url)).blob());
      const context = new OffscreenCanvas(size, size).getContext('2d');
      context.drawImage(bitmap, 0, 0);
      return [...context.getImageData(0, 0, size, size).data].filter((_, i) => i % 4 !== 3);
    };
    window.pngOf = async (pixels) => {
      const rgba = new Uint8ClampedArray(4 * size * size).fill(255);
      pixels.forEach((value, i) => { rgba[4 * Math.floor(i / 3) + i % 3] = value; });
      const canvas = new OffscreenCanvas(size, size);
      canvas.getContext('2d').putImageData(new ImageData(rgba, size), 0, 0);
      return [...new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer())];
    };
    window.psnr = (a, b) => {
      const sum = a.reduce((sum, value, i) => sum + (value - b[i]) ** 2, 0);
      return 10 * Math.log10(255 ** 2 * a.length / Math.max(sum, 1e-9));
    };
  }, SIZE);
  return page;
}

// The sphere as OBJ.
function sphere(page) {
  return page.evaluate(async () => {
    const THREE = await import('three/webgpu');
    const { OBJExporter } = await import('three/addons/exporters/OBJExporter.js');
    return new OBJExporter().parse(new THREE.Mesh(new THREE.SphereGeometry(1, 96, 48)));
  });
}

// The picture of the same by btf-view, of a mesh in OBJ.
async function reference(name, obj, frames, more = []) {
  const folder = await mkdtemp(join(tmpdir(), 'btf-three-'));
  await writeFile(join(folder, 'sphere.obj'), obj);
  await writeFile(join(folder, 'weave.spmm'), await readFile(WEAVE));
  await writeFile(join(folder, 'scene.toml'), `background = [0, 0, 0]
[[material]]\nname = "weave"\nasset = "weave.spmm"
[[object]]\nmesh = "sphere.obj"\nmaterial = "weave"
[[light]]\nposition = [2, 3, 4]\nintensity = [30, 30, 30]
[camera]\neye = [0.5, 0.6, 3.4]\ntarget = [0, 0, 0]\nfov_deg = 40\n`);
  const options = ['--size', `${SIZE}x${SIZE}`, '--filter', 'nearest', '--frames', `${frames}`];
  return native(name, ['--scene', join(folder, 'scene.toml'), ...options, ...more]);
}

test('a sphere in three.js is that of btf-view', { skip }, async (t) => {
  const page = await open();
  const url = await reference('three', await sphere(page), 1);
  const { whole, derived, plain, png } = await page.evaluate(async (url) => {
    const THREE = await import('three/webgpu');
    const { BtfLoader } = await import('btf-runtime/three.js');
    const loader = new BtfLoader();
    const material = await loader.loadAsync('/weave.spmm');
    const geometry = new THREE.SphereGeometry(1, 96, 48);
    const expected = await window.pixelsOf(url);
    let pixels;
    const compare = async (geometry, material) => {
      pixels = await window.draw(THREE, new THREE.Mesh(geometry, material));
      return window.psnr(pixels, expected);
    };
    const derived = await compare(geometry, material);
    const tangents = geometry.clone();
    tangents.computeTangents();
    const whole = await compare(tangents, material);
    const png = await window.pngOf(pixels);
    const few = material.clone();
    few.components = 0;
    const plain = await compare(tangents, few);
    loader.dispose();
    return { whole, derived, plain, png };
  }, url);
  await writeFile(join(pictures, 'in_three.png'), Buffer.from(png));
  assert.deepEqual(page.errors, []);
  t.diagnostic(`${whole.toFixed(1)} dB, ${derived.toFixed(1)} without tangents, ${plain.toFixed(1)} without the residual`);
  assert.ok(whole >= 40, `${whole} dB`);
  assert.ok(derived >= 38, `${derived} dB without tangents`);
  assert.ok(plain < whole - 6, `planted: ${plain} dB without the residual`);
  await page.close();
});

test('a sphere in three-gpu-pathtracer is that of btf-view', { skip }, async (t) => {
  const page = await open();
  const obj = await sphere(page);
  const urls = [await reference('traced', obj, 16), await reference('traced_lobes', obj, 16, ['--components', '0'])];
  const { traced, plain, png } = await page.evaluate(async (urls) => {
    const THREE = await import('three/webgpu');
    const { texture } = await import('three/tsl');
    const { WebGPUPathTracer } = await import('three-gpu-pathtracer/webgpu');
    const { BtfLoader } = await import('btf-runtime/three.js');
    const { BtfPathTracingMaterial } = await import('btf-runtime/three_path_tracer.js');
    const { words } = await new BtfLoader().loadAsync('/weave.spmm');
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(1, 96, 48), new THREE.MeshPhysicalMaterial());
    const { renderer, scene, camera } = await window.stage(THREE, mesh);
    const pathTracer = new WebGPUPathTracer(renderer);
    const btf = new BtfPathTracingMaterial(pathTracer.getMaterial());
    mesh.geometry = btf.prepare(mesh.geometry);
    mesh.material = btf.add(words);
    pathTracer.setMaterial(btf);
    pathTracer.useMegakernel(true);
    Object.assign(pathTracer, {
      maxBounces: 1, maxSamples: 16, renderToCanvas: false, renderDelay: 0, dynamicLowRes: false, filterGlossyFactor: 0,
    });
    pathTracer.setScene(scene, camera);
    while ((await pathTracer.getSampleCountsAsync()).min < 16) {
      pathTracer.renderSample();
    }
    const shown = new THREE.MeshBasicNodeMaterial();
    shown.colorNode = texture(pathTracer.target);
    const pixels = await window.read(THREE, renderer, () => new THREE.QuadMesh(shown).render(renderer));
    const [traced, plain] = await Promise.all(urls.map(async (url) => window.psnr(pixels, await window.pixelsOf(url))));
    return { traced, plain, png: await window.pngOf(pixels) };
  }, urls);
  await writeFile(join(pictures, 'in_path_tracer.png'), Buffer.from(png));
  t.diagnostic(`${traced.toFixed(1)} dB, ${plain.toFixed(1)} of lobes alone`);
  assert.deepEqual(page.errors, []);
  assert.ok(traced >= 45, `${traced} dB`);
  assert.ok(plain < traced - 10, `planted: ${plain} dB of lobes alone`);
  await page.close();
});

test('a glTF file shows the asset that its material names, or its fallback', { skip }, async () => {
  const page = await open();
  const folder = await mkdtemp(join(tmpdir(), 'btf-three-'));
  const weave = new URL(WEAVE).pathname;
  await promisify(execFile)(process.env.BTF_FIT, ['export-gltf', weave, '-o', join(folder, 'weave.glb'), '--embed']);
  site.files.set('/weave.glb', await readFile(join(folder, 'weave.glb')));
  // Type, words and texels of the material that a file's mesh gets.
  const material = (url) => page.evaluate(async (url) => {
    const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');
    const { GLTFBtfExtension } = await import('btf-runtime/three.js');
    const loader = new GLTFLoader().register((parser) => new GLTFBtfExtension(parser));
    const { scene } = await loader.loadAsync(url);
    let material;
    scene.traverse((object) => { material ??= object.material; });
    return { type: material.type, words: material.words?.length, width: material.userData.btf?.width };
  }, url);
  const told = await material('/weave.glb');
  assert.equal(told.type, 'BtfNodeMaterial');
  assert.ok(told.words > 1000 && told.width === 64, JSON.stringify(told));
  // Damaged, the file's own textures are what is left.
  const damaged = Buffer.from(site.files.get('/weave.glb'));
  damaged[damaged.lastIndexOf('SPMM') + 30_000] ^= 1;
  site.files.set('/damaged.glb', damaged);
  assert.match((await material('/damaged.glb')).type, /^Mesh(Physical|Standard)Material$/);
  await page.close();
});
