// Dawn, whose WGSL compiler is Tint, on a WGSL file.
//
//   node dawn.mjs PACKAGES check FILE
//   node dawn.mjs PACKAGES run FILE ENTRY_POINT WORDS QUERIES RANGE ANSWERS COUNT
//
// PACKAGES is the folder with node_modules/webgpu. `check` compiles and needs no driver. `run` runs an entry point over
// the bytes of three files and writes those of the fourth, on the Vulkan adapter that the environment names.
// Exit codes: 0 success, 1 the text is refused, with Tint's messages on standard error, 2 anything else.
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const WORKGROUP = 64;

async function compiled(device, file, code) {
    device.pushErrorScope('validation');
    const module = device.createShaderModule({ code });
    const { messages } = await module.getCompilationInfo();
    await device.popErrorScope();
    const errors = messages.filter((message) => message.type === 'error');
    for (const { lineNum, linePos, message } of errors) {
        console.error(`${file}:${lineNum}:${linePos}: ${message}`);
    }
    if (errors.length > 0) {
        process.exit(1);
    }
    return module;
}

async function answers(device, module, entryPoint, [words, queries, range], length, count) {
    const { STORAGE, UNIFORM, COPY_SRC, COPY_DST, MAP_READ } = globalThis.GPUBufferUsage;
    const buffer = (bytes, usage) => {
        const made = device.createBuffer({ size: bytes.length, usage: usage | COPY_DST });
        device.queue.writeBuffer(made, 0, bytes);
        return made;
    };
    device.pushErrorScope('validation');
    const pipeline = device.createComputePipeline({ layout: 'auto', compute: { module, entryPoint } });
    const output = device.createBuffer({ size: length, usage: STORAGE | COPY_SRC });
    const bound = [buffer(words, STORAGE), buffer(queries, STORAGE), buffer(range, UNIFORM), output];
    const group = device.createBindGroup({
        layout: pipeline.getBindGroupLayout(0),
        entries: bound.map((buffer, binding) => ({ binding, resource: { buffer } })),
    });
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, group);
    pass.dispatchWorkgroups(Math.ceil(count / WORKGROUP));
    pass.end();
    const copy = device.createBuffer({ size: length, usage: MAP_READ | COPY_DST });
    encoder.copyBufferToBuffer(output, 0, copy, 0, length);
    device.queue.submit([encoder.finish()]);
    const error = await device.popErrorScope();
    if (error) {
        throw new Error(error.message);
    }
    await copy.mapAsync(globalThis.GPUMapMode.READ);
    return new Uint8Array(copy.getMappedRange());
}

async function main([packages, job, file, entryPoint, ...rest]) {
    const { create, globals } = await import(pathToFileURL(join(packages, 'node_modules/webgpu/index.js')));
    Object.assign(globalThis, globals);
    const gpu = create([`backend=${job === 'run' ? 'vulkan' : 'null'}`]);
    const adapter = await gpu.requestAdapter();
    if (!adapter) {
        throw new Error('Dawn finds no adapter');
    }
    const device = await adapter.requestDevice();
    const module = await compiled(device, file, await readFile(file, 'utf8'));
    if (job === 'run') {
        const inputs = await Promise.all(rest.slice(0, 3).map((name) => readFile(name)));
        const count = Number(rest[4]);
        const bytes = await answers(device, module, entryPoint, inputs, 32 * count, count);
        await writeFile(rest[3], bytes);
    }
}

try {
    await main(process.argv.slice(2));
    // Dawn's threads would keep the process alive.
    process.exit(0);
} catch (error) {
    console.error(error.message);
    process.exit(2);
}
