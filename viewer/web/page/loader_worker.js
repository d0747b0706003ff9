// The worker that loads assets: it asks the server for a beginning that can be shown, then for the rest, and makes the form
// that the viewer draws from, so that neither page nor viewer waits.

import init, { Loaded, tierLengths } from './btf_viewer.js';

// Bytes that hold the tables of any asset of usual size.
const TABLES_BYTES = 16 << 10;
// Largest part of the file that is shown after the first tier and before the whole.
const MIDDLE = 0.5;
// Files below this come at once.
const AT_ONCE_BYTES = 256 << 10;
// How often a connection that breaks is taken up again.
const RETRIES = 4;

let begin;
const ready = new Promise((resolve) => { begin = resolve; });

// Reads a response into `bytes` from byte `at` on, as far as it goes; returns where it ended.
async function drain(response, bytes, at, onBytes) {
  const reader = response.body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) {
        return at;
      }
      const room = value.subarray(0, Math.max(0, bytes.length - at));
      bytes.set(room, at);
      at += room.length;
      onBytes?.(at);
    }
  } catch {
    // The connection broke; what came is good.
    return at;
  }
}

function ask(url, from, to) {
  return fetch(url, { headers: { Range: `bytes=${from}-${to - 1}` } });
}

function sizeOf(response) {
  const range = /\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
  return Number(range?.[1] ?? response.headers.get('Content-Length') ?? 0);
}

// Loads an asset piece by piece and calls `onBytes` with the bytes so far and their number.
class Download {
  constructor(url) {
    this.url = url;
    this.have = 0;
  }

  // Asks for the beginning; the server may send everything.
  async begin() {
    const response = await ask(this.url, 0, TABLES_BYTES);
    if (!response.ok) {
      throw new Error(`the server answers ${response.status}`);
    }
    this.ranges = response.status === 206;
    const size = sizeOf(response);
    if (this.ranges && size) {
      this.bytes = new Uint8Array(size);
      this.have = await drain(response, this.bytes, 0);
    } else {
      // Without ranges everything comes in one piece.
      this.bytes = new Uint8Array(await response.arrayBuffer());
      this.have = this.bytes.length;
    }
  }

  // Loads up to byte `end`, and takes broken connections up again.
  async until(end) {
    for (let attempt = 0; this.have < end; attempt += 1) {
      if (attempt > RETRIES) {
        throw new Error(`the connection broke after ${this.have} of ${this.bytes.length} bytes`);
      }
      if (attempt > 0) {
        await new Promise((resolve) => setTimeout(resolve, 200 * 2 ** attempt));
      }
      const had = this.have;
      try {
        const response = await ask(this.url, this.have, end);
        if (response.status !== 206) {
          throw new Error(`the server answers ${response.status}`);
        }
        this.have = await drain(response, this.bytes, this.have);
      } catch (error) {
        if (attempt === RETRIES) {
          throw error;
        }
      }
      if (this.have > had) {
        attempt = 0;
      }
    }
    return this.bytes.subarray(0, end);
  }
}

// Returns the beginnings to show: the first, one on the way, the whole.
function chosenTiers(lengths) {
  const whole = lengths.at(-1);
  if (whole <= AT_ONCE_BYTES) {
    return [whole];
  }
  const middle = lengths.findLast((length) => length <= MIDDLE * whole) ?? whole;
  return [...new Set([lengths[0], middle, whole])];
}

async function load({ id, url, name }) {
  const download = new Download(url);
  await download.begin();
  let lengths;
  try {
    lengths = tierLengths(download.bytes.subarray(0, download.have));
  } catch {
    // Tables that need more bytes, or no asset: the whole file tells.
    lengths = new Uint32Array([download.bytes.length]);
  }
  if (lengths.at(-1) !== download.bytes.length) {
    lengths = new Uint32Array([download.bytes.length]);
  }
  for (const length of chosenTiers(lengths)) {
    const bytes = await download.until(length);
    give(id, name, bytes, { isWhole: length === download.bytes.length, isEarly: length > AT_ONCE_BYTES });
  }
}

// Gives the page the form that the viewer draws from: in the end with all levels, which take longer than all else, and early
// without.
function give(id, name, bytes, { isWhole, isEarly }) {
  const asset = Loaded.read(bytes);
  const post = (isWhole) => {
    const [expanded, original] = [asset.expanded(), isWhole ? bytes.slice() : undefined];
    const parts = original ? [expanded.buffer, original.buffer] : [expanded.buffer];
    postMessage({ kind: 'asset', id, name, expanded, original, isWhole, bytes: bytes.length }, parts);
  };
  try {
    if (isWhole && asset.lacksLevels) {
      if (isEarly) {
        post(false);
      }
      asset.addLevels();
    }
    post(isWhole);
  } finally {
    asset.free();
  }
}

onmessage = async ({ data }) => {
  const { kind, id } = data;
  try {
    if (kind === 'open') {
      begin(init({ module_or_path: data.module }));
      return;
    }
    await ready;
    if (kind === 'load') {
      await load(data);
    } else {
      give(id, data.name, new Uint8Array(data.bytes), { isWhole: true });
    }
  } catch (error) {
    postMessage({ kind: 'failed', id, name: data.name, message: error.message });
  }
};
