// Opens the package in a real Chromium: WebAssembly answers as in Node.js, and the WGSL text decodes on WebGPU what
// WebAssembly does.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import test from 'node:test';
import { TYPES, launch, skip } from '../../../tests/peers/browser/chromium.mjs';

const { BTF_WEB_PACKAGE, BTF_WEB_ANSWERS } = process.env;

// Serves the package and the answers; a path that leaves their folders is not found.
async function serve() {
  const folders = { package: BTF_WEB_PACKAGE, answers: BTF_WEB_ANSWERS };
  const server = createServer(async (request, response) => {
    const [, folder, ...rest] = normalize(request.url).split('/');
    try {
      const page = request.url === '/' ? '<!doctype html><title>btf-runtime</title>' : undefined;
      const body = page ?? await readFile(join(folders[folder], ...rest));
      response.setHeader('content-type', page ? 'text/html' : TYPES[extname(request.url)] ?? 'application/octet-stream');
      response.end(body);
    } catch {
      response.statusCode = 404;
      response.end();
    }
  });
  await new Promise((resolve) => { server.listen(0, '127.0.0.1', resolve); });
  return server;
}

// Runs a function in a page of the server's.
async function inPage(work) {
  const server = await serve();
  const browser = await launch();
  try {
    const page = await browser.newPage();
    await page.goto(`http://127.0.0.1:${server.address().port}/`);
    return await page.evaluate(work);
  } finally {
    await browser.close();
    server.close();
  }
}

test('a page evaluates assets', { skip }, async () => {
  const worst = await inPage(async () => {
    const { open } = await import('/package/index.js');
    const { answers } = await (await fetch('/answers/weave.json')).json();
    const asset = await open(await (await fetch('/answers/weave.spmm')).arrayBuffer(), { levels: 'all' });
    let found = 0;
    for (const { level, uv, wi, wo, exact, value } of answers) {
      const interpolation = exact ? 'exact' : 'fast';
      asset.evaluate(uv, wi, wo, { level, interpolation }).forEach((x, i) => {
        found = Math.max(found, Math.abs(x - value[i]));
      });
    }
    return found;
  });
  assert.ok(worst < 2e-5, `${worst}`);
});

test('WGSL decodes on WebGPU what WebAssembly does', { skip }, async () => {
  const found = await inPage(async () => {
    const { open } = await import('/package/index.js');
    const { btfWGSL } = await import('/package/wgsl.js');
    const { answers } = await (await fetch('/answers/weave.json')).json();
    const asset = await open(await (await fetch('/answers/weave.spmm')).arrayBuffer(), { levels: 'all' });
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) {
      return { adapter: null };
    }
    // No feature and no limit is asked for.
    const device = await adapter.requestDevice();
    const shader = (text) => device.createShaderModule({
      code: `${text}
        struct Asked { uv: vec2f, level: u32, interpolation: u32, wi: vec3f, a: f32, wo: vec3f, b: f32 }
        @group(0) @binding(0) var<storage, read> words: array<u32>;
        @group(0) @binding(1) var<storage, read> asked: array<Asked>;
        @group(0) @binding(2) var<storage, read_write> values: array<vec4f>;
        fn asset_word(index: u32) -> u32 { return words[index]; }
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
          if id.x < arrayLength(&asked) {
            let q = asked[id.x];
            let options = BtfOptions(0xffffffffu, 0xffffffffu, q.interpolation, 2u);
            values[id.x] = vec4f(btf_evaluate(0u, q.level, q.uv, q.wi, q.wo, options), 0.0);
          }
        }`,
    });
    const buffer = (data, usage) => {
      const made = device.createBuffer({ size: data.byteLength, usage: usage | GPUBufferUsage.COPY_DST });
      device.queue.writeBuffer(made, 0, data);
      return made;
    };
    const asked = new ArrayBuffer(48 * answers.length);
    answers.forEach(({ uv, level, exact, wi, wo }, i) => {
      new Float32Array(asked, 48 * i, 2).set(uv);
      new Uint32Array(asked, 48 * i + 8, 2).set([level, exact ? 1 : 0]);
      new Float32Array(asked, 48 * i + 16, 3).set(wi);
      new Float32Array(asked, 48 * i + 32, 3).set(wo);
    });
    const [words, queries] = [asset.words, new Uint8Array(asked)].map((data) => buffer(data, GPUBufferUsage.STORAGE));
    const size = 16 * answers.length;
    const values = device.createBuffer({ size, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
    const staging = device.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    const run = async (text) => {
      const module = shader(text);
      const messages = (await module.getCompilationInfo()).messages.map(({ type, message }) => `${type}: ${message}`);
      const pipeline = await device.createComputePipelineAsync({ layout: 'auto', compute: { module } });
      const entries = [words, queries, values].map((one, binding) => ({ binding, resource: { buffer: one } }));
      const encoder = device.createCommandEncoder();
      const pass = encoder.beginComputePass();
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries }));
      pass.dispatchWorkgroups(Math.ceil(answers.length / 64));
      pass.end();
      encoder.copyBufferToBuffer(values, 0, staging, 0, size);
      device.queue.submit([encoder.finish()]);
      await staging.mapAsync(GPUMapMode.READ);
      const decoded = new Float32Array(staging.getMappedRange().slice(0));
      staging.unmap();
      const differ = answers.filter(({ value }, i) =>
        value.some((x, c) => !(Math.abs(decoded[4 * i + c] - x) <= 1e-3 * Math.max(1, x)))).length;
      return { differ, messages };
    };
    const planted = btfWGSL.replace('return value * lit.fall;', 'return 1.02 * value * lit.fall;');
    const right = await run(btfWGSL);
    return { adapter: adapter.info.vendor, ...right, planted: (await run(planted)).differ, changed: planted !== btfWGSL };
  });
  assert.ok(found.adapter !== null, 'Chromium has no WebGPU adapter');
  assert.deepEqual([found.messages, found.differ, found.changed], [[], 0, true]);
  assert.ok(found.planted > 50, `${found.planted}`);
});
