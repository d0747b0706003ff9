//! Sizes in bytes as people type and read them: `2MB`, `1.5 MiB`, `4GB`.

/// Units and their bytes: decimal ones by powers of ten, binary ones by powers of two.
const UNITS: [(&str, u64); 9] = [
    ("", 1),
    ("b", 1),
    ("kb", 1_000),
    ("mb", 1_000_000),
    ("gb", 1_000_000_000),
    ("tb", 1_000_000_000_000),
    ("kib", 1 << 10),
    ("mib", 1 << 20),
    ("gib", 1 << 30),
];

/// Returns the bytes of a size in words: a number and B, kB, MB, GB, TB (powers of ten) or KiB, MiB, GiB (powers of
/// two), in any case; a number alone is bytes.
///
/// # Errors
/// One sentence for what is not such a size, is not positive, or is below one byte.
pub fn bytes_from_text(text: &str) -> Result<u64, String> {
    let refuse =
        || format!("`{text}` is not a size; write a positive number with B, kB, MB, GB, KiB, MiB or GiB, as in 2MB");
    let trimmed = text.trim();
    let split = trimmed.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(trimmed.len());
    let (number, unit) = (trimmed[..split].trim(), trimmed[split..].to_ascii_lowercase());
    let factor = UNITS.iter().find(|(name, _)| *name == unit).ok_or_else(refuse)?.1;
    // Digits and a point only: `parse` would also take signs, exponents, inf and nan.
    if number.is_empty() || !number.chars().all(|c| c.is_ascii_digit() || c == '.') {
        return Err(refuse());
    }
    let bytes = number.parse::<f64>().map_err(|_| refuse())? * factor as f64;
    // Below 2^53 every whole number of bytes is exact.
    if (1.0..9e15).contains(&bytes) { Ok(bytes.round() as u64) } else { Err(refuse()) }
}

/// Returns a number of bytes for people, as `1.75 MB`.
pub fn text_from_bytes(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mb_is_a_million_and_mib_is_two_to_the_twenty() {
        for (text, bytes) in [
            ("2MB", 2_000_000),
            ("2MiB", 2_097_152),
            ("1.75MB", 1_750_000),
            ("1.75 mb", 1_750_000),
            ("4GB", 4_000_000_000),
            ("0.5GiB", 536_870_912),
            ("300", 300),
            ("300B", 300),
            ("64kB", 64_000),
            ("64KiB", 65_536),
        ] {
            assert_eq!(bytes_from_text(text), Ok(bytes), "{text}");
        }
    }

    #[test]
    fn what_is_no_size_is_refused() {
        for text in
            ["", "MB", "-2MB", "2XB", "0", "0.1", "nan", "infMB", "1e6", "2 M B", "1.2.3MB", "99999999TB", "2µB"]
        {
            let message = bytes_from_text(text).unwrap_err();
            assert!(message.contains("as in 2MB"), "{message}");
        }
    }

    #[test]
    fn sizes_are_written_with_three_digits_or_so() {
        assert_eq!(text_from_bytes(999), "999 B");
        assert_eq!(text_from_bytes(1_749_760), "1.75 MB");
        assert_eq!(text_from_bytes(4_000_000_000), "4.00 GB");
        assert_ne!(text_from_bytes(2_097_152), text_from_bytes(2_000_000));
    }
}
