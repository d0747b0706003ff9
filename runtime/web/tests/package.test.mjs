// Compares the package with the runtime's own answers, and tries what users do wrong. `cargo xtask web` makes both and sets
// BTF_WEB_PACKAGE and BTF_WEB_ANSWERS to their folders.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';

const { BTF_WEB_PACKAGE: packageFolder, BTF_WEB_ANSWERS: answersFolder } = process.env;
assert.ok(packageFolder && answersFolder, '`cargo xtask web` runs these tests');
const { BtfError, open } = await import(pathToFileURL(join(packageFolder, 'index.js')));
const { btfWGSL } = await import(pathToFileURL(join(packageFolder, 'wgsl.js')));
const { answers, levels, width } = JSON.parse(await readFile(join(answersFolder, 'weave.json'), 'utf8'));
const file = await readFile(join(answersFolder, 'weave.spmm'));

// Both are the same Rust, but powers and exponentials are rounded by other libraries.
const TOLERANCE = 2e-5;

function differs(found, expected) {
  const [a, b] = [found, expected].map((numbers) => [numbers].flat(2));
  return a.length !== b.length || a.some((x, i) => !(Math.abs(x - b[i]) <= TOLERANCE * Math.max(1, Math.abs(b[i]))));
}

function differing(asset, planted = 1) {
  const wrong = { evaluate: 0, sample: 0, pdf: 0, uvBetween: 0 };
  for (const { level, uv, wi, wo, at, exact, value, pdf, drawn, between } of answers) {
    const options = { level, interpolation: exact ? 'exact' : 'fast' };
    const found = asset.sample(uv, wo, at, options);
    const flat = (one) => one && [one.wi, one.pdf, one.value];
    wrong.evaluate += differs(asset.evaluate(uv, wi, wo, options).map((x) => planted * x), value);
    wrong.sample += found === null || drawn === null ? found !== drawn : differs(flat(found), flat(drawn));
    wrong.pdf += differs(planted * asset.pdf(uv, wi, wo, options), pdf);
    wrong.uvBetween += differs(asset.uvBetween(uv, at.slice(0, 2), { level }), between);
  }
  return wrong;
}

test('answers are those of the runtime', async () => {
  const asset = await open(file, { levels: 'all' });
  assert.equal(answers.length, 500);
  assert.deepEqual(differing(asset), { evaluate: 0, sample: 0, pdf: 0, uvBetween: 0 });
  // Planted: a hundredth too bright, and too dense.
  const planted = differing(asset, 1.01);
  assert.ok(planted.evaluate > 200 && planted.pdf > 200, JSON.stringify(planted));
});

test('many places are evaluated like one', async () => {
  const asset = await open(file, { levels: 'all' });
  const fast = answers.filter(({ level, exact }) => level === 0 && !exact);
  assert.ok(fast.length > 20);
  const places = new Float32Array(fast.flatMap(({ uv, wi, wo }) => [...uv, ...wi, ...wo]));
  const values = asset.evaluateMany(places);
  fast.forEach(({ uv, wi, wo }, i) => {
    assert.deepEqual([...values.subarray(3 * i, 3 * i + 3)], asset.evaluate(uv, wi, wo));
  });
  assert.equal(asset.evaluateMany(new Float32Array(0)).length, 0);
});

test('an asset tells what it is', async () => {
  const asset = await open(file.buffer.slice(file.byteOffset, file.byteOffset + file.length), { levels: 'all' });
  const { info } = asset;
  assert.equal(info.width, width);
  assert.equal(info.levels, levels);
  assert.deepEqual(info.sides, ['frontLitFront']);
  assert.equal(typeof asset.material, 'object');
  assert.ok(asset.words.length > 1000 && asset.words[2] === info.layers);
  // At hand are fewer levels than all.
  assert.ok((await open(file)).info.levels <= levels);
});

test('the decoder in WGSL is whole', () => {
  for (const name of ['btf_evaluate', 'btf_sample', 'btf_density', 'btf_texel_between']) {
    assert.ok(btfWGSL.includes(`fn ${name}(`), name);
  }
});

test('what is no asset gets a sentence', async () => {
  const damaged = Uint8Array.from(file);
  damaged[damaged.length >> 1] ^= 0x55;
  for (const bytes of [new Uint8Array(0), new Uint8Array(100), file.subarray(0, 500), damaged]) {
    await assert.rejects(open(bytes), (error) => error instanceof BtfError && error.message.length > 20);
  }
  await assert.rejects(open('weave.spmm'), /ArrayBuffer/);
  await assert.rejects(open(file, { levels: 'some' }), /at-hand/);
  // A failure leaves the next asset alone.
  assert.ok((await open(file)).info.width === width);
});

test('arguments out of range get a sentence, and a closed asset does', async () => {
  const asset = await open(file);
  const [uv, z] = [[0.5, 0.5], [0, 0, 1]];
  assert.throws(() => asset.evaluate(uv, z, z, { level: 99 }), /level 99/);
  assert.throws(() => asset.evaluate(uv, z, z, { interpolation: 'slow' }), /'fast' or 'exact'/);
  assert.throws(() => asset.evaluate([0.5], z, z), /uv has 2 numbers/);
  assert.throws(() => asset.evaluateMany(new Float32Array(9)), /8 numbers/);
  assert.deepEqual(asset.evaluate([NaN, 0], z, z), [0, 0, 0]);
  asset.close();
  asset.close();
  assert.throws(() => asset.evaluate(uv, z, z), /closed/);
});

test('assets do not share memory, and memory is given back', async () => {
  const [one, two] = [await open(file), await open(file)];
  const before = two.evaluate([0.1, 0.2], [0, 0, 1], [0.6, 0, 0.8]);
  one.close();
  assert.deepEqual(two.evaluate([0.1, 0.2], [0, 0, 1], [0.6, 0, 0.8]), before);
  const places = new Float32Array(8 * 10000);
  two.evaluateMany(places);
  const size = two.words.buffer.byteLength;
  for (let i = 0; i < 50; i++) {
    two.evaluateMany(places);
  }
  assert.equal(two.words.buffer.byteLength, size);
});
