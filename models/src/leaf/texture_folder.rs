//! Reads and writes a folder of appearance textures: `structure.png`, `pigment.png` and so on, and `textures.toml`,
//! which says what place on the leaf they cover and what black and white mean.
//!
//! ```toml
//! size_mm = 20.0      # width and height of the patch
//!
//! [area]              # where the images lie, from the patch's lower left corner
//! left_mm = -1.02
//! bottom_mm = -1.02
//! width_mm = 22.04
//! height_mm = 22.04
//!
//! [pigment]
//! low = 0.0           # value of black
//! high = 2.0          # value of white
//! ```
//!
//! Without the file, or a part of it, images cover the patch exactly and have the usual range of their kind. Every
//! image may have its own resolution. Positions on a patch are in millimetres from its lower left corner, x to the
//! right, y up to the tip.

use std::fmt::Write;
#[cfg(test)]
use std::fs;
use std::path::Path;
use std::sync::Arc;

use crate::error::ModelError;
use crate::leaf::texture_image::{TextureImage, TextureKind};
use btf_capture::atomic::{StagedFolder, write_file_atomically};
use btf_capture::files;
use btf_capture::toml_text::bounded_text;

/// Name of the description file.
pub const TEXTURES_NAME: &str = "textures.toml";

/// Largest description file in bytes.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 16;

/// Relative difference between the shape of an image and that of its area above which the image is taken for a mistake.
const SHAPE_TOLERANCE: f64 = 0.02;

/// Area that textures cover: x and y of the lower left corner, width and height, in millimetres.
type AreaMm = [f64; 4];

/// One texture as numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureGrid {
    /// Kind of the texture.
    pub kind: TextureKind,
    /// Number of texels in a row.
    pub width: usize,
    /// Values that black and white stand for in the file. Values of a grid to be written are clamped to this range.
    pub range: [f64; 2],
    /// Values `[texel, channel]`, with [`TextureKind::channels`] channels, row 0 at the top.
    pub values: Vec<f32>,
}

/// Textures that the user supplies. Without any, all textures are generated.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TextureImages {
    /// Width and height of the patch in millimetres, where the description says it.
    size_mm: Option<f32>,
    /// Area that the images cover; `None` is the patch.
    area_mm: Option<AreaMm>,
    /// Images with their ranges, by [`TextureKind`].
    images: [Option<(Arc<TextureImage>, [f64; 2])>; TextureKind::ALL.len()],
}

impl TextureImages {
    /// Reads the textures in the folder `dir`. Any may be missing, but not all.
    ///
    /// # Errors
    /// [`ModelError::Leaf`] for a folder without textures, an image that is damaged, too large, of another format or of
    /// another shape than its area, or an invalid description.
    ///
    /// Cost: 6 bytes per texel, at most 8192 x 8192 texels per image.
    pub fn read(dir: impl AsRef<Path>) -> Result<TextureImages, ModelError> {
        let dir = dir.as_ref();
        let listing = files::list(dir).map_err(|error| {
            ModelError::leaf(dir, format!("cannot be opened as a folder ({error})"), "point to a folder of textures")
        })?;
        for path in listing {
            let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or("").to_ascii_lowercase();
            let is_kind = TextureKind::ALL.iter().any(|kind| kind.name() == stem);
            let expected = path.file_name().and_then(|s| s.to_str()) == Some(&format!("{stem}.png"));
            if is_kind && !expected {
                let fault = "is named like a texture but not with the ending .png in small letters".to_string();
                return Err(ModelError::leaf(&path, fault, "save it as a PNG of that name or move it away"));
            }
        }
        let description = Description::read(&dir.join(TEXTURES_NAME))?;
        let mut textures =
            TextureImages { size_mm: description.size_mm, area_mm: description.area_mm, ..TextureImages::default() };
        for (slot, kind) in textures.images.iter_mut().zip(TextureKind::ALL) {
            let path = dir.join(format!("{}.png", kind.name()));
            if !files::exists(&path) {
                continue;
            }
            let image = TextureImage::read(&path, kind.channels())?;
            check_shape(&path, &image, description.area_mm)?;
            *slot = Some((Arc::new(image), description.ranges[kind as usize]));
        }
        if textures.is_empty() {
            let names = TextureKind::ALL.map(|kind| format!("{}.png", kind.name())).join(", ");
            let fault = format!("holds none of {names}");
            return Err(ModelError::leaf(dir, fault, "point to a folder of textures"));
        }
        Ok(textures)
    }

    /// Returns whether there is no image at all.
    pub fn is_empty(&self) -> bool {
        self.images.iter().all(Option::is_none)
    }

    /// Returns the kinds of the images that there are.
    pub fn kinds(&self) -> impl Iterator<Item = TextureKind> {
        TextureKind::ALL.into_iter().filter(|kind| self.has(*kind))
    }

    /// Returns whether there is an image of a kind.
    pub fn has(&self, kind: TextureKind) -> bool {
        self.images[kind as usize].is_some()
    }

    /// Returns the width and height of the patch in millimetres, where `textures.toml` says it.
    pub fn size_mm(&self) -> Option<f32> {
        self.size_mm
    }

    /// Returns the area that every image covers on a patch of `size_mm`: x and y of the lower left corner, width and
    /// height, in millimetres. The area may be larger than the patch, because oblique views see beside it.
    pub fn area_mm(&self, size_mm: f32) -> [f64; 4] {
        let size = f64::from(size_mm);
        self.area_mm.unwrap_or([0.0, 0.0, size, size])
    }

    /// Returns the number of texels in a row of the widest image; `None` without images.
    pub fn finest_width(&self) -> Option<usize> {
        self.images.iter().flatten().map(|(image, _)| image.size()[0]).max()
    }

    /// Returns the texture of a kind as numbers, if there is an image of it. Costs 4 bytes per texel and channel.
    pub fn grid(&self, kind: TextureKind) -> Option<TextureGrid> {
        let (image, range) = self.images[kind as usize].as_ref()?;
        Some(TextureGrid { kind, width: image.size()[0], range: *range, values: image.values(*range) })
    }

    /// Returns the bilinearly interpolated value of a kind at a position in millimetres of a patch of `size_mm`, if
    /// there is an image of it. Beyond the area the image is mirrored; channels that it lacks are 0.
    pub fn sample(&self, kind: TextureKind, position_mm: [f32; 2], size_mm: f32) -> Option<[f32; 3]> {
        let (image, range) = self.images[kind as usize].as_ref()?;
        let [left, bottom, width, height] = self.area_mm(size_mm);
        let [x, y] = position_mm.map(f64::from);
        Some(image.sample([(x - left) / width, 1.0 - (y - bottom) / height], *range))
    }
}

/// Writes textures of a patch of `size_mm` into the new folder `dir`, with `textures.toml`. All cover `area_mm` (x and
/// y of the lower left corner, width and height). `about` is a line for people. The structure has 8 bits, the others
/// 16. The folder appears whole or not at all.
///
/// # Errors
/// [`ModelError::Leaf`] if `dir` holds files already or cannot be created, [`ModelError::File`] if a file cannot be
/// written.
pub fn write_textures(
    dir: impl AsRef<Path>,
    area_mm: [f64; 4],
    size_mm: f32,
    about: &str,
    textures: &[TextureGrid],
) -> Result<(), ModelError> {
    let dir = dir.as_ref();
    if files::list(dir).is_ok_and(|listing| !listing.is_empty()) {
        let fault = "holds files already".to_string();
        return Err(ModelError::leaf(dir, fault, "give a folder that is new or empty"));
    }
    let staging = StagedFolder::create(dir)?;
    let [left, bottom, area_width, area_height] = area_mm;
    // Writing to a string does not fail.
    let mut text = String::new();
    let _ = write!(
        text,
        "# Appearance textures of a leaf; edit or replace any image, delete what shall be grown again.\n\
         # {about}\n\
         # Pixels are numbers, not colours: black is `low`, white is `high`, no gamma curve. The tip is at the top.\n\n\
         size_mm = {size_mm:?}\n\n\
         [area]\nleft_mm = {left:?}\nbottom_mm = {bottom:?}\nwidth_mm = {area_width:?}\nheight_mm = {area_height:?}\n"
    );
    for TextureGrid { kind, width, range, values } in textures {
        let image = TextureImage::from_values(*width, kind.channels(), values, *range);
        let path = staging.path().join(format!("{}.png", kind.name()));
        let depth = if *kind == TextureKind::Structure { png::BitDepth::Eight } else { png::BitDepth::Sixteen };
        let bytes = image.encode(depth).map_err(|error| {
            ModelError::leaf(&path, format!("cannot be encoded ({error})"), "report this with the command line")
        })?;
        write_file_atomically(&path, &bytes)?;
        let (name, [low, high]) = (kind.name(), range);
        let _ = write!(text, "\n# {}\n[{name}]\nlow = {low:?}\nhigh = {high:?}\n", kind.meaning());
    }
    write_file_atomically(staging.path().join(TEXTURES_NAME), text.as_bytes())?;
    Ok(staging.commit()?)
}

fn check_shape(path: &Path, image: &TextureImage, area_mm: Option<AreaMm>) -> Result<(), ModelError> {
    let [width, height] = image.size();
    let [_, _, area_width, area_height] = area_mm.unwrap_or([0.0, 0.0, 1.0, 1.0]);
    let ratio = width as f64 * area_height / (height as f64 * area_width);
    if (1.0 - SHAPE_TOLERANCE..=1.0 + SHAPE_TOLERANCE).contains(&ratio) {
        return Ok(());
    }
    let shape = match area_mm {
        Some(_) => format!("an area of {area_width} x {area_height} mm"),
        None => "a square patch".to_string(),
    };
    let fault = format!("has {width} x {height} texels but covers {shape}");
    Err(ModelError::leaf(path, fault, "crop or scale it to that shape"))
}

/// Contents of `textures.toml`.
struct Description {
    size_mm: Option<f32>,
    area_mm: Option<AreaMm>,
    ranges: [[f64; 2]; TextureKind::ALL.len()],
}

impl Description {
    /// Reads the file, or returns the defaults where there is none.
    fn read(path: &Path) -> Result<Description, ModelError> {
        let bad = |fault: String| {
            ModelError::leaf(path, fault, "correct or delete it, then images cover the patch in their usual range")
        };
        let mut description =
            Description { size_mm: None, area_mm: None, ranges: TextureKind::ALL.map(TextureKind::default_range) };
        if !files::exists(path) {
            return Ok(description);
        }
        let text = bounded_text(path, MAX_DESCRIPTION_BYTES, "a description of textures").map_err(bad)?;
        let file: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            bad(format!("is no TOML ({})", error.message().lines().next().unwrap_or("unknown")))
        })?;
        let number_of = |value: &toml::Value| {
            value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).filter(|v| v.is_finite())
        };
        let number = |table: &toml::Table, name: &str, key: &str| -> Result<f64, ModelError> {
            table.get(key).and_then(number_of).ok_or_else(|| bad(format!("has no number `{key}` in [{name}]")))
        };
        if let Some(size) = file.get("size_mm") {
            let size = number_of(size).filter(|size| (1e-3..=1e4).contains(size));
            let size = size.ok_or_else(|| bad("has a `size_mm` that is no number from 0.001 to 10000".to_string()))?;
            description.size_mm = Some(size as f32);
        }
        let table = |name: &str| match file.get(name) {
            None => Ok(None),
            Some(toml::Value::Table(table)) => Ok(Some(table)),
            Some(_) => Err(bad(format!("has `{name}` as something else than a table"))),
        };
        if let Some(area) = table("area")? {
            let get = |key| number(area, "area", key);
            let [left, bottom, width, height] =
                [get("left_mm")?, get("bottom_mm")?, get("width_mm")?, get("height_mm")?];
            if ![left, bottom].iter().all(|x| x.abs() <= 1e4)
                || ![width, height].iter().all(|x| (1e-3..=1e4).contains(x))
            {
                return Err(bad("has an [area] of less than 0.001 or more than 10000 mm".to_string()));
            }
            description.area_mm = Some([left, bottom, width, height]);
        }
        for kind in TextureKind::ALL {
            let name = kind.name();
            let Some(range) = table(name)? else { continue };
            let (low, high) = (number(range, name, "low")?, number(range, name, "high")?);
            let [least, most] = kind.allowed_range();
            if !(least <= low && low < high && high <= most) {
                return Err(bad(format!(
                    "has {low} to {high} in [{name}], which is not a rise within {least} to {most}"
                )));
            }
            description.ranges[kind as usize] = [low, high];
        }
        Ok(description)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::texture_image::tests::png_bytes;

    fn grey(side: [u32; 2]) -> Vec<u8> {
        let data = vec![128; (side[0] * side[1]) as usize];
        png_bytes(side, png::ColorType::Grayscale, png::BitDepth::Eight, &data)
    }

    fn refusal(files: &[(&str, &[u8])]) -> String {
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in files {
            fs::write(dir.path().join(name), bytes).unwrap();
        }
        let message = TextureImages::read(dir.path()).unwrap_err().to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        message
    }

    #[test]
    fn a_folder_of_one_grey_texel_is_textures() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("gloss.png"), grey([1, 1])).unwrap();
        let textures = TextureImages::read(dir.path()).unwrap();
        assert_eq!(textures.kinds().collect::<Vec<_>>(), [TextureKind::Gloss]);
        let value = textures.sample(TextureKind::Gloss, [3.0, 99.0], 20.0).unwrap()[0];
        assert!((value - 128.0 / 255.0).abs() < 1e-6);
        assert_eq!(textures.sample(TextureKind::Pigment, [3.0, 9.0], 20.0), None);
    }

    #[test]
    fn black_and_white_mean_what_the_description_says() {
        let dir = tempfile::tempdir().unwrap();
        let two = png_bytes([2, 2], png::ColorType::Grayscale, png::BitDepth::Eight, &[0, 255, 0, 255]);
        fs::write(dir.path().join("height.png"), two).unwrap();
        let text = "[area]\nleft_mm = 10\nbottom_mm = 0.0\nwidth_mm = 2\nheight_mm = 2\n[height]\nlow = -1\nhigh = 3\n";
        fs::write(dir.path().join(TEXTURES_NAME), text).unwrap();
        let textures = TextureImages::read(dir.path()).unwrap();
        let at = |x: f32| textures.sample(TextureKind::Height, [x, 1.0], 20.0).unwrap()[0];
        assert!((at(10.5) + 1.0).abs() < 1e-4 && (at(11.5) - 3.0).abs() < 1e-4 && (at(11.0) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn written_textures_are_read_back_with_their_place_and_size() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("textures");
        let values = (0..24).map(|i| i as f32 / 23.0).collect();
        let pigment = TextureGrid { kind: TextureKind::Pigment, width: 4, range: [0.0, 1.0], values };
        write_textures(&dir, [-1.0, -2.0, 22.0, 11.0], 20.0, "a test", std::slice::from_ref(&pigment)).unwrap();
        let textures = TextureImages::read(&dir).unwrap();
        assert_eq!((textures.size_mm(), textures.area_mm(7.0)), (Some(20.0), [-1.0, -2.0, 22.0, 11.0]));
        assert_eq!(textures.grid(TextureKind::Gloss), None);
        let read = textures.grid(TextureKind::Pigment).unwrap();
        assert_eq!((read.kind, read.width, read.range), (pigment.kind, pigment.width, pigment.range));
        let worst = read.values.iter().zip(&pigment.values).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst}");
        // A grid's texel is what sampling gives in its middle: the last column of the top row.
        let middle =
            textures.sample(TextureKind::Pigment, [-1.0 + 22.0 * 3.5 / 4.0, -2.0 + 11.0 * 0.75], 20.0).unwrap();
        assert!((0..3).all(|k| (middle[k] - read.values[9 + k]).abs() < 1e-5 && read.values[9 + k] != read.values[k]));
    }

    #[test]
    fn what_cannot_be_used_is_named_with_its_remedy() {
        let whole = grey([4, 4]);
        for (message, parts) in [
            (refusal(&[]), ["holds none of", "point to"]),
            (refusal(&[("photo.png", &whole)]), ["holds none of", "point to"]),
            (refusal(&[("gloss.png", &whole[..whole.len() - 9])]), ["gloss.png is no whole PNG", "save it again"]),
            (refusal(&[("pigment.png", b"")]), ["pigment.png is no whole PNG", "save it again"]),
            (refusal(&[("pigment.png", b"\xFF\xD8 a jpeg")]), ["pigment.png is no whole PNG", "save it again"]),
            (refusal(&[("gloss.jpg", &whole)]), ["gloss.jpg is named like", "save it as a PNG"]),
            (refusal(&[("Gloss.PNG", &whole)]), ["Gloss.PNG is named like", "save it as a PNG"]),
            (refusal(&[("gloss.png", &grey([8, 2]))]), ["8 x 2 texels but covers a square", "crop or scale"]),
            (refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"[gloss")]), ["is no TOML", "correct or delete"]),
            (refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"size_mm = 0")]), ["`size_mm` that is no", "correct"]),
            (refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"gloss = 1")]), ["`gloss` as something", "correct"]),
            (refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"[gloss]\nlow = 0")]), ["no number `high`", "correct"]),
            (
                refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"[height]\nlow = nan\nhigh = 1")]),
                ["no number `low`", "correct"],
            ),
            (
                refusal(&[("gloss.png", &whole), (TEXTURES_NAME, b"[height]\nlow = 1\nhigh = 1")]),
                ["not a rise", "correct"],
            ),
            (
                refusal(&[("gloss.png", &whole), (TEXTURES_NAME, &[b'#'; 1 << 17])]),
                ["65536 bytes", "correct or delete"],
            ),
            (
                refusal(&[
                    ("gloss.png", &whole),
                    (TEXTURES_NAME, b"[area]\nleft_mm = 0\nbottom_mm = 0\nwidth_mm = 0\nheight_mm = 1"),
                ]),
                ["[area] of less than", "correct"],
            ),
        ] {
            assert!(parts.iter().all(|part| message.contains(part)), "{message}: {parts:?}");
        }
        let nowhere = TextureImages::read("/nonexistent/textures").unwrap_err().to_string();
        assert!(nowhere.contains("/nonexistent/textures cannot be opened"), "{nowhere}");
    }
}
