// A server for the page and a browser that opens it. `cargo xtask test` sets BTF_WEB_PAGE to the page's folder, BTF_WEB_PACKAGE to
// btf-runtime's, BTF_WEB_PICTURES to one for pictures, BTF_VIEW, BTF_FIT and BTF_SYNTH to the programs. three.js is beside
// playwright-core.

import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { promisify } from 'node:util';
import { TYPES, launch, skip } from '../../../tests/peers/browser/chromium.mjs';

const { BTF_WEB_PACKAGE, BTF_WEB_PAGE, BTF_WEB_PICTURES, BTF_VIEW, BTF_WEB_PLAYWRIGHT } = process.env;

export { launch, skip };

export const pictures = BTF_WEB_PICTURES;

/** The server. */
export class Site {
  /** Whether ranges are answered. */
  hasRanges = true;
  /** Number of answers to assets that break off in the middle. */
  cuts = 0;
  /** Ranges that were asked for, and answers that broke off. */
  asked = [];
  broken = 0;
  /** Files beside those of the page, by their paths. */
  files = new Map();

  async start() {
    this.server = createServer((request, response) => this.#answer(request, response));
    await new Promise((resolve) => { this.server.listen(0, '127.0.0.1', resolve); });
    this.url = `http://127.0.0.1:${this.server.address().port}/`;
    return this;
  }

  stop() {
    this.server.close();
    this.server.closeAllConnections();
  }

  async #body(path) {
    if (this.files.has(path)) {
      return this.files.get(path);
    }
    const [, folder, ...rest] = path.split('/');
    const folders = { pictures: BTF_WEB_PICTURES, package: BTF_WEB_PACKAGE, npm: join(BTF_WEB_PLAYWRIGHT, '..') };
    return readFile(folders[folder] ? join(folders[folder], ...rest) : join(BTF_WEB_PAGE, path));
  }

  async #answer(request, response) {
    let path = normalize(decodeURIComponent(new URL(request.url, this.url).pathname));
    path = path.endsWith('/') ? `${path}index.html` : path;
    let body;
    try {
      body = await this.#body(path);
    } catch {
      response.writeHead(404).end();
      return;
    }
    const headers = { 'content-type': TYPES[extname(path)] ?? 'application/octet-stream' };
    const range = this.hasRanges && /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
    if (!range) {
      response.writeHead(200, { ...headers, 'content-length': body.length }).end(body);
      return;
    }
    const [from, to] = [Number(range[1]), Math.min(Number(range[2]), body.length - 1)];
    const part = body.subarray(from, to + 1);
    this.asked.push([from, to]);
    response.writeHead(206, { ...headers, 'content-range': `bytes ${from}-${to}/${body.length}`, 'content-length': part.length });
    if (this.cuts > 0 && part.length > 20_000) {
      this.cuts -= 1;
      this.broken += 1;
      response.write(part.subarray(0, part.length / 2), () => setTimeout(() => response.destroy(), 50));
      return;
    }
    response.end(part);
  }
}

// A pixel for two points each way: SwiftShader takes most of the time of these tests, and takes it for pixels.
const PIXELS_PER_POINT = 0.5;

/** Opens the page and notes what its viewer tells; `errors` are the browser's. */
export async function open(browser, url, options = {}) {
  const context = await browser.newContext({
    viewport: { width: 620, height: 420 }, deviceScaleFactor: PIXELS_PER_POINT, ...options,
  });
  const page = await context.newPage();
  page.errors = [];
  page.on('pageerror', (error) => page.errors.push(String(error)));
  page.on('console', (message) => message.type() === 'error' && page.errors.push(message.text()));
  page.panic = new Promise((_, reject) => {
    page.on('console', (message) => message.text().startsWith('panicked') && reject(new Error(message.text())));
  });
  page.panic.catch(() => {});
  if (options.init) {
    await page.addInitScript(options.init);
  }
  await page.goto(url);
  await page.evaluate(() => {
    const view = document.querySelector('btf-view');
    window.told = { samples: 0, loaded: [], messages: [] };
    view.addEventListener('picture', ({ detail }) => { window.told.samples = detail; });
    view.addEventListener('loaded', ({ detail }) => window.told.loaded.push(detail));
    view.addEventListener('message', ({ detail }) => window.told.messages.push(detail));
  });
  return page;
}

/** Waits until the picture has so many samples a pixel; not any longer where the viewer panicked. */
export function drawn(page, samples = 1) {
  const picture = page.waitForFunction((least) => window.told.samples >= least, samples, { timeout: 240_000 });
  picture.catch(() => {});
  return Promise.race([picture, page.panic]);
}

/** The line below the picture. */
export function line(page) {
  return page.evaluate(() => document.querySelector('btf-view').shadowRoot.querySelector('p').textContent);
}

/** Runs btf-view and returns the path of its picture on the server. */
export async function native(name, args) {
  await promisify(execFile)(BTF_VIEW, [...args, '--headless', '--backend', 'bvh', '--out', join(BTF_WEB_PICTURES, `${name}.png`)]);
  return `/pictures/${name}.png`;
}

// The page through which the browser is asked what it does.
let tracing;

/** Begins to note what the browser does; [endOfTrace] tells. */
export async function beginTrace(browser) {
  tracing = await browser.newPage();
  await browser.startTracing(tracing, { categories: ['toplevel', 'blink.user_timing', '__metadata'] });
}

/** Returns the processor time in milliseconds of the longest task of the page's main thread. (Not its time: the software GPU has
 * other threads wait.) */
export async function endOfTrace(browser, page) {
  await page.evaluate(() => performance.mark('btf-page'));
  const { traceEvents } = JSON.parse((await browser.stopTracing()).toString());
  await tracing.close();
  const own = traceEvents.find(({ name }) => name === 'btf-page');
  const isOwn = ({ pid, tid }) => pid === own.pid && tid === own.tid;
  const tasks = traceEvents.filter((event) => isOwn(event) && /RunTask/.test(event.name) && event.tdur);
  return tasks.reduce((longest, { tdur }) => Math.max(longest, tdur / 1000), 0);
}
