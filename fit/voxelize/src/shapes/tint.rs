//! Tints inside the volume: pictures and procedural textures [Neyret 1996, section 3.3].

use std::path::Path;
use std::sync::Arc;

use btf_capture::Transfer;
use btf_models::shapes::{Projection, Script, Space, Tint};
use glam::{DVec2, DVec3};

use super::noise::NoiseField;
use super::unusable;
use crate::error::VoxelizeError;

/// Texels along a side of a picture at most.
const MAX_TEXELS: u32 = 1 << 14;

/// Factors of a colour by place.
#[derive(Debug, Clone)]
pub enum TintMap {
    /// A picture, and the plane that it lies on.
    Picture(Arc<Picture>, Option<Plane>),
    /// Colours from one to the other by the noise.
    Noise(NoiseField, [[f64; 3]; 2]),
    /// Stripes of two colours along a vector, whose length is a period.
    Stripes(DVec3, [[f64; 3]; 2]),
    /// Boxes of two colours by turns.
    Checker(DVec3, [[f64; 3]; 2]),
}

/// A picture, whose texels begin at the top left.
#[derive(Debug)]
pub struct Picture {
    width: u32,
    height: u32,
    /// Texels, encoded with the sRGB curve.
    texels: Vec<[u8; 3]>,
    linear: [f32; 256],
}

/// A plane with two coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    corner: DVec3,
    /// Vectors whose products with a vector from the corner are its coordinates.
    duals: [DVec3; 2],
}

impl TintMap {
    /// Returns the tint of a material; `script` is the path that its files stand beside.
    ///
    /// # Errors
    /// For a picture that cannot be read.
    pub fn new(tint: &Tint, space: &Space, script: &Path) -> Result<TintMap, VoxelizeError> {
        Ok(match tint {
            Tint::Picture { file, projection } => {
                let picture = Picture::read(&Script::beside(script, file))?;
                TintMap::Picture(picture.into(), projection.as_ref().map(Plane::new))
            }
            Tint::Noise { noise, colours } => TintMap::Noise(NoiseField::new(noise, space), *colours),
            Tint::Stripes { period_m, colours } => TintMap::Stripes((*period_m).into(), *colours),
            Tint::Checker { box_m, colours } => TintMap::Checker((*box_m).into(), *colours),
        })
    }

    /// Returns the factors at a place with texture coordinates `uv`; where a picture needs coordinates and there are
    /// none, those of its first texel.
    pub fn at(&self, place_m: DVec3, uv: Option<DVec2>) -> [f32; 3] {
        let mix = |colours: &[[f64; 3]; 2], share: f64| -> [f32; 3] {
            std::array::from_fn(|k| (colours[0][k] + (colours[1][k] - colours[0][k]) * share) as f32)
        };
        match self {
            TintMap::Picture(picture, None) => picture.at(uv.unwrap_or_default()),
            TintMap::Picture(picture, Some(plane)) => picture.at(plane.coordinates(place_m)),
            TintMap::Noise(noise, colours) => mix(colours, (noise.at(place_m).0 + 0.5).clamp(0.0, 1.0)),
            TintMap::Stripes(period_m, colours) => {
                let phase = place_m.dot(*period_m) / period_m.length_squared();
                mix(colours, f64::from(u8::from(phase.rem_euclid(1.0) >= 0.5)))
            }
            TintMap::Checker(box_m, colours) => {
                let number = (place_m / box_m).floor().element_sum();
                mix(colours, number.rem_euclid(2.0))
            }
        }
    }
}

impl Plane {
    fn new(projection: &Projection) -> Plane {
        let [right, up] = [projection.right_m, projection.up_m].map(DVec3::from);
        let normal = right.cross(up);
        let duals = [up.cross(normal), normal.cross(right)].map(|dual| dual / normal.length_squared());
        Plane { corner: projection.corner_m.into(), duals }
    }

    fn coordinates(&self, place_m: DVec3) -> DVec2 {
        let from = place_m - self.corner;
        DVec2::new(from.dot(self.duals[0]), from.dot(self.duals[1]))
    }
}

impl Picture {
    fn read(path: &Path) -> Result<Picture, VoxelizeError> {
        const REMEDY: &str = "name a PNG or JPEG picture";
        let failed = |action| move |source| VoxelizeError::File { path: path.into(), action, source, remedy: REMEDY };
        let mut reader = image::ImageReader::open(path).map_err(failed("opening"))?;
        let mut limits = image::Limits::default();
        (limits.max_image_width, limits.max_image_height) = (Some(MAX_TEXELS), Some(MAX_TEXELS));
        reader.limits(limits);
        let reader = reader.with_guessed_format().map_err(failed("reading"))?;
        let picture = reader.decode().map_err(|error| unusable(path, format!("is no picture ({error})"), REMEDY))?;
        let picture = picture.into_rgb8();
        let (width, height) = picture.dimensions();
        if width == 0 || height == 0 {
            return Err(unusable(path, "has no texels".into(), REMEDY));
        }
        let linear = std::array::from_fn(|code| Transfer::Srgb.linear_from_encoded(code as f32 / 255.0));
        Ok(Picture { width, height, texels: picture.pixels().map(|texel| texel.0).collect(), linear })
    }

    /// Interpolates between the four nearest texels; v counts upwards.
    fn at(&self, uv: DVec2) -> [f32; 3] {
        let at = DVec2::new(uv.x, 1.0 - uv.y) * DVec2::new(f64::from(self.width), f64::from(self.height)) - 0.5;
        let (corner, share) = (at.floor(), at - at.floor());
        let texel = |i: i64, j: i64| {
            let column = (corner.x as i64 + i).rem_euclid(i64::from(self.width)) as usize;
            let row = (corner.y as i64 + j).rem_euclid(i64::from(self.height)) as usize;
            self.texels[row * self.width as usize + column].map(|code| self.linear[usize::from(code)])
        };
        let [x, y] = [share.x as f32, share.y as f32];
        let (upper, lower) = ([texel(0, 0), texel(1, 0)], [texel(0, 1), texel(1, 1)]);
        std::array::from_fn(|k| {
            let row = |pair: &[[f32; 3]; 2]| pair[0][k] + (pair[1][k] - pair[0][k]) * x;
            row(&upper) + (row(&lower) - row(&upper)) * y
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_lie_where_they_are_projected_and_repeat() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("four.png");
        let texels = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
        let picture = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb(texels[(y * 2 + x) as usize]));
        picture.save(&path).unwrap();
        let projection = Projection { corner_m: [1.0, 0.0, 2.0], right_m: [2.0, 0.0, 0.0], up_m: [1.0, 0.0, 4.0] };
        let space = Space { least_m: [0.0; 3], most_m: [1.0; 3], cyclic: [false; 2] };
        let tint = Tint::Picture { file: "four.png".into(), projection: Some(projection) };
        let tint = TintMap::new(&tint, &space, &folder.path().join("a.shapes.toml")).unwrap();
        // Middles of texels; y does not matter, and whole periods do not.
        for (u, v, expected) in
            [(0.25, 0.75, [1.0, 0.0, 0.0]), (0.75, 0.75, [0.0, 1.0, 0.0]), (0.25, 0.25, [0.0, 0.0, 1.0])]
        {
            for shift in [0.0, 3.0] {
                let place = DVec3::new(1.0, 5.0, 2.0)
                    + DVec3::X * (2.0 * (u + shift))
                    + DVec3::new(1.0, 0.0, 4.0) * (v - shift);
                let found = tint.at(place, None);
                assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-5), "{found:?} {expected:?}");
            }
        }
        std::fs::write(&path, b"no picture").unwrap();
        let tint = Tint::Picture { file: "four.png".into(), projection: None };
        let message = TintMap::new(&tint, &space, &folder.path().join("a")).unwrap_err().to_string();
        assert!(
            message.contains("four.png is no picture") && message.ends_with("name a PNG or JPEG picture"),
            "{message}"
        );
    }

    #[test]
    fn stripes_and_checkers_take_turns() {
        let colours = [[0.0; 3], [1.0; 3]];
        let stripes = TintMap::Stripes(DVec3::new(0.0, 0.2, 0.0), colours);
        assert_eq!(
            [0.05, 0.15, 0.25, -0.05].map(|y| stripes.at(DVec3::new(9.0, y, 1.0), None)[0]),
            [0.0, 1.0, 0.0, 1.0]
        );
        let checker = TintMap::Checker(DVec3::splat(0.1), colours);
        assert_eq!(
            [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [1.5, 1.5, 0.5], [-0.5, 0.5, 0.5]]
                .map(|p| checker.at(0.1 * DVec3::from(p), None)[0]),
            [0.0, 1.0, 0.0, 1.0]
        );
    }
}
