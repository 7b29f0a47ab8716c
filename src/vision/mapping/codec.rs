//! A map as bytes for the store, and back.
//!
//! A header in the clear (little-endian: magic, version, size, origin, builder, coverage), then the texels' columns
//! compressed by zstd with its checksum. What comes back was written by an earlier version or a failing disk:
//! every field is checked before it is believed, and memory is bounded by the header's checked size.

use super::grid::GridSettings;
use super::map::{Coverage, Texel, WorldMap};
use super::side::Side;
use super::{Builder, MappingError, check_size};
use glam::{DVec3, Vec3};
use zstd::bulk::{Compressor, decompress};
use zstd::zstd_safe::CParameter;

const MAGIC: &[u8; 4] = b"VFWM";
const VERSION: u32 = 1;
/// Magic, version, width, height; three origin coordinates, the grid's step (0: rays), two shares of coverage.
const HEADER_BYTES: usize = 4 * 4 + 6 * 8;
/// Three offsets, theta, footprint, side.
const TEXEL_BYTES: usize = 6 * 4;
/// Maps are written once and read at each start.
const LEVEL: i32 = 3;

impl WorldMap {
    /// The map as bytes; the same map gives the same bytes.
    ///
    /// # Errors
    /// When the compressor fails.
    pub fn encode(&self) -> Result<Vec<u8>, MappingError> {
        let step_m = match self.builder {
            Builder::Ray => 0.0,
            Builder::Grid(settings) => settings.step_m,
        };
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend_from_slice(MAGIC);
        for number in [VERSION, self.size_px.0, self.size_px.1] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        let origin = self.origin_in_world;
        for number in [origin.x, origin.y, origin.z, step_m, self.coverage.direct, self.coverage.interpolated]
        {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        // Column by column: neighbours in a column are alike, and so compress.
        let columns: [fn(&Texel) -> u32; 6] = [
            |texel| texel.offset.x.to_bits(),
            |texel| texel.offset.y.to_bits(),
            |texel| texel.offset.z.to_bits(),
            |texel| texel.theta_rad.to_bits(),
            |texel| texel.footprint_m.to_bits(),
            |texel| texel.side.bits(),
        ];
        let mut plain = Vec::with_capacity(self.texels.len() * TEXEL_BYTES);
        for column in columns {
            plain.extend(self.texels.iter().flat_map(|texel| column(texel).to_le_bytes()));
        }
        bytes.extend(
            compress(&plain).map_err(|error| MappingError::Compression { message: error.to_string() })?,
        );
        Ok(bytes)
    }

    /// The map that [`Self::encode`] wrote.
    ///
    /// # Errors
    /// When the bytes are of another version, cut short, changed, or hold a number that no map has.
    pub fn decode(bytes: &[u8]) -> Result<Self, MappingError> {
        let corrupt = |what| MappingError::Corrupt { what };
        let (header, packed) =
            bytes.split_at_checked(HEADER_BYTES).ok_or_else(|| corrupt("it is shorter than its header"))?;
        if header[..4] != MAGIC[..] {
            return Err(corrupt("it does not begin as a map does"));
        }
        let (counts, numbers) = header[4..].split_at(3 * 4);
        let [version, width, height] = words(counts);
        if version != VERSION {
            return Err(corrupt("it is of another version"));
        }
        let size_px = (width, height);
        check_size(size_px).ok().ok_or_else(|| corrupt("its size is out of range"))?;
        let [x, y, z, step_m, direct, interpolated] = numbers_of(numbers);
        let origin_in_world = DVec3::new(x, y, z);
        let shares = 0.0..=1.0;
        if !origin_in_world.is_finite() || !shares.contains(&direct) || !shares.contains(&interpolated) {
            return Err(corrupt("its header is out of range"));
        }
        let builder = if step_m == 0.0 { Builder::Ray } else { Builder::Grid(GridSettings { step_m }) };
        if let Builder::Grid(settings) = builder {
            settings.check().ok().ok_or_else(|| corrupt("its grid's step is out of range"))?;
        }
        let texels = texels(packed, width as usize * height as usize)?;
        Ok(Self { size_px, origin_in_world, builder, coverage: Coverage { direct, interpolated }, texels })
    }
}

fn compress(plain: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut compressor = Compressor::new(LEVEL)?;
    compressor.set_parameter(CParameter::ChecksumFlag(true))?;
    compressor.compress(plain)
}

fn texels(packed: &[u8], count: usize) -> Result<Vec<Texel>, MappingError> {
    let corrupt = |what| MappingError::Corrupt { what };
    let length = count * TEXEL_BYTES;
    // A frame that claims another length is refused before memory is taken for it.
    let claimed = zstd::zstd_safe::get_frame_content_size(packed).ok().flatten();
    if claimed != Some(length as u64) {
        return Err(corrupt("its texels are not of its size"));
    }
    let plain = decompress(packed, length).ok().ok_or_else(|| corrupt("its texels do not decompress"))?;
    if plain.len() != length {
        return Err(corrupt("its texels are not of its size"));
    }
    let word = |column: usize, idx: usize| {
        let [word] = words(&plain[(column * count + idx) * 4..][..4]);
        word
    };
    let number = |column, idx| f32::from_bits(word(column, idx));
    (0..count)
        .map(|idx| {
            let texel = Texel {
                offset: Vec3::new(number(0, idx), number(1, idx), number(2, idx)),
                theta_rad: number(3, idx),
                footprint_m: number(4, idx),
                side: Side::from_bits(word(5, idx)).ok_or_else(|| corrupt("a texel names no surface"))?,
            };
            let is_sound = texel.offset.is_finite()
                && (0.0..=std::f32::consts::FRAC_PI_2).contains(&texel.theta_rad)
                && texel.footprint_m >= 0.0;
            if is_sound { Ok(texel) } else { Err(corrupt("a texel is out of range")) }
        })
        .collect()
}

/// The first `N` little-endian words of as many times four bytes.
fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    let mut words = [0; N];
    for (word, chunk) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *word = u32::from_le_bytes(*chunk);
    }
    words
}

fn numbers_of<const N: usize>(bytes: &[u8]) -> [f64; N] {
    let mut numbers = [0.0; N];
    for (number, chunk) in numbers.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *number = f64::from_le_bytes(*chunk);
    }
    numbers
}
