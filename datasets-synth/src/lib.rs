//! Synthetic captures of leaves, woven cloth and leather: their optics and relief, and a virtual rig
//! that photographs them under every pair of a view and a light.
//!
//! The chain, from contents to pictures:
//!
//! 1. [`LeafContents`]: pigments per area, and their absorption at 31 wavelengths.
//! 2. [`plate_inside`] and [`plate`]: `plate-exact`, a leaf as one absorbing plate.
//! 3. [`SpectrumToRgb`]: spectra under D65 to linear sRGB.
//! 4. [`CookTorrance`]: the gloss on top, and how much light it lets in and out.
//! 5. [`Leaf`]: veins, relief and the textures of pigment, gloss and thickness on a grid.
//! 6. [`HeightField`], [`Material`], [`ViewHits`], [`Illumination`], [`render`]: parallax, masking,
//!    shadows, one image of any material.
//! 7. [`write_leaf_capture`]: all images and the height map, as a Bonn-layout folder.
//!
//! Two other materials keep fitters from being tuned to leaves: [`Cloth`], yarns whose [`Fibre`]s
//! scatter light as cylinders, written by [`write_cloth_capture`], and [`Leather`], a grain of pebbles
//! under a [`Finish`] of long-tailed [`Facets`], written by [`write_leather_capture`]. Both add one
//! indirect [`Bounce`].
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

mod cloth;
mod error;
mod leaf;
mod leather;
mod optics;
mod surface;

pub use cloth::capture::write_cloth_capture;
pub use cloth::fabric::{Cloth, ClothPair, ClothPoint};
pub use cloth::fibre::{Fibre, FibreDirection, FibrePair, FibreParams, FibreView};
pub use cloth::params::ClothParams;
pub use cloth::weave::Weave;
pub use error::SynthError;
pub use leaf::capture::write_leaf_capture;
pub use leaf::patch::{Leaf, LeafParams, MAX_LEAF_SIZE, MAX_LEAF_THETA_DEG};
pub use leaf::shading::{LeafPair, LeafPoint};
pub use leather::capture::write_leather_capture;
pub use leather::facets::{FacetDirection, Facets};
pub use leather::finish::{Finish, FinishParams, FinishView};
pub use leather::hide::{Leather, LeatherPair, LeatherPoint};
pub use leather::params::LeatherParams;
pub use optics::colour::{LeafContents, SpectrumToRgb, refractive_index, wavelengths_nm};
pub use optics::cook_torrance::{CUTICLE_INDEX, CookTorrance, LobeAngles, MIN_ROUGHNESS, fresnel};
pub use optics::plate::{PlateOptics, diffuse_transmission, mean_interface_transmittance, plate, plate_inside};
pub use surface::bounce::{Bounce, BouncedLight};
pub use surface::capture::{HEIGHT_MAP_NAME, Progress, write_capture};
pub use surface::capture_params::{CaptureParams, MAX_CAPTURE_SIZE, MAX_CAPTURE_THETA_DEG};
pub use surface::height_field::{HeightField, LightVisibility};
pub use surface::rig::{Hit, Illumination, Material, ViewHits, render};
