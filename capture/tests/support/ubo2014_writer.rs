//! Writes small UBO2014 files for tests, from the published byte layout and with no code of the reader:
//! the factorisations are exact, over an orthonormal cosine basis in double precision.

#![allow(dead_code, reason = "each test program takes what it needs of this")]

/// What a file holds, in the channels' own values (colour models are undone by whoever calls).
pub struct Scene {
    pub width: usize,
    pub height: usize,
    /// Polar angle and azimuth in degrees, in the order of the file.
    pub views: Vec<[f64; 2]>,
    pub lights: Vec<[f64; 2]>,
    pub channels: Vec<String>,
    /// `[view, light, row, column, channel]`.
    pub values: Vec<f64>,
}

impl Scene {
    pub fn at(&self, view: usize, light: usize, texel: usize, channel: usize) -> f64 {
        let texels = self.width * self.height;
        self.values[((view * self.lights.len() + light) * texels + texel) * self.channels.len() + channel]
    }

    fn texels(&self) -> usize {
        self.width * self.height
    }

    fn pairs(&self) -> usize {
        self.views.len() * self.lights.len()
    }
}

/// How the fields around the data are written.
#[derive(Clone)]
pub struct Style {
    pub version: u32,
    pub cosine: u32,
    pub texels_per_mm: f32,
    pub xml: String,
    /// Row-major 3 x 3 each.
    pub rotations: Vec<[f32; 9]>,
    /// Bytes of a number: 2, 4 or 8.
    pub scalar: u8,
    /// Images as columns instead of texels' functions.
    pub transposed: bool,
}

impl Default for Style {
    fn default() -> Style {
        Style {
            version: 4,
            cosine: 1,
            texels_per_mm: 4.0,
            xml: "<measurement/>".into(),
            rotations: Vec::new(),
            scalar: 4,
            transposed: false,
        }
    }
}

pub struct Bytes(pub Vec<u8>);

impl Bytes {
    pub fn new(signature: &str) -> Bytes {
        Bytes(signature.as_bytes().to_vec())
    }
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }
    pub fn u32(&mut self, value: usize) {
        self.0.extend(u32::try_from(value).unwrap().to_le_bytes());
    }
    pub fn f32(&mut self, value: f64) {
        self.0.extend((value as f32).to_le_bytes());
    }
    pub fn number(&mut self, scalar: u8, value: f64) {
        match scalar {
            2 => self.0.extend(half::f16::from_f64(value).to_le_bytes()),
            4 => self.f32(value),
            _ => self.0.extend(value.to_le_bytes()),
        }
    }
    pub fn numbers(&mut self, scalar: u8, values: &[f64]) {
        values.iter().for_each(|value| self.number(scalar, *value));
    }
}

/// Meta data, directions, and what `size` says of size and rotations.
fn common(out: &mut Bytes, scene: &Scene, style: &Style, rotations: Option<&[[f32; 9]]>) {
    let mut meta = Bytes(Vec::new());
    meta.u32(style.version as usize);
    for text in ["test rig", "", "lamp"] {
        let mut field = [0u8; 80];
        field[..text.len()].copy_from_slice(text.as_bytes());
        meta.0.extend(field);
    }
    meta.0.extend(style.texels_per_mm.to_le_bytes());
    [1.0, 1.5, 2.0].into_iter().for_each(|scale| meta.f32(scale));
    if style.version > 1 {
        meta.u32(style.cosine as usize);
    }
    if style.version > 2 {
        meta.u32(style.xml.len());
        meta.0.extend(style.xml.as_bytes());
    }
    if style.version > 3 {
        meta.u32(scene.channels.len());
        for name in &scene.channels {
            meta.u32(name.len());
            meta.0.extend(name.as_bytes());
        }
    }
    out.u32(meta.0.len() + 4);
    out.0.extend(meta.0);
    sampling(out, scene);
    out.u32(scene.width);
    out.u32(scene.height);
    if let Some(rotations) = rotations {
        out.u32(rotations.len());
        rotations.iter().flatten().for_each(|number| out.0.extend(number.to_le_bytes()));
    }
}

fn sampling(out: &mut Bytes, scene: &Scene) {
    out.u32(scene.views.len());
    for view in &scene.views {
        view.iter().for_each(|angle| out.f32(angle.to_radians()));
        out.u32(scene.lights.len());
        scene.lights.iter().flatten().for_each(|angle| out.f32(angle.to_radians()));
    }
}

/// Column `k` of the orthonormal cosine basis of `count` dimensions, at `i`.
fn basis(count: usize, i: usize, k: usize) -> f64 {
    let scale = if k == 0 { 1.0 } else { 2.0f64 };
    (scale / count as f64).sqrt() * (std::f64::consts::PI * (i as f64 + 0.5) * k as f64 / count as f64).cos()
}

/// Factors `matrix[r, c]` of `rows` x `columns` exactly: left `[r, k]` and right `[c, k]`, with the basis over
/// the shorter side.
fn factors(rows: usize, columns: usize, matrix: impl Fn(usize, usize) -> f64) -> (usize, Vec<f64>, Vec<f64>) {
    let count = rows.min(columns);
    let basis_of = |n: usize| -> Vec<f64> { (0..n * n).map(|at| basis(n, at / n, at % n)).collect() };
    let table = basis_of(count);
    let project = |outer: usize, value: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let project_one = |i: usize, k: usize| (0..count).map(|j| value(i, j) * table[j * count + k]).sum();
        (0..outer * count).map(|at| project_one(at / count, at % count)).collect()
    };
    if rows <= columns {
        let right = project(columns, &|c, r| matrix(r, c));
        (count, table, right)
    } else {
        let left = project(rows, &|r, c| matrix(r, c));
        (count, left, table)
    }
}

/// `!DFMF08FCR`.
pub fn dfmf(scene: &Scene, style: &Style, model: i32, mean: [f64; 3], matrix: [f64; 9]) -> Vec<u8> {
    let mut out = Bytes::new("!DFMF08FCR");
    common(&mut out, scene, style, Some(&style.rotations));
    let (texels, pairs, lights) = (scene.texels(), scene.pairs(), scene.lights.len());
    out.u32(texels.min(pairs));
    out.0.extend(model.to_le_bytes());
    mean.into_iter().chain(matrix).for_each(|number| out.f32(number));
    for channel in 0..scene.channels.len() {
        let value = |pair: usize, texel: usize| scene.at(pair / lights, pair % lights, texel, channel);
        let (rows, columns) = if style.transposed { (texels, pairs) } else { (pairs, texels) };
        let (count, left, right) =
            factors(rows, columns, |r, c| if style.transposed { value(c, r) } else { value(r, c) });
        out.u8(style.scalar);
        factored(&mut out, style.scalar, [count, rows, columns], &left, &right);
    }
    out.0
}

/// The heads that FMF files may have.
pub enum FmfHead {
    /// `!FMF06FC`.
    Old,
    /// `!FMF06FCR`.
    OldWithRotations,
    /// `!FMF12FCER` with this header version, dynamic range reduction and height map.
    Extended { version: u8, reduction: u32, height_map: Option<(usize, usize, Vec<f64>)> },
}

pub fn fmf(scene: &Scene, style: &Style, head: &FmfHead) -> Vec<u8> {
    let (signature, rotations) = match head {
        FmfHead::Old => ("!FMF06FC", None),
        FmfHead::OldWithRotations => ("!FMF06FCR", Some(&style.rotations[..])),
        FmfHead::Extended { .. } => ("!FMF12FCER", Some(&style.rotations[..])),
    };
    let mut out = Bytes::new(signature);
    common(&mut out, scene, style, rotations);
    if let FmfHead::Extended { version, reduction, height_map } = head {
        out.u8(*version);
        if *version >= 1 {
            out.u32(*reduction as usize);
        }
        if *version >= 2 {
            let (width, height, values) = height_map.clone().unwrap_or((0, 0, Vec::new()));
            out.u32(width);
            out.u32(height);
            out.numbers(2, &values);
        }
    }
    let (texels, pairs, lights, channels) = (scene.texels(), scene.pairs(), scene.lights.len(), scene.channels.len());
    let value = |pair: usize, texel: usize, channel: usize| scene.at(pair / lights, pair % lights, texel, channel);
    let (rows, columns) = if style.transposed { (texels * channels, pairs) } else { (pairs * channels, texels) };
    let (count, left, right) = factors(rows, columns, |r, c| {
        let (outer, channel) = (r / channels, r % channels);
        if style.transposed { value(c, outer, channel) } else { value(outer, c, channel) }
    });
    out.u32(count);
    out.u8(style.scalar);
    factored(&mut out, style.scalar, [count, rows, columns], &left, &right);
    out.0
}

/// A factored matrix: its shape (components, rows, columns), singular values of 1, and the factors.
fn factored(out: &mut Bytes, scalar: u8, shape: [usize; 3], left: &[f64], right: &[f64]) {
    shape.into_iter().for_each(|number| out.u32(number));
    out.numbers(scalar, &vec![1.0; shape[0]]);
    out.numbers(scalar, left);
    out.numbers(scalar, right);
}

/// The heads that PVF files may have.
pub enum PvfHead {
    /// `!PVF06FC`.
    Plain,
    /// `!PVF06FCR`.
    WithRotations,
    /// `!PVF06FC` with the number 301074 in place of a description.
    Legacy,
}

pub fn pvf(scene: &Scene, style: &Style, head: &PvfHead) -> Vec<u8> {
    let (texels, lights, channels) = (scene.texels(), scene.lights.len(), scene.channels.len());
    let (dimension, weights) = if style.transposed { (texels * channels, lights) } else { (lights * channels, texels) };
    let components = dimension.min(weights);
    let mut out = Bytes::new(if matches!(head, PvfHead::WithRotations) { "!PVF06FCR" } else { "!PVF06FC" });
    match head {
        PvfHead::Legacy => {
            out.u32(301_074);
            [components, scene.width, scene.height, scene.views.len()].into_iter().for_each(|number| out.u32(number));
            sampling(&mut out, scene);
        }
        PvfHead::Plain => common(&mut out, scene, style, None),
        PvfHead::WithRotations => common(&mut out, scene, style, Some(&style.rotations)),
    }
    if !matches!(head, PvfHead::Legacy) {
        out.u32(components);
        out.u32(scene.views.len());
    }
    for view in 0..scene.views.len() {
        let value = |row: usize, column: usize| {
            let (outer, channel) = (row / channels, row % channels);
            if style.transposed {
                scene.at(view, column, outer, channel)
            } else {
                scene.at(view, outer, column, channel)
            }
        };
        let mean: Vec<f64> =
            (0..dimension).map(|r| (0..weights).map(|c| value(r, c)).sum::<f64>() / weights as f64).collect();
        let (count, left, right) = factors(dimension, weights, |r, c| value(r, c) - mean[r]);
        out.u8(style.scalar);
        [count, weights, dimension].into_iter().for_each(|number| out.u32(number));
        out.numbers(style.scalar, &vec![1.0; count]);
        out.numbers(style.scalar, &mean);
        out.numbers(style.scalar, &left);
        out.numbers(style.scalar, &right);
    }
    out.0
}

/// `!BDIF06R2!`.
pub struct BdiStyle {
    pub compression: u8,
    pub scanlines_per_chunk: usize,
    /// 1 for each texel that is there.
    pub mask: Vec<u8>,
    /// Whether the count of rotations stands behind the mask.
    pub rotations: bool,
    /// Whether the last chunk is filled up with zeros.
    pub full_last_chunk: bool,
}

pub fn bdi(scene: &Scene, style: &Style, bdi: &BdiStyle) -> Vec<u8> {
    let mut out = Bytes::new("!BDIF06R2!");
    common(&mut out, scene, style, None);
    out.u32(bdi.scanlines_per_chunk);
    out.u8(bdi.compression);
    out.0.extend(&bdi.mask);
    if bdi.rotations {
        out.u32(style.rotations.len());
        style.rotations.iter().flatten().for_each(|number| out.0.extend(number.to_le_bytes()));
    }
    let stored: Vec<usize> = (0..scene.texels()).filter(|&t| bdi.compression != 2 || bdi.mask[t] != 0).collect();
    let per_chunk = bdi.scanlines_per_chunk * scene.width;
    for texels in stored.chunks(per_chunk) {
        let mut chunk = Bytes(Vec::new());
        for &texel in texels {
            for pair in 0..scene.pairs() {
                for channel in 0..scene.channels.len() {
                    let (view, light) = (pair / scene.lights.len(), pair % scene.lights.len());
                    chunk.number(2, scene.at(view, light, texel, channel));
                }
            }
        }
        if bdi.full_last_chunk {
            chunk.0.resize(per_chunk * scene.pairs() * scene.channels.len() * 2, 0);
        }
        out.u32(chunk.0.len());
        out.0.extend(chunk.0);
    }
    out.0
}

/// One small file of each kind, with what may stand in it.
pub fn one_of_each_kind() -> Vec<Vec<u8>> {
    let scene = Scene {
        width: 3,
        height: 2,
        views: vec![[30.0, 90.0], [0.0, 0.0]],
        lights: vec![[75.0, 10.0], [0.0, 0.0]],
        channels: ["R", "G", "B"].map(String::from).to_vec(),
        values: (0..2 * 2 * 6 * 3).map(|i| 0.1 + 0.01 * f64::from(i)).collect(),
    };
    let style = Style { scalar: 2, rotations: vec![[0.5; 9]], ..Style::default() };
    let height_map = Some((2, 1, vec![0.0, 1.0]));
    let sparse =
        BdiStyle { compression: 2, scanlines_per_chunk: 1, mask: vec![1; 6], rotations: true, full_last_chunk: false };
    vec![
        dfmf(&scene, &style, 11, [0.0; 3], [0.0; 9]),
        fmf(&scene, &style, &FmfHead::Extended { version: 2, reduction: 0, height_map }),
        pvf(&scene, &style, &PvfHead::WithRotations),
        pvf(&scene, &style, &PvfHead::Legacy),
        bdi(&scene, &style, &sparse),
    ]
}
