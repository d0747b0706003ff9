// node validate.mjs PACKAGES FILE: what Khronos' validator says of a glTF file, as JSON. Files that it names are looked
// for beside it. PACKAGES is the folder in which npm has installed gltf-validator.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { dirname, join, resolve } from "node:path";

const [packages, file] = process.argv.slice(2);
const validator = createRequire(join(resolve(packages), "package.json"))("gltf-validator");
const bytes = new Uint8Array(await readFile(file));
const externalResourceFunction = async (uri) => new Uint8Array(await readFile(join(dirname(file), decodeURIComponent(uri))));
const report = await validator.validateBytes(bytes, { externalResourceFunction });
console.log(JSON.stringify(report));
