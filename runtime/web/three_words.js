// The words of assets in the shaders of three.js: the buffer that holds them, and the decoder that reads them.

import { StorageBufferAttribute } from 'three/webgpu';
import { code, storage } from 'three/tsl';
import { btfWGSL } from './wgsl.js';

// The buffer's name in shaders.
const WORDS = 'btfWords';

const buffers = new WeakMap();

/** Returns the node of the buffer of `words`, a Uint32Array; those who share words share a buffer. */
export function wordsNode(words) {
  if (!buffers.has(words)) {
    buffers.set(words, new StorageBufferAttribute(words, 1));
  }
  return storage(buffers.get(words), 'uint', words.length).toReadOnly().setName(WORDS);
}

/** Returns the decoder for shaders that use such a buffer, with `more` WGSL behind it. */
export function decoder(more = '') {
  return code(`
fn asset_word(index: u32) -> u32 {
  return ${WORDS}.value[index];
}
${btfWGSL}
${more}`, [], 'wgsl');
}
