//! Export of an asset as block-compressed textures that samplers filter; docs/reference/ktx2-filtered.md specifies them.

use crate::error::FitError;
use crate::export::ktx2::file::{Ktx2Array, Ktx2Format};
use crate::export::ktx2::filtered::components::{Component, FilteredLayer, Source, fit_components};
use crate::export::ktx2::filtered::error::{LayerError, errors};
use crate::export::ktx2::filtered::layout::{Layout, MIN_COMPONENTS};
use crate::export::ktx2::filtered::light_map::LightMap;
use crate::export::ktx2::filtered::measured_rows::{AssetRows, CaptureRows, LobeTables, MeasuredRows};
use crate::export::ktx2::filtered::planes::Plane;
use crate::export::ktx2::filtered::view_map::{CELLS, triangles_of_cells};
use crate::export::ktx2::planes::KTX2_KEY;
use crate::export::ktx2::planes::refuse_bands;
use crate::input::layer_frame::side_of_layer;
use crate::input::tile_cache::TileCache;
use crate::inspect::load::{parallel, resident_in_parallel};
use crate::measure::compare::layer_for_capture;
use crate::measure::image_decoder::Spot;
use crate::monitor::Monitor;
use btf_capture::Capture;
use btf_runtime::{Asset, HORIZON_COS, Layer, with_levels};
use serde_json::json;

/// Version of the files' layout.
const LAYOUT: u32 = 2;
/// Bytes in memory for each texel, where none are asked for (12 MB for 256 x 256), and components that there are at least:
/// bases take the same for few texels as for many.
const BYTES_A_TEXEL: usize = 183;
const COMPONENTS: usize = 128;
/// Texels a row of the tables.
const TABLE_WIDTH: usize = 64;

/// Parameters of [`export_filtered`].
#[derive(Debug, Clone)]
pub struct FilteredParams {
    /// Bytes that all textures may take in memory, mip levels included; 183 a texel and layer, or what 128 components
    /// take, if `None`.
    pub bytes: Option<u64>,
    /// Most memory for the captures' images.
    pub memory_bytes: u64,
}

/// The textures of an asset.
#[derive(Debug, Clone, PartialEq)]
pub struct FilteredExport {
    /// Names and contents. The first file names the others.
    pub files: Vec<(String, Vec<u8>)>,
    /// Bytes that the textures take in memory.
    pub memory_bytes: usize,
    /// Figures of each layer, in the asset's order.
    pub layers: Vec<FilteredFigures>,
}

/// Figures of a layer's textures.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct FilteredFigures {
    /// Side of the layer, in the words of `capture.toml`.
    pub side: String,
    /// Components.
    pub components: usize,
    /// Components that have mip levels.
    pub coarse_components: usize,
    /// Texture reads of an evaluation at the finest level, and from the second level on.
    pub reads: [usize; 2],
    /// Error at the measured pairs.
    #[serde(flatten)]
    pub error: LayerError,
}

/// Fits block-compressed textures to `asset`; `stem` is the first file's name without `.ktx2`. Layers whose captures are
/// given are fitted to these at the finest level, where they lose less than the asset; their sides, sizes and directions
/// must be the asset's.
///
/// # Errors
/// If the bytes do not suffice for four components, a capture does not match or cannot be read, or the monitor was
/// cancelled.
pub fn export_filtered(
    asset: &Asset,
    stem: &str,
    captures: &[Capture],
    params: &FilteredParams,
    monitor: &Monitor,
) -> Result<FilteredExport, FitError> {
    refuse_bands(asset.spectrum.is_some(), stem)?;
    let asset = with_levels(asset, &parallel);
    let resident = resident_in_parallel(&asset);
    let caches = captures_of_layers(&asset, captures, params, monitor)?;
    let texels = asset.width * asset.height;
    let (mut files, mut figures, mut told, mut memory_bytes) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for (number, layer) in asset.layers.iter().enumerate() {
        let map = LightMap::new(&layer.lights);
        let layout = layout(&asset, layer, &map);
        let bytes = match params.bytes {
            Some(bytes) => bytes as usize / asset.layers.len(),
            None => layout.bytes(COMPONENTS).max(BYTES_A_TEXEL * texels),
        };
        let count = layout.components_within(bytes);
        if count == 0 {
            return Err(FitError::Params(format!(
                "{bytes} bytes are too few for the textures of a layer; allow at least {} with --bytes",
                layout.bytes(MIN_COMPONENTS) * asset.layers.len()
            )));
        }
        let tables = LobeTables::new(&asset, number);
        let of_asset: Vec<AssetRows> =
            (0..=asset.levels.len()).map(|level| AssetRows::new(&asset, &resident, &tables, level, number)).collect();
        let of_capture = caches[number].as_ref().map(CaptureRows::new);
        let finest: &dyn MeasuredRows = match &of_capture {
            Some(rows) => rows,
            None => &of_asset[0],
        };
        let coarser = of_asset[1..].iter().map(|rows| rows as &dyn MeasuredRows).collect();
        let source = Source { finest, coarser, shape: [layer.views.len(), layer.lights.len()] };
        let fitted = fit_components(&source, &layout, &map, count, monitor)?;
        let error = errors(&fitted, &of_asset[0], of_capture.as_ref().map(|rows| rows as &dyn MeasuredRows), monitor)?;
        let side = side_of_layer(layer).to_string();
        let textures = textures(&fitted, &layout, &map, layer);
        memory_bytes += textures.iter().map(|(_, array)| array.memory_bytes()).sum::<usize>();
        let name = |kind: &str| match (kind, number) {
            ("tables", 0) => format!("{stem}.ktx2"),
            _ => format!("{stem}.{kind}-{side}.ktx2"),
        };
        let mut names = json!({ "side": side });
        textures.iter().for_each(|(kind, _)| names[*kind] = json!(name(kind)));
        told.push(names);
        files.extend(textures.into_iter().map(|(kind, array)| (name(kind), array)));
        let [components, coarse] = [fitted.components.len(), Layout::coarse(fitted.components.len())];
        figures.push(FilteredFigures {
            side,
            components,
            coarse_components: coarse,
            reads: [components, coarse].map(reads),
            error,
        });
    }
    let index = json!({ "layout": LAYOUT, "sizeMm": asset.size_mm, "seamless": asset.seamless, "layers": told });
    files[0].1.notes.push((KTX2_KEY.into(), index.to_string()));
    let files = files.into_iter().map(|(name, array)| (name, array.file())).collect();
    Ok(FilteredExport { files, memory_bytes, layers: figures })
}

/// Returns the texture reads of an evaluation with so many components: two words of the tables, a cell, three views, three
/// of the mean; for each two components a scale, a plane and six of the bases.
fn reads(components: usize) -> usize {
    2 + 1 + 3 + 3 + components / 2 * (1 + 1 + 6)
}

/// Returns the layout of a layer's textures.
fn layout(asset: &Asset, layer: &Layer, map: &LightMap) -> Layout {
    let levels = std::iter::once([asset.width, asset.height])
        .chain(asset.levels.iter().map(|level| [level.width, level.height]))
        .collect();
    let columns = (layer.views.len() as f64).sqrt().ceil() as usize;
    let table_texels = TABLE_WIDTH + CELLS * CELLS + layer.views.len();
    Layout { levels, nodes: map.side(), tiles: [columns, layer.views.len().div_ceil(columns)], table_texels }
}

/// Returns the captures in the order of the layers, ready to be read.
fn captures_of_layers<'a>(
    asset: &Asset,
    captures: &'a [Capture],
    params: &FilteredParams,
    monitor: &'a Monitor,
) -> Result<Vec<Option<TileCache<'a>>>, FitError> {
    let mut caches: Vec<Option<TileCache>> = asset.layers.iter().map(|_| None).collect();
    for capture in captures {
        let info = capture.info();
        let number = layer_for_capture(info, asset)?;
        let layer = &asset.layers[number];
        let in_order = |sphere, set| {
            Spot::of_set(sphere, set, info.side).iter().enumerate().all(|(i, spot)| *spot == Spot::Measured(i))
        };
        let matches = (info.width, info.height) == (asset.width, asset.height)
            && (info.views.len(), info.lights.len()) == (layer.views.len(), layer.lights.len())
            && in_order(&layer.views, &info.views)
            && in_order(&layer.lights, &info.lights);
        if !matches {
            return Err(FitError::Params(format!(
                "the capture {} has other texels or directions than the asset; give the capture that it was fitted to, \
                 or leave --capture out",
                info.name
            )));
        }
        if !info.missing.is_empty() {
            return Err(FitError::Params(format!(
                "the capture {} lacks images, so textures cannot be fitted to it; leave --capture out",
                info.name
            )));
        }
        if caches[number].is_some() {
            return Err(FitError::Params(format!(
                "two captures are of the side `{}`; give one --capture for each layer",
                info.side
            )));
        }
        let memory_bytes = params.memory_bytes / captures.len() as u64;
        caches[number] = Some(TileCache::build(capture, memory_bytes, &std::env::temp_dir(), monitor)?);
    }
    Ok(caches)
}

/// Returns the textures of a layer with their kinds, the tables first.
fn textures(fitted: &FilteredLayer, layout: &Layout, map: &LightMap, layer: &Layer) -> Vec<(&'static str, Ktx2Array)> {
    let array = |format, size: [usize; 2], layers, levels| Ktx2Array {
        format,
        width: size[0],
        height: size[1],
        layers,
        levels,
        notes: Vec::new(),
    };
    let components = &fitted.components;
    let coarse = Layout::coarse(components.len());
    let finest = |range: std::ops::Range<usize>| -> Vec<u8> {
        components[range].chunks_exact(2).flat_map(|two| pair_of_planes([&two[0].plane, &two[1].plane])).collect()
    };
    let mut levels = vec![finest(0..coarse)];
    for level in 0..layout.levels.len() - 1 {
        let two = components[..coarse].chunks_exact(2);
        levels.push(two.flat_map(|two| pair_of_planes([&two[0].coarser[level], &two[1].coarser[level]])).collect());
    }
    let bases = components.iter().flat_map(|component| &fitted.bases.columns[component.basis].blocks).copied();
    let (size, atlas) = (layout.levels[0], layout.atlas());
    let tables = tables(fitted, layout, map, layer);
    let rows = tables.len() / TABLE_WIDTH;
    let fine = finest(coarse..components.len());
    vec![
        (
            "tables",
            array(Ktx2Format::Rgba32Float, [TABLE_WIDTH, rows], 0, vec![bytemuck::cast_slice(&tables).to_vec()]),
        ),
        ("planes", array(Ktx2Format::Bc5, size, coarse / 2, levels)),
        ("bases", array(Ktx2Format::Bc7, atlas, components.len(), vec![bases.collect()])),
        (
            "mean",
            array(Ktx2Format::Rgba16Float, atlas, 0, vec![bytemuck::cast_slice(&fitted.bases.mean_texels).to_vec()]),
        ),
        ("fine", array(Ktx2Format::Bc5, size, (components.len() - coarse) / 2, vec![fine])),
    ]
}

/// Returns the blocks of two planes as BC5: those of the first are red, those of the second green.
fn pair_of_planes([red, green]: [&Plane; 2]) -> Vec<u8> {
    red.blocks.iter().zip(&green.blocks).flat_map(|(red, green)| [*red, *green]).flatten().collect()
}

/// Returns the texels of the tables: what belongs to all, the cells' triangles, the views, the scales.
fn tables(fitted: &FilteredLayer, layout: &Layout, map: &LightMap, layer: &Layer) -> Vec<[f32; 4]> {
    let count = fitted.components.len();
    let mut texels = vec![[0.0; 4]; TABLE_WIDTH];
    texels[0] = [map.side(), layout.tiles[0], Layout::coarse(count) / 2, count / 2].map(|x| x as f32);
    let least = layer.lights.least_cosine();
    texels[1] = [map.radius(), least.max(1e-6), least.clamp(1e-6, HORIZON_COS), layer.views.len() as f32];
    texels
        .extend(triangles_of_cells(&layer.views).iter().map(|ids| [ids[0] as f32, ids[1] as f32, ids[2] as f32, 0.0]));
    texels.extend((0..layer.views.len() as u32).map(|id| {
        let [x, y, z] = layer.views.direction(id);
        [x, y, z, 0.0]
    }));
    // A sampler gives a code over 255.
    let scale =
        |component: &Component| 255.0 * 255.0 * component.plane.scale * fitted.bases.columns[component.basis].scale;
    texels.extend(fitted.components.chunks_exact(2).map(|two| [scale(&two[0]), scale(&two[1]), 0.0, 0.0]));
    texels.resize(texels.len().next_multiple_of(TABLE_WIDTH), [0.0; 4]);
    texels
}
