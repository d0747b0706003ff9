//! Writes small uncompressed TIFF files for tests, from the specification and with no code of the reader: the directory
//! stands before the samples.

#![allow(dead_code, reason = "each test program takes what it needs of this")]

/// How a page is written.
#[derive(Debug, Clone)]
pub struct Page {
    pub width: usize,
    pub height: usize,
    pub samples: usize,
    /// Bits of a sample, and the format of samples: 1 whole, 2 whole with a sign, 3 float.
    pub bits: u16,
    pub format: u16,
    pub photometric: u16,
    pub is_planar: bool,
    /// Width and height of tiles; strips of two rows where there is none.
    pub tile: Option<(usize, usize)>,
    pub extra_samples: Vec<u16>,
    pub kind: u32,
    /// Texts of GDAL.
    pub metadata: Option<String>,
    pub nodata: Option<String>,
}

impl Page {
    /// Returns a page of 5 x 3 texels of 16 bits, grey from black.
    pub fn of(samples: usize) -> Page {
        Page {
            width: 5,
            height: 3,
            samples,
            bits: 16,
            format: 1,
            photometric: 1,
            is_planar: false,
            tile: None,
            extra_samples: vec![0; samples - 1],
            kind: 0,
            metadata: None,
            nodata: None,
        }
    }
}

/// How the numbers of a file are written.
#[derive(Debug, Clone, Copy, Default)]
pub struct Style {
    pub is_big_endian: bool,
    /// BigTIFF.
    pub is_wide: bool,
}

impl Style {
    fn whole(self, number: u64, size: usize) -> Vec<u8> {
        if self.is_big_endian {
            number.to_be_bytes()[8 - size..].to_vec()
        } else {
            number.to_le_bytes()[..size].to_vec()
        }
    }

    fn place(self, number: usize) -> Vec<u8> {
        self.whole(number as u64, if self.is_wide { 8 } else { 4 })
    }

    fn sample(self, page: &Page, value: f64) -> Vec<u8> {
        let number = match (page.format, page.bits) {
            (3, 16) => u64::from(half::f16::from_f64(value).to_bits()),
            (3, 32) => u64::from((value as f32).to_bits()),
            (3, 64) => value.to_bits(),
            (2, _) => value as i64 as u64,
            _ => value as u64,
        };
        self.whole(number, usize::from(page.bits / 8))
    }

    /// Returns the strips or tiles of a page, of values `[texel, sample]`.
    fn chunks(self, page: &Page, values: &[f64]) -> Vec<Vec<u8>> {
        let (across, down) = page.tile.unwrap_or((page.width, 2));
        let planes: Vec<Vec<usize>> = if page.is_planar {
            (0..page.samples).map(|s| vec![s]).collect()
        } else {
            vec![(0..page.samples).collect()]
        };
        let mut chunks = Vec::new();
        for plane in &planes {
            for top in (0..page.height).step_by(down) {
                // Tiles are filled up beyond the edge, strips are not.
                let bottom = if page.tile.is_some() { top + down } else { (top + down).min(page.height) };
                for left in (0..page.width).step_by(across) {
                    let mut chunk = Vec::new();
                    for y in top..bottom {
                        for x in left..left + across {
                            let is_within = x < page.width && y < page.height;
                            for s in plane {
                                let value =
                                    if is_within { values[(y * page.width + x) * page.samples + s] } else { 77.0 };
                                chunk.extend(self.sample(page, value));
                            }
                        }
                    }
                    chunks.push(chunk);
                }
            }
        }
        chunks
    }

    fn tags(self, page: &Page, chunks: &[Vec<u8>]) -> Vec<(u16, u16, usize, Vec<u8>)> {
        let shorts = |tag: u16, numbers: &[u16]| {
            (tag, 3, numbers.len(), numbers.iter().flat_map(|n| self.whole(u64::from(*n), 2)).collect::<Vec<u8>>())
        };
        let longs = |tag: u16, numbers: &[usize]| {
            (tag, 4, numbers.len(), numbers.iter().flat_map(|n| self.whole(*n as u64, 4)).collect::<Vec<u8>>())
        };
        let text = |tag: u16, text: &str| (tag, 2, text.len() + 1, [text.as_bytes(), &[0]].concat());
        let counts: Vec<usize> = chunks.iter().map(Vec::len).collect();
        let unknown = vec![0; chunks.len()];
        let mut tags = vec![
            longs(254, &[page.kind as usize]),
            longs(256, &[page.width]),
            longs(257, &[page.height]),
            shorts(258, &vec![page.bits; page.samples]),
            shorts(259, &[1]),
            shorts(262, &[page.photometric]),
            shorts(277, &[page.samples as u16]),
            shorts(284, &[if page.is_planar { 2 } else { 1 }]),
            shorts(339, &vec![page.format; page.samples]),
        ];
        match page.tile {
            None => tags.extend([longs(273, &unknown), longs(278, &[2]), longs(279, &counts)]),
            Some((width, height)) => {
                tags.extend([longs(322, &[width]), longs(323, &[height]), longs(324, &unknown), longs(325, &counts)]);
            }
        }
        if !page.extra_samples.is_empty() {
            tags.push(shorts(338, &page.extra_samples));
        }
        tags.extend(page.metadata.as_deref().map(|metadata| text(42112, metadata)));
        tags.extend(page.nodata.as_deref().map(|nodata| text(42113, nodata)));
        tags.sort();
        tags
    }

    /// Returns a file of pages with their values, `[texel, sample]`.
    pub fn file(self, pages: &[(&Page, &[f64])]) -> Vec<u8> {
        let mut bytes = if self.is_big_endian { b"MM".to_vec() } else { b"II".to_vec() };
        bytes.extend(self.whole(if self.is_wide { 43 } else { 42 }, 2));
        if self.is_wide {
            bytes.extend([self.whole(8, 2), self.whole(0, 2)].concat());
        }
        let (count_size, place_size) = if self.is_wide { (8, 8) } else { (2, 4) };
        bytes.extend(self.place(bytes.len() + place_size));
        for (number, (page, values)) in pages.iter().enumerate() {
            let chunks = self.chunks(page, values);
            let mut tags = self.tags(page, &chunks);
            let directory = count_size + tags.len() * (4 + 2 * place_size) + place_size;
            let outside: usize = tags.iter().map(|tag| tag.3.len()).filter(|length| *length > place_size).sum();
            let mut at = bytes.len() + directory + outside;
            let offsets = chunks.iter().flat_map(|chunk| {
                at += chunk.len();
                self.whole((at - chunk.len()) as u64, 4)
            });
            let offsets: Vec<u8> = offsets.collect();
            tags.iter_mut().filter(|tag| matches!(tag.0, 273 | 324)).for_each(|tag| tag.3.clone_from(&offsets));
            let mut outside_at = bytes.len() + directory;
            bytes.extend(self.whole(tags.len() as u64, count_size));
            for (tag, kind, count, value) in &tags {
                bytes.extend(
                    [self.whole(u64::from(*tag), 2), self.whole(u64::from(*kind), 2), self.place(*count)].concat(),
                );
                if value.len() > place_size {
                    bytes.extend(self.place(outside_at));
                    outside_at += value.len();
                } else {
                    bytes.extend(value.iter().copied().chain(std::iter::repeat(0)).take(place_size));
                }
            }
            bytes.extend(self.place(if number + 1 < pages.len() { at } else { 0 }));
            tags.iter().filter(|tag| tag.3.len() > place_size).for_each(|tag| bytes.extend(&tag.3));
            bytes.extend(chunks.concat());
        }
        bytes
    }
}
