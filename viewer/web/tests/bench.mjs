// Measures the page beside btf-view on the same adapter, SwiftShader: how soon an asset is seen after a click and after the page
// is opened, how long the page's main thread is kept, a frame's time, and how long the program takes for the
// asset by itself. Prints JSON; times are in seconds where their names have no unit.
//
//   BTF_WEB_PAGE=... BTF_VIEW=... BTF_WEB_BROWSER=... BTF_WEB_PLAYWRIGHT=... BTF_WEB_PICTURES=... \
//     node viewer/web/tests/bench.mjs ASSET.spmm [/usr/lib/chromium/vk_swiftshader_icd.json]

import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
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
      before = samples;
    });
  });
}

// Waits until all of the asset is seen, and returns when what was.
async function waited(browser, page) {
  await page.waitForFunction(() => {
    const last = window.seen.pictures.at(-1);
    return last?.isWhole && last.fine;
  }, undefined, { timeout: 400_000 });
  return { ...await page.evaluate(() => window.seen), longest_task_ms: await endOfTrace(browser, page) };
}

function openBench(browser, site) {
  return open(browser, `${site.url}bench.html`, { viewport: { width: SIZE, height: SIZE }, deviceScaleFactor: 1 });
}

// From the page's opening, program and shaders included.
async function opened(browser, site) {
  await beginTrace(browser);
  const page = await openBench(browser, site);
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
  const page = await openBench(browser, site);
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

// The work of the page's loader, while nothing else is at work.
async function ofLoader() {
  const folder = process.env.BTF_WEB_PAGE;
  const program = await import(pathToFileURL(join(folder, 'btf_viewer.js')));
  await program.default({ module_or_path: await readFile(join(folder, 'btf_viewer_bg.wasm')) });
  const times = [];
  const timed = (work) => {
    const start = performance.now();
    const result = work();
    times.push((performance.now() - start) / 1000);
    return result;
  };
  const bytes = await readFile(asset);
  const loaded = timed(() => program.Loaded.read(bytes));
  timed(() => loaded.expanded());
  timed(() => loaded.addLevels());
  timed(() => loaded.expanded());
  const [read, expanded, levels, expanded_with_levels] = times;
  return { read, expanded, levels, expanded_with_levels };
}

const site = await new Site().start();
site.files.set('/asset.spmm', await readFile(asset));
site.files.set('/bench.html', Buffer.from(PAGE));
const one = await ofProgram(1);
const program = { first: one, frame: (await ofProgram(1 + FRAMES) - one) / FRAMES };
const loader = await ofLoader();
const browser = await launch();
const page = { opened: await opened(browser, site), clicked: await clicked(browser, site) };
await browser.close();
site.stop();
const frame_ratio = page.clicked.frame / program.frame;
console.log(JSON.stringify({ size: SIZE, program, loader, page, frame_ratio }, undefined, 1));
