// Packed BTF assets in three-gpu-pathtracer, on its WebGPUPathTracer: what each does stands in three_path_tracer.d.ts.
//
// The path tracer has one model of reflection for all surfaces, which knows a surface's frame and colour but not its texture
// coordinates. So the texture coordinates travel as colours of vertices, the frame is that of anisotropy, and the index of
// refraction of iridescence, which such a surface does not have, tells which asset it carries.

import { DoubleSide, FrontSide, Float32BufferAttribute, MeshPhysicalMaterial } from 'three/webgpu';
import { wgslTagFn } from 'three-mesh-bvh/webgpu';
import { RNG_INDEX_SCATTER_DIRECTION, rand3 } from 'three-gpu-pathtracer/src/webgpu/nodes/random.wgsl.js';
import { scatterRecordStruct, surfaceRecordStruct } from 'three-gpu-pathtracer/src/webgpu/nodes/structs.wgsl.js';
import { decoder, wordsNode } from './three_words.js';

// Marks of surfaces with assets: this, plus the asset's number.
const MARK = 1000;

/** The model of reflection; see three_path_tracer.d.ts. */
export class BtfPathTracingMaterial {
  #assets = [];

  constructor(others) {
    this.others = others;
    this.initialized = false;
  }

  init(renderer) {
    this.others.init(renderer);
  }

  /** Returns a material for meshes that are to carry an asset, which `words` are. */
  add(words, { doubleSided = false } = {}) {
    let number = this.#assets.indexOf(words);
    if (number < 0) {
      number = this.#assets.push(words) - 1;
    }
    return new MeshPhysicalMaterial({
      vertexColors: true, anisotropy: 1, iridescenceIOR: MARK + number, side: doubleSided ? DoubleSide : FrontSide,
    });
  }

  /** Returns a geometry as such meshes need it. */
  prepare(geometry) {
    const prepared = geometry.clone();
    const { uv } = prepared.attributes;
    if (!uv || !prepared.index) {
      throw new Error('a surface that carries an asset needs texture coordinates and an index');
    }
    if (!prepared.attributes.tangent) {
      prepared.computeTangents();
    }
    const colours = new Float32Array(4 * uv.count);
    for (let i = 0; i < uv.count; i += 1) {
      colours.set([uv.getX(i), uv.getY(i), 0, 1], 4 * i);
    }
    prepared.setAttribute('color', new Float32BufferAttribute(colours, 4));
    return prepared;
  }

  // All assets in one buffer, and where each begins.
  #join() {
    const starts = [];
    let length = 0;
    for (const words of this.#assets) {
      starts.push(length);
      length += words.length;
    }
    const all = new Uint32Array(Math.max(length, 1));
    this.#assets.forEach((words, number) => all.set(words, starts[number]));
    return { all, starts };
  }

  getData() {
    const { all, starts } = this.#join();
    const words = wordsNode(all);
    const library = decoder(`
const BTF_STARTS = array<u32, ${starts.length || 1}>(${starts.map((start) => `${start}u`).join() || '0u'});
fn btf_start(mark: f32) -> u32 {
  let starts = BTF_STARTS;
  return starts[u32(mark - ${MARK}.0 + 0.5)];
}
const BTF_ALL = BtfOptions(0xffffffffu, 0xffffffffu, 0u, 2u);`);
    const others = this.others.getData();
    return {
      bsdfSample: wgslTagFn/* wgsl */`
        fn btfBsdfSample(worldWo: vec3f, surf: ${surfaceRecordStruct}) -> ${scatterRecordStruct} {
          ${[library]}
          if (surf.iridescenceIor < ${String(MARK)}.0) {
            return ${others.bsdfSample}(worldWo, surf);
          }
          let words = &${words};
          var record: ${scatterRecordStruct};
          let wo = normalize(surf.normalInvBasis * worldWo);
          let drawn = btf_sample(btf_start(surf.iridescenceIor), 0u, surf.color.xy, wo, ${rand3}(${String(RNG_INDEX_SCATTER_DIRECTION)}), BTF_ALL);
          record.direction = normalize(surf.normalBasis * drawn.wi);
          record.color = drawn.value / 3.14159265;
          record.pdf = drawn.density;
          record.isTransmissive = drawn.wi.z * wo.z < 0.0;
          return record;
        }`,
      bsdfEvalPdf: wgslTagFn/* wgsl */`
        fn btfBsdfEvalPdf(worldWo: vec3f, worldWi: vec3f, surf: ${surfaceRecordStruct}) -> ${scatterRecordStruct} {
          ${[library]}
          if (surf.iridescenceIor < ${String(MARK)}.0) {
            return ${others.bsdfEvalPdf}(worldWo, worldWi, surf);
          }
          let words = &${words};
          var record: ${scatterRecordStruct};
          let wo = normalize(surf.normalInvBasis * worldWo);
          let wi = normalize(surf.normalInvBasis * worldWi);
          let start = btf_start(surf.iridescenceIor);
          record.direction = worldWi;
          record.color = btf_evaluate(start, 0u, surf.color.xy, wi, wo, BTF_ALL) / 3.14159265;
          record.pdf = btf_density(start, 0u, surf.color.xy, wi, wo, BTF_ALL);
          record.isTransmissive = wi.z * wo.z < 0.0;
          return record;
        }`,
    };
  }
}
