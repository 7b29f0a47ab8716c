//! Numbered pictures as a source: JPEG and PNG files whose names a pattern gives.
//!
//! The sequence begins at the least number that is there and ends at the greatest. A number left out in between is
//! an error, found before the first picture is read: frames are numbered from 0 in order, so a silent gap would
//! shift every later frame against its truth and its time.

use super::medium::Medium;
use super::pattern::Pattern;
use super::{IngestError, MediaRoots, StopFlag, Tap, jpeg};
use crate::media::{EncodedFrame, MAX_SIDE, Picture, is_too_large};
use image::metadata::Orientation;
use image::{ImageDecoder, ImageFormat, ImageReader, Limits};
use std::fs;
use std::io::{self, Cursor, Read as _};
use std::path::{Path, PathBuf};
use videofields_vision::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage};

/// What is longer is cut, and then no picture: uncompressed, the largest one is smaller.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// Most bytes of a decoded pixel: four channels of 16 bits.
const MAX_PIXEL_BYTES: u64 = 8;

/// Most bytes of what a picture's file holds beside the picture: profiles, texts.
const MAX_BESIDE_BYTES: u64 = 4 << 20;

/// A folder of numbered pictures.
pub(super) struct NumberedPictures {
    path: PathBuf,
    pattern: Pattern,
    roots: MediaRoots,
    stop: StopFlag,
    tap: Tap,
    numbers: std::ops::RangeInclusive<u64>,
    next: Option<u64>,
    /// The newest picture as it is recorded.
    encoded: Option<EncodedFrame>,
}

impl NumberedPictures {
    /// Finds the pictures that fit the pattern `path`.
    pub(super) fn open(
        path: &Path,
        roots: &MediaRoots,
        stop: &StopFlag,
        tap: Tap,
    ) -> Result<Self, IngestError> {
        let pattern = Pattern::parse(path)?;
        let numbers = find_numbers(path, &pattern, roots)?;
        let (path, roots, stop) = (path.to_path_buf(), roots.clone(), stop.clone());
        Ok(Self { path, pattern, roots, stop, tap, next: None, numbers, encoded: None })
    }

    /// How many pictures there are.
    pub(super) fn n_pictures(&self) -> u64 {
        self.numbers.end() - self.numbers.start() + 1
    }

    /// The picture so many after the first; none behind the last.
    pub(super) fn nth(&self, idx: u64) -> Result<Option<YuvImage>, IngestError> {
        let number = self.numbers.start().checked_add(idx).filter(|number| self.numbers.contains(number));
        number.map(|number| Ok(self.read(number)?.0)).transpose()
    }

    /// The picture of that number, and the file as it is if that is a JPEG.
    fn read(&self, number: u64) -> Result<(YuvImage, Option<Vec<u8>>), IngestError> {
        let path = self.pattern.path(number);
        let bytes = read_bytes(&path, &self.roots, MAX_FILE_BYTES)?;
        let (rgb, format) =
            decode(&bytes).map_err(|source| IngestError::Picture { path: path.clone(), source })?;
        // JPEG's own colours are full-range BT.601 (JFIF); PNG pictures take the same way.
        let image = YuvImage::from_rgb(&rgb, ColorMatrix::Bt601, ColorRange::Full)
            .map_err(|source| IngestError::Layout { path, source })?;
        Ok((image, (format == Some(ImageFormat::Jpeg)).then_some(bytes)))
    }
}

impl Medium for NumberedPictures {
    fn path(&self) -> &Path {
        &self.path
    }

    fn begin(&mut self) -> Result<(), IngestError> {
        self.next = Some(*self.numbers.start());
        Ok(())
    }

    fn next_picture(&mut self) -> Result<Option<Picture>, IngestError> {
        if self.stop.is_raised() {
            return Err(IngestError::Stopped);
        }
        let Some(number) = self.next.filter(|number| self.numbers.contains(number)) else { return Ok(None) };
        let (image, jpeg) = self.read(number)?;
        self.next = number.checked_add(1);
        // They have no times; what is recorded is paired with its picture by the order.
        let stream_nanos = i64::try_from(number - self.numbers.start()).ok();
        let picture = Picture {
            image,
            stream_nanos,
            interval_nanos: None,
            reference_nanos: None,
            encoded_number: None,
        };
        if self.tap == Tap::Open {
            self.encoded = jpeg::frame(&picture, jpeg);
        }
        Ok(Some(picture))
    }

    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        self.encoded.take()
    }

    fn newest_path(&self) -> PathBuf {
        let newest = self.next.map_or(*self.numbers.end(), |next| next.saturating_sub(1));
        self.pattern.path(newest)
    }
}

/// The least and the greatest number, none between them missing.
fn find_numbers(
    path: &Path,
    pattern: &Pattern,
    roots: &MediaRoots,
) -> Result<std::ops::RangeInclusive<u64>, IngestError> {
    let folder = roots.resolve_folder(pattern.folder())?;
    let unreadable = |source| IngestError::Unreadable { path: path.to_path_buf(), source };
    let mut numbers = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let name = entry.map_err(unreadable)?.file_name();
        numbers.extend(name.to_str().and_then(|name| pattern.number(name)));
    }
    numbers.sort_unstable();
    let (Some(first), Some(last)) = (numbers.first(), numbers.last()) else {
        return Err(IngestError::NoPictures { path: path.to_path_buf() });
    };
    match numbers.windows(2).find(|pair| pair[1] - pair[0] != 1) {
        Some(pair) => Err(IngestError::Gap { path: path.to_path_buf(), missing: pair[0] + 1 }),
        None => Ok(*first..=*last),
    }
}

/// The bytes of a file, at most so many of them.
///
/// # Errors
/// When the file lies outside the roots, cannot be read, or is larger than `most` bytes.
pub fn read_bytes(path: &Path, roots: &MediaRoots, most: u64) -> Result<Vec<u8>, IngestError> {
    let mut bytes = Vec::new();
    let unreadable = |source: io::Error| IngestError::Unreadable { path: path.to_path_buf(), source };
    roots.open(path)?.take(most).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok(bytes)
}

/// One picture, JPEG or PNG.
///
/// # Errors
/// When the file lies outside the roots, cannot be read, or is no picture.
pub fn read_picture(path: &Path, roots: &MediaRoots) -> Result<RgbImage, IngestError> {
    let bytes = read_bytes(path, roots, MAX_FILE_BYTES)?;
    let (picture, _) =
        decode(&bytes).map_err(|source| IngestError::Picture { path: path.to_path_buf(), source })?;
    Ok(picture)
}

/// Returns how many bytes decoding may take: a PNG's profiles and texts are compressed too, and may be far larger than its picture.
fn memory_for(bytes: &[u8], format: Option<ImageFormat>) -> u64 {
    let largest = u64::from(MAX_SIDE).pow(2);
    let header = bytes.get(16..24).filter(|_| format == Some(ImageFormat::Png));
    let n_pixels = header.map_or(largest, |header| {
        let side =
            |of: usize| u32::from_be_bytes([header[of], header[of + 1], header[of + 2], header[of + 3]]);
        u64::from(side(0)).saturating_mul(side(4).into()).min(largest)
    });
    n_pixels * MAX_PIXEL_BYTES + MAX_BESIDE_BYTES
}

/// Reads a picture's header.
fn open_picture(bytes: &[u8]) -> Result<(impl ImageDecoder + '_, Option<ImageFormat>), image::ImageError> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let format = reader.format();
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(memory_for(bytes, format));
    reader.limits(limits);
    let decoder = reader.into_decoder()?;
    if is_too_large(decoder.dimensions()) {
        let kind = image::error::LimitErrorKind::DimensionError;
        return Err(image::ImageError::Limits(image::error::LimitError::from_kind(kind)));
    }
    Ok((decoder, format))
}

fn decode(bytes: &[u8]) -> Result<(RgbImage, Option<ImageFormat>), image::ImageError> {
    let (mut decoder, format) = open_picture(bytes)?;
    let orientation = decoder.orientation()?;
    let mut picture = image::DynamicImage::from_decoder(decoder)?;
    picture.apply_orientation(orientation);
    let (width, height) = (picture.width(), picture.height());
    // One that is turned is recorded as it is shown, not as its file has it.
    let format = format.filter(|_format| orientation == Orientation::NoTransforms);
    Ok((RgbImage { width, height, data: picture.into_rgb8().into_raw() }, format))
}

#[cfg(test)]
mod tests {
    use super::super::Source as _;
    use super::super::timed::TimedSource;
    use super::*;
    use videofields_vision::config::{End, Timing};
    use videofields_vision::error::ErrorKind;

    fn write(folder: &Path, name: &str, color: [u8; 3]) {
        image::RgbImage::from_pixel(6, 4, image::Rgb(color)).save(folder.join(name)).unwrap();
    }

    fn open(folder: &Path, pattern: &str) -> Result<NumberedPictures, IngestError> {
        let roots = MediaRoots::new(&[folder.to_path_buf()]).unwrap();
        NumberedPictures::open(&folder.join(pattern), &roots, &StopFlag::default(), Tap::Open)
    }

    /// So telephones write pictures: as the sensor lies, with a word on how it was held.
    #[test]
    fn a_picture_that_is_to_be_turned_is_turned_and_recorded_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in1.jpg");
        image::RgbImage::from_pixel(16, 8, image::Rgb([9, 9, 9])).save(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        // EXIF with one entry: orientation 6, a quarter to the right.
        let entry = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        bytes.splice(2..2, [&[0xff, 0xe1][..], &(entry.len() as u16 + 2).to_be_bytes(), entry].concat());
        fs::write(&path, &bytes).unwrap();
        let mut pictures = open(folder.path(), "in%d.jpg").unwrap();
        pictures.begin().unwrap();
        let picture = pictures.next_picture().unwrap().unwrap();
        assert_eq!((picture.image.width(), picture.image.height()), (8, 16));
        let recorded = pictures.take_encoded().unwrap();
        assert_eq!(recorded.format.size_px(), Some((8, 16)));
        assert_ne!(recorded.len_bytes(), bytes.len(), "not the file's own bytes");
    }

    /// A profile of 64 MiB in 64 kB of file beside a picture of a few pixels.
    #[test]
    fn a_picture_takes_no_more_memory_for_what_stands_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "in1.png", [9; 3]);
        let path = folder.path().join("in1.png");
        let plain = fs::read(&path).unwrap();
        let with_profile = |n_bytes: usize| {
            let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
            io::Write::write_all(&mut packed, &vec![0; n_bytes]).unwrap();
            let body = [&b"iCCPodd\0\0"[..], &packed.finish().unwrap()].concat();
            let mut crc = flate2::Crc::new();
            crc.update(&body);
            let chunk = [&(body.len() as u32 - 4).to_be_bytes()[..], &body, &crc.sum().to_be_bytes()];
            let mut bytes = plain.clone();
            bytes.splice(33..33, chunk.concat());
            bytes
        };
        for (n_bytes, n_kept) in [(64 << 10, Some(64 << 10)), (64 << 20, None)] {
            let bytes = with_profile(n_bytes);
            let (mut decoder, _) = open_picture(&bytes).expect("its profile counts for nothing");
            assert_eq!(decoder.icc_profile().unwrap().map(|profile| profile.len()), n_kept);
            let (picture, _) = decode(&bytes).expect("it is a picture");
            assert_eq!((picture.width, picture.height), (6, 4));
        }
    }

    #[test]
    fn pictures_come_in_order_from_the_first_number_there_is() {
        let folder = tempfile::tempdir().unwrap();
        for number in [3_u8, 4, 5] {
            write(folder.path(), &format!("in{number:03}.png"), [10 * number, 200, 30]);
        }
        write(folder.path(), "in7.png", [0; 3]);
        let mut pictures = open(folder.path(), "in%03d.png").unwrap();
        for _pass in 0..2 {
            pictures.begin().unwrap();
            for number in [3_u8, 4, 5] {
                let picture = pictures.next_picture().unwrap().unwrap();
                assert_eq!((picture.image.width(), picture.image.height()), (6, 4));
                let rgb = picture.image.to_rgb();
                for (got, want) in rgb.data[..3].iter().zip([10 * number, 200, 30]) {
                    assert!(got.abs_diff(want) <= 2, "{:?}", &rgb.data[..3]);
                }
            }
            assert!(pictures.next_picture().unwrap().is_none());
        }
    }

    #[test]
    fn pictures_are_recorded_as_the_jpeg_they_are_or_become() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["in1.jpg", "in2.png"] {
            write(folder.path(), name, [200, 60, 90]);
        }
        fs::copy(folder.path().join("in2.png"), folder.path().join("png1.png")).unwrap();
        for (pattern, original) in [("in%d.jpg", Some("in1.jpg")), ("png%d.png", None)] {
            let mut pictures = open(folder.path(), pattern).unwrap();
            pictures.begin().unwrap();
            let picture = pictures.next_picture().unwrap().unwrap();
            let frame = pictures.take_encoded().unwrap();
            assert_eq!((frame.format.codec(), frame.format.size_px()), ("image/jpeg", Some((6, 4))));
            assert_eq!((frame.stream_nanos, frame.is_key), (picture.stream_nanos, true));
            if let Some(original) = original {
                assert_eq!(
                    frame.len_bytes() as u64,
                    fs::metadata(folder.path().join(original)).unwrap().len()
                );
            }
            assert!(pictures.take_encoded().is_none());
        }
        let roots = MediaRoots::new(&[folder.path().to_path_buf()]).unwrap();
        let (path, stop) = (folder.path().join("in%d.jpg"), StopFlag::default());
        let mut closed = NumberedPictures::open(&path, &roots, &stop, Tap::Closed).unwrap();
        closed.begin().unwrap();
        closed.next_picture().unwrap().unwrap();
        assert!(closed.take_encoded().is_none());
    }

    #[test]
    fn a_picture_of_another_size_is_told_once_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        for (number, size) in [(6, 4), (6, 4), (3, 2), (6, 4), (8, 4)].into_iter().enumerate() {
            image::RgbImage::new(size.0, size.1).save(folder.path().join(format!("in{number}.png"))).unwrap();
        }
        let pictures = open(folder.path(), "in%d.png").unwrap();
        let mut source = TimedSource::new(pictures, Timing::Index, 10.0, End::Stop);
        let mut concerns = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            concerns.push((frame.image.width(), source.concern().map(str::to_owned)));
        }
        let told = "its pictures are of several sizes: 6 x 4 at first, 3 x 2 in in2.png (number 2); each has a \
                    background of its own";
        let expected = [(6, None), (6, None), (3, Some(told)), (6, Some(told)), (8, Some(told))];
        assert_eq!(concerns, expected.map(|(width, told)| (width, told.map(str::to_owned))));
    }

    #[test]
    fn gaps_missing_folders_and_broken_pictures_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let check = |pattern: &str, kind: ErrorKind, part: &str| {
            let error = open(folder.path(), pattern).map(|_| ()).unwrap_err();
            assert_eq!(error.kind(), kind, "{error}");
            assert!(error.to_string().contains(part), "{error}");
        };
        check("in%d.jpg", ErrorKind::NotFound, "in%d.jpg");
        check("nowhere/in%d.jpg", ErrorKind::NotFound, "nowhere");
        check("in%s.jpg", ErrorKind::Invalid, "pattern");
        check("../in%d.jpg", ErrorKind::Invalid, "`..`");
        for name in ["in1.jpg", "in2.jpg", "in4.jpg"] {
            write(folder.path(), name, [9; 3]);
        }
        check("in%d.jpg", ErrorKind::Invalid, "picture 3 of");
        fs::write(folder.path().join("bad1.jpg"), b"no picture").unwrap();
        let jpeg = fs::read(folder.path().join("in1.jpg")).unwrap();
        fs::write(folder.path().join("cut1.jpg"), &jpeg[..40]).unwrap();
        for pattern in ["bad%d.jpg", "cut%d.jpg"] {
            let mut pictures = open(folder.path(), pattern).unwrap();
            pictures.begin().unwrap();
            let error = pictures.next_picture().unwrap_err();
            assert!(matches!(error, IngestError::Picture { .. }), "{error}");
            assert!(error.to_string().contains("1.jpg"), "{error}");
        }
    }

    #[test]
    fn a_picture_that_leads_out_of_the_roots_or_claims_a_huge_size_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("media");
        fs::create_dir(&inside).unwrap();
        write(folder.path(), "secret.png", [1; 3]);
        std::os::unix::fs::symlink(folder.path().join("secret.png"), inside.join("in0.png")).unwrap();
        let mut pictures = open(&inside, "in%d.png").unwrap();
        pictures.begin().unwrap();
        assert!(matches!(pictures.next_picture(), Err(IngestError::Outside { .. })));

        let mut bomb = fs::read(folder.path().join("secret.png")).unwrap();
        bomb[16..24].copy_from_slice(&[0, 0, 0xff, 0xdc, 0, 0, 0xff, 0xdc]);
        fs::write(inside.join("big0.png"), bomb).unwrap();
        let mut pictures = open(&inside, "big%d.png").unwrap();
        pictures.begin().unwrap();
        assert!(matches!(pictures.next_picture(), Err(IngestError::Picture { .. })));
    }
}
