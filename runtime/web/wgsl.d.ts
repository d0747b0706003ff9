/**
 * The decoder of assets in WGSL: no bindings and no entry points. The shader that includes it defines
 * `fn asset_word(index: u32) -> u32`, which reads a word of `asset.words`, and calls `btf_evaluate`, `btf_sample` and
 * `btf_density`.
 */
export const btfWGSL: string;
