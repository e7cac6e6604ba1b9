//! Parsing of data files with hexadecimal bytes; comments follow a #.

/// All bytes of a file without names.
pub fn bytes(text: &str) -> Vec<u8> {
    words(text).map(|word| u8::from_str_radix(word, 16).unwrap()).collect()
}

/// Words of a file, without comments.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace())
}
