// Measures the page: how soon an asset of the URL is seen, and a frame's time beside that of btf-view on the same adapter,
// SwiftShader. Prints JSON.
//
//   BTF_WEB_PAGE=... BTF_VIEW=... BTF_WEB_BROWSER=... BTF_WEB_PLAYWRIGHT=... BTF_WEB_PICTURES=... \
//     node viewer/web/tests/bench.mjs ASSET.spmm [/usr/lib/chromium/vk_swiftshader_icd.json]

import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { Site, launch, open, pictures } from './site.mjs';

const [asset, driver = '/usr/lib/chromium/vk_swiftshader_icd.json'] = process.argv.slice(2);
const SIZE = 512;
const FRAMES = 8;

const run = promisify(execFile);
const env = { ...process.env, VK_DRIVER_FILES: driver };

async function native() {
  const times = [];
  for (const frames of [1, 1 + FRAMES]) {
    const out = join(pictures, 'bench.png');
    const args = [asset, '--headless', '--backend', 'bvh', '--size', `${SIZE}x${SIZE}`, '--frames', `${frames}`, '--out', out];
    const start = performance.now();
    await run(process.env.BTF_VIEW, [...args, '--json', '-'], { env });
    times.push(performance.now() - start);
  }
  return { first_s: times[0] / 1000, frame_ms: (times[1] - times[0]) / FRAMES };
}

async function page() {
  const site = await new Site().start();
  site.files.set('/asset.spmm', await readFile(asset));
  const browser = await launch();
  const opened = await open(browser, `${site.url}#leaf=maize`);
  // The shaders of another asset are those of this one: what is measured is the way of the asset, not the first start.
  await opened.waitForFunction(() => window.told.samples > 0, undefined, { timeout: 240_000 });
  const seen = await opened.evaluate(async () => {
    const view = document.querySelector('btf-view');
    const start = performance.now();
    const times = { loaded: [] };
    view.addEventListener('loaded', ({ detail }) => times.loaded.push([detail.bytes, performance.now() - start]));
    view.removeAttribute('leaf');
    view.setAttribute('src', '/asset.spmm');
    await new Promise((resolve) => {
      view.addEventListener('picture', ({ detail }) => {
        if (times.loaded.length > 0 && detail > 0) {
          times.first_ms ??= performance.now() - start;
        }
        if (times.loaded.length > 1 && detail > 1) {
          times.whole_ms = performance.now() - start;
          resolve();
        }
      });
    });
    return times;
  });
  const frames = await opened.evaluate(async ({ size, frames }) => {
    const view = document.querySelector('btf-view');
    view.style.display = 'none';
    const time = async (samples) => {
      const start = performance.now();
      await view.picture({ width: size, height: size, samples });
      return performance.now() - start;
    };
    await time(1);
    const one = await time(1);
    return { picture_of_one_sample_ms: one, frame_ms: (await time(1 + frames) - one) / frames };
  }, { size: SIZE, frames: FRAMES });
  await browser.close();
  site.stop();
  return { ...seen, ...frames };
}

console.log(JSON.stringify({ native: await native(), page: await page() }, undefined, 1));
