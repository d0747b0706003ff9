/** Packed BTF assets in three.js (r187 or newer), on WebGPURenderer. */

import type { Loader, LoadingManager, NodeMaterial } from 'three/webgpu';
import type { GLTFLoaderPlugin, GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import type { Info } from './index.js';

/** Name of the extension of glTF materials. */
export const BTF_MATERIALS_SPMM: 'BTF_materials_spmm';

export interface BtfNodeMaterialParameters {
  /** The asset as words of one storage buffer: what `BtfLoader` makes, or `Asset.words` of btf-runtime, copied. */
  words: Uint32Array;
  /** Place on the asset, 0 to 1 for one repetition, v upwards; the geometry's `uv` if not given. */
  uvNode?: unknown;
  /** Residual components that are used at most; all of them if not given. */
  components?: number;
  /** Lobes of a texel that are used at most; all of them if not given. */
  lobes?: number;
  /** The rule between the measured directions; 'fast' if not given. */
  interpolation?: 'fast' | 'exact';
  /** The use of the asset's heights; 'relief' if not given, which is everything. */
  heights?: 'none' | 'parallax' | 'relief';
}

/**
 * A surface that looks as it was measured: lights and shadows of three.js as for its own materials, light from all around
 * (AmbientLight, HemisphereLight, LightProbe) by four directions. The frame is that of the geometry's tangents, or along its
 * texture coordinates where it has none. A texel a pixel, of the level that is as coarse as pixels.
 */
export class BtfNodeMaterial extends NodeMaterial {
  constructor(parameters?: BtfNodeMaterialParameters);
  readonly isBtfNodeMaterial: true;
  words: Uint32Array | null;
  uvNode: unknown;
  components: number;
  lobes: number;
  interpolation: 'fast' | 'exact';
  heights: 'none' | 'parallax' | 'relief';
  /** `userData.btf` of materials that `BtfLoader` makes tells what the asset has. */
  userData: { btf?: Info } & Record<string, unknown>;
}

/** Loads `.spmm` files in a worker. */
export class BtfLoader extends Loader<BtfNodeMaterial> {
  constructor(manager?: LoadingManager);
  /** The levels of the file, or all of them (the default), which takes a second longer and is needed in the distance. */
  levels: 'at-hand' | 'all';
  /** Opens the bytes of an asset. */
  parse(bytes: ArrayBuffer): Promise<BtfNodeMaterial>;
  /** Ends the worker. */
  dispose(): void;
}

/**
 * Loads the assets to which a glTF file's materials point: `gltfLoader.register((parser) => new GLTFBtfExtension(parser))`.
 * A material whose asset cannot be had is drawn by its fallback.
 */
export class GLTFBtfExtension implements GLTFLoaderPlugin {
  constructor(parser: GLTFParser, loader?: BtfLoader);
  readonly name: 'BTF_materials_spmm';
  loadMaterial(index: number): Promise<unknown> | null;
}
