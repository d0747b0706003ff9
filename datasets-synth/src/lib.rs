//! Makes synthetic captures of leaves, woven cloth and leather: their optics and displacement, and a virtual rig that
//! photographs them under every pair of a view and a light.
//!
//! The chain from the contents of a leaf to its images:
//!
//! 1. [`LeafContents`]: pigments per area, and [`SpecificAbsorption`]: what they absorb.
//! 2. [`PlateModel`]: [`plate_n`], a leaf as N absorbing plates; [`plate`], as one; [`plate_paper`],
//!    as printed; [`TwoHalves`], a leaf whose faces differ. [`plate_spectrum`] gives a whole leaf's spectra, [`PlateBody`] a texel's colour.
//!    [`CookTorrance`]: the gloss on top, and how much light it lets in and out.
//! 3. [`Tissue`]: the algorithmic models [`Abm97`], [`AbmB`] and [`AbmU`], each a [`Stack`] of interfaces
//!    that [`walk`] walks; [`trace_path_lengths`] gives spectra of any pigments, [`ScatterTable`] a BRDF.
//! 4. [`Spectrophotometer`] and [`Goniophotometer`]: what a laboratory would measure on them.
//! 5. [`RgbFromSpectrum`]: spectra under D65 to linear sRGB. The other way round, [`Inverter`]: the contents of a leaf
//!    from its measured [`LeafSpectra`], with their standard errors.
//! 6. [`AppearanceTextures`]: structure, pigment, gloss, thickness and relief, grown for a [`Species`]
//!    and a [`Chlorosis`] or the user's own [`TextureImages`].
//! 7. [`HeightField`], [`Material`], [`ViewHits`], [`Illumination`], [`render`]: parallax, masking,
//!    shadows, one image of any material.
//! 8. [`write_leaf_capture`]: all images of [`LeafParams`] and the height map, as a Bonn-layout folder.
//!
//! Two other materials keep fitters from being tuned to leaves: [`Cloth`], yarns whose [`Fibre`]s scatter light as
//! cylinders, written by [`write_cloth_capture`], and [`Leather`], a grain of pebbles under a [`Finish`] of long-tailed
//! [`Facets`], written by [`write_leather_capture`]. Both add one indirect [`Bounce`].
//!
//! [`write_plants`] generates plants that bear such leaves, from [`PlantsParams`] by L-systems, as instanced meshes in
//! a glTF file or as a script of shapes.
//!
//! Everything random comes from a seed; the number of threads never matters.
//!
//! The package is independent of the fitter and the decoder on purpose: nothing here knows the lobes that a capture is
//! fitted with, so that fitting a capture measures more than self-consistency.
//!
//! ```
//! use std::ops::ControlFlow;
//! use btf_capture::DirectionSet;
//! use btf_synth::{CaptureParams, LeafParams, write_leaf_capture};
//!
//! let parent = tempfile::tempdir()?;
//! let set = DirectionSet::random(2, 1)?;
//! let params = LeafParams {
//!     capture: CaptureParams { size: 16, views: set.clone(), lights: set, ..CaptureParams::new(20.0) },
//!     ..LeafParams::default()
//! };
//! write_leaf_capture(parent.path().join("leaf"), &params, &|_, _| ControlFlow::Continue(()))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cloth;
mod error;
mod instruments;
mod inversion;
mod leaf;
mod leather;
mod optics;
mod plants;
mod surface;
mod vector;

// What a leaf is belongs to whoever makes or lights one.
pub use btf_models::{Deficiency, LeafContents, LeafDescription, LeafTable, Species, TextureImages};
pub use cloth::capture::write_cloth_capture;
pub use cloth::fabric::{Cloth, ClothPair, ClothPoint};
pub use cloth::fibre::{Fibre, FibreDirection, FibrePair, FibreParams, FibreView};
pub use cloth::params::ClothParams;
pub use cloth::weave::Weave;
pub use error::SynthError;
pub use instruments::goniophotometer::{Goniogram, Goniophotometer, Interactions};
pub use instruments::plot::{LinePlot, Series, counts_svg, disk_svg, goniogram_svg};
pub use instruments::spectrophotometer::{Method, Rays, Spectrophotometer, Spectrum};
pub use inversion::digits::significant;
pub use inversion::forward::{MAX_UNKNOWNS, Unknown};
pub use inversion::invert::{InversionParams, Inverter};
pub use inversion::maps::{COLOURS_TELL, LeafMaps, invert_captures};
pub use inversion::mean_spectra::MeanSpectra;
pub use inversion::outcome::{Inversion, State};
pub use inversion::simulated::{any_contents, simulated_spectra};
pub use inversion::spectra::{LeafSpectra, SHARES};
pub use inversion::spectra_file::{ReadSpectra, read_spectra};
pub use leaf::capture::write_leaf_capture;
pub use leaf::chlorosis::Chlorosis;
pub use leaf::look::{BladePlace, LeafLook};
pub use leaf::model::LeafModel;
pub use leaf::params::LeafParams;
pub use leaf::table::leaf_table;
pub use leaf::textures::AppearanceTextures;
pub use leather::capture::write_leather_capture;
pub use leather::facets::{FacetDirection, Facets};
pub use leather::finish::{Finish, FinishParams, FinishView};
pub use leather::hide::{Leather, LeatherPair, LeatherPoint};
pub use leather::params::LeatherParams;
pub use optics::abm::abm_b::AbmB;
pub use optics::abm::abm_u::AbmU;
pub use optics::abm::abm97::{Abm97, Abm97Switches, EntryLobe, Epidermis, MesophyllKind, States};
pub use optics::abm::path_lengths::{
    Beam, Diffuse, Estimate, Face, Parallel, PathLengths, TracedBeam, trace_path_lengths, trace_splitting,
};
pub use optics::abm::scatter_table::{Passage, ScatterTable};
pub use optics::abm::specimen::{AspectRatios, Composition, Specimen};
pub use optics::abm::stack::{Crossing, Interface, InverseExponent, Medium, PathRule, Spread, Stack};
pub use optics::abm::tissue::{DepthParts, Tissue};
pub use optics::abm::walk::{Absorption, End, Walked, walk, walk_splitting};
pub use optics::colour::{PAPER_WAVELENGTHS_NM, RgbBands, RgbFromSpectrum};
pub use optics::contents::check_contents;
pub use optics::fresnel::{fresnel, fresnel_between, reflect, refract, refract_cos};
pub use optics::gloss::lobe::{CookTorrance, LobeAngles, vein_frame};
pub use optics::gloss::params::{CUTICLE_INDEX, GlossCoupling, GlossForm, GlossParams, MIN_ROUGHNESS};
pub use optics::interface::mean_interface_transmittance;
pub use optics::plates::body::{BodyRgb, PlateBody};
pub use optics::plates::exact::{plate, plate_inside};
pub use optics::plates::model::{PROSPECT_CONE_DEG, PlateModel, plate_spectrum};
pub use optics::plates::paper::{plate_paper, plate_paper_absorption, plate_paper_of_theta};
pub use optics::plates::pile::{plate_n, plate_n_inside};
pub use optics::plates::shares::PlateOptics;
pub use optics::plates::slopes::{PlateSlopes, plate_n_slopes};
pub use optics::plates::theta::{
    ThetaForm, diffuse_transmission, diffuse_transmission_f32, diffuse_transmission_with_slope, rational_p1q2,
    rational_p2q3, three_piece_fit,
};
pub use optics::plates::two_halves::{TwoHalves, two_sided_spectrum};
pub use optics::specific_absorption::{LEAF_TABLE_NM, SpecificAbsorption, check_wavelengths};
pub use optics::two_sided::two_sided_diffuse;
pub use optics::units::{
    Centimetres, GramsPerCubicCentimetre, MicrogramsPerSquareCentimetre, Nanometres, OpticalDepth, PerCentimetre,
    SquareCentimetresPerGram, SquareCentimetresPerMicrogram,
};
pub use plants::gltf::LEAF_EXTENSION;
pub use plants::params::{CanopySize, Form, Ground, Habit, MAX_PLANTS, MAX_UNIQUE_TRIANGLES, PlantsParams};
pub use plants::script::MAX_SHAPES;
pub use plants::write::{CANOPY_VARIATION, Existing, PlantsReport, write_plants};
pub use surface::bounce::{Bounce, BouncedLight};
pub use surface::capture::{HEIGHT_MAP_NAME, Progress, write_capture};
pub use surface::capture_params::{CaptureParams, MAX_CAPTURE_SIZE, MAX_CAPTURE_THETA_DEG};
pub use surface::height_field::{HeightField, LightVisibility};
pub use surface::rig::{Hit, Illumination, Material, ViewHits, render};
