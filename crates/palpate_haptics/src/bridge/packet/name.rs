//! Name of a device in a packet.

use super::PacketError;
use std::fmt;

const SIZE: usize = 32;

/// A name of 1 to 32 bytes of UTF-8 without control characters. It holds no heap memory.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Name([u8; SIZE]);

impl Name {
    /// Truncates `name` to the capacity and removes control characters; "device" if nothing is left.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let (mut bytes, mut used) = ([0; SIZE], 0);
        for character in name.chars().filter(|character| !character.is_control()) {
            let Some(place) = bytes.get_mut(used..used + character.len_utf8()) else { break };
            character.encode_utf8(place);
            used += character.len_utf8();
        }
        if used == 0 { Self::new("device") } else { Self(bytes) }
    }

    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        // The bytes are UTF-8 by construction.
        self.used().and_then(|used| str::from_utf8(used).ok()).unwrap_or_default()
    }

    /// The bytes before the zero padding; `None` if other bytes follow.
    fn used(&self) -> Option<&[u8]> {
        let length = self.0.iter().position(|byte| *byte == 0).unwrap_or(SIZE);
        let (used, rest) = self.0.split_at_checked(length)?;
        rest.iter().all(|byte| *byte == 0).then_some(used)
    }

    pub(super) fn of_bytes(bytes: [u8; SIZE]) -> Result<Self, PacketError> {
        let name = Self(bytes);
        let text = name.used().and_then(|used| str::from_utf8(used).ok()).ok_or(PacketError::Name)?;
        if text.is_empty() || text.chars().any(char::is_control) { Err(PacketError::Name) } else { Ok(name) }
    }

    pub(super) fn bytes(&self) -> [u8; SIZE] {
        self.0
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}
