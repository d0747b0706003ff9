//! The WGSL of the decoders as text. An includer joins the files in this order with its own.

/// The file of [`WGSL`] that an includer leaves out which defines `fn asset_quad(index: u32) -> vec4<u32>` itself: the words from
/// number `4 * index` on.
const ASSET_QUAD: &str = "asset_quad.wgsl";

/// The decoder's library in WGSL: `(file name, text)`. The library has no bindings; its includer defines `fn
/// asset_word(index: u32) -> u32`.
///
/// The text is core WGSL. It reads half-precision pairs with `unpack2x16float`: naga's `SHADER_FLOAT16_IN_FLOAT32`,
/// which every WebGPU device has (wgpu: `DownlevelFlags::SHADER_F16_IN_F32`).
pub const WGSL: &[(&str, &str)] = &[
    ("quantize.wgsl", include_str!("numeric/quantize.wgsl")),
    ("sphere.wgsl", include_str!("asset/sphere.wgsl")),
    ("lobe.wgsl", include_str!("asset/lobe.wgsl")),
    ("residual.wgsl", include_str!("asset/residual.wgsl")),
    ("layout.wgsl", include_str!("resident/layout.wgsl")),
    (ASSET_QUAD, include_str!("resident/asset_quad.wgsl")),
    ("height_field.wgsl", include_str!("asset/height_field.wgsl")),
    ("parallax.wgsl", include_str!("decode/parallax.wgsl")),
    ("packed_part.wgsl", include_str!("resident/packed_part.wgsl")),
    ("packed_sum.wgsl", include_str!("decode/packed_sum.wgsl")),
    ("texel.wgsl", include_str!("decode/texel.wgsl")),
    ("residual_sum.wgsl", include_str!("decode/residual_sum.wgsl")),
    ("relief.wgsl", include_str!("decode/relief.wgsl")),
    ("shown.wgsl", include_str!("decode/shown.wgsl")),
    ("viewed_texel.wgsl", include_str!("decode/viewed_texel.wgsl")),
    ("sample.wgsl", include_str!("decode/sample.wgsl")),
    ("decode.wgsl", include_str!("decode/decode.wgsl")),
    ("evaluate.wgsl", include_str!("decode/evaluate.wgsl")),
];

/// Returns the files of [`WGSL`], joined.
pub fn wgsl_library() -> String {
    WGSL.iter().map(|(_, text)| *text).collect::<Vec<_>>().join("\n")
}

/// Returns the files of [`WGSL`], joined, for an includer that defines `fn asset_quad(index: u32) -> vec4<u32>` besides
/// `asset_word`: the words from number `4 * index` on, in one read of an array of `vec4<u32>`.
pub fn wgsl_library_of_quads() -> String {
    let texts = WGSL.iter().filter(|(name, _)| *name != ASSET_QUAD).map(|(_, text)| *text);
    texts.collect::<Vec<_>>().join("\n")
}

/// The functions of leaves whose optics are evaluated live: `(file name, text)`. They follow [`WGSL`], of which they
/// use `asset_f32`, `sample_about_z` and constants. Core WGSL without capabilities of its own.
pub const LEAF_WGSL: &[(&str, &str)] = &[
    ("leaf_words.wgsl", include_str!("leaf/words.wgsl")),
    ("leaf_theta.wgsl", include_str!("leaf/theta.wgsl")),
    ("leaf_texture.wgsl", include_str!("leaf/texture.wgsl")),
    ("leaf_body.wgsl", include_str!("leaf/body.wgsl")),
    ("leaf_scatter.wgsl", include_str!("leaf/scatter.wgsl")),
    ("leaf_lobe.wgsl", include_str!("leaf/lobe.wgsl")),
    ("viewed_leaf.wgsl", include_str!("leaf/viewed.wgsl")),
];

/// Returns the files of [`LEAF_WGSL`], joined.
pub fn leaf_wgsl() -> String {
    LEAF_WGSL.iter().map(|(_, text)| *text).collect::<Vec<_>>().join("\n")
}

/// The functions of volumetric textures ([`crate::voltex`]): `(file name, text)`. They follow [`WGSL`], of which they
/// use `asset_f32`. Functions take the number of a volume's first word as `base`. Core WGSL without capabilities of its
/// own.
pub const VOLTEX_WGSL: &[(&str, &str)] = &[
    ("voltex_matrix.wgsl", include_str!("voltex/matrix.wgsl")),
    ("voltex_words.wgsl", include_str!("voltex/words.wgsl")),
    ("voltex_voxel.wgsl", include_str!("voltex/voxel.wgsl")),
    ("voltex_node.wgsl", include_str!("voltex/node.wgsl")),
    ("voltex_tree.wgsl", include_str!("voltex/tree.wgsl")),
    ("voltex_walk.wgsl", include_str!("voltex/walk.wgsl")),
    ("voltex_shade.wgsl", include_str!("voltex/shade.wgsl")),
    ("voltex_gloss.wgsl", include_str!("voltex/gloss.wgsl")),
];

/// Returns the files of [`VOLTEX_WGSL`], joined.
pub fn voltex_wgsl() -> String {
    VOLTEX_WGSL.iter().map(|(_, text)| *text).collect::<Vec<_>>().join("\n")
}
