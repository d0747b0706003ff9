//! How a path goes on from a surface: by its mirror, or scattered by what lies below. Twin: `scatter.wgsl`.

use crate::cpu::shader::Shader;
use crate::geometry::surface::{MIN_EYE_COS, Surface};
use crate::scene::material::{Body, Material};
use crate::scene::scene::Scene;
use crate::shading::viewed_body::ViewedBody;
use btf_models::DiffuseColour;
use btf_runtime::{LightRows, ViewedLeaf};
use glam::Vec3;
use std::f32::consts::PI;

/// The next ray of a path from a surface.
pub(crate) struct Scattered {
    pub direction: Vec3,
    /// The direction leaves on the back.
    pub back: bool,
    /// Reflected light over density.
    pub weight: Vec3,
    /// Density of the direction, per steradian; 0 from a mirror.
    pub density: f32,
}

/// Returns how often a path goes on from the body, in proportion to the mirror's reflectance.
fn body_share(material: &Material) -> f32 {
    match material.body {
        Body::Plain(DiffuseColour { reflectance, transmittance }) => {
            Vec3::from(reflectance).max_element() + Vec3::from(transmittance).max_element()
        }
        Body::Asset(_) | Body::Leaf(_) => 1.0,
    }
}

/// Returns the share of the directions in which a diffuse surface sends a path that leaves on the other side.
fn share_through(colour: &DiffuseColour) -> f32 {
    let [reflected, passed] = [colour.reflectance, colour.transmittance].map(|share| Vec3::from(share).max_element());
    passed / (reflected + passed).max(1e-6)
}

/// Returns the share of a path's directions that leave on a side in another way than by the mirror.
pub(crate) fn side_share(scene: &Scene, s: &Surface, material: &Material, back: bool) -> f32 {
    let body = body_share(material);
    let share = body / (Vec3::from(material.mirror).max_element() + body).max(1e-6);
    match material.body {
        Body::Plain(colour) if back == s.view_back => share * (1.0 - share_through(&colour)),
        Body::Plain(colour) => share * share_through(&colour),
        Body::Asset(asset)
            if scene.assets[asset].head().layer_for_sides(0, (!back).into(), s.view_back.into()).is_some() =>
        {
            0.5 * share
        }
        // A leaf's density is over both sides.
        _ => share,
    }
}

/// Returns the mirror direction about the shading normal, kept above the triangle.
pub(crate) fn mirror_direction(s: &Surface, direction: Vec3) -> Vec3 {
    let side = if s.view_back { -1.0 } else { 1.0 };
    let mirrored = direction - 2.0 * s.normal.dot(direction) * s.normal;
    let above = mirrored.dot(s.flat) * side;
    (mirrored + s.flat * (side * (MIN_EYE_COS - above).max(0.0))).normalize()
}

impl Shader<'_> {
    /// Draws how a path along `direction` goes on from a surface, from the numbers `at` and `choice` in [0, 1); `None`
    /// where the path ends.
    pub(crate) fn scatter(
        &self,
        s: &Surface,
        material: &Material,
        leaf: Option<&ViewedLeaf>,
        direction: Vec3,
        at: [f32; 2],
        choice: f32,
    ) -> Option<Scattered> {
        let glossy = Vec3::from(material.mirror).max_element();
        let body = body_share(material);
        if glossy + body <= 0.0 {
            return None;
        }
        let mirror_share = glossy / (glossy + body);
        if choice < mirror_share {
            let weight = Vec3::from(material.mirror) / mirror_share;
            return Some(Scattered {
                direction: mirror_direction(s, direction),
                back: s.view_back,
                weight,
                density: 0.0,
            });
        }
        let mut rest = (choice - mirror_share) / (1.0 - mirror_share);
        let mut back = s.view_back;
        if let Body::Plain(colour) = material.body {
            back ^= rest < share_through(&colour);
        }
        if let Body::Asset(asset) = material.body {
            let head = self.scene.assets[asset].head();
            if head.layer_for_sides(0, (!s.view_back).into(), s.view_back.into()).is_some() {
                // Either side of the surface is as likely, where light comes from both.
                let both = head.layer_for_sides(0, s.view_back.into(), s.view_back.into()).is_some();
                if !both || rest < 0.5 {
                    back = !back;
                }
                rest = if both { (2.0 * rest).fract() } else { rest };
            }
        }
        let viewed = self.viewed_body(s, material, leaf, 0, back)?;
        let wi = viewed.body_sample([at[0], at[1], rest], back);
        if matches!(viewed, ViewedBody::Leaf(..)) {
            back = wi.z < 0.0;
        }
        let density = side_share(self.scene, s, material, back) * viewed.body_density(wi);
        if density <= 0.0 || (wi.z < 0.0) != back {
            return None;
        }
        let weight = viewed.body_light(&mut LightRows::default(), wi) / (PI * density);
        Some(Scattered { direction: s.world_from_local(wi), back, weight, density })
    }
}
