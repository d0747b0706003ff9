//! The settings of a rendering: what costs time and changes accuracy.

use btf_runtime::DecodeOptions;

/// The settings of a rendering that trade speed for accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShadeOptions {
    /// Options of the decoder of assets.
    pub decode: DecodeOptions,
    /// The light that is followed.
    pub mode: RenderMode,
    /// Point lights of which a sample asks at most: where there are more, they are drawn by what each could add, 1 to
    /// [`MAX_LIGHT_SAMPLES`].
    pub light_samples: u32,
    /// Rays of a path at most, the first from the eye: 1 shows no mirror images, 1 to [`MAX_DEPTH`].
    pub depth: u32,
    /// Take the level of an asset whose texels are about as large as what a pixel sees of the surface: each pixel the
    /// nearest level at first, then levels at random, in the mean between the two nearest. Traced paths, the reference,
    /// take the finest level always.
    pub levels: bool,
    /// Texels that an asset's place is shaded by.
    pub filter: Filter,
    /// The way in which a sky lights surfaces, where no path goes on to it.
    pub sky: SkyLight,
    /// Cells along the scene's longest side of a grid that holds the light after one bounce, which [`RenderMode::Direct`] then has
    /// besides, at most [`MAX_IRRADIANCE_CELLS`]; 0 for none. The grid is filled during the first 32 samples of a scene that stays as
    /// it is.
    pub irradiance_cells: u32,
}

/// The texels by which a place of an asset is shaded. (A live leaf's textures are always interpolated.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
#[repr(u32)]
pub enum Filter {
    /// The nearest one: a magnified picture has edges between its texels.
    Nearest = 0,
    /// Where texels are larger than pixels, one of the four around, anew for each sample, in the mean their bilinear
    /// interpolation [pharr2024, filtering after shading]; the nearest in a picture's first sample.
    #[default]
    Stochastic = 1,
    /// All four around what a pixel's ray meets first, by their bilinear weights, at every level: no noise where texels
    /// are larger than pixels, and less change from frame to frame where they are smaller, for four times the light.
    /// Texels behind mirrors and further on a path are drawn as by `Stochastic`.
    Linear = 2,
}

/// A way in which a sky lights a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
#[repr(u32)]
pub enum SkyLight {
    /// Rays towards parts of the sky, each with its own radiance and its own occlusion: exact in the mean.
    #[default]
    Rays = 0,
    /// Irradiance of the surface's normal, times how much of the half space is open (Miao): less noise, but what is
    /// bright and what is occluded are not told apart.
    Irradiance = 1,
}

impl SkyLight {
    /// Returns the name on the command line and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            SkyLight::Rays => "rays",
            SkyLight::Irradiance => "irradiance",
        }
    }
}

/// The light that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum RenderMode {
    /// Light that comes straight from a lamp or, within the occlusion distance, from the surroundings; and perfect
    /// mirrors.
    #[default]
    Direct = 0,
    /// Light on any way up to the depth: progressive path tracing, what the other is measured against. What goes past
    /// everything meets the ambient light, whatever the occlusion distance.
    Path = 1,
}

impl RenderMode {
    /// Returns the name on the command line and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            RenderMode::Direct => "direct",
            RenderMode::Path => "path",
        }
    }
}

/// A way in which the GPU decodes a texel that several lights shine on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DecoderForm {
    /// The view-dependent half once, and for each light the rest.
    #[default]
    Halves,
    /// Everything anew for every light: what the halves are measured by.
    Whole,
}

/// Largest [`ShadeOptions::light_samples`].
pub const MAX_LIGHT_SAMPLES: u32 = 4096;
/// Largest [`ShadeOptions::irradiance_cells`].
pub const MAX_IRRADIANCE_CELLS: u32 = 64;
/// Largest [`ShadeOptions::depth`].
pub const MAX_DEPTH: u32 = 256;

impl ShadeOptions {
    /// Returns whether assets' coarser levels are used.
    pub fn uses_levels(&self) -> bool {
        self.levels && self.mode == RenderMode::Direct
    }

    /// Returns whether light after one bounce is taken from a grid.
    pub fn uses_irradiance_volume(&self) -> bool {
        self.irradiance_cells > 0 && self.mode == RenderMode::Direct
    }
}

impl Default for ShadeOptions {
    fn default() -> ShadeOptions {
        ShadeOptions {
            decode: DecodeOptions::default(),
            mode: RenderMode::Direct,
            light_samples: 64,
            depth: 4,
            levels: true,
            filter: Filter::default(),
            sky: SkyLight::default(),
            irradiance_cells: 0,
        }
    }
}
