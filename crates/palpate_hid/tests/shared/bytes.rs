//! Bytes as they stand in a data file, in hexadecimal. What follows a # is a remark.

/// All bytes of a file that has nothing else.
pub fn bytes(text: &str) -> Vec<u8> {
    words(text).map(|word| u8::from_str_radix(word, 16).unwrap()).collect()
}

/// The words of a file.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace())
}
