//! Reflectance and transmittance of microflakes of a leaf or of an asset: the hemispherical integrals of the same
//! material that is shaded near by, so that colours do not jump where a volume takes over.

use crate::error::VoxelizeError;
use crate::model::additive_recurrence::{place_of, recurrence_steps};
use crate::model::light_table::LightTable;
use crate::model::microflakes::MicroflakeColour;
use btf_models::{LeafDescription, ModelError, TextureImages, TextureKind};
use btf_runtime::{
    Asset, DecodeOptions, Leaf, LeafError, LeafMode, LeafState, LeafTexel, LeafTexture, Query, Resident, ViewedLeaf,
    evaluate,
};
use std::f32::consts::TAU;
use std::path::Path;

/// Number of places and directions of an integral: errors are some tenths of a per cent.
const SAMPLES: u32 = 1 << 14;

/// Steps in six dimensions: of the root of `x^7 = x + 1`.
const STEPS: [f64; 6] = recurrence_steps(1.112_775_684_278_705_5);

/// Texels of a leaf along its textures.
const LEAF_TEXELS: usize = 32;

/// A material from its file: a leaf's description (.toml) with its textures, or an asset (.spmm).
pub(crate) enum MaterialFile {
    /// A leaf, with the share of its faces that gloss.
    Leaf(Leaf, f32),
    /// An asset.
    Asset(Resident),
}

impl MaterialFile {
    /// Reads the file.
    ///
    /// # Errors
    /// For files that cannot be read.
    pub fn read(path: &Path) -> Result<MaterialFile, VoxelizeError> {
        if path.extension().is_some_and(|ending| ending == "spmm") {
            let bytes = std::fs::read(path).map_err(|source| VoxelizeError::File {
                path: path.into(),
                action: "reading",
                source,
                remedy: "check that it exists and that you may read it",
            })?;
            let asset = Asset::parse(&bytes).map_err(|source| VoxelizeError::Asset { path: path.into(), source })?;
            return Ok(MaterialFile::Asset(Resident::from_asset(&asset)));
        }
        let description = LeafDescription::read(path)?;
        let textures = description.textures_beside(path).map(TextureImages::read).transpose()?.unwrap_or_default();
        let state = LeafState::from_values(LeafMode::NLayers, description.tissue_and_gloss());
        let texture = texture_of(&textures, description.size_mm as f32);
        let leaf = Leaf::new(&state, &texture).map_err(|error| ModelError::Leaf {
            path: path.into(),
            fault: format!("cannot be evaluated ({error})"),
            remedy: "correct it",
        })?;
        Ok(MaterialFile::Leaf(leaf, glossy_share(&texture)))
    }

    /// Returns the hemispherical integrals.
    pub fn colour(&self) -> MicroflakeColour {
        match self {
            MaterialFile::Leaf(leaf, glossy) => colour_of(leaf, *glossy),
            MaterialFile::Asset(asset) => colour_of_asset(asset),
        }
    }

    /// Returns the light by directions.
    pub fn light_table(&self) -> LightTable {
        match self {
            MaterialFile::Leaf(leaf, _) => LightTable::new(|uv, wo| {
                let viewed = ViewedLeaf::new(leaf.words(), uv, 0, [1.0; 4], wo);
                move |wi| viewed.light(wi)
            }),
            MaterialFile::Asset(asset) => {
                LightTable::new(|uv, wo| move |wi| evaluate(asset, 0, &Query { uv, wi, wo }, &DecodeOptions::default()))
            }
        }
    }
}

/// Returns the share of a leaf's faces that gloss.
fn glossy_share(texture: &LeafTexture) -> f32 {
    let faces = texture.texels.iter().flat_map(|texel| texel.gloss);
    faces.sum::<f32>() / (2 * texture.texels.len()) as f32
}

/// Returns the colour of a leaf with `texture`. The specular lobe is apart: what it reflects of diffuse light is not
/// part of the reflectance.
///
/// # Errors
/// As [`Leaf::new`].
pub fn colour_of_leaf(state: &LeafState, texture: &LeafTexture) -> Result<MicroflakeColour, LeafError> {
    Ok(colour_of(&Leaf::new(state, texture)?, glossy_share(texture)))
}

fn colour_of(leaf: &Leaf, glossy: f32) -> MicroflakeColour {
    let all = integrate(|query| ViewedLeaf::new(leaf.words(), query.uv, 0, [1.0; 4], query.wo).light(query.wi));
    let LeafState { gloss_index, gamma_along, gamma_across, .. } = leaf.state();
    let smooth = ((gloss_index - 1.0) / (gloss_index + 1.0)).powi(2);
    MicroflakeColour {
        reflectance: all.reflectance.map(|x| (x - glossy * leaf.gloss_albedo()).max(0.0)),
        specular: glossy * smooth,
        // Facets of Beckmann's gamma are as steep as GGX's of that alpha.
        roughness: (gamma_along * gamma_across).sqrt().clamp(0.0, 1.0),
        ..all
    }
}

/// Returns the colour of an asset, whose specular reflection counts as diffuse. Where the asset has no layer for a
/// side, the other side's stands for both; without transmission it is opaque.
pub fn colour_of_asset(asset: &Resident) -> MicroflakeColour {
    integrate(|query| evaluate(asset, 0, query, &DecodeOptions::default()))
}

/// Returns the shares of diffuse light that `light`, `pi f |cos_i|`, reflects and transmits, as means of both sides.
fn integrate(light: impl Fn(&Query) -> [f32; 3]) -> MicroflakeColour {
    // Reflection of the front and of the back, transmission to each.
    let mut sums = [[0f64; 3]; 4];
    for i in 0..SAMPLES {
        let at = place_of(&STEPS, i + 1);
        let (wo, wi) = (cosine_direction(at[2], at[3]), uniform_direction(at[4], at[5]));
        for (number, sides) in [[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]].into_iter().enumerate() {
            let turned = |[x, y, z]: [f32; 3], side: f32| [x, y, z * side];
            let query = Query { uv: [at[0], at[1]], wi: turned(wi, sides[1]), wo: turned(wo, sides[0]) };
            let value = light(&query);
            (0..3).for_each(|k| sums[number][k] += f64::from(value[k]));
        }
    }
    // The mean over the hemisphere of `pi f cos_i` is half of what its integral over pi is.
    let shares = sums.map(|sum| sum.map(|sum| 2.0 * sum / f64::from(SAMPLES)));
    let both = |a: [f64; 3], b: [f64; 3]| -> [f32; 3] {
        let there = |share: [f64; 3]| share.iter().any(|x| *x != 0.0);
        let parts = f64::from(u8::from(there(a)) + u8::from(there(b))).max(1.0);
        std::array::from_fn(|k| ((a[k] + b[k]) / parts).clamp(0.0, 1.0) as f32)
    };
    MicroflakeColour {
        reflectance: both(shares[0], shares[1]),
        transmittance: both(shares[2], shares[3]),
        ..MicroflakeColour::default()
    }
}

fn cosine_direction(a: f32, b: f32) -> [f32; 3] {
    let (radius, (sin, cos)) = (a.sqrt(), (TAU * b).sin_cos());
    [radius * cos, radius * sin, (1.0 - a).max(1e-6).sqrt()]
}

fn uniform_direction(a: f32, b: f32) -> [f32; 3] {
    let (z, (sin, cos)) = (1.0 - a, (TAU * b).sin_cos());
    let radius = (1.0 - z * z).max(0.0).sqrt();
    [radius * cos, radius * sin, z]
}

/// Returns pigment, thickness and roughness of textures on a coarse grid; displacement and the directions of veins
/// hardly change hemispherical shares.
fn texture_of(images: &TextureImages, size_mm: f32) -> LeafTexture {
    let texel = |number: usize| {
        let at = [number % LEAF_TEXELS, number / LEAF_TEXELS].map(|i| size_mm * (i as f32 + 0.5) / LEAF_TEXELS as f32);
        let here = |kind| images.sample(kind, at, size_mm);
        let plain = LeafTexel::default();
        let [a, b, c] = here(TextureKind::Pigment).unwrap_or([plain.factors[0], plain.factors[1], plain.factors[2]]);
        let thickness = here(TextureKind::Thickness).map_or(plain.factors[3], |thickness| thickness[0]);
        let front = here(TextureKind::Gloss).map_or(plain.gloss[0], |gloss| gloss[0]);
        let back = here(TextureKind::GlossAbaxial).map_or(front, |gloss| gloss[0]);
        LeafTexel { factors: [a, b, c, thickness], gloss: [front, back], ..plain }
    };
    LeafTexture { width: LEAF_TEXELS, texels: (0..LEAF_TEXELS * LEAF_TEXELS).map(texel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diffuse_sheet_has_the_shares_that_it_is_made_of() {
        let [reflectance, transmittance] = [[0.3, 0.5, 0.1], [0.2, 0.1, 0.6]];
        let found = integrate(|query| {
            let share = if query.wi[2] * query.wo[2] > 0.0 { reflectance } else { transmittance };
            share.map(|share: f32| share * query.wi[2].abs())
        });
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 2e-3);
        assert!(near(found.reflectance, reflectance) && near(found.transmittance, transmittance), "{found:?}");
        // One side alone stands for both.
        let front = integrate(|query| [query.wi[2].max(0.0) * f32::from(u8::from(query.wo[2] > 0.0)); 3]);
        assert!(near(front.reflectance, [1.0; 3]) && front.transmittance == [0.0; 3], "{front:?}");
    }

    #[test]
    fn a_leaf_without_pigments_loses_nothing_and_a_green_one_is_green() {
        let clear = LeafState {
            chlorophyll_ug_per_cm2: 0.0,
            carotenoid_ug_per_cm2: 0.0,
            anthocyanin_ug_per_cm2: 0.0,
            brown: 0.0,
            water_cm: 0.0,
            dry_matter_g_per_cm2: 0.0,
            ..LeafState::default()
        };
        let colour = |state| colour_of_leaf(&state, &LeafTexture::uniform(LeafTexel::default())).unwrap();
        let whole = colour(clear);
        // The default gloss on both faces.
        let gloss = Leaf::new(&clear, &LeafTexture::uniform(LeafTexel::default())).unwrap().gloss_albedo();
        for k in 0..3 {
            let sum = whole.reflectance[k] + whole.transmittance[k] + gloss;
            assert!((sum - 1.0).abs() < 0.02, "{whole:?}");
        }
        let green = colour(LeafState::default());
        assert!(green.reflectance[1] > 1.5 * green.reflectance[2] && green.transmittance[1] > green.transmittance[0]);
    }
}
