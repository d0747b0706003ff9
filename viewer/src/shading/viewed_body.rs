//! What a surface is made of at a point, as the eye sees it: any kind of body behind one set of functions. Twin:
//! `viewed_body.wgsl`.

use crate::sampler;
use btf_runtime::{LightRows, ViewedLeaf, ViewedTexel};
use glam::Vec3;
use std::f32::consts::PI;

/// The view's half of a point's shading, for light on one side of the surface.
pub(crate) enum ViewedBody<'a> {
    /// The share that a diffuse surface reflects or, with the light on the other side than the eye, lets through.
    Plain(Vec3),
    /// A texel of a layer, and its tint.
    Asset(Box<ViewedTexel<'a>>, Vec3),
    /// A leaf, for light on either side.
    Leaf(&'a ViewedLeaf<'a>),
}

impl ViewedBody<'_> {
    /// Returns `pi * f * |cos|` for light at `wi`, which is on the side that this body is viewed for.
    pub(crate) fn body_light(&self, rows: &mut LightRows, wi: Vec3) -> Vec3 {
        match self {
            ViewedBody::Plain(share) => *share * wi.z.abs(),
            ViewedBody::Asset(viewed, tint) => *tint * Vec3::from(viewed.light(rows, wi.to_array())),
            ViewedBody::Leaf(leaf) => leaf.light(wi.to_array()).into(),
        }
    }

    /// Returns whether the values lack the relief's shadows.
    pub(crate) fn is_bare(&self) -> bool {
        matches!(self, ViewedBody::Asset(viewed, _) if !viewed.has_residual())
    }

    /// Returns whether light on the body counts as an evaluation.
    pub(crate) fn is_evaluated(&self) -> bool {
        !matches!(self, ViewedBody::Plain(_))
    }

    /// Draws a direction on the back (`back`) or the front of the surface from three numbers in [0, 1); a leaf's may
    /// lie on either side.
    pub(crate) fn body_sample(&self, at: [f32; 3], back: bool) -> Vec3 {
        match self {
            ViewedBody::Plain(_) => {
                let wi = sampler::cosine([at[0], at[1]]);
                Vec3::new(wi.x, wi.y, if back { -wi.z } else { wi.z })
            }
            ViewedBody::Asset(viewed, _) => viewed.sample_direction(at).into(),
            ViewedBody::Leaf(leaf) => leaf.sample_direction(at).into(),
        }
    }

    /// Returns the density of [`ViewedBody::body_sample`], per steradian.
    pub(crate) fn body_density(&self, wi: Vec3) -> f32 {
        match self {
            ViewedBody::Plain(_) => wi.z.abs() / PI,
            ViewedBody::Asset(viewed, _) => viewed.sample_density(wi.to_array()),
            ViewedBody::Leaf(leaf) => leaf.sample_density(wi.to_array()),
        }
    }
}
