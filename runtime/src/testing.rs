//! Small deterministic assets and file surgery for the tests of this package and of its users. Not part
//! of the promised interface.

use crate::asset::asset::{Asset, Layer, LobeRole, SurfaceSide};
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::heights::Heights;
use crate::asset::lobe::{Lobe, LobeFamily};
use crate::asset::residual::{Basis, Coefficients, Factors, Residual, ResidualKind, SharedBases};
use crate::asset::sphere::Sphere;
use crate::container::directory::Directory;
use crate::container::file_format::{ALIGNMENT, HEADER_WORDS, SECTION_ENTRY_WORDS, checksum};
use crate::error::FormatError;
use crate::file::format::{Form, header, read_directory};
use crate::voltex::{
    Facets, LevelShadow, MicroflakeMaterial, Sym3, VoltexError, VoltexRay, Volume, VolumeLevel, Voxel, order,
    read_voltex_directory,
};
use half::f16;
use std::collections::BTreeSet;

/// A small generator (splitmix64): the same seed gives the same numbers everywhere.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// A stream of numbers from `seed`.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform within `least..most`.
    pub fn within(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * ((self.bits() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// Uniform below `count`, which is at least 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// Unit direction, uniform on the upper hemisphere.
    pub fn direction(&mut self) -> [f32; 3] {
        direction_from_cos(self.within(0.0, 1.0), self.within(0.0, 360.0))
    }
}

/// Unit direction, uniform on the sphere.
pub fn sphere_direction(random: &mut Random) -> [f32; 3] {
    direction_from_cos(random.within(-1.0, 1.0), random.within(0.0, 360.0))
}

fn direction_from_cos(cos: f32, phi_deg: f32) -> [f32; 3] {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi_deg.to_radians().sin_cos();
    [sin * cos_phi, sin * sin_phi, cos]
}

/// The unit direction `(theta, phi)` in degrees.
pub fn direction_from_degrees(theta_deg: f64, phi_deg: f64) -> [f32; 3] {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    let (sin_phi, cos_phi) = phi_deg.to_radians().sin_cos();
    [(sin * cos_phi) as f32, (sin * sin_phi) as f32, cos as f32]
}

/// The pole and rings of `(theta in degrees, count)`.
pub fn ring_directions(rings: &[(f64, usize)]) -> Vec<[f32; 3]> {
    let ring = |&(theta_deg, count): &(f64, usize)| {
        (0..count).map(move |i| direction_from_degrees(theta_deg, 360.0 * i as f64 / count as f64))
    };
    std::iter::once([0.0, 0.0, 1.0]).chain(rings.iter().flat_map(ring)).collect()
}

/// A lobe of `family` with normal, tangent and parameters anywhere in their ranges, as the file form
/// gives it back. One parameter in eight stands at a bound.
pub fn random_lobe(random: &mut Random, family: LobeFamily) -> Lobe {
    let mut params = [0.0; 4];
    for (param, (least, most)) in params.iter_mut().zip(family.ranges()) {
        *param = match random.below(16) {
            0 => least,
            1 => most,
            // Exponents: as likely below as above the geometric middle.
            _ if least > 0.0 => least * (most / least).powf(random.within(0.0, 1.0)),
            _ => random.within(least, most),
        };
    }
    let tilt = random.within(0.0, 1.0).powi(2);
    let [x, y, _] = direction_from_cos((1.0 - 0.98 * tilt).sqrt(), random.within(0.0, 360.0));
    Lobe { family, normal_xy: [x, y], tangent_rad: random.within(-3.2, 3.2), params }.rounded()
}

fn halves(random: &mut Random, count: usize, amplitude: f32) -> Vec<f16> {
    (0..count).map(|_| f16::from_f32(random.within(-amplitude, amplitude))).collect()
}

/// A one-layer asset of random content that [`crate::pack`] writes and [`Asset::parse`] reads back equal:
/// three clusters, 20 lights and 17 views in three rings each, every lobe family, 1 to 4 lobes a texel
/// and 4 residual components of different steps and ranks up to 5.
pub fn sample_asset(seed: u64, width: usize, height: usize, kind: ResidualKind) -> Asset {
    const CLUSTERS: usize = 3;
    const COMPONENTS: usize = 4;
    const SHARED: usize = 3;
    let mut random = Random::new(seed);
    let random = &mut random;
    let sphere = |rings: &[(f64, usize)]| Sphere::new(&ring_directions(rings)).expect("the rings are distinct");
    let lights = sphere(&[(25.0, 4), (50.0, 6), (75.0, 9)]);
    let views = sphere(&[(30.0, 3), (55.0, 5), (70.0, 8)]);

    let texels = width * height;
    let texel_clusters: Vec<u8> = (0..texels).map(|_| random.below(CLUSTERS) as u8).collect();
    let texel_lobe_counts: Vec<u8> = (0..texels).map(|_| 1 + random.below(4) as u8).collect();
    let dictionary: Vec<Vec<DictionaryLobe>> = (0..CLUSTERS)
        .map(|_| {
            let entry = |family| DictionaryLobe {
                lobe: random_lobe(random, family),
                // Narrow peaks are tall: keep the sum near reflectances.
                weight_scale: f16::from_f32(if family == LobeFamily::Lambertian { 0.5 } else { 0.05 }).to_f32(),
            };
            LobeFamily::ALL.map(entry).to_vec()
        })
        .collect();
    let mut lobe_refs = Vec::new();
    for count in &texel_lobe_counts {
        for slot in 0..*count {
            // Every texel has a diffuse part, as real ones do.
            let lobe = if slot == 0 { 0 } else { 1 + random.below(8) as u8 };
            lobe_refs.push(LobeRef { lobe, weight: [0; 3].map(|_| random.below(256) as u8) });
        }
    }

    // The additive curve adds reflectances, the others steps of their own.
    let amplitude = match kind {
        ResidualKind::Additive => 0.05,
        ResidualKind::Log => 0.25,
        ResidualKind::Root => 0.08,
    };
    let ranks = [0; 3].map(|_| [1 + random.below(5), 1 + random.below(5)]);
    let shape = [views.len(), lights.len()];
    let factors = Factors {
        shape,
        ranks,
        view: ranks.map(|[rank, _]| halves(random, shape[0] * rank, 1.0)),
        light: ranks.map(|[_, rank]| halves(random, shape[1] * rank, 1.0)),
    };
    let mut codes = |count: usize, most: usize| -> Vec<i16> {
        (0..count).map(|_| random.below(2 * most + 1) as i16 - most as i16).collect()
    };
    // Rank-1 to rank-5 cores of +-1, mixed by weights that fall with the component.
    let shared = SharedBases { steps: vec![0.01; SHARED], values: codes(SHARED * factors.core_len(), 100) };
    let bases = (0..=COMPONENTS)
        .map(|index| {
            let step = amplitude / (1.0 + index as f32) / 50.0;
            Basis { steps: vec![step, 0.5 * step, 0.7 * step], values: codes(CLUSTERS * SHARED, 50) }
        })
        .collect();
    let coefficients = (0..COMPONENTS)
        .map(|component| {
            let most = [127, 20, 3, 1][component];
            let codes = codes(texels, most).into_iter().map(|code| code as i8).collect();
            Coefficients { step: 0.7 / most as f32, codes }
        })
        .collect();
    let layer = Layer {
        light_side: SurfaceSide::Front,
        view_side: SurfaceSide::Front,
        lobe_role: LobeRole::Base,
        residual_kind: kind,
        epsilon: 0.01,
        lights,
        views,
        heights: None,
        texel_clusters,
        texel_lobe_counts,
        dictionary,
        lobe_refs,
        residual: Some(Residual { factors, shared, bases, coefficients }),
    };
    let material = format!("{{\"name\":\"sample {seed}\"}}");
    Asset {
        width,
        height,
        size_mm: Some([30.0, 25.0]),
        seamless: [true, false],
        material,
        layers: vec![layer],
        levels: Vec::new(),
        edits: crate::Edits::default(),
    }
}

/// A small asset whose bases would take more than 1 GiB when expanded with some more components than its four: factors of rank 0
/// are free in the file, and expanded bases are not.
pub fn huge_asset() -> Asset {
    let mut asset = sample_asset(9, 1, 1, ResidualKind::Root);
    let layer = &mut asset.layers[0];
    let set = ring_directions(&[(20.0, 64), (40.0, 64), (60.0, 64), (75.0, 64)]);
    layer.lights = Sphere::new(&set).expect("the rings are distinct");
    layer.views = layer.lights.clone();
    layer.texel_clusters = vec![0];
    layer.dictionary = vec![layer.dictionary[0].clone(); 256];
    let residual = layer.residual.as_mut().unwrap();
    residual.factors.shape = [set.len(); 2];
    residual.factors.ranks = [[0; 2]; 3];
    residual.factors.view = Default::default();
    residual.factors.light = Default::default();
    residual.shared.steps.clear();
    residual.shared.values.clear();
    for basis in &mut residual.bases {
        basis.steps = vec![0.0; 256];
        basis.values.clear();
    }
    asset
}

/// Rough heights of `texels` texels, up to three texel widths either way.
pub fn sample_heights(seed: u64, texels: usize) -> Heights {
    let mut random = Random::new(seed);
    Heights { step: 0.125, codes: (0..texels).map(|_| random.below(49) as i8 - 24).collect() }
}

/// A volume of `levels` levels (1 to 13), with `count` voxels at the finest or as many as there is room for.
pub fn sample_volume(seed: u64, levels: usize, count: usize) -> Volume {
    let mut random = Random::new(seed);
    let side = 1usize << (levels - 1);
    let mut cells: BTreeSet<[u32; 3]> = (0..count.max(1)).map(|_| [0; 3].map(|_| random.below(side) as u32)).collect();
    let mut all = Vec::new();
    for _ in 0..levels {
        let mut voxels: Vec<([u32; 3], Voxel)> = cells.iter().map(|at| (*at, sample_voxel(&mut random))).collect();
        voxels.sort_by_key(|(at, _)| order(*at));
        let shared = std::array::from_fn(|i| 0.9 - 0.19 * i as f32);
        let shadow = LevelShadow { offset: random.within(0.0, 2.0), shared };
        let clumping = Sym3([0.5, -0.25, -0.125, 0.25, 0.0, -0.375]);
        let others = some_others(&mut random, voxels.len(), sample_voxel);
        let facets = Facets(std::array::from_fn(|i| 0.25 * (i as f32 - 7.0)));
        all.push(VolumeLevel { shadow, clumping, facets, voxels, others });
        cells = cells.iter().map(|at| at.map(|x| x / 2)).collect();
    }
    // Numbers that half precision has.
    let material = |i: u16| MicroflakeMaterial {
        reflectance: [0.125, 0.25, 0.0625 * f32::from(i)],
        transmittance: [0.0, 0.375, 0.5],
        specular: 0.046875,
        roughness: 0.25,
    };
    Volume {
        description: "{\"name\": \"sample\"}".into(),
        side_m: random.within(0.5, 20.0),
        extent: [1.0, 0.75, 0.5],
        cyclic: [random.below(2) == 0, random.below(2) == 0],
        materials: (0..3).map(material).collect(),
        levels: all,
    }
}

/// A second sort of microflakes in a third of so many cells.
fn some_others(random: &mut Random, count: usize, voxel: impl Fn(&mut Random) -> Voxel) -> Vec<(u32, Voxel)> {
    let numbers = (0..count as u32).filter(|_| random.below(3) == 0).collect::<Vec<_>>();
    numbers.into_iter().map(|number| (number, voxel(random))).collect()
}

/// Three microflakes of one of three materials.
fn sample_voxel(random: &mut Random) -> Voxel {
    let extinction = (0..3).fold(Sym3::default(), |sum, _| {
        let microflake = Sym3::outer(random.direction(), random.within(0.1, 40.0));
        sum.plus(&microflake)
    });
    Voxel::new(extinction, random.below(3) as u32)
}

/// A volume of random microflakes with 2^`level_count` voxels a side: of the eight children of a voxel each is there with probability
/// `share`, and one in any case.
pub fn random_volume(random: &mut Random, level_count: u32, share: f32) -> Volume {
    const MATERIALS: usize = 3;
    let mut levels: Vec<VolumeLevel> = Vec::new();
    let mut cells = vec![[0u32; 3]];
    for level in (0..=level_count).rev() {
        cells.sort_by_key(|cell| order(*cell));
        let mut children = Vec::new();
        for cell in &cells {
            let kept = random.below(8);
            let there = (0..8).filter(|child| *child == kept || random.within(0.0, 1.0) < share).collect::<Vec<_>>();
            children
                .extend(there.iter().map(|child| [0, 1, 2].map(|axis| 2 * cell[axis] + (child >> axis & 1) as u32)));
        }
        fn voxel(random: &mut Random) -> Voxel {
            let area = 2f32.powf(random.within(-3.0, 6.0));
            let microflakes = (0..1 + random.below(4)).map(|_| Sym3::outer(sphere_direction(random), area * area));
            Voxel::new(
                microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake)),
                random.below(MATERIALS) as u32,
            )
        }
        let voxels: Vec<_> = cells.iter().map(|cell| (*cell, voxel(random))).collect();
        let others = some_others(random, voxels.len(), voxel);
        levels.push(VolumeLevel {
            shadow: LevelShadow {
                offset: level as f32 + random.within(0.0, 1.0),
                shared: std::array::from_fn(|_| random.within(-1.0, 1.0)),
            },
            clumping: Sym3(std::array::from_fn(|_| random.within(-0.5, 0.5))),
            facets: Facets(std::array::from_fn(|_| random.within(-2.0, 2.0))),
            voxels,
            others,
        });
        cells = children;
    }
    levels.reverse();
    let mut shares = || std::array::from_fn(|_| random.within(0.0, 1.0));
    let materials = (0..MATERIALS)
        .map(|number| MicroflakeMaterial {
            reflectance: shares(),
            transmittance: shares(),
            specular: 0.04 * number as f32,
            roughness: 0.5,
        })
        .collect();
    let extent = shares();
    Volume {
        description: "{}".into(),
        side_m: 1.0 + level_count as f32,
        extent,
        cyclic: [level_count & 1 == 1, level_count & 2 == 2],
        materials,
        levels,
    }
}

/// Kinds of [`sample_ray`].
pub const RAY_KINDS: usize = 8;

/// A ray that meets the unit cube of 2^`level_count` voxels a side, by kind: 0 anyhow, 1 along an axis, 2 from corner to corner of
/// voxels, 3 within a plane between voxels, 4 from inside, 5 with a large direction, 6 with a small one, 7 nearly along a plane.
pub fn sample_ray(random: &mut Random, level_count: u32, kind: usize) -> VoltexRay {
    let resolution = (1u32 << level_count) as f32;
    let inside = |random: &mut Random| -> [f32; 3] { std::array::from_fn(|_| random.within(0.0, 1.0)) };
    let corner = |random: &mut Random| -> [f32; 3] {
        std::array::from_fn(|_| random.below(resolution as usize + 1) as f32 / resolution)
    };
    let (mut aim, mut direction) = (inside(random), sphere_direction(random));
    let mut back = random.within(1.0, 4.0);
    let axis = random.below(3);
    match kind {
        1 => {
            let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
            direction = std::array::from_fn(|i| if i == axis { sign } else { 0.0 * sign });
            if random.below(2) == 0 {
                aim = corner(random);
            }
        }
        2 => {
            aim = corner(random);
            let other = corner(random);
            direction = std::array::from_fn(|i| other[i] - aim[i]);
        }
        3 => {
            aim = corner(random);
            direction[axis] = 0.0;
        }
        4 => back = 0.0,
        7 => direction[axis] *= 10f32.powi(-(random.below(30) as i32)),
        _ => {}
    }
    let origin = std::array::from_fn(|i| aim[i] - back * direction[i]);
    let length = match kind {
        5 => 1e10,
        6 => 1e-10,
        _ => 1.0,
    };
    VoltexRay { origin, direction: direction.map(|x| x * length) }
}

/// Index of a texel's first lobe reference.
pub fn first_ref(layer: &Layer, texel: usize) -> usize {
    layer.texel_lobe_counts[..texel].iter().map(|count| usize::from(*count)).sum()
}

/// A section taken out of a file, to be changed and put back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SectionPart {
    /// Kind number, layer, index and flags, as in the section table.
    pub head: [u32; 4],
    /// The section's bytes.
    pub bytes: Vec<u8>,
    /// True where a tier ends behind it.
    pub ends_tier: bool,
}

/// A file in parts. Putting it together again computes offsets, lengths and checksums anew, so that a
/// reader sees the change and not the damage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileParts {
    /// The header's words; lengths, counts and checksum are overwritten.
    pub header: [u32; HEADER_WORDS],
    /// The sections in order.
    pub sections: Vec<SectionPart>,
}

impl FileParts {
    /// Takes a valid file apart, or what a tier of one holds. Errors: those of [`Asset::parse`]'s first stage.
    pub fn from_bytes(bytes: &[u8]) -> Result<FileParts, FormatError> {
        let directory = read_directory(bytes)?;
        Ok(FileParts::of(bytes, &directory, directory.head.form.alignment()))
    }

    /// The same of a volumetric texture's file.
    pub fn from_voltex_bytes(bytes: &[u8]) -> Result<FileParts, VoltexError> {
        Ok(FileParts::of(bytes, &read_voltex_directory(bytes)?, ALIGNMENT))
    }

    fn of<H>(bytes: &[u8], directory: &Directory<H>, alignment: usize) -> FileParts {
        let mut header = [0; HEADER_WORDS];
        for (word, b) in header.iter_mut().zip(bytes.chunks_exact(4)) {
            *word = u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        }
        let sections = directory
            .sections
            .iter()
            .filter(|entry| entry.offset as usize + entry.length as usize <= bytes.len())
            .map(|entry| {
                let (start, end) = (entry.offset as usize, (entry.offset + entry.length) as usize);
                SectionPart {
                    head: [entry.kind, entry.layer, entry.index, entry.flags],
                    bytes: bytes[start..end].to_vec(),
                    ends_tier: directory.tiers.contains(&(end.next_multiple_of(alignment) as u32)),
                }
            })
            .collect();
        FileParts { header, sections }
    }

    /// The file, with every derived number right.
    pub fn to_bytes(&self) -> Vec<u8> {
        let tiers = self.sections.iter().filter(|section| section.ends_tier).count();
        let tables_end = 4 * (HEADER_WORDS + self.sections.len() * SECTION_ENTRY_WORDS + tiers);
        let alignment =
            if self.header[header::FORM] == Form::Resident as u32 { Form::Resident } else { Form::File }.alignment();
        let mut words = self.header.to_vec();
        let mut body = vec![0; tables_end.next_multiple_of(alignment)];
        let mut ends = Vec::new();
        for section in &self.sections {
            let hash = checksum(&section.bytes);
            words.extend(section.head);
            words.extend([body.len() as u32, section.bytes.len() as u32, hash as u32, (hash >> 32) as u32]);
            body.extend_from_slice(&section.bytes);
            body.resize(body.len().next_multiple_of(alignment), 0);
            if section.ends_tier {
                ends.push(body.len() as u32);
            }
        }
        words.extend(ends);
        words[header::LENGTH_LOW] = body.len() as u32;
        words[header::LENGTH_HIGH] = 0;
        words[header::SECTIONS] = self.sections.len() as u32;
        words[header::TIERS] = tiers as u32;
        for (place, word) in body.chunks_exact_mut(4).zip(&words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        repair_header_checksum(&mut body);
        body
    }
}

/// Makes the header's checksum right again after a change to header or tables. Counts that reach beyond
/// the file leave it as it is.
pub fn repair_header_checksum(bytes: &mut [u8]) {
    let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[4 * index + i])) as usize;
    let (sections, tiers) = (word(header::SECTIONS), word(header::TIERS));
    let words = sections.saturating_mul(SECTION_ENTRY_WORDS).saturating_add(tiers).saturating_add(HEADER_WORDS);
    let Some(tables) = words.checked_mul(4).and_then(|end| bytes.get_mut(..end)) else {
        return;
    };
    tables[4 * header::CHECKSUM_LOW..][..8].fill(0);
    let hash = checksum(tables);
    tables[4 * header::CHECKSUM_LOW..][..8].copy_from_slice(&hash.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack;

    const KINDS: [ResidualKind; 3] = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];

    #[test]
    fn a_sample_asset_survives_packing_and_parsing() {
        for (seed, kind) in KINDS.into_iter().enumerate() {
            let asset = sample_asset(seed as u64, 6, 5, kind);
            let bytes = pack(&asset).unwrap();
            assert_eq!(Asset::parse(&bytes).unwrap(), asset);
            assert_eq!(pack(&sample_asset(seed as u64, 6, 5, kind)).unwrap(), bytes, "same seed, same bytes");
            // Planted difference: another seed is another asset.
            assert_ne!(pack(&sample_asset(seed as u64 + 100, 6, 5, kind)).unwrap(), bytes);
        }
    }

    #[test]
    fn a_file_taken_apart_and_put_together_is_the_same_file() {
        let bytes = pack(&sample_asset(4, 6, 5, ResidualKind::Root)).unwrap();
        let mut parts = FileParts::from_bytes(&bytes).unwrap();
        assert_eq!(parts.to_bytes(), bytes);
        parts.sections[0].bytes.push(b' ');
        assert_ne!(parts.to_bytes(), bytes);
        assert!(Asset::parse(&parts.to_bytes()).is_ok());
    }
}
