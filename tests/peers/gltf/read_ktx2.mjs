// node read_ktx2.mjs PACKAGES FILE: what ktx-parse finds in a KTX2 file, as JSON, and whether its writer makes the same file
// again. PACKAGES is the folder in which npm has installed ktx-parse.
import { readFile } from "node:fs/promises";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [packages, file] = process.argv.slice(2);
const { read, write } = await import(pathToFileURL(join(resolve(packages), "node_modules/ktx-parse/dist/index.mjs")));
const bytes = new Uint8Array(await readFile(file));
const found = read(bytes);
// Its reader cuts levels short that reach beyond the file.
const descriptor = found.dataFormatDescriptor[0];
const [blockWidth, blockHeight] = descriptor.texelBlockDimension.map((last) => last + 1);
const blocks = (texels, i, side) => Math.ceil(Math.max(1, texels >> i) / side);
for (const [i, { levelData, uncompressedByteLength }] of found.levels.entries()) {
    const count = blocks(found.pixelWidth, i, blockWidth) * blocks(found.pixelHeight, i, blockHeight);
    const wanted = count * Math.max(1, found.layerCount) * descriptor.bytesPlane[0];
    if (levelData.byteLength !== wanted || uncompressedByteLength !== wanted) {
        throw new Error(`level ${i} has ${levelData.byteLength} bytes, ${wanted} are needed`);
    }
}
const again = write(found, { keepWriter: true });
console.log(
    JSON.stringify({
        format: found.vkFormat,
        size: [found.pixelWidth, found.pixelHeight],
        layers: found.layerCount,
        levels: found.levels.length,
        samples: found.dataFormatDescriptor[0].samples,
        notes: found.keyValue.BTFspmm,
        again: Buffer.compare(again, bytes) === 0,
    }),
);
