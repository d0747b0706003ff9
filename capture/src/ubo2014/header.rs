//! Reads what precedes the data of every UBO2014 file: signature, description, directions, size.

use crate::direction::{Direction, DirectionSet};
use crate::error::CaptureError;
use crate::images::decoded::check_size;

/// Largest number of colour channels that is read.
const MAX_CHANNELS: usize = 4096;

/// Bytes of each of the three fixed-length texts.
const TEXT_BYTES: usize = 80;

/// Number that follows the signature of the oldest PVF files in place of a description.
const LEGACY_PVF: u32 = 301_074;

/// Parts of a degree that directions are rounded to; files hold radians in single precision, 2e-5 degrees apart.
const PARTS_OF_A_DEGREE: f64 = 1000.0;

/// Reading position in a file, which never passes the end.
#[derive(Debug, Clone)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Cursor<'a> {
        Cursor { bytes, at: 0 }
    }

    /// Returns the next `count` bytes and moves past them. `what` names them in the message about a file that ends
    /// before.
    pub(super) fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| {
            let left = self.bytes.len() - self.at;
            format!("it ends inside {what}: {count} bytes should stand at byte {} and {left} do", self.at)
        })?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// Returns the bytes of `count` items of `size` bytes, as [`Cursor::take`] does.
    pub(super) fn take_many(&mut self, count: usize, size: usize, what: &str) -> Result<&'a [u8], String> {
        let bytes = count.checked_mul(size).ok_or_else(|| format!("its {what} would have {count} x {size} bytes"))?;
        self.take(bytes, what)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self, what: &str) -> Result<u8, String> {
        Ok(self.array::<1>(what)?[0])
    }

    pub(super) fn u32(&mut self, what: &str) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    /// Returns the next 32-bit count.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, String> {
        Ok(self.u32(what)? as usize)
    }

    pub(super) fn i32(&mut self, what: &str) -> Result<i32, String> {
        Ok(i32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f32s<const N: usize>(&mut self, what: &str) -> Result<[f32; N], String> {
        let mut numbers = [0f32; N];
        for number in &mut numbers {
            *number = f32::from_le_bytes(self.array(what)?);
        }
        Ok(numbers)
    }

    /// Checks that the whole file was read.
    pub(super) fn expect_end(&self) -> Result<(), String> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            left => Err(format!("{left} bytes follow its data")),
        }
    }
}

/// Kind of a UBO2014 file: how it holds its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContainerKind {
    /// Decorrelated full matrix factorisation: one factorisation per colour channel.
    Dfmf,
    /// Full matrix factorisation over all channels.
    Fmf,
    /// Per-view factorisation: a principal component analysis of each view.
    Pvf,
    /// Every sample in half precision, texel by texel.
    Bdi,
}

impl ContainerKind {
    /// Returns the name of the kind, as in signatures.
    pub fn name(self) -> &'static str {
        match self {
            ContainerKind::Dfmf => "DFMF",
            ContainerKind::Fmf => "FMF",
            ContainerKind::Pvf => "PVF",
            ContainerKind::Bdi => "BDI",
        }
    }
}

/// Kind of a file by its first bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Signature {
    text: &'static str,
    pub(super) kind: ContainerKind,
    /// Whether the file has rotations.
    pub(super) rotations: bool,
    /// Whether an FMF file has the longer header.
    pub(super) extended: bool,
}

/// Signatures that are known; a longer one precedes those that it starts with.
const SIGNATURES: [Signature; 7] = [
    Signature { text: "!DFMF08FCR", kind: ContainerKind::Dfmf, rotations: true, extended: false },
    Signature { text: "!FMF12FCER", kind: ContainerKind::Fmf, rotations: true, extended: true },
    Signature { text: "!FMF06FCR", kind: ContainerKind::Fmf, rotations: true, extended: false },
    Signature { text: "!FMF06FC", kind: ContainerKind::Fmf, rotations: false, extended: false },
    Signature { text: "!PVF06FCR", kind: ContainerKind::Pvf, rotations: true, extended: false },
    Signature { text: "!PVF06FC", kind: ContainerKind::Pvf, rotations: false, extended: false },
    Signature { text: "!BDIF06R2!", kind: ContainerKind::Bdi, rotations: true, extended: false },
];

/// Returns whether a file that starts with `bytes` claims to be a UBO2014 file. Every signature starts with an
/// exclamation mark, which no zip archive does.
pub(crate) fn is_container(bytes: &[u8]) -> bool {
    bytes.starts_with(b"!")
}

/// Reads the signature at `cursor`.
pub(super) fn read_signature(cursor: &mut Cursor) -> Result<Signature, String> {
    let bytes = cursor.bytes;
    let found = SIGNATURES.into_iter().find(|signature| bytes.starts_with(signature.text.as_bytes()));
    let found = found.ok_or_else(|| {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(10)]).escape_debug().to_string();
        let known: Vec<&str> = SIGNATURES.iter().map(|signature| signature.text).collect();
        format!("it starts with `{start}`, not with one of {}", known.join(" "))
    })?;
    cursor.take(found.text.len(), "its signature")?;
    Ok(found)
}

/// Header of a file: everything before the data.
#[derive(Debug)]
pub(super) struct Header {
    /// Set-up, sensor and light in words, where given.
    pub(super) words: Vec<String>,
    /// Texels per millimetre; 0 where unknown.
    pub(super) texels_per_mm: f32,
    pub(super) rgb_scale: [f32; 3],
    pub(super) cosine_included: bool,
    pub(super) channels: Vec<String>,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) views: Directions,
    pub(super) lights: Directions,
    /// Rotations of local frames, row-major 3 x 3.
    pub(super) rotations: Vec<[f32; 9]>,
}

impl Header {
    pub(super) fn texel_count(&self) -> usize {
        self.width * self.height
    }

    pub(super) fn pair_count(&self) -> usize {
        self.views.in_file.len() * self.lights.in_file.len()
    }
}

/// Set of directions, with their order in the file.
#[derive(Debug)]
pub(super) struct Directions {
    pub(super) set: DirectionSet,
    /// Index in the file of each direction of the set.
    pub(super) in_file: Vec<usize>,
}

impl Directions {
    /// Sorts angles in radians, polar angle first, to a set.
    fn new(angles: &[[f32; 2]]) -> Result<Directions, String> {
        let degrees = |radians: f32| (f64::from(radians).to_degrees() * PARTS_OF_A_DEGREE).round() / PARTS_OF_A_DEGREE;
        let mut order: Vec<(Direction, usize)> = angles
            .iter()
            .zip(0..)
            .map(|(&[theta, phi], i)| (Direction::new(degrees(theta), degrees(phi)), i))
            .collect();
        // As `DirectionSet` sorts.
        order.sort_by(|(a, _), (b, _)| a.theta_deg.total_cmp(&b.theta_deg).then(a.phi_deg.total_cmp(&b.phi_deg)));
        let (directions, in_file) = order.into_iter().unzip();
        let set = DirectionSet::new(directions).map_err(|error| match error {
            CaptureError::BadDirections { reason } => reason,
            other => other.to_string(),
        })?;
        Ok(Directions { set, in_file })
    }
}

/// Reads the header up to the data of the file's kind. Also returns the number of components and of view slots of the
/// oldest PVF files, which have them inside the header.
pub(super) fn read_header(cursor: &mut Cursor, signature: Signature) -> Result<(Header, Option<[usize; 2]>), String> {
    let mut ahead = cursor.clone();
    if signature.kind == ContainerKind::Pvf && ahead.u32("its description") == Ok(LEGACY_PVF) {
        *cursor = ahead;
        let mut header = empty_header();
        let components = cursor.count("its number of components")?;
        (header.width, header.height) = read_size(cursor)?;
        let slots = cursor.count("its number of view slots")?;
        (header.views, header.lights) = read_directions(cursor)?;
        return Ok((header, Some([components, slots])));
    }
    let mut header = read_description(cursor)?;
    (header.views, header.lights) = read_directions(cursor)?;
    (header.width, header.height) = read_size(cursor)?;
    // BDI has other things in between.
    if signature.rotations && signature.kind != ContainerKind::Bdi {
        header.rotations = read_rotations(cursor)?;
    }
    Ok((header, None))
}

fn empty_header() -> Header {
    let none = || Directions { set: DirectionSet::bonn81(), in_file: Vec::new() };
    Header {
        words: Vec::new(),
        texels_per_mm: 0.0,
        rgb_scale: [1.0; 3],
        cosine_included: false,
        channels: ["R", "G", "B"].map(String::from).to_vec(),
        width: 0,
        height: 0,
        views: none(),
        lights: none(),
        rotations: Vec::new(),
    }
}

fn read_description(cursor: &mut Cursor) -> Result<Header, String> {
    const WHAT: &str = "its description";
    let start = cursor.at;
    let mut header = empty_header();
    let size = cursor.count(WHAT)?;
    let version = cursor.u32(WHAT)?;
    for _ in 0..3 {
        let text = cursor.take(TEXT_BYTES, WHAT)?;
        let text = &text[..text.iter().position(|&byte| byte == 0).unwrap_or(TEXT_BYTES)];
        let text = String::from_utf8_lossy(text).split_whitespace().collect::<Vec<_>>().join(" ");
        if !text.is_empty() {
            header.words.push(text.chars().filter(|character| !character.is_control()).collect());
        }
    }
    [header.texels_per_mm] = cursor.f32s(WHAT)?;
    header.rgb_scale = cursor.f32s(WHAT)?;
    if version > 1 {
        header.cosine_included = cursor.u32(WHAT)? != 0;
    }
    if version > 2 {
        let length = cursor.count(WHAT)?;
        cursor.take(length, "its measurement text")?;
    }
    if version > 3 {
        let count = cursor.count(WHAT)?;
        if !(1..=MAX_CHANNELS).contains(&count) {
            return Err(format!("it claims {count} colour channels; 1 to {MAX_CHANNELS} are read"));
        }
        header.channels.clear();
        for _ in 0..count {
            let length = cursor.count("its channels' names")?;
            let name = String::from_utf8_lossy(cursor.take(length, "its channels' names")?);
            header.channels.push(name.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_string());
        }
    }
    let read = cursor.at - start;
    if read != size {
        return Err(format!("its description claims {size} bytes and has {read}"));
    }
    Ok(header)
}

fn read_directions(cursor: &mut Cursor) -> Result<(Directions, Directions), String> {
    const WHAT: &str = "its directions";
    let view_count = cursor.count(WHAT)?;
    let (mut views, mut lights) = (Vec::new(), Vec::new());
    for view in 0..view_count {
        views.push(cursor.f32s::<2>(WHAT)?);
        let count = cursor.count(WHAT)?;
        let angles = cursor.take_many(count, 8, WHAT)?;
        if view == 0 {
            let mut angles = Cursor::new(angles);
            for _ in 0..count {
                lights.push(angles.f32s::<2>(WHAT)?);
            }
        } else if count != lights.len() {
            let first = lights.len();
            return Err(format!("its view {view} has {count} lights and its first has {first}, so they form no grid"));
        }
    }
    let views = Directions::new(&views).map_err(|reason| format!("in the set of its views, {reason}"))?;
    Ok((views, Directions::new(&lights).map_err(|reason| format!("in the set of its lights, {reason}"))?))
}

fn read_size(cursor: &mut Cursor) -> Result<(usize, usize), String> {
    let (width, height) = (cursor.count("its size")?, cursor.count("its size")?);
    check_size(width, height, None)
        .map_err(|_| format!("it claims {width} x {height} texels, no size that is read"))?;
    Ok((width, height))
}

pub(super) fn read_rotations(cursor: &mut Cursor) -> Result<Vec<[f32; 9]>, String> {
    const WHAT: &str = "its rotations";
    let count = cursor.count(WHAT)?;
    let mut numbers = Cursor::new(cursor.take_many(count, 36, WHAT)?);
    (0..count).map(|_| numbers.f32s::<9>(WHAT)).collect()
}
