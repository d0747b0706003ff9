//! Export of an asset as KTX2 textures for engines that load those and have no reader of `.spmm`: what each texel has
//! as planes of one array with mip levels, the expanded bases as an array for each layer, and everything else as JSON
//! in the first file's key/value data. docs/reference/ktx2.md specifies it.

use crate::error::FitError;
use crate::export::ktx2::file::{Ktx2Array, Ktx2Format};
use crate::inspect::describe_resident::sides_of_resident;
use crate::inspect::load::parallel;
use btf_runtime::{
    ASSET_LAYERS, DIRECTION_WORDS, EDGE_WORDS, EDIT_WORDS, LOBE_RESIDENT_WORDS, Levels, Resident, SPHERE_HEADER_WORDS,
    TRIANGLE_WORDS, block, open,
};
use serde_json::{Value, json};
use std::sync::Arc;

/// Key of the JSON in the key/value data.
pub const KTX2_KEY: &str = "BTFspmm";
/// Version of the files' layout.
const LAYOUT: u32 = 1;
/// Largest side of a texture on common Vulkan adapters.
const MAX_SIDE: usize = 16384;
/// Byte of a plane that stands for the number 0, where the plane's numbers have signs.
const ZERO: u8 = 128;

/// The files of an export: the first holds the planes and names the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Ktx2Export {
    /// Names and contents.
    pub files: Vec<(String, Vec<u8>)>,
    /// Texels a row and rows of the planes' finest level.
    pub size: [usize; 2],
    /// Number of planes.
    pub planes: usize,
    /// Number of mip levels.
    pub levels: usize,
}

/// Refuses an asset in bands, whose channels textures do not hold.
pub(crate) fn refuse_bands(is_spectral: bool, name: &str) -> Result<(), FitError> {
    match is_spectral {
        true => Err(FitError::Params(format!(
            "{name} is in spectral bands, which these textures do not hold; fit its capture with --colours and export that"
        ))),
        false => Ok(()),
    }
}

/// Returns the asset in `bytes`, of either form, as KTX2 files; `stem` is the first file's name without `.ktx2`. A file
/// form without levels gets them.
///
/// # Errors
/// A fault of the bytes; bases that make a texture of more than 16384 texels a side.
pub fn export_ktx2(bytes: Vec<u8>, stem: &str) -> Result<Ktx2Export, FitError> {
    let file = open(Arc::new(bytes), Levels::All, &parallel)?;
    let resident = &file.resident;
    refuse_bands(resident.is_spectral(), stem)?;
    let (count, levels) = (resident.layers() as usize, resident.levels() as usize);
    let of = |level: usize, number: usize| LayerWords::new(resident, level * count + number);
    let size = resident.size(0).map(|side| side as usize);

    let (mut planes, mut layers, mut bases) = (0, Vec::new(), Vec::new());
    let mut plans = Vec::new();
    for (number, side) in sides_of_resident(resident).iter().enumerate() {
        let layer = of(0, number);
        let plan = Planes {
            first: planes,
            edits: layer.field(block::EDIT_COUNT) > 0,
            lobes: (0..levels).map(|level| of(level, number).most_lobes()).max().unwrap_or(0),
            components: layer.components(),
            heights: layer.field(block::HEIGHTS) > 0,
        };
        planes += plan.count();
        let mut told = layer.describe(&plan);
        told["side"] = json!(side.to_string());
        if plan.heights {
            told["heightSteps"] = (0..levels).map(|level| json!(of(level, number).height_step())).collect();
        }
        if layer.field(block::BASES) > 0 {
            let name = format!("{stem}.bases-{side}.ktx2");
            let (array, columns) = layer.bases()?;
            told["bases"] = json!({ "file": name, "clusterColumns": columns });
            bases.push((name, array.file()));
        }
        layers.push(told);
        plans.push(plan);
    }
    let index = json!({
        "layout": LAYOUT,
        "sizeMm": file.size_mm,
        "seamless": file.seamless,
        "layers": layers,
    });
    let array = Ktx2Array {
        format: Ktx2Format::R8Uint,
        width: size[0],
        height: size[1],
        layers: planes,
        levels: (0..levels)
            .map(|level| plans.iter().enumerate().flat_map(|(number, plan)| of(level, number).planes(plan)).collect())
            .collect(),
        notes: vec![(KTX2_KEY.into(), index.to_string())],
    };
    let mut files = vec![(format!("{stem}.ktx2"), array.file())];
    files.extend(bases);
    Ok(Ktx2Export { files, size, planes, levels })
}

/// Numbers of the planes of a layer.
struct Planes {
    first: usize,
    edits: bool,
    /// Lobes of the texel that has most, four planes each.
    lobes: usize,
    components: usize,
    heights: bool,
}

impl Planes {
    /// Returns the places of edits, lobes, coefficients and heights, and the end.
    fn places(&self) -> [usize; 5] {
        let edits = self.first + 1;
        let lobes = edits + usize::from(self.edits);
        let coefficients = lobes + 4 * self.lobes;
        let heights = coefficients + self.components;
        [edits, lobes, coefficients, heights, heights + usize::from(self.heights)]
    }

    fn count(&self) -> usize {
        self.places()[4] - self.first
    }
}

/// A layer's block of the resident form at one level (docs/reference/format.md, "Resident form").
struct LayerWords<'a> {
    words: &'a [u32],
    at: usize,
}

impl<'a> LayerWords<'a> {
    fn new(resident: &'a Resident, layer: usize) -> LayerWords<'a> {
        let words = resident.words();
        LayerWords { words, at: words[ASSET_LAYERS + layer] as usize }
    }

    fn field(&self, field: usize) -> usize {
        self.words[self.at + field] as usize
    }

    fn float(&self, field: usize) -> f32 {
        f32::from_bits(self.words[self.at + field])
    }

    /// Returns the texel widths a height code; 0 where the level has no heights.
    fn height_step(&self) -> f32 {
        if self.field(block::HEIGHTS) > 0 { self.float(block::HEIGHT_STEP) } else { 0.0 }
    }

    fn components(&self) -> usize {
        self.field(block::BASES).saturating_sub(1)
    }

    fn texels(&self) -> usize {
        self.field(block::WIDTH) * self.field(block::ROWS)
    }

    /// Returns a texel's record: cluster, edit and lobe count, then the first reference.
    fn records(&self) -> impl Iterator<Item = &'a [u32]> {
        let at = self.field(block::RECORDS);
        self.words[at..at + 2 * self.texels()].chunks_exact(2)
    }

    fn most_lobes(&self) -> usize {
        self.records().map(|record| record[0] as usize >> 16).max().unwrap_or(0)
    }

    /// Returns the planes' bytes at this level. Of a lobe: its number and three weight codes. What a texel does not
    /// have is 0, or the byte of the number 0.
    fn planes(&self, plan: &Planes) -> Vec<u8> {
        let mut out: Vec<u8> = self.records().map(|record| record[0] as u8).collect();
        if plan.edits {
            out.extend(self.records().map(|record| (record[0] >> 8) as u8));
        }
        let refs = self.field(block::REFS);
        for part in 0..4 * plan.lobes {
            let (slot, byte) = (part / 4, part % 4);
            out.extend(self.records().map(|record| {
                let there = slot < record[0] as usize >> 16;
                if there { (self.words[refs + record[1] as usize + slot] >> (8 * byte)) as u8 } else { 0 }
            }));
        }
        let (codes, stride) = (self.field(block::CODES), self.field(block::CODE_WORDS));
        for component in 0..plan.components {
            let there = component < self.components();
            out.extend((0..self.texels()).map(|texel| {
                let code = || byte_of(self.words, codes + texel * stride, component);
                if there { code() ^ ZERO } else { ZERO }
            }));
        }
        if plan.heights {
            let at = self.field(block::HEIGHTS);
            let code = |texel| if at > 0 { byte_of(self.words, at, texel) ^ ZERO } else { ZERO };
            out.extend((0..self.texels()).map(code));
        }
        out
    }

    /// Returns everything about the layer that is no texture, as JSON.
    fn describe(&self, plan: &Planes) -> Value {
        let [edits, lobes, coefficients, heights, _] = plan.places();
        let mut planes = json!({
            "cluster": plan.first,
            "lobes": lobes,
            "lobeSlots": plan.lobes,
            "coefficients": coefficients,
            "components": plan.components,
        });
        if plan.edits {
            planes["edit"] = json!(edits);
        }
        if plan.heights {
            planes["height"] = json!(heights);
        }
        let list = self.field(block::EDITS);
        let told: Vec<Value> = (0..self.field(block::EDIT_COUNT))
            .map(|edit| {
                let at = list + edit * EDIT_WORDS;
                let [r, g, b, keep] = [0, 1, 2, 3].map(|i| f32::from_bits(self.words[at + i]));
                let dictionaries = self.dictionaries(self.words[at + 4] as usize);
                json!({ "tint": [r, g, b], "keep": keep, "dictionaries": dictionaries })
            })
            .collect();
        json!({
            "planes": planes,
            "residualKind": self.field(block::RESIDUAL_KIND),
            "epsilon": self.float(block::EPSILON),
            "lobeRole": self.field(block::LOBE_ROLE),
            "horizon": self.float(block::HORIZON),
            "lights": self.directions(block::LIGHTS),
            "views": self.directions(block::VIEWS),
            "dictionaries": self.dictionaries(self.field(block::DICTIONARIES)),
            "edits": told,
        })
    }

    /// Returns the lobes of each cluster: family, normal, tangent, four parameters, weight scale.
    fn dictionaries(&self, table: usize) -> Vec<Vec<Value>> {
        let lobe = |at: usize| {
            let numbers: Vec<f32> = self.words[at + 1..at + 12].iter().map(|word| f32::from_bits(*word)).collect();
            json!({ "family": self.words[at], "normal": numbers[..3], "tangent": numbers[3..6],
                    "parameters": numbers[6..10], "scale": numbers[10] })
        };
        let places = &self.words[table..=table + self.field(block::CLUSTERS)];
        places
            .windows(2)
            .map(|ends| (ends[0] as usize..ends[1] as usize).step_by(LOBE_RESIDENT_WORDS).map(lobe).collect())
            .collect()
    }

    /// Returns a set's unit vectors, and the corners of its triangles and edges.
    fn directions(&self, set: usize) -> Value {
        let at = self.field(set);
        let [n, t, e] = [0, 1, 2].map(|i| self.words[at + i] as usize);
        let units = at + SPHERE_HEADER_WORDS;
        let triangles = units + n * DIRECTION_WORDS;
        let edges = triangles + t * TRIANGLE_WORDS;
        let rows = |at: usize, count: usize, words: usize, part: std::ops::Range<usize>| -> Vec<&[u32]> {
            (0..count).map(|row| &self.words[at + row * words..][part.clone()]).collect()
        };
        let units: Vec<Vec<f32>> = rows(units, n, DIRECTION_WORDS, 0..3)
            .into_iter()
            .map(|unit| unit.iter().map(|word| f32::from_bits(*word)).collect())
            .collect();
        json!({
            "directions": units,
            "triangles": rows(triangles, t, TRIANGLE_WORDS, 6..9),
            "edges": rows(edges, e, EDGE_WORDS, 5..7),
        })
    }

    /// Returns the expanded bases: a layer for each, in it a block of views x lights for each cluster, row by row of
    /// blocks; and how many blocks stand in a row.
    fn bases(&self) -> Result<(Ktx2Array, usize), FitError> {
        let (clusters, lights, pairs) =
            (self.field(block::CLUSTERS), self.field(block::LIGHT_COUNT), self.field(block::PAIRS));
        let (views, bases) = (pairs / lights, self.field(block::BASES));
        let columns = (clusters as f64).sqrt().ceil() as usize;
        let (width, height) = (lights * columns, views * clusters.div_ceil(columns));
        if width.max(height) > MAX_SIDE {
            return Err(FitError::Params(format!(
                "its bases make a texture of {width} x {height} texels, and engines take {MAX_SIDE} a side at most; fit it with fewer \
                 --clusters"
            )));
        }
        let (at, stride) = (self.field(block::BASIS), self.field(block::CHANNEL_WORDS));
        let mut texels = vec![[0u16; 4]; bases * width * height];
        for cluster in 0..clusters {
            for pair in 0..pairs {
                let row = cluster / columns * views + pair / lights;
                let place = row * width + cluster % columns * lights + pair % lights;
                for channel in 0..3 {
                    let words = &self.words[at + ((cluster * pairs + pair) * 3 + channel) * stride..][..stride];
                    for basis in 0..bases {
                        texels[basis * width * height + place][channel] =
                            (words[basis / 2] >> (16 * (basis % 2))) as u16;
                    }
                }
            }
        }
        let level = bytemuck::cast_slice(&texels).to_vec();
        let format = Ktx2Format::Rgba16Float;
        Ok((Ktx2Array { format, width, height, layers: bases, levels: vec![level], notes: Vec::new() }, columns))
    }
}

/// Returns the byte `number` of those from word `at` on, the lowest of a word first.
fn byte_of(words: &[u32], at: usize, number: usize) -> u8 {
    (words[at + number / 4] >> (8 * (number % 4))) as u8
}
