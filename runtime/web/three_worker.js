// Opens assets beside the page: the words of the form that shaders read go back.

import { open } from './index.js';

onmessage = async ({ data: { id, bytes, levels } }) => {
  try {
    const asset = await open(bytes, { levels });
    const { info } = asset;
    const words = asset.words.slice();
    asset.close?.();
    postMessage({ id, words, info }, [words.buffer]);
  } catch (error) {
    postMessage({ id, message: error.message });
  }
};
