//! A picture on its way to a screen: what comes before the picture's own bytes in a message.
//!
//! | bytes | |
//! | --- | --- |
//! | 0..4 | `VFF1` |
//! | 4..6 | length of this header, 48: a later version may be longer |
//! | 6 | media type: 1 JPEG, 2 PNG |
//! | 7 | flags: 1 shows what is now, 2 leaves cameras out, 4 is a pattern and no picture of the scene |
//! | 8..16 | number of the frame |
//! | 16..24 | instant shown, nanoseconds since 1970 UTC, signed |
//! | 24..32 | the wall's version, signed; 0 of a view |
//! | 32..40 | when it was sent by the daemon's clock, nanoseconds since 1970 UTC, signed |
//! | 40..44 | most frames in a thousand seconds |
//! | 44..48 | bytes of the picture, which follows |
//!
//! Numbers are big-endian.

use videofields_vision::clock::Timestamp;
use videofields_vision::encode::PictureFormat;

const MAGIC: &[u8; 4] = b"VFF1";

/// Bytes of the header.
pub const HEADER_BYTES: usize = 48;

const IS_LIVE: u8 = 1;
const IS_RESTRICTED: u8 = 2;
const IS_PATTERN: u8 = 4;

/// What a message says of the picture in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// How the picture is written.
    pub format: PictureFormat,
    /// Whether it shows what is now.
    pub is_live: bool,
    /// Whether cameras are left out.
    pub is_restricted: bool,
    /// Whether it is a pattern and no picture of the scene.
    pub is_pattern: bool,
    /// The frame's number.
    pub frame: u64,
    /// The instant shown.
    pub instant: Timestamp,
    /// The wall's version; 0 of a view.
    pub version: i64,
    /// When it was sent by the daemon's clock.
    pub sent_at: Timestamp,
    /// Most frames in a thousand seconds.
    pub rate_millihertz: u32,
}

/// Bytes that are no such message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// Fewer than a header, or than the header promises.
    #[error("the message has {n_bytes} bytes, fewer than it says")]
    Short {
        /// As many.
        n_bytes: usize,
    },
    /// Another kind of message, or one of a later version that this one does not know.
    #[error("the message does not begin as one of this version does")]
    Unknown,
}

impl FrameHeader {
    /// The message of a picture.
    #[must_use]
    pub fn message(&self, picture: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + picture.len());
        bytes.extend_from_slice(MAGIC);
        bytes.extend_from_slice(&(HEADER_BYTES as u16).to_be_bytes());
        bytes.push(match self.format {
            PictureFormat::Jpeg => 1,
            PictureFormat::Png => 2,
        });
        let flags =
            [(self.is_live, IS_LIVE), (self.is_restricted, IS_RESTRICTED), (self.is_pattern, IS_PATTERN)];
        bytes.push(flags.iter().filter(|(is_set, _)| *is_set).map(|(_, bit)| bit).sum());
        bytes.extend_from_slice(&self.frame.to_be_bytes());
        for number in [self.instant.as_nanos(), self.version, self.sent_at.as_nanos()] {
            bytes.extend_from_slice(&number.to_be_bytes());
        }
        bytes.extend_from_slice(&self.rate_millihertz.to_be_bytes());
        bytes.extend_from_slice(&u32::try_from(picture.len()).unwrap_or(u32::MAX).to_be_bytes());
        bytes.extend_from_slice(picture);
        bytes
    }

    /// Takes a message apart: its header and its picture.
    ///
    /// # Errors
    /// When it is none, or not whole.
    pub fn read(message: &[u8]) -> Result<(Self, &[u8]), MessageError> {
        let short = MessageError::Short { n_bytes: message.len() };
        let header = message.first_chunk::<HEADER_BYTES>().ok_or(short)?;
        let format = match header[6] {
            1 => PictureFormat::Jpeg,
            2 => PictureFormat::Png,
            _ => return Err(MessageError::Unknown),
        };
        let n_header = usize::from(u16::from_be_bytes([header[4], header[5]]));
        if &header[..4] != MAGIC || n_header < HEADER_BYTES {
            return Err(MessageError::Unknown);
        }
        let u32_at = |at: usize| u32::from_be_bytes(std::array::from_fn(|idx| header[at + idx]));
        let u64_at = |at: usize| u64::from_be_bytes(std::array::from_fn(|idx| header[at + idx]));
        let time_at = |at: usize| Timestamp::from_nanos(u64_at(at).cast_signed());
        let picture = message.get(n_header..n_header + u32_at(44) as usize).ok_or(short)?;
        let has = |flag| header[7] & flag != 0;
        let read = Self {
            format,
            is_live: has(IS_LIVE),
            is_restricted: has(IS_RESTRICTED),
            is_pattern: has(IS_PATTERN),
            frame: u64_at(8),
            instant: time_at(16),
            version: u64_at(24).cast_signed(),
            sent_at: time_at(32),
            rate_millihertz: u32_at(40),
        };
        Ok((read, picture))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_they_are_written() {
        let header = FrameHeader {
            format: PictureFormat::Png,
            is_live: true,
            is_restricted: false,
            is_pattern: true,
            frame: 17_000_000_000,
            instant: Timestamp::from_nanos(-5),
            version: 3,
            sent_at: Timestamp::from_nanos(1_700_000_000_000_000_000),
            rate_millihertz: 10_000,
        };
        let message = header.message(b"picture");
        assert_eq!((message.len(), &message[..8]), (HEADER_BYTES + 7, b"VFF1\0\x30\x02\x05".as_slice()));
        assert_eq!(FrameHeader::read(&message), Ok((header, b"picture".as_slice())));
        for n_bytes in 0..message.len() {
            let error = FrameHeader::read(&message[..n_bytes]).unwrap_err();
            assert_eq!(error, MessageError::Short { n_bytes });
        }
        let mut other = message.clone();
        other[3] = b'2';
        assert_eq!(FrameHeader::read(&other), Err(MessageError::Unknown));
        // A longer header of later.
        let mut later = message;
        later[5] += 4;
        later.splice(HEADER_BYTES..HEADER_BYTES, [9; 4]);
        assert_eq!(FrameHeader::read(&later), Ok((header, b"picture".as_slice())));
    }
}
