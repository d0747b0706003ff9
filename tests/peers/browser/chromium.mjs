// Chromium for the tests of pages. `cargo xtask test` sets BTF_WEB_BROWSER to it and BTF_WEB_PLAYWRIGHT to the folder of
// playwright-core; without them these tests are skipped, which is told.

import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const { BTF_WEB_BROWSER, BTF_WEB_PLAYWRIGHT } = process.env;

/** Why tests are left out, or false. */
export const skip = BTF_WEB_BROWSER && BTF_WEB_PLAYWRIGHT ? false : 'no browser';

/** Types of files by their endings, where a server tells any. */
export const TYPES = {
  '.css': 'text/css', '.html': 'text/html', '.jpg': 'image/jpeg', '.js': 'text/javascript', '.json': 'application/json',
  '.png': 'image/png', '.wasm': 'application/wasm',
};

// WebGPU without a GPU: SwiftShader, which comes with Chromium. Pictures of its canvases reach the page only if Chromium itself
// draws by it as well.
const FLAGS = [
  '--no-sandbox', '--enable-unsafe-webgpu', '--use-webgpu-adapter=swiftshader', '--use-vulkan=swiftshader',
  '--use-angle=swiftshader', '--disable-vulkan-surface', '--enable-features=Vulkan', '--disable-background-networking',
  '--disable-component-update', '--disable-sync', '--no-first-run',
];

/** Starts Chromium. */
export async function launch() {
  const { chromium } = await import(pathToFileURL(join(BTF_WEB_PLAYWRIGHT, 'index.mjs')));
  return chromium.launch({ executablePath: BTF_WEB_BROWSER, args: FLAGS });
}
