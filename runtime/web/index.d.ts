/** Packed BTF assets (.spmm) in browsers and Node.js. Values are pi x BRDF x |cosine of the light|, linear RGB. */

/** A file that is no asset, or an argument out of range; the message says what to do about it. */
export class BtfError extends Error {}

/** Two or three numbers, in any array. */
export type Vector2 = ArrayLike<number> & Iterable<number>;
export type Vector3 = ArrayLike<number> & Iterable<number>;

export interface OpenOptions {
  /** The levels of the file (the default), or all down to one texel; making them takes seconds. */
  levels?: 'at-hand' | 'all';
}

/** From fast to exact. At the measured directions interpolation and heights change nothing. */
export interface EvaluationOptions {
  /** 0 the finest (the default), below `info.levels`. */
  level?: number;
  /** Residual components that are used at most; all of them if not given. */
  components?: number;
  /** Lobes of a texel that are used at most; all of them if not given. */
  lobes?: number;
  /** The rule between the measured directions; 'fast' if not given. */
  interpolation?: 'fast' | 'exact';
  /** The use of the asset's heights; 'relief' if not given, which is everything. */
  heights?: 'none' | 'parallax' | 'relief';
}

export interface Info {
  formatVersion: number;
  /** Texels of the finest level. */
  width: number;
  height: number;
  /** Layers, 1 to 4: one for each of `sides`. */
  layers: number;
  /** Levels, the finest included. */
  levels: number;
  /** Residual components of the layer that has most. */
  components: number;
  /** Lobes of the texel that has most. */
  lobes: number;
  /** Pairs of sides of eye and light that the asset has; others are black. */
  sides: ('frontLitFront' | 'frontLitBack' | 'backLitFront' | 'backLitBack')[];
  /** Whether the left edge continues the right one, and the bottom edge the top one. */
  seamless: [boolean, boolean];
  /** Width and height in millimetres, where they are known. */
  sizeMm: [number, number] | null;
}

/** A direction to light that was drawn. */
export interface Sample {
  /** Unit vector to the light. */
  wi: [number, number, number];
  /** Probability density, per steradian. */
  pdf: number;
  /** Value of `evaluate` for a light there; value / (pi x pdf) is the weight of a path that goes on so. */
  value: [number, number, number];
}

/** An open asset. Directions are unit vectors in the frame of tangent (along u), bitangent (along v) and normal. */
export interface Asset {
  readonly info: Info;
  /** The description: name, origin, fit. */
  readonly material: unknown;
  /**
   * The asset as words of one storage buffer, for the WGSL decoder (`btf-runtime/wgsl`). A view of the module's memory,
   * valid until the next call: upload or copy it at once.
   */
  readonly words: Uint32Array;
  /** Evaluates pi x BRDF x |cosine of wi| for light from `wi` and an eye at `wo`; 1 is a white Lambertian surface. */
  evaluate(uv: Vector2, wi: Vector3, wo: Vector3, options?: EvaluationOptions): [number, number, number];
  /** Evaluates many places, 8 numbers each: uv, wi, wo. Returns 3 numbers for each. */
  evaluateMany(places: Float32Array, options?: EvaluationOptions): Float32Array;
  /** Draws a direction to light that matters to an eye, from three numbers in [0, 1); null where there is none. */
  sample(uv: Vector2, wo: Vector3, at: Vector3, options?: EvaluationOptions): Sample | null;
  /** Returns the density with which `sample` draws `wi`, per steradian. */
  pdf(uv: Vector2, wi: Vector3, wo: Vector3, options?: EvaluationOptions): number;
  /** Draws one of the four texels around a place, for smooth magnification: the place to ask for in its stead. */
  uvBetween(uv: Vector2, at: Vector2, options?: EvaluationOptions): [number, number];
  /** Closes the asset; its memory goes with it. */
  close(): void;
}

/**
 * Opens an asset: checks the bytes, and expands them to the form that is evaluated. `bytes` is a whole .spmm file, or a
 * prefix that ends where a tier does.
 *
 * @throws BtfError where the bytes are no asset.
 */
export function open(bytes: ArrayBuffer | ArrayBufferView, options?: OpenOptions): Promise<Asset>;
