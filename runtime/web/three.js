// Packed BTF assets in three.js, on WebGPURenderer: a material, a loader, and a plugin of GLTFLoader. What each does stands in
// three.d.ts.

import { FileLoader, Loader, LightingModel, NodeMaterial } from 'three/webgpu';
import {
  bitangentView, normalView, positionView, positionViewDirection, tangentView, uv, uvec4, vec2, vec3, wgslFn,
} from 'three/tsl';
import { decoder, wordsNode } from './three_words.js';

/** Name of the extension of glTF materials. */
export const BTF_MATERIALS_SPMM = 'BTF_materials_spmm';

const ALL = 0xffffffff;
const INTERPOLATIONS = { fast: 0, exact: 1 };
const HEIGHTS = { none: 0, parallax: 1, relief: 2 };
// Directions by which light from all around is told: at 45 degrees to the normal.
const AROUND = [0, 1, 2, 3].map((quarter) => {
  const azimuth = (quarter + 0.5) * Math.PI / 2;
  return [Math.SQRT1_2 * Math.cos(azimuth), Math.SQRT1_2 * Math.sin(azimuth), Math.SQRT1_2];
});

// Evaluates the asset at the level whose texels are about as wide as a pixel. `first` has the buffer declared.
const evaluate = wgslFn(`
fn btf_three(first: u32, place: vec2<f32>, width: vec2<f32>, wi: vec3<f32>, wo: vec3<f32>, limits: vec4<u32>) -> vec3<f32> {
  let size = vec2<f32>(btf_size(0u, btf_layer_for_sides(0u, 0u, 0u, 0u)));
  let texels = max(width.x * size.x, width.y * size.y);
  let level = u32(clamp(round(log2(max(texels, 1.0))), 0.0, f32(btf_levels(0u) - 1u)));
  return btf_evaluate(0u, level, place, wi, wo, BtfOptions(limits.x, limits.y, limits.z, limits.w));
}`, [decoder()]);

// Lights a surface by an asset.
class BtfLightingModel extends LightingModel {
  constructor(material) {
    super();
    this.material = material;
  }

  start(builder) {
    const { words, place, limits } = this.material.nodesOf();
    const [tangent, bitangent] = frame(builder, place);
    const local = (direction) => vec3(
      direction.dot(tangent), direction.dot(bitangent), direction.dot(normalView),
    ).normalize();
    const eye = local(positionViewDirection).toVar();
    const width = place.fwidth().toVar();
    const at = place.toVar();
    this.value = (wi) => evaluate({ first: words.element(0), place: at, width, wi, wo: eye, limits });
    this.local = local;
    super.start?.(builder);
  }

  // The value is pi x BRDF x |cosine|.
  direct({ lightDirection, lightColor, reflectedLight }) {
    reflectedLight.directDiffuse.addAssign(lightColor.mul(this.value(this.local(lightDirection))).div(Math.PI));
  }

  indirect(builder) {
    const { ambientOcclusion, irradiance, reflectedLight } = builder.context;
    const sum = AROUND.map((wi) => this.value(vec3(...wi))).reduce((sum, value) => sum.add(value));
    const reflectance = sum.div(AROUND.length * AROUND[0][2]);
    reflectedLight.indirectDiffuse.addAssign(irradiance.mul(reflectance).div(Math.PI));
    reflectedLight.indirectDiffuse.mulAssign(ambientOcclusion);
  }
}

// Tangent and bitangent in view space: the geometry's, or along the texture coordinates.
function frame(builder, place) {
  if (builder.geometry.hasAttribute('tangent')) {
    return [tangentView, bitangentView];
  }
  const [right, up] = [positionView.dFdx(), positionView.dFdy()];
  const [placeRight, placeUp] = [place.dFdx(), place.dFdy()];
  const [acrossUp, acrossRight] = [up.cross(normalView), normalView.cross(right)];
  const along = (axis) => acrossUp.mul(placeRight[axis]).add(acrossRight.mul(placeUp[axis]));
  const rough = along('x');
  const tangent = rough.sub(normalView.mul(normalView.dot(rough))).normalize().toVar();
  const side = normalView.cross(tangent);
  return [tangent, side.mul(side.dot(along('y')).sign())];
}

/** The material; see three.d.ts. */
export class BtfNodeMaterial extends NodeMaterial {
  static get type() {
    return 'BtfNodeMaterial';
  }

  constructor(parameters) {
    super();
    this.isBtfNodeMaterial = true;
    this.lights = true;
    this.words = null;
    this.uvNode = null;
    this.components = ALL;
    this.lobes = ALL;
    this.interpolation = 'fast';
    this.heights = 'relief';
    this.setValues(parameters);
  }

  setupLightingModel() {
    return new BtfLightingModel(this);
  }

  nodesOf() {
    const limits = [this.components, this.lobes, INTERPOLATIONS[this.interpolation], HEIGHTS[this.heights]];
    if (!(this.words instanceof Uint32Array) || limits.includes(undefined)) {
      throw new Error('BtfNodeMaterial needs `words`, a Uint32Array as BtfLoader gives it, and known options');
    }
    const [components, lobes, interpolation, heights] = limits;
    return {
      words: wordsNode(this.words),
      place: this.uvNode ?? uv(),
      limits: uvec4(components, lobes, interpolation, heights),
    };
  }

  customProgramCacheKey() {
    const { components, lobes, interpolation, heights } = this;
    return [super.customProgramCacheKey(), components, lobes, interpolation, heights].join();
  }

  copy(source) {
    super.copy(source);
    for (const name of ['words', 'uvNode', 'components', 'lobes', 'interpolation', 'heights']) {
      this[name] = source[name];
    }
    return this;
  }
}

/** Loads assets; see three.d.ts. */
export class BtfLoader extends Loader {
  #worker;
  #asked = new Map();

  constructor(manager) {
    super(manager);
    this.levels = 'all';
  }

  load(url, onLoad, onProgress, onError) {
    const loader = new FileLoader(this.manager).setPath(this.path).setResponseType('arraybuffer');
    loader.setRequestHeader(this.requestHeader).setWithCredentials(this.withCredentials);
    const failed = (error) => {
      (onError ?? console.error)(error);
      this.manager.itemError(url);
    };
    loader.load(url, (bytes) => this.parse(bytes).then(onLoad).catch(failed), onProgress, onError);
  }

  /** Opens the bytes of an asset in a worker. */
  async parse(bytes) {
    this.#worker ??= this.#start();
    const { words, info } = await new Promise((resolve, reject) => {
      const id = this.#asked.size;
      this.#asked.set(id, { resolve, reject });
      this.#worker.postMessage({ id, bytes, levels: this.levels });
    });
    const material = new BtfNodeMaterial({ words });
    material.userData.btf = info;
    return material;
  }

  #start() {
    const worker = new Worker(new URL('./three_worker.js', import.meta.url), { type: 'module' });
    worker.onmessage = ({ data: { id, words, info, message } }) => {
      const { resolve, reject } = this.#asked.get(id);
      if (words) {
        resolve({ words, info });
      } else {
        reject(new Error(message));
      }
    };
    worker.onerror = (event) => this.#asked.forEach(({ reject }) => reject(new Error(event.message)));
    return worker;
  }

  /** Ends the worker. */
  dispose() {
    this.#worker?.terminate();
    this.#worker = undefined;
    this.#asked.clear();
  }
}

/** Plugin of GLTFLoader; see three.d.ts. */
export class GLTFBtfExtension {
  constructor(parser, loader = new BtfLoader(parser.options.manager)) {
    this.name = BTF_MATERIALS_SPMM;
    this.parser = parser;
    this.loader = loader;
  }

  loadMaterial(index) {
    const definition = this.parser.json.materials[index];
    const extension = definition.extensions?.[this.name];
    if (!extension) {
      return null;
    }
    return this.#material(definition, extension).catch((error) => {
      // What the file has for other viewers.
      console.warn(`${this.name} of material ${index}: ${error.message}`);
      return this.parser.loadMaterial(index);
    });
  }

  async #material({ name, doubleSided }, { asset, texCoord = 0 }) {
    const material = await this.loader.parse(await this.#bytes(asset));
    material.name = name ?? '';
    material.side = doubleSided ? 2 : 0;
    // glTF's v grows downwards.
    const at = uv(texCoord);
    material.uvNode = vec2(at.x, at.y.oneMinus());
    return material;
  }

  async #bytes({ uri, bufferView }) {
    if (bufferView !== undefined) {
      return this.parser.getDependency('bufferView', bufferView);
    }
    const { path, manager } = this.parser.options;
    const loader = new FileLoader(manager).setResponseType('arraybuffer');
    return loader.loadAsync(new URL(uri, new URL(path, document.baseURI)).href);
  }
}
