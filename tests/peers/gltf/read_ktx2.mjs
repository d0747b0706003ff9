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
const level = (width) => Math.max(1, width);
const texelBytes = found.dataFormatDescriptor[0].bytesPlane[0];
for (const [i, { levelData, uncompressedByteLength }] of found.levels.entries()) {
    const texels = level(found.pixelWidth >> i) * level(found.pixelHeight >> i) * found.layerCount;
    if (levelData.byteLength !== texels * texelBytes || uncompressedByteLength !== texels * texelBytes) {
        throw new Error(`level ${i} has ${levelData.byteLength} bytes for ${texels} texels`);
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
