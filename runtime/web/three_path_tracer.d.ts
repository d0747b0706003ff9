/** Packed BTF assets in three-gpu-pathtracer (0.0.26 or newer), on its WebGPUPathTracer. */

import type { BufferGeometry, MeshPhysicalMaterial } from 'three/webgpu';

/** A model of reflection of WebGPUPathTracer: `getMaterial()` returns one. */
export interface PathTracerMaterial {
  init(renderer: unknown): void;
  getData(): { bsdfSample: unknown; bsdfEvalPdf: unknown };
}

/**
 * The model of reflection of a scene in which some surfaces carry assets: these scatter light as the assets do, drawn by the
 * assets' own densities, and all others as `others` has it.
 *
 * ```js
 * const btf = new BtfPathTracingMaterial(pathTracer.getMaterial());
 * const { words } = await new BtfLoader().loadAsync('leather.spmm');
 * scene.add(new Mesh(btf.prepare(geometry), btf.add(words)));
 * pathTracer.setMaterial(btf);        // when all assets are added
 * pathTracer.setScene(scene, camera);
 * ```
 */
export class BtfPathTracingMaterial implements PathTracerMaterial {
  constructor(others: PathTracerMaterial);
  /** Returns a material for meshes that are to carry an asset. */
  add(words: Uint32Array, options?: { doubleSided?: boolean }): MeshPhysicalMaterial;
  /**
   * Returns a copy of a geometry as such meshes need it: with tangents, and with its texture coordinates as colours of its vertices.
   * It needs an index and texture coordinates.
   */
  prepare(geometry: BufferGeometry): BufferGeometry;
  init(renderer: unknown): void;
  getData(): { bsdfSample: unknown; bsdfEvalPdf: unknown };
}
