//! Synthetic captures of leaves: leaf optics, veins and relief, and a virtual rig that photographs
//! them under every pair of a view and a light.
//!
//! The chain, from contents to pictures:
//!
//! 1. [`LeafContents`]: pigments per area, and their absorption at 31 wavelengths.
//! 2. [`plate_inside`] and [`plate`]: `plate-exact`, a leaf as one absorbing plate.
//! 3. [`SpectrumToRgb`]: spectra under D65 to linear sRGB.
//! 4. [`CookTorrance`]: the gloss on top, and how much light it lets in and out.
//! 5. [`AppearanceTextures`]: structure, pigment, gloss, thickness and relief, grown for a [`Species`]
//!    and a [`Chlorosis`] or the user's own [`TextureImages`]; [`Leaf`]: a face with its colours.
//! 6. [`ViewHits`], [`LightVisibility`], [`render`]: parallax, masking, shadows, one image.
//! 7. [`write_leaf_capture`]: all images, as a Bonn-layout folder.
//!
//! Everything that is random comes from a seed; the number of threads never matters.
//!
//! Independent on purpose of the fitter and the decoder: nothing here knows the lobes that a
//! capture is fitted with, so that fitting one measures more than self-consistency.
//!
//! ```
//! use std::ops::ControlFlow;
//! use btf_capture::DirectionSet;
//! use btf_synth::{LeafParams, write_leaf_capture};
//!
//! let parent = tempfile::tempdir()?;
//! let set = DirectionSet::random(2, 1)?;
//! let params = LeafParams { size: 16, views: set.clone(), lights: set, ..LeafParams::default() };
//! write_leaf_capture(parent.path().join("leaf"), &params, &|_, _| ControlFlow::Continue(()))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod leaf;
mod optics;
mod surface;

pub use error::SynthError;
pub use leaf::capture::{Progress, write_leaf_capture};
pub use leaf::chlorosis::{Chlorosis, Deficiency};
pub use leaf::patch::{Leaf, LeafFace, LeafParams, MAX_LEAF_SIZE, MAX_LEAF_THETA_DEG};
pub use leaf::species::{Species, SpeciesPreset};
pub use leaf::texture_folder::{TEXTURES_NAME, TextureImages};
pub use leaf::texture_image::TextureKind;
pub use leaf::textures::{AppearanceTextures, LeafLook};
pub use optics::colour::{LeafContents, SpectrumToRgb, refractive_index, wavelengths_nm};
pub use optics::cook_torrance::{CUTICLE_INDEX, CookTorrance, LobeAngles, MIN_ROUGHNESS, fresnel};
pub use optics::plate::{PlateOptics, diffuse_transmission, mean_interface_transmittance, plate, plate_inside};
pub use surface::rig::{LightVisibility, ViewHits, render};
