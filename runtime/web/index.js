// Opens, evaluates and samples packed BTF assets (.spmm) in browsers and Node.js: the C interface of the Rust runtime
// (runtime/c), compiled to WebAssembly. What each call means stands in index.d.ts.

// The structures of runtime/c/include/btf.h: numbers of 4 bytes without gaps.
const PLACE_NUMBERS = 8;
const OPTIONS_BYTES = 16;
const INFO_BYTES = 44;
const DRAWN_NUMBERS = 7;
const POINTER_BYTES = 4;
// Arguments and results of a call that evaluates one place.
const SCRATCH_BYTES = 128;
const SIDES = ['frontLitFront', 'frontLitBack', 'backLitFront', 'backLitBack'];
const INTERPOLATIONS = ['fast', 'exact'];
const HEIGHTS = ['none', 'parallax', 'relief'];
const ALL = 0xffffffff;

/** A file that is no asset, or an argument out of range. */
export class BtfError extends Error {
  constructor(message) {
    super(message);
    this.name = 'BtfError';
  }
}

let compiled;

// Compiles the module once; every asset has memory of its own, which goes with it.
function compile() {
  compiled ??= load(new URL('./btf.wasm', import.meta.url));
  // A failed load may succeed next time.
  compiled.catch(() => { compiled = undefined; });
  return compiled;
}

async function load(url) {
  if (url.protocol === 'file:' && typeof process !== 'undefined') {
    const { readFile } = await import('node:fs/promises');
    return WebAssembly.compile(await readFile(url));
  }
  const response = await fetch(url);
  if (!response.ok) {
    throw new BtfError(`${url} cannot be loaded: the server answers ${response.status}`);
  }
  // Servers that do not know the type of .wasm files are common.
  return WebAssembly.compile(await response.arrayBuffer());
}

/** Opens an asset; see index.d.ts. */
export async function open(bytes, { levels = 'at-hand' } = {}) {
  if (!['at-hand', 'all'].includes(levels)) {
    throw new BtfError(`levels is '${levels}': take 'at-hand' or 'all'`);
  }
  const { exports } = await WebAssembly.instantiate(await compile());
  return new Asset(exports, asBytes(bytes), levels === 'all');
}

function asBytes(bytes) {
  if (bytes instanceof ArrayBuffer) {
    return new Uint8Array(bytes);
  }
  if (ArrayBuffer.isView(bytes)) {
    return new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  throw new BtfError('an asset is opened from an ArrayBuffer or a view of one');
}

/** An open asset; see index.d.ts. */
class Asset {
  #exports;
  #handle;
  #scratch;

  constructor(exports, bytes, allLevels) {
    this.#exports = exports;
    this.#scratch = this.#allocate(SCRATCH_BYTES);
    const file = this.#allocate(bytes.length);
    new Uint8Array(exports.memory.buffer, file, bytes.length).set(bytes);
    const [place, options] = [this.#scratch, this.#scratch + POINTER_BYTES];
    this.#words(options, 2).set([allLevels ? 1 : 0, 1]);
    const code = exports.btf_open_memory(file, bytes.length, options, place);
    exports.btf_free(file, bytes.length);
    this.#check(code);
    this.#handle = this.#words(place, 1)[0];
  }

  get info() {
    this.#check(this.#library.btf_query(this.#handle, this.#scratch));
    const [formatVersion, width, height, layers, levels, components, lobes, sides, seamless] =
      this.#words(this.#scratch, INFO_BYTES / 4);
    const [widthMm, heightMm] = this.#numbers(this.#scratch + INFO_BYTES - 8, 2);
    return {
      formatVersion, width, height, layers, levels, components, lobes,
      sides: SIDES.filter((_, bit) => sides & (1 << bit)),
      seamless: [(seamless & 1) !== 0, (seamless & 2) !== 0],
      sizeMm: widthMm > 0 ? [widthMm, heightMm] : null,
    };
  }

  get material() {
    const [text, length] = [this.#scratch, this.#scratch + POINTER_BYTES];
    this.#check(this.#library.btf_material(this.#handle, text, length));
    const bytes = new Uint8Array(this.#exports.memory.buffer, this.#words(text, 1)[0], this.#words(length, 1)[0]);
    return JSON.parse(new TextDecoder().decode(bytes));
  }

  get words() {
    const [words, count] = [this.#scratch, this.#scratch + POINTER_BYTES];
    this.#check(this.#library.btf_resident(this.#handle, words, count));
    return this.#words(this.#words(words, 1)[0], this.#words(count, 1)[0]);
  }

  evaluate(uv, wi, wo, options) {
    const value = this.#result(32, 3);
    this.#check(this.#library.btf_evaluate(...this.#asked(options), this.#place(uv, wi, wo), this.#options(options), value));
    return [...this.#numbers(value, 3)];
  }

  evaluateMany(places, options) {
    if (!(places instanceof Float32Array) || places.length % PLACE_NUMBERS !== 0) {
      throw new BtfError('places are a Float32Array of 8 numbers each: uv, wi, wo');
    }
    const count = places.length / PLACE_NUMBERS;
    const [from, to] = [this.#allocate(places.byteLength), this.#allocate(12 * count)];
    try {
      this.#numbers(from, places.length).set(places);
      const asked = this.#asked(options);
      this.#check(this.#library.btf_evaluate_many(...asked, from, count, this.#options(options), to));
      return this.#numbers(to, 3 * count).slice();
    } finally {
      this.#exports.btf_free(from, places.byteLength);
      this.#exports.btf_free(to, 12 * count);
    }
  }

  sample(uv, wo, at, options) {
    const asked = this.#asked(options);
    const from = this.#scratch;
    this.#numbers(from, 8).set([...vector(uv, 2, 'uv'), ...vector(wo, 3, 'wo'), ...vector(at, 3, 'at')]);
    const drawn = this.#result(32, DRAWN_NUMBERS);
    this.#check(this.#library.btf_sample(...asked, from, from + 8, from + 20, this.#options(options), drawn));
    const [x, y, z, density, r, g, b] = this.#numbers(drawn, DRAWN_NUMBERS);
    return density > 0 ? { wi: [x, y, z], pdf: density, value: [r, g, b] } : null;
  }

  pdf(uv, wi, wo, options) {
    const density = this.#result(32, 1);
    this.#check(this.#library.btf_density(...this.#asked(options), this.#place(uv, wi, wo), this.#options(options), density));
    return this.#numbers(density, 1)[0];
  }

  uvBetween(uv, at, options) {
    const from = this.#scratch;
    this.#numbers(from, 4).set([...vector(uv, 2, 'uv'), ...vector(at, 2, 'at')]);
    const between = this.#result(32, 2);
    this.#check(this.#library.btf_uv_between(...this.#asked(options), from, from + 8, between));
    return [...this.#numbers(between, 2)];
  }

  close() {
    // The memory is the asset's own, and goes with the module.
    this.#exports = undefined;
  }

  // The module's functions.
  get #library() {
    if (!this.#exports) {
      throw new BtfError('the asset is closed');
    }
    return this.#exports;
  }

  // The handle and the level of a call.
  #asked(options) {
    return [this.#handle, options?.level ?? 0];
  }

  #place(uv, wi, wo) {
    this.#numbers(this.#scratch, PLACE_NUMBERS).set([...vector(uv, 2, 'uv'), ...vector(wi, 3, 'wi'), ...vector(wo, 3, 'wo')]);
    return this.#scratch;
  }

  // Writes options behind the results; null stands for the usual ones.
  #options(options) {
    if (!options) {
      return 0;
    }
    const at = this.#scratch + SCRATCH_BYTES - OPTIONS_BYTES;
    const { components = ALL, lobes = ALL, interpolation = 'fast', heights = 'relief' } = options;
    const named = [numberOf(INTERPOLATIONS, interpolation, 'interpolation'), numberOf(HEIGHTS, heights, 'heights')];
    this.#words(at, 4).set([Math.min(components, ALL), Math.min(lobes, ALL), ...named]);
    return at;
  }

  // The place of a result, so many bytes behind the arguments' first.
  #result(offset, numbers) {
    console.assert(offset + 4 * numbers <= SCRATCH_BYTES - OPTIONS_BYTES);
    return this.#scratch + offset;
  }

  #allocate(length) {
    const pointer = this.#library.btf_allocate(length);
    if (pointer === 0) {
      throw new BtfError(`there is no memory for ${length} bytes`);
    }
    return pointer;
  }

  // Views are made anew: memory that grows leaves the old ones empty.
  #words(pointer, count) {
    return new Uint32Array(this.#exports.memory.buffer, pointer, count);
  }

  #numbers(pointer, count) {
    return new Float32Array(this.#exports.memory.buffer, pointer, count);
  }

  #check(code) {
    if (code === 0) {
      return;
    }
    const bytes = new Uint8Array(this.#exports.memory.buffer, this.#exports.btf_last_error());
    throw new BtfError(new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0))));
  }
}

function vector(numbers, length, name) {
  if (numbers?.length !== length) {
    throw new BtfError(`${name} has ${length} numbers`);
  }
  return numbers;
}

function numberOf(names, name, what) {
  const number = names.indexOf(name);
  if (number < 0) {
    throw new BtfError(`${what} is '${name}': take ${names.map((one) => `'${one}'`).join(' or ')}`);
  }
  return number;
}
