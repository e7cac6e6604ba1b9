//! Parses and encodes packets.

use super::bytes::{Reader, Writer};
use super::{
    Body, EndReason, HEADER_SIZE, MAGIC, MAX_SIZE, Name, Packet, PacketError, Sampled, VERSION, Welcome,
};
use glam::DQuat;

/// Header common to packets of all versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Version of the protocol.
    pub version: u16,
    /// Kind of the packet; a hello has the same kind in all versions.
    pub kind: u8,
    /// Session number.
    pub session: u64,
    /// Packet number.
    pub number: u64,
}

impl Header {
    /// Reads the header of a packet of any version; `None` if the bytes are not a packet.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let mut read = Reader::new(bytes);
        if read.array()? != MAGIC {
            return None;
        }
        let (version, kind, _) = (read.u16()?, read.u8()?, read.u8()?);
        Some(Self { version, kind, session: read.u64()?, number: read.u64()? })
    }

    /// Whether the packet is a hello, in any version.
    #[must_use]
    pub fn is_hello(&self) -> bool {
        self.kind == Body::Hello.kind()
    }
}

/// Size of a packet of this kind, bytes.
fn size_of(kind: u8) -> Result<usize, PacketError> {
    match kind {
        1 | 5 => Ok(HEADER_SIZE),
        2 => Ok(128),
        3 => Ok(120),
        4 => Ok(48),
        6 => Ok(32),
        _ => Err(PacketError::Kind(kind)),
    }
}

impl Packet {
    /// Parses a packet.
    ///
    /// # Errors
    /// [`PacketError`] for the first violation of the protocol.
    pub fn parse(bytes: &[u8]) -> Result<Self, PacketError> {
        let found = bytes.len();
        let Some(Header { version, kind, session, number }) = Header::of(bytes) else {
            let is_long = found >= HEADER_SIZE;
            return Err(if is_long {
                PacketError::Magic
            } else {
                PacketError::Length { found, expected: HEADER_SIZE }
            });
        };
        if version != VERSION {
            return Err(PacketError::Version(version));
        }
        let expected = size_of(kind)?;
        let body = bytes.get(HEADER_SIZE..).filter(|_| found == expected);
        let body = body.ok_or(PacketError::Length { found, expected })?;
        if bytes.get(7) != Some(&0) {
            return Err(PacketError::Reserved);
        }
        let body = read_body(kind, body).ok_or(PacketError::Length { found, expected })??;
        let packet = Self { session, number, body };
        packet.check()?;
        Ok(packet)
    }

    /// Encodes the packet to `buffer` and returns the used part.
    ///
    /// # Errors
    /// [`PacketError`] if [`Packet::parse`] would reject the result.
    pub fn encode<'a>(&self, buffer: &'a mut [u8; MAX_SIZE]) -> Result<&'a [u8], PacketError> {
        self.check()?;
        let kind = self.body.kind();
        let size = size_of(kind)?;
        let too_long = PacketError::Length { found: MAX_SIZE, expected: size };
        let mut write = Writer::new(buffer);
        write.array(MAGIC).ok_or(too_long)?;
        write.u16(VERSION).ok_or(too_long)?;
        write.array([kind, 0]).ok_or(too_long)?;
        write.u64(self.session).ok_or(too_long)?;
        write.u64(self.number).ok_or(too_long)?;
        write_body(&self.body, &mut write).ok_or(too_long)?;
        buffer.get(..size).ok_or(too_long)
    }
}

/// Returns `None` for too few bytes, which the caller has excluded.
fn read_body(kind: u8, bytes: &[u8]) -> Option<Result<Body, PacketError>> {
    let mut read = Reader::new(bytes);
    let body = match kind {
        1 => Body::Hello,
        2 => {
            let name = match Name::of_bytes(read.array()?) {
                Ok(name) => name,
                Err(error) => return Some(Err(error)),
            };
            let workspace_m = [read.vector()?, read.vector()?];
            let (max_force_n, rate_hz, watchdog_us) = (read.f64()?, read.f64()?, read.u32()?);
            if read.u32()? != 0 {
                return Some(Err(PacketError::Reserved));
            }
            Body::Welcome(Welcome { name, workspace_m, max_force_n, rate_hz, watchdog_us })
        }
        3 => {
            let (buttons, flags) = (read.u32()?, read.u32()?);
            let position_m = read.vector()?;
            let orientation = DQuat::from_array([read.f64()?, read.f64()?, read.f64()?, read.f64()?]);
            let velocity = read.vector()?;
            let has_velocity = flags == 1;
            let is_zero = velocity.to_array().iter().all(|v| v.to_bits() == 0);
            if flags > 1 || !(has_velocity || is_zero) {
                return Some(Err(PacketError::Reserved));
            }
            let velocity_m_per_s = has_velocity.then_some(velocity);
            Body::Sample(Sampled { position_m, orientation, velocity_m_per_s, buttons, shown: read.u64()? })
        }
        4 => Body::Force(read.vector()?),
        5 => Body::Stop,
        _ => {
            let (code, rest) = (read.u32()?, read.u32()?);
            let Some(reason) = EndReason::ALL.into_iter().find(|reason| *reason as u32 == code) else {
                return Some(Err(PacketError::Reason(code)));
            };
            if rest != 0 {
                return Some(Err(PacketError::Reserved));
            }
            Body::End(reason)
        }
    };
    Some(Ok(body))
}

fn write_body(body: &Body, write: &mut Writer<'_>) -> Option<()> {
    match body {
        Body::Hello | Body::Stop => Some(()),
        Body::Welcome(welcome) => {
            write.array(welcome.name.bytes())?;
            welcome.workspace_m.into_iter().try_for_each(|corner| write.vector(corner))?;
            write.f64(welcome.max_force_n)?;
            write.f64(welcome.rate_hz)?;
            write.u32(welcome.watchdog_us)?;
            write.u32(0)
        }
        Body::Sample(sampled) => {
            write.u32(sampled.buttons)?;
            write.u32(u32::from(sampled.velocity_m_per_s.is_some()))?;
            write.vector(sampled.position_m)?;
            sampled.orientation.to_array().into_iter().try_for_each(|component| write.f64(component))?;
            write.vector(sampled.velocity_m_per_s.unwrap_or_default())?;
            write.u64(sampled.shown)
        }
        Body::Force(force_n) => write.vector(*force_n),
        Body::End(reason) => {
            write.u32(*reason as u32)?;
            write.u32(0)
        }
    }
}
