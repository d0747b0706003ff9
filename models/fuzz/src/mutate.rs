//! Mutates inputs in ways that keep their form for longer than changes of bytes do: a text changes by lines, words and
//! numbers, a binary glTF file in the text of its document, with its lengths corrected.

/// Ratio of all inputs to those that are changed as plain bytes, so that the first checks of a reader are tried as
/// well.
const RAW_ONE_IN: usize = 8;

/// Numbers at borders of types and ranges.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "2",
    "255",
    "65536",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "nan",
    "inf",
    "-0.0",
    "1e-320",
];

/// A generator of random numbers [Steele, Lea & Flood 2014, SplitMix64].
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// Starts the sequence of `seed`.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// Returns the next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number below `end`, which must not be 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }
}

/// Returns a changed input of at most `most` bytes. `change_bytes` is the caller's mutator of bytes, told the bytes and how many
/// there may be.
pub fn mutate(bytes: &[u8], seed: u64, most: usize, change_bytes: &mut dyn FnMut(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut random = Random::new(seed);
    let is_raw = random.below(RAW_ONE_IN) == 0;
    let mut changed = bytes.to_vec();
    match (std::str::from_utf8(bytes), chunks_of(bytes)) {
        (Ok(text), _) if !is_raw && !text.is_empty() => changed = changed_text(text, &mut random, change_bytes),
        (_, Some((text, binary))) if !is_raw => {
            let (mut text, mut binary) = (text.to_string(), binary.to_vec());
            match random.below(4) {
                0 if !binary.is_empty() => change_bytes(&mut binary, bytes.len() + 64),
                _ => text = String::from_utf8_lossy(&changed_text(&text, &mut random, change_bytes)).into_owned(),
            }
            changed = glb_of(text.as_bytes(), &binary);
        }
        _ if random.below(2) == 0 && bytes.len() >= 4 => {
            let at = random.below(bytes.len() - 3);
            let word = [0, 1, 2, 255, 65535, 1 << 20, u32::MAX >> 1, u32::MAX][random.below(8)];
            changed[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        _ => change_bytes(&mut changed, most),
    }
    if changed.len() <= most { changed } else { bytes.to_vec() }
}

/// Changes an input by [`mutate`] in place, as libFuzzer asks for it: `data` holds the input in its first `size` bytes
/// and has room for `most`. `change_bytes` is libFuzzer's own mutator, which has the same arguments and result. Returns
/// the new size.
pub fn mutate_in_place(
    data: &mut [u8],
    size: usize,
    most: usize,
    seed: u32,
    change_bytes: impl Fn(&mut [u8], usize, usize) -> usize,
) -> usize {
    let changed = mutate(&data[..size], seed.into(), most, &mut |bytes, most| {
        let (size, most) = (bytes.len(), most.max(bytes.len()));
        bytes.resize(most, 0);
        let changed = change_bytes(bytes, size, most);
        bytes.truncate(changed);
    });
    data[..changed.len()].copy_from_slice(&changed);
    changed.len()
}

/// Returns the document and the binary chunk of a binary glTF file.
fn chunks_of(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    bytes.starts_with(b"glTF").then_some(())?;
    let end = 20usize.checked_add(word(12)?)?;
    let text = std::str::from_utf8(bytes.get(20..end)?).ok()?;
    Some((text, bytes.get(end + 8..).unwrap_or_default()))
}

/// Returns a binary glTF file of a document and a binary chunk.
fn glb_of(text: &[u8], binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (text, binary) = (padded(text, b' '), padded(binary, 0));
    let mut out = b"glTF".to_vec();
    let words = |out: &mut Vec<u8>, words: [u32; 2]| out.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    words(&mut out, [2, (28 + text.len() + binary.len()) as u32]);
    words(&mut out, [text.len() as u32, u32::from_le_bytes(*b"JSON")]);
    out.extend(text);
    words(&mut out, [binary.len() as u32, u32::from_le_bytes(*b"BIN\0")]);
    out.extend(binary);
    out
}

/// Returns a text with a few lines, words or numbers changed.
fn changed_text(text: &str, random: &mut Random, change_bytes: &mut dyn FnMut(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut text = text.to_string();
    for _ in 0..1 + random.below(3) {
        match random.below(10) {
            0 => text = with_line(&text, random, |lines, at, _| lines.insert(at, lines[at])),
            1 => text = with_line(&text, random, |lines, at, _| _ = lines.remove(at)),
            2 => text = with_line(&text, random, |lines, at, other| lines.swap(at, other)),
            3 => {
                let mut bytes = text.into_bytes();
                let most = bytes.len() + 64;
                change_bytes(&mut bytes, most);
                return bytes;
            }
            4..=6 => {
                text = with_word(&text, random, |words, at, random| {
                    words[at] = NUMBERS[random.below(NUMBERS.len())].to_string();
                })
            }
            7 => text = with_word(&text, random, |words, at, _| _ = words.remove(at)),
            _ => {
                text =
                    with_word(&text, random, |words, at, random| words[at] = words[random.below(words.len())].clone())
            }
        }
    }
    text.into_bytes()
}

fn with_line(text: &str, random: &mut Random, change: impl FnOnce(&mut Vec<&str>, usize, usize)) -> String {
    let mut lines: Vec<&str> = text.split_inclusive('\n').collect();
    if !lines.is_empty() {
        let (at, other) = (random.below(lines.len()), random.below(lines.len()));
        change(&mut lines, at, other);
    }
    lines.concat()
}

/// Changes one of the words (runs of letters, digits, signs, points and underscores) that `text` consists of, or what is
/// between two of them.
fn with_word(text: &str, random: &mut Random, change: impl FnOnce(&mut Vec<String>, usize, &mut Random)) -> String {
    let is_of_word = |c: char| c.is_alphanumeric() || "+-._".contains(c);
    let mut words: Vec<String> = Vec::new();
    let mut before = None;
    for c in text.chars() {
        let kind = is_of_word(c);
        match words.last_mut().filter(|_| before == Some(kind) && kind) {
            Some(word) => word.push(c),
            None => words.push(c.to_string()),
        }
        before = Some(kind);
    }
    let places: Vec<usize> = (0..words.len()).filter(|&at| words[at].chars().any(is_of_word)).collect();
    if !places.is_empty() {
        change(&mut words, places[random.below(places.len())], random);
    }
    words.concat()
}
