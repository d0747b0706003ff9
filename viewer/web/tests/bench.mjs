// Measures the page beside btf-view on the same adapter, SwiftShader: how soon an asset is seen after a click and after the page
// is opened, how long the page's main thread is kept, and a frame's time. Prints JSON; every time in seconds.
//
//   BTF_WEB_PAGE=... BTF_VIEW=... BTF_WEB_BROWSER=... BTF_WEB_PLAYWRIGHT=... BTF_WEB_PICTURES=... \
//     node viewer/web/tests/bench.mjs ASSET.spmm [/usr/lib/chromium/vk_swiftshader_icd.json]

import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { Site, beginTrace, drawn, endOfTrace, launch, open, pictures } from './site.mjs';

const [asset, driver = '/usr/lib/chromium/vk_swiftshader_icd.json'] = process.argv.slice(2);
const SIZE = 512;
const FRAMES = 8;

const run = promisify(execFile);
const env = { ...process.env, VK_DRIVER_FILES: driver };

const PAGE = `<!doctype html><link rel="icon" href="data:,"><script type="module" src="btf_view.js"></script>
<btf-view style="position: fixed; inset: 0; height: ${SIZE}px"></btf-view>`;

// Seconds of a picture of so many frames, from the program's start to its end.
async function ofProgram(frames) {
  const args = [asset, '--headless', '--backend', 'bvh', '--size', `${SIZE}x${SIZE}`, '--frames', `${frames}`];
  const start = performance.now();
  await run(process.env.BTF_VIEW, [...args, '--out', join(pictures, 'bench.png')], { env });
  return (performance.now() - start) / 1000;
}

// Notes on the page when the asset is loaded and seen, in seconds after `window.start`.
function watch(page) {
  return page.evaluate(() => {
    const view = document.querySelector('btf-view');
    const now = () => (performance.now() - window.start) / 1000;
    const seen = window.seen = { pictures: [] };
    let before = 0;
    let begun;
    view.addEventListener('loaded', ({ detail: { bytes, isWhole } }) => {
      seen.pictures.push({ bytes, isWhole, loaded: now() });
      begun = undefined;
    });
    view.addEventListener('picture', ({ detail: samples }) => {
      const last = seen.pictures.at(-1);
      if (last && samples > 0) {
        seen.first ??= now();
      }
      // A coarse picture has one sample; then those of the fine one are counted from 0.
      if (last && before === 0 && samples === 1) {
        begun = now();
      } else if (begun && samples > 1) {
        last.fine ??= begun;
      }
      seen.isDone = last?.isWhole && last.fine;
      before = samples;
    });
  });
}

// Waits until all of the asset is seen, and returns when what was.
async function waited(browser, page) {
  await page.waitForFunction(() => window.seen.isDone, undefined, { timeout: 400_000 });
  await page.evaluate(() => performance.mark('btf-page'));
  return { ...await page.evaluate(() => window.seen), longest_task_ms: await endOfTrace(browser) };
}

// From the page's opening, program and shaders included.
async function opened(browser, site) {
  await beginTrace(browser);
  const page = await open(browser, `${site.url}bench.html`, { viewport: { width: SIZE, height: SIZE } });
  await page.evaluate(() => {
    window.start = 0;
    document.querySelector('btf-view').setAttribute('src', '/asset.spmm');
  });
  await watch(page);
  const seen = await waited(browser, page);
  await page.context().close();
  return seen;
}

// From a click while another material is seen, and a frame's time.
async function clicked(browser, site) {
  const page = await open(browser, `${site.url}bench.html`, { viewport: { width: SIZE, height: SIZE } });
  await page.evaluate(() => document.querySelector('btf-view').setAttribute('src', 'gallery/leather.spmm'));
  await page.waitForFunction(() => window.told.loaded.some(({ isWhole }) => isWhole), undefined, { timeout: 240_000 });
  await drawn(page, 2);
  await watch(page);
  await beginTrace(browser);
  await page.evaluate(() => {
    window.start = performance.now();
    document.querySelector('btf-view').setAttribute('src', '/asset.spmm');
  });
  const seen = await waited(browser, page);
  const times = await page.evaluate(async ({ size, counts }) => {
    const view = document.querySelector('btf-view');
    view.style.display = 'none';
    const times = [];
    for (const samples of counts) {
      const start = performance.now();
      await view.picture({ width: size, height: size, samples });
      times.push((performance.now() - start) / 1000);
    }
    return times;
  }, { size: SIZE, counts: [1, 1, 1 + FRAMES] });
  await page.context().close();
  return { ...seen, frame: (times[2] - times[1]) / FRAMES };
}

const site = await new Site().start();
site.files.set('/asset.spmm', await readFile(asset));
site.files.set('/bench.html', Buffer.from(PAGE));
const one = await ofProgram(1);
const program = { first: one, frame: (await ofProgram(1 + FRAMES) - one) / FRAMES };
const browser = await launch();
const page = { opened: await opened(browser, site), clicked: await clicked(browser, site) };
await browser.close();
site.stop();
const frame_ratio = page.clicked.frame / program.frame;
console.log(JSON.stringify({ size: SIZE, program, page, frame_ratio }, undefined, 1));
