// The material of a surface at a point, as the eye sees it: any kind of body behind one set of functions. Twin:
// viewed_body.rs.

const BODY_NONE: u32 = 0u;
const BODY_PLAIN: u32 = 1u;
const BODY_ASSET: u32 = 2u;
const BODY_LEAF: u32 = 3u;

// The view's half of a point's shading, for light on one side of the surface; a leaf's is for either side.
struct ViewedBody {
    kind: u32,
    // Of an asset, for the decoder that does everything anew.
    layer: u32,
    number: u32,
    // Whether the relief's shadows are missing in its values.
    bare: bool,
    // What a plain one sends from that side to the eye, or the tint of an asset.
    diffuse: vec3<f32>,
    texel: ViewedTexel,
    leaf: ViewedLeaf,
}

// Returns the view-dependent half of a point's shading for light on one side, of the kind BODY_NONE where nothing of
// that reaches the eye. `leaf` is the leaf there, if the material is one.
fn viewed_body(s: Surface, material: Material, leaf: ViewedLeaf, level: u32, light_back: bool) -> ViewedBody {
    var viewed: ViewedBody;
    viewed.diffuse = material.diffuse;
    if with_leaves && material.leaf != NO_ASSET {
        viewed.kind = BODY_LEAF;
        viewed.leaf = leaf;
        viewed.leaf.reflected *= material.diffuse;
        viewed.leaf.transmitted *= material.diffuse;
        return viewed;
    }
    if !with_assets || material.asset == NO_ASSET {
        let through = light_back != s.view_back;
        viewed.diffuse = select(material.diffuse, material.transmitted, through);
        if material.noise > 0u && !through {
            let noise = fractal_noise(s.uv * material.uv_scale, level);
            viewed.diffuse *= mix(vec3<f32>(1.0), 255.0 / 127.0 * unpack4x8unorm(material.noise).xyz, noise);
        }
        viewed.kind = select(BODY_PLAIN, BODY_NONE, through && most(material.transmitted) <= 0.0);
        return viewed;
    }
    viewed.layer = btf_layer_for_sides(material.asset, level, select(0u, 1u, light_back), select(0u, 1u, s.view_back));
    if viewed.layer == NO_LAYER {
        return viewed;
    }
    viewed.kind = BODY_ASSET;
    viewed.number = btf_texel_between(material.asset, viewed.layer, s.uv * material.uv_scale, s.texel_at);
    viewed.bare = asset_word(material.asset + asset_word(material.asset + ASSET_LAYERS + viewed.layer) + BLOCK_BASES) == 0u;
    if !whole_decoder || (with_environment && frame.environment.x > 0u) {
        viewed.texel = viewed_new(material.asset, viewed.layer, viewed.number, s.wo, decode_options());
        if !with_edits {
            viewed.texel.t.edit = 0u;
        }
        if !with_packed_bases {
            viewed.texel.packed = false;
        }
        if !with_uneven_rows {
            viewed.texel.in_quads = true;
        }
    }
    return viewed;
}

// Returns how assets are decoded in this frame.
fn decode_options() -> BtfOptions {
    var options = BtfOptions(frame.components, frame.lobes, frame.interpolation, min(frame.heights, most_heights));
    if !with_exact_rule {
        options.interpolation = INTERPOLATION_FAST;
    }
    return options;
}

// Returns pi * f * |cos| for light at `wi`, which is on the side that this body is viewed for.
fn body_light(viewed: ViewedBody, asset: u32, wo: vec3<f32>, rows: ptr<function, LightRows>, wi: vec3<f32>) -> vec3<f32> {
    if with_leaves && viewed.kind == BODY_LEAF {
        return leaf_light(viewed.leaf, wi);
    }
    if !with_assets || viewed.kind == BODY_PLAIN {
        return viewed.diffuse * abs(wi.z);
    }
    if whole_decoder {
        return viewed.diffuse * btf_decode(asset, viewed.layer, viewed.number, wi, wo, decode_options());
    }
    if !with_kept_rows {
        return viewed.diffuse * viewed_light_alone(viewed.texel, wi);
    }
    return viewed.diffuse * viewed_light(viewed.texel, rows, wi);
}

// Draws a direction on the back (`back`) or the front of the surface from three numbers in [0, 1); a leaf's may lie on
// either side.
fn body_sample(viewed: ViewedBody, at: vec3<f32>, back: bool) -> vec3<f32> {
    if with_leaves && viewed.kind == BODY_LEAF {
        return leaf_sample_direction(viewed.leaf, at);
    }
    if !with_assets || viewed.kind == BODY_PLAIN {
        let wi = sampler_cosine(at.xy);
        return vec3<f32>(wi.xy, select(wi.z, -wi.z, back));
    }
    return sample_direction(viewed.texel, at);
}

// Returns the density of body_sample, per steradian.
fn body_density(viewed: ViewedBody, wi: vec3<f32>) -> f32 {
    if with_leaves && viewed.kind == BODY_LEAF {
        return leaf_sample_density(viewed.leaf, wi);
    }
    if !with_assets || viewed.kind == BODY_PLAIN {
        return abs(wi.z) / TRACE_PI;
    }
    return sample_density(viewed.texel, wi);
}
