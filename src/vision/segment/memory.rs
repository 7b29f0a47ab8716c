//! Holds what the verdicts on a frame take from the frames before it, and writes it as bytes.
//!
//! ```text
//! one zstd frame: deviations of the noise (f32 each, NaN where nothing is known), turn (u32), whether turns were counted (u8)
//! if they were: seconds waited (f64), the last verdict's words (u32 each), counts of turns (u8 each)
//! ```
//! All numbers are little-endian.

use super::flicker::Flicker;
use super::noise::Noise;
use std::io::{self, Read, Write};

/// The fastest level: counts are mostly zero.
const LEVEL: i32 = 1;

/// Holds the noise of one camera's pictures of one size, and the pixels whose verdict keeps turning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    pub(super) noise: Noise,
    pub(super) flicker: Flicker,
}

impl Memory {
    /// Returns the bytes that it takes.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        size_of::<Self>() + self.flicker.len_bytes()
    }

    /// Writes everything as bytes.
    ///
    /// # Errors
    /// When compression fails.
    pub fn encode(&self) -> io::Result<Vec<u8>> {
        let mut encoder = zstd::Encoder::new(Vec::new(), LEVEL)?;
        encoder.include_checksum(true)?;
        self.noise.write(&mut encoder)?;
        self.flicker.write(&mut encoder)?;
        encoder.finish()
    }

    /// Reads what [`Self::encode`] wrote of pictures of `size_px`.
    ///
    /// # Errors
    /// When `bytes` are damaged, cut short, or of pictures of another size.
    pub fn decode(bytes: &[u8], size_px: (u32, u32)) -> io::Result<Self> {
        let mut decoder = zstd::Decoder::with_buffer(bytes)?.single_frame();
        let noise = Noise::read(&mut decoder)?;
        let flicker = Flicker::read(&mut decoder, size_px)?;
        let mut end = [0; 1];
        if decoder.read(&mut end)? != 0 || !decoder.finish().is_empty() {
            return Err(invalid("bytes follow what segmentation remembers"));
        }
        Ok(Self { noise, flicker })
    }
}

pub(super) fn invalid(reason: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}

/// Writes numbers one after the other.
pub(super) fn write_all<const N: usize>(
    out: &mut impl Write,
    values: impl IntoIterator<Item = [u8; N]>,
) -> io::Result<()> {
    values.into_iter().try_for_each(|value| out.write_all(&value))
}

/// Reads the bytes of one number.
pub(super) fn read<const N: usize>(from: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    from.read_exact(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::BitMask;

    const SIZE_PX: (u32, u32) = (70, 3);

    fn filled() -> Memory {
        let mut memory = Memory::default();
        for turn in 0..20 {
            let mut mask = BitMask::new(SIZE_PX.0, SIZE_PX.1);
            if turn % 2 == 0 {
                mask.set_run(1, 5, 69);
            }
            memory.flicker.observe(&mask, 0.04);
        }
        memory.noise = Noise::known(&[Some(0.01), None, Some(0.5)]);
        memory
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        for memory in [Memory::default(), filled()] {
            let bytes = memory.encode().unwrap();
            assert_eq!(Memory::decode(&bytes, SIZE_PX).unwrap(), memory);
        }
    }

    #[test]
    fn damaged_bytes_and_those_of_another_size_are_refused() {
        let bytes = filled().encode().unwrap();
        assert!(Memory::decode(&bytes, (70, 4)).is_err());
        assert!(Memory::decode(&bytes, (33, 3)).is_err());
        assert!(Memory::decode(&[bytes.as_slice(), &[0]].concat(), SIZE_PX).is_err());
        for len in 0..bytes.len() {
            assert!(Memory::decode(&bytes[..len], SIZE_PX).is_err(), "cut to {len}");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            // The checksum lets reserved bits of zstd's header through: nothing of what was written.
            if let Ok(read) = Memory::decode(&damaged, SIZE_PX) {
                assert_eq!(read, filled(), "byte {at}");
            }
        }
    }

    #[test]
    fn numbers_that_no_build_writes_are_refused() {
        let mut memory = filled();
        for deviation in [-1.0, 2.0, f32::INFINITY] {
            memory.noise = Noise::known(&[Some(deviation)]);
            assert!(Memory::decode(&memory.encode().unwrap(), SIZE_PX).is_err(), "{deviation}");
        }
    }
}
