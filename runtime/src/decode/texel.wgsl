// A texel within a layer: everything that does not depend on the directions, its lobes and its residual. Twin:
// decode/texel.rs.

const LOBE_ROLE_OLD_BASE: u32 = 0u;
const LOBE_ROLE_GUIDE: u32 = 1u;
const LOBE_ROLE_BASE: u32 = 2u;

// The options of one evaluation, from fast to exact.
struct BtfOptions {
    components: u32,
    lobes: u32,
    interpolation: u32,
    // Use of the heights, where the asset has any: 0 none, 1 for parallax beyond the views' hull, 2 for relief as well.
    heights: u32,
}

// The record of a texel, with the limits of the options applied.
struct Texel {
    base: u32,
    // First word of the layer's block.
    layer: u32,
    texel: u32,
    cluster: u32,
    lobes: u32,
    first_ref: u32,
    // Number of bases in use: the mean and the components; 0 without residual.
    bases: u32,
    // Number of the texel's edit, counted from 1; 0 for none.
    edit: u32,
}

// Reads texel number `texel` of the layer whose block begins at word `layer`, in the asset at word `base`.
fn texel_at(base: u32, layer: u32, texel: u32, options: BtfOptions) -> Texel {
    let record = base + asset_word(layer + BLOCK_RECORDS) + 2u * texel;
    let head = asset_word(record);
    // Adds 1 without wrapping round at 0xffffffff.
    let wanted = min(options.components, 0xfffffffeu) + 1u;
    return Texel(
        base,
        layer,
        texel,
        head & 0xffu,
        min(head >> 16u, options.lobes),
        asset_word(record + 1u),
        min(asset_word(layer + BLOCK_BASES), wanted),
        (head >> 8u) & 0xffu,
    );
}

struct TexelLobe {
    lobe: LobeSetup,
    weights: vec3<f32>,
}

// Reads the lobe that a reference names in the dictionary at word `dictionary`, and its weights.
fn texel_lobe(dictionary: u32, reference: u32) -> TexelLobe {
    let lobe = lobe_from_resident(dictionary + (reference & 0xffu) * LOBE_RESIDENT_WORDS);
    let weights = vec3<f32>(
        weight_from_byte((reference >> 8u) & 0xffu, lobe.weight_scale),
        weight_from_byte((reference >> 16u) & 0xffu, lobe.weight_scale),
        weight_from_byte((reference >> 24u) & 0xffu, lobe.weight_scale),
    );
    return TexelLobe(lobe, weights);
}

// Returns the first word of the dictionary of the texel's cluster, as measured (`edit` 0) or as the edit numbered
// `edit` has it.
fn texel_dictionary(t: Texel, edit: u32) -> u32 {
    var table = asset_word(t.layer + BLOCK_DICTIONARIES);
    if edit > 0u {
        table = asset_word(t.base + asset_word(t.layer + BLOCK_EDITS) + (edit - 1u) * EDIT_WORDS + 4u);
    }
    return t.base + asset_word(t.base + table + t.cluster);
}

// Sums the texel's lobes from the dictionary of `edit`.
fn texel_lobe_sum(t: Texel, edit: u32, wi: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let dictionary = texel_dictionary(t, edit);
    let refs = t.base + asset_word(t.layer + BLOCK_REFS) + t.first_ref;
    var sum = vec3<f32>(0.0);
    for (var slot = 0u; slot < t.lobes; slot++) {
        let one = texel_lobe(dictionary, asset_word(refs + slot));
        sum += one.weights * lobe_eval(one.lobe, wi, wo);
    }
    return sum;
}
