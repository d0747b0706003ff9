// How a path goes on from a surface: by its mirror, or scattered by what lies below. Twin: scatter.rs.

// How a path goes on from a surface.
struct Scattered {
    direction: vec3<f32>,
    // The direction leaves on the back.
    back: bool,
    // Reflected light over density; 0 ends the path.
    weight: vec3<f32>,
    // Density of the direction, per steradian; 0 from a mirror.
    density: f32,
}

// Returns how often a path goes on from the body, in proportion to the mirror's reflectance.
fn body_share(material: Material) -> f32 {
    return select(1.0, most(material.diffuse) + most(material.transmitted), is_plain(material));
}

// Returns whether a material is neither an asset nor a leaf.
fn is_plain(material: Material) -> bool {
    return material.asset == NO_ASSET && material.leaf == NO_ASSET;
}

// Returns the share of the directions in which a diffuse surface sends a path that leaves on the other side.
fn share_through(material: Material) -> f32 {
    return most(material.transmitted) / max(most(material.diffuse) + most(material.transmitted), 1e-6);
}

// Returns the share of a path's directions that leave on a side in another way than by the mirror.
fn side_share(s: Surface, material: Material, back: bool) -> f32 {
    let body = body_share(material);
    let share = body / max(most(material.mirror) + body, 1e-6);
    if with_assets && material.asset != NO_ASSET {
        let other = btf_layer_for_sides(material.asset, 0u, select(1u, 0u, back), select(0u, 1u, s.view_back));
        return share * select(1.0, 0.5, other != NO_LAYER);
    }
    if is_plain(material) {
        let through = share_through(material);
        return share * select(1.0 - through, through, back != s.view_back);
    }
    // A leaf's density is over both sides.
    return share;
}

// Returns the mirror direction about the shading normal, kept above the triangle.
fn mirror_direction(s: Surface, direction: vec3<f32>) -> vec3<f32> {
    let side = select(1.0, -1.0, s.view_back);
    let mirrored = reflect(direction, s.normal);
    let above = dot(mirrored, s.flat) * side;
    return normalize(mirrored + s.flat * (side * max(MIN_EYE_COS - above, 0.0)));
}

// Draws how a path along `direction` goes on from a surface, from the numbers `at` and `choice` in [0, 1).
fn scatter(
    s: Surface,
    material: Material,
    leaf: ViewedLeaf,
    direction: vec3<f32>,
    at: vec2<f32>,
    choice: f32,
) -> Scattered {
    let nothing = Scattered(direction, s.view_back, vec3<f32>(0.0), 0.0);
    let glossy = most(material.mirror);
    let body = body_share(material);
    if glossy + body <= 0.0 {
        return nothing;
    }
    let mirror_share = glossy / (glossy + body);
    if choice < mirror_share {
        return Scattered(mirror_direction(s, direction), s.view_back, material.mirror / mirror_share, 0.0);
    }
    var rest = (choice - mirror_share) / (1.0 - mirror_share);
    var back = s.view_back;
    if is_plain(material) && rest < share_through(material) {
        back = !back;
    }
    if with_assets && material.asset != NO_ASSET {
        let eye_side = select(0u, 1u, s.view_back);
        if btf_layer_for_sides(material.asset, 0u, 1u - eye_side, eye_side) != NO_LAYER {
            // Either side of the surface is as likely, where light comes from both.
            let both = btf_layer_for_sides(material.asset, 0u, eye_side, eye_side) != NO_LAYER;
            if !both || rest < 0.5 {
                back = !back;
            }
            rest = select(rest, fract(2.0 * rest), both);
        }
    }
    let viewed = viewed_body(s, material, leaf, 0u, back);
    if viewed.kind == BODY_NONE {
        return nothing;
    }
    let wi = body_sample(viewed, vec3<f32>(at, rest), back);
    if viewed.kind == BODY_LEAF {
        back = wi.z < 0.0;
    }
    let density = side_share(s, material, back) * body_density(viewed, wi);
    if density <= 0.0 || (wi.z < 0.0) != back {
        return nothing;
    }
    var rows: LightRows;
    let weight = body_light(viewed, material.asset, s.wo, &rows, wi) / (TRACE_PI * density);
    return Scattered(world_from_local(s, wi), back, weight, density);
}
