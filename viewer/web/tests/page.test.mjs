// The viewer's page in a real Chromium: what it draws, loads, saves and says.

import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtemp, readFile, readdir, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import { promisify } from 'node:util';
import { Site, beginTrace, drawn, endOfTrace, launch, line, native, open, pictures, skip } from './site.mjs';

const UNSEEN = '<!doctype html><link rel="icon" href="data:,"><script type="module" src="btf_view.js"></script><btf-view style="display: none"></btf-view>';

let site;
let browser;

before(async () => {
  if (!skip) {
    site = await new Site().start();
    site.files.set('/unseen.html', Buffer.from(UNSEEN));
    browser = await launch();
  }
});

after(async () => {
  await browser?.close();
  site?.stop();
});

// Root mean square difference of the picture that the element draws and one of the server's, as parts of white.
function rmse(page, picture, options) {
  return page.evaluate(async ({ url, options }) => {
    const pixels = async (blob) => {
      const bitmap = await createImageBitmap(blob);
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    };
    const [own, other] = await Promise.all([
      document.querySelector('btf-view').picture(options).then(pixels),
      fetch(url).then((response) => response.blob()).then(pixels),
    ]);
    if (own.length !== other.length) {
      throw new Error('the pictures are of different sizes');
    }
    let sum = 0;
    for (let i = 0; i < own.length; i += 1) {
      sum += i % 4 === 3 ? 0 : (own[i] - other[i]) ** 2;
    }
    return Math.sqrt(sum / (own.length * 0.75)) / 255;
  }, { url: picture, options });
}

// A page whose element is not seen, and not drawn therefore.
function unseen() {
  return open(browser, `${site.url}unseen.html`);
}

function set(page, attributes) {
  return page.evaluate((attributes) => {
    const view = document.querySelector('btf-view');
    for (const [name, value] of Object.entries(attributes)) {
      if (value === null) {
        view.removeAttribute(name);
      } else {
        view.setAttribute(name, value);
      }
    }
  }, attributes);
}

test('the gallery loads tier by tier', { skip }, async () => {
  const page = await open(browser, `${site.url}#asset=gallery/cloth.spmm`);
  await page.waitForFunction(() => window.told.loaded.some(({ isWhole }) => isWhole), undefined, { timeout: 240_000 });
  await drawn(page, 2);
  const { loaded } = await page.evaluate(() => window.told);
  assert.equal(loaded.length, 4);
  assert.ok(loaded[0].bytes < 0.1 * loaded.at(-1).bytes, 'the first tier is small');
  assert.deepEqual(page.errors, []);
  await page.screenshot({ path: join(pictures, 'wide.png') });
  // What the sender saw is in the address.
  await page.mouse.move(120, 280);
  await page.mouse.down();
  await page.mouse.move(170, 300, { steps: 4 });
  await page.mouse.up();
  await page.waitForFunction(() => location.hash.includes('camera'), undefined, { timeout: 60_000 });
  const [saved] = await Promise.all([page.waitForEvent('download', { timeout: 120_000 }), page.keyboard.press('p')]);
  assert.match(saved.suggestedFilename(), /^btf-view_\d+\.png$/);
  const sent = page.url();
  await page.context().close();
  const other = await open(browser, sent);
  await drawn(other);
  await other.waitForFunction((sent) => location.href === sent, sent, { timeout: 60_000 });
  await other.context().close();
});

test('an asset of more than 2 MB never keeps the page waiting', { skip }, async (t) => {
  // What the measurement of a GPU draws with where it is given no asset: random content, as large as measured ones.
  const folder = await mkdtemp(join(tmpdir(), 'btf-page-'));
  await promisify(execFile)(process.env.BTF_VIEW, ['bench', 'gpu', '-o', folder, '--only', 'adapter', '--quiet']);
  const [name] = (await readdir(folder)).filter((name) => name.endsWith('.spmm'));
  const asset = await readFile(join(folder, name));
  assert.ok(asset.length > 2e6, `${asset.length} bytes`);
  site.files.set('/large.spmm', asset);
  // The page stands, as for who clicks in its gallery.
  const page = await open(browser, site.url);
  await drawn(page);
  await beginTrace(browser);
  await set(page, { src: 'large.spmm' });
  await page.waitForFunction(() => window.told.loaded.some(({ bytes, isWhole }) => isWhole && bytes > 2e6), undefined, {
    timeout: 240_000,
  });
  const longest = await endOfTrace(browser, page);
  t.diagnostic(`longest task of the page: ${longest.toFixed(1)} ms while ${asset.length} bytes load`);
  assert.ok(longest > 0.1 && longest <= 50, `a task of ${longest} ms keeps the page waiting`);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test('pictures are those of btf-view', { skip }, async (t) => {
  const page = await unseen();
  const options = { width: 96, height: 80, samples: 2 };
  const size = ['--size', '96x80', '--frames', '2'];
  const weave = new URL('../../src/scene/builtin/weave.spmm', import.meta.url).pathname;
  const sphere = await native('sphere', [weave, '--mesh', 'sphere', ...size]);
  await set(page, { mesh: 'sphere' });
  const same = await rmse(page, sphere, options);
  assert.ok(same <= 1 / 255, `sphere: ${255 * same} of 255`);
  await set(page, { mesh: 'shoe' });
  const other = await rmse(page, sphere, options);
  assert.ok(other > 4 / 255, 'planted: another shape');
  const shoe = await rmse(page, await native('shoe', [weave, '--mesh', 'shoe', ...size]), options);
  assert.ok(shoe <= 1 / 255, `shoe: ${255 * shoe} of 255`);
  await set(page, { mesh: null, landscape: 'grove' });
  await page.waitForFunction(() => document.querySelector('btf-view').shadowRoot.querySelector('p').textContent === '');
  const grove = await rmse(page, await native('grove', ['scene', 'grove', ...size]), options);
  assert.ok(grove <= 1 / 255, `grove: ${255 * grove} of 255`);
  // A canopy of meshes whose leaves have live optics, by a file of its own, here without textures.
  const folder = await mkdtemp(join(tmpdir(), 'btf-page-'));
  const [model, leaf] = ['canopy.glb', 'canopy-leaf.toml'].map((name) => join(folder, name));
  await promisify(execFile)(process.env.BTF_SYNTH, ['plants', model, '--triangles', '20000']);
  await writeFile(leaf, (await readFile(leaf, 'utf8')).replace(/^textures.*$/m, ''));
  const daylight = { daylight: '2026-06-21T10:00+02:00', place: '52.5,13.4' };
  const sky = Object.entries(daylight).flatMap(([name, value]) => [`--${name}`, value]);
  await page.evaluate(async (files) => {
    const file = ([name, bytes]) => new File([new Uint8Array(bytes)], name);
    await document.querySelector('btf-view').open(files.map(file));
  }, [['canopy.glb', [...await readFile(model)]], ['canopy-leaf.toml', [...await readFile(leaf)]]]);
  await set(page, { landscape: null, mesh: 'canopy.glb', ...daylight });
  const canopy = await rmse(page, await native('canopy', ['--mesh', model, ...sky, ...size]), options);
  t.diagnostic(`of 255: sphere ${255 * same}, shoe ${255 * shoe}, grove ${255 * grove}, canopy ${255 * canopy}`);
  assert.ok(canopy <= 1 / 255, `canopy: ${255 * canopy} of 255`);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test('white surfaces in white light are not to be seen', { skip }, async () => {
  const page = await unseen();
  const light = [...Buffer.from('#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n'), ...new Array(32).fill(128)];
  // Mean and range of the values of a sphere of so much reflectance in light of radiance 0.5, which is 187.5 of 255.
  const values = (reflectance) => page.evaluate(async ({ light, reflectance }) => {
    const view = document.querySelector('btf-view');
    const scene = `[environment]\nfile = "white.hdr"\n[[material]]\nname = "white"\ndiffuse = [${reflectance}]
      [[object]]\nmesh = "sphere"\nmaterial = "white"\n`;
    const name = `furnace_${reflectance[0]}.toml`;
    await view.open([new File([scene], name), new File([new Uint8Array(light)], 'white.hdr')]);
    view.setAttribute('scene', name);
    view.view = '{"paths":[true,4]}';
    const bitmap = await createImageBitmap(await view.picture({ width: 48, height: 48, samples: 32 }));
    const context = new OffscreenCanvas(48, 48).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const values = context.getImageData(0, 0, 48, 48).data.filter((_, i) => i % 4 !== 3);
    return [values.reduce((sum, value) => sum + value, 0) / values.length, Math.min(...values), Math.max(...values)];
  }, { light, reflectance });
  const [mean, least, most] = await values([1, 1, 1]);
  assert.ok(Math.abs(mean - 187.5) < 0.6 && least > 176 && most < 199, `${mean}, from ${least} to ${most}`);
  const [darker] = await values([0.9, 0.9, 0.9]);
  assert.ok(darker < 185, `planted: ${darker} of grey surfaces`);
  await page.context().close();
});

test('a server without ranges and one that breaks off serve as well', { skip }, async () => {
  const asset = await readFile(join(process.env.BTF_WEB_PAGE, 'gallery/leather.spmm'));
  site.files.set('/far/leather.spmm', asset);
  const whole = (page) => page.waitForFunction(() => window.told.loaded.at(-1)?.isWhole, undefined, { timeout: 240_000 });
  site.hasRanges = false;
  let page = await open(browser, `${site.url}?asset=far/leather.spmm`);
  await whole(page);
  await page.context().close();
  Object.assign(site, { hasRanges: true, cuts: 2, broken: 0, asked: [] });
  page = await open(browser, `${site.url}?asset=far/leather.spmm`);
  await whole(page);
  assert.equal(site.broken, 2);
  // No byte was asked for twice that had come.
  const starts = site.asked.map(([from]) => from);
  assert.deepEqual(starts, [...starts].sort((a, b) => a - b));
  assert.equal(await line(page), '');
  await page.context().close();
});

test('files that are damaged or foreign get a sentence, and the page lives on', { skip }, async () => {
  const page = await open(browser, `${site.url}#leaf=maize`);
  const drop = (name, bytes) => page.evaluate(async ({ name, bytes }) => {
    await document.querySelector('btf-view').open([new File([new Uint8Array(bytes)], name)]);
  }, { name, bytes: [...bytes] });
  const weave = await readFile(new URL('../../src/scene/builtin/weave.spmm', import.meta.url));
  const damaged = Buffer.from(weave);
  damaged[30_000] ^= 1;
  for (const [name, bytes, said] of [
    ['cut.spmm', weave.subarray(0, 20_001), /cut\.spmm: .*bytes/],
    ['damaged.spmm', damaged, /damaged\.spmm: .*checksum/i],
    ['picture.spmm', Buffer.from('a picture of a cat'), /picture\.spmm: /],
  ]) {
    await drop(name, bytes);
    await page.waitForFunction((said) => new RegExp(said, 'i').test(
      document.querySelector('btf-view').shadowRoot.querySelector('p').textContent), said.source, { timeout: 60_000 });
  }
  await drop('none.txt', Buffer.from('x'));
  await page.waitForFunction(() => window.told.messages.some((text) => /none\.txt/.test(text)), undefined, { timeout: 60_000 });
  // A file may come before the program is there.
  const early = await page.evaluate((bytes) => new Promise((resolve, reject) => {
    const view = document.createElement('btf-view');
    view.addEventListener('loaded', ({ detail }) => {
      view.remove();
      resolve(detail.name);
    }, { once: true });
    document.body.append(view);
    view.open([new File([new Uint8Array(bytes)], 'early.spmm')]).catch(reject);
  }), [...weave]);
  assert.equal(early, 'early.spmm');
  await drop('good.spmm', weave);
  await page.waitForFunction(() => window.told.loaded.some(({ name }) => name === 'good.spmm'), undefined, { timeout: 60_000 });
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test('a lost device is told, and begun again', { skip }, async () => {
  const page = await open(browser, `${site.url}#leaf=maize`, {
    init: () => {
      const Own = Worker;
      window.workers = [];
      window.Worker = class extends Own {
        constructor(...args) {
          super(...args);
          window.workers.push(this);
        }
      };
    },
  });
  await drawn(page);
  await page.evaluate(() => window.workers[0].postMessage({ kind: 'lose' }));
  const again = page.getByRole('button', { name: 'begin again' });
  await again.waitFor({ timeout: 60_000 });
  assert.match(await line(page), /device was lost/);
  await page.evaluate(() => { window.told.samples = 0; });
  await again.click();
  await drawn(page);
  assert.doesNotMatch(await line(page), /lost/);
  await page.context().close();
});

test('a phone has room for the picture, and fingers turn it', { skip }, async () => {
  const page = await open(browser, `${site.url}#leaf=soybean`, {
    viewport: { width: 390, height: 720 }, hasTouch: true, isMobile: true,
  });
  await drawn(page);
  await page.screenshot({ path: join(pictures, 'narrow.png') });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `${wide} points wide`);
  const touch = await page.context().newCDPSession(page);
  const at = (x, y, id = 0) => ({ x, y, id });
  const send = (type, touchPoints) => touch.send('Input.dispatchTouchEvent', { type, touchPoints });
  await send('touchStart', [at(200, 400)]);
  for (let x = 210; x <= 260; x += 10) {
    await send('touchMove', [at(x, 400)]);
  }
  await send('touchEnd', []);
  await page.waitForFunction(() => location.hash.includes('camera'), undefined, { timeout: 60_000 });
  const turned = page.url();
  await send('touchStart', [at(150, 400, 0), at(220, 400, 1)]);
  for (let step = 1; step <= 5; step += 1) {
    await send('touchMove', [at(150 - 8 * step, 400, 0), at(220 + 8 * step, 400, 1)]);
  }
  await send('touchEnd', []);
  await page.waitForFunction((turned) => location.href !== turned, turned, { timeout: 60_000 });
  // A leaf's link shows it so, too: what is seen is told anew, and is the same.
  const other = await open(browser, turned);
  await other.evaluate(() => {
    window.links = [];
    document.querySelector('btf-view').addEventListener('link', ({ detail }) => window.links.push(detail));
  });
  await drawn(other, 2);
  assert.deepEqual(await other.evaluate(() => [location.href, window.links.at(-1) ?? 'none']),
    [turned, new URLSearchParams(new URL(turned).hash.slice(1)).get('view')]);
  await other.context().close();
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test('without WebGPU there is a sentence and a still picture', { skip }, async () => {
  const page = await open(browser, site.url, {
    init: () => Object.defineProperty(Navigator.prototype, 'gpu', { get: () => undefined }),
  });
  await page.waitForFunction(() => /WebGPU/.test(
    document.querySelector('btf-view').shadowRoot.querySelector('p').textContent), undefined, { timeout: 60_000 });
  assert.ok(await page.locator('btf-view img').isVisible());
  await page.screenshot({ path: join(pictures, 'without_webgpu.png') });
  await page.context().close();
});
