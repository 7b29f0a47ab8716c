//! `/api/v1/cameras/{id}/strip.jpg`: a stretch of a camera's time as one row of small pictures, for finding a place in it.
//!
//! A tile stands for an equal part of the stretch and shows a picture from within it: the key frame before its middle where
//! one is near enough, which costs one frame's decoding. Header fields tell each picture's own time.

use super::cameras;
use super::cameras::problem_of;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::picture::{Encoded, FIXED_TIME_CACHING, server_timing, write_rgb};
use super::query::Query;
use super::segments::Segments;
use axum::extract::RawQuery;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use image::imageops::thumbnail;
use image::{ImageBuffer, Rgb};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;
use videofields_service::engine::{EngineError, Handle, Preview};
use videofields_vision::access::Right;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::{RgbImage, YuvImage};

/// Tiles of a strip, unless others are asked for.
const N_TILES: u32 = 12;
const TILES: RangeInclusive<u32> = 1..=48;

/// Rows of a strip, unless others are asked for.
const HEIGHT_PX: u32 = 90;
const HEIGHTS_PX: RangeInclusive<u32> = 32..=360;

/// Columns and rows of a picture where none tells.
const ASPECT: (u32, u32) = (16, 9);

/// Columns of one tile at most, for each row: a picture that is wider is cut.
const MAX_ASPECT: u32 = 3;

/// Grey where there is no picture, 8-bit sRGB.
const NOTHING_SRGB: u8 = 32;

/// Time for decoding: the answer must begin within the limit of a request.
const DECODING_TIME: Duration = Duration::from_secs(7);

/// What of a stretch there is a picture of.
enum Tile {
    /// A small picture, and the scene time of what it shows.
    Picture(Rgb8, Timestamp),
    /// Nothing was seen then.
    Gap,
    /// What was recorded then cannot be read.
    Unreadable,
    /// There was no time left.
    Late,
}

/// 8-bit sRGB.
type Rgb8 = ImageBuffer<Rgb<u8>, Vec<u8>>;

const PARAMETERS: &[Parameter] = &[
    Parameter::instant("from", "Where the stretch begins").required(),
    Parameter::instant("to", "Where it ends").required(),
    Parameter::whole("count", &(1..=48), "Pictures, each of an equal part of the stretch").default_is("12"),
    Parameter::whole("height", &(32..=360), "Rows, pixels").default_is("90"),
];

/// Routes to previews.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_strip", "A stretch of a camera's time as one row of small pictures")
        .right(Right::History)
        .revalidated()
        .parameters(PARAMETERS)
        .answers(
            Answer::bytes(200, "The pictures beside one another", &["image/jpeg"])
                .field("Videofields-Times", "Each picture's own time, or `gap`, `unreadable` or `late`"),
        );
    Routes::of(cameras::TAG, cameras::SEGMENTS).get("/api/v1/cameras/{id}/strip.jpg", self::show, show)
}

/// The strip.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    query.require("from");
    query.require("to");
    let (from, to) = (query.instant("from"), query.instant("to"));
    let n_tiles = query.whole("count", &TILES).unwrap_or(N_TILES);
    let height_px = query.whole("height", &HEIGHTS_PX).unwrap_or(HEIGHT_PX);
    let (from, to) = query.finish(from.zip(to))?;
    if from >= to {
        let fault = Fault::new("to", format!("must be after from, which is {from}"));
        return Err(Problem::at(ErrorKind::Invalid, vec![fault]));
    }
    let started = api.clock.monotonic();
    let clock = Arc::clone(&api.clock);
    let look = move |door: Handle| tiles(&door, &*clock, &id, (from, to), (n_tiles, height_px));
    let found = api.look_back("looking back", look).await;
    let found = found.map_err(|error| problem_of(&api, error))?;
    let decoding_time = api.clock.monotonic().saturating_sub(started);
    let times: Vec<String> = found.iter().map(Tile::time).collect();
    let size_px = [found.len() as u32 * width_px(&found, height_px), height_px];
    let Encoded { bytes, tag, took } = api
        .encoded(size_px, move || {
            let picture = joined(&found, height_px);
            write_rgb(PictureFormat::Jpeg, &picture)
        })
        .await?;
    let mut response = bytes.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(PictureFormat::Jpeg.content_type()));
    headers.insert(header::CACHE_CONTROL, FIXED_TIME_CACHING);
    headers.insert(header::ETAG, tag.value());
    let timing = server_timing(&[("decode", decoding_time), ("encode", took)]);
    for (name, value) in [("videofields-times", times.join(",")), ("server-timing", timing)] {
        if let Ok(value) = HeaderValue::try_from(value) {
            headers.insert(name, value);
        }
    }
    Ok(response)
}

/// A small picture of each part of the stretch, as far as there is one.
fn tiles(
    door: &Handle,
    clock: &dyn Clock,
    camera: &str,
    (from, to): (Timestamp, Timestamp),
    (n_tiles, height_px): (u32, u32),
) -> Result<Vec<Tile>, EngineError> {
    let until = clock.monotonic().saturating_add(DECODING_TIME);
    let length_nanos = i128::from(to.as_nanos()) - i128::from(from.as_nanos());
    let halves_nanos = |n: i128| length_nanos * n / (2 * i128::from(n_tiles));
    let reach = Duration::from_nanos(u64::try_from(halves_nanos(1)).unwrap_or(u64::MAX));
    let mut tiles = Vec::with_capacity(n_tiles as usize);
    let mut width_px = None;
    for idx in 0..i128::from(n_tiles) {
        if clock.monotonic() > until {
            tiles.push(Tile::Late);
            continue;
        }
        // Between two instants, so an instant.
        let nanos = i64::try_from(i128::from(from.as_nanos()) + halves_nanos(2 * idx + 1));
        let middle = nanos.map_or(to, Timestamp::from_nanos);
        tiles.push(match door.preview(camera, middle, reach) {
            Ok(Preview { image, timestamp }) => {
                let size_px = (image.width(), image.height());
                let width_px = *width_px.get_or_insert_with(|| tile_width_px(size_px, height_px));
                Tile::Picture(small(&image, (width_px, height_px)), timestamp)
            }
            Err(EngineError::Gap { .. } | EngineError::NoFrame { .. }) => Tile::Gap,
            Err(EngineError::Unavailable(_) | EngineError::Internal(_)) => Tile::Unreadable,
            Err(error) => return Err(error),
        });
    }
    Ok(tiles)
}

/// Columns of a tile for pictures of that shape.
fn tile_width_px((columns, rows): (u32, u32), height_px: u32) -> u32 {
    (height_px * columns).div_ceil(rows.max(1)).clamp(1, MAX_ASPECT * height_px)
}

fn small(image: &YuvImage, (width_px, height_px): (u32, u32)) -> Rgb8 {
    let RgbImage { width, height, data } = image.to_rgb();
    // Always: a picture has as many bytes as its size says.
    let full = Rgb8::from_raw(width, height, data);
    full.map_or_else(|| Rgb8::new(width_px, height_px), |full| thumbnail(&full, width_px, height_px))
}

impl Tile {
    /// As the header field tells it.
    fn time(&self) -> String {
        match self {
            Self::Picture(_, timestamp) => timestamp.to_string(),
            Self::Gap => "gap".to_owned(),
            Self::Unreadable => "unreadable".to_owned(),
            Self::Late => "late".to_owned(),
        }
    }
}

/// All tiles beside one another.
fn joined(tiles: &[Tile], height_px: u32) -> RgbImage {
    let width_px = width_px(tiles, height_px);
    let mut strip = Rgb8::from_pixel(width_px * tiles.len() as u32, height_px, Rgb([NOTHING_SRGB; 3]));
    for (tile, idx) in tiles.iter().zip(0_i64..) {
        if let Tile::Picture(small, _) = tile {
            image::imageops::replace(&mut strip, small, idx * i64::from(width_px), 0);
        }
    }
    RgbImage { width: strip.width(), height: strip.height(), data: strip.into_raw() }
}

/// Returns the columns of each small picture.
fn width_px(tiles: &[Tile], height_px: u32) -> u32 {
    let of_picture = |tile: &Tile| match tile {
        Tile::Picture(small, _) => Some(small.width()),
        _ => None,
    };
    tiles.iter().find_map(of_picture).unwrap_or_else(|| tile_width_px(ASPECT, height_px))
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::{ColorMatrix, ColorRange};

    fn picture(luma: u8, size_px: (u32, u32)) -> Tile {
        let image =
            YuvImage::filled(size_px.0, size_px.1, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Full);
        Tile::Picture(small(&image, (48, 36)), Timestamp::from_nanos(0))
    }

    #[test]
    fn tiles_stand_beside_one_another_and_gaps_are_dark() {
        let strip = joined(&[Tile::Gap, picture(200, (64, 48)), picture(90, (32, 48)), Tile::Late], 36);
        assert_eq!((strip.width, strip.height), (4 * 48, 36));
        for (column, expected) in [(0, 32), (47, 32), (48, 200), (95, 200), (96, 90), (143, 90), (144, 32)] {
            for row in [0, 35] {
                let pixel = &strip.data[(row * 192 + column) * 3..][..3];
                assert!(pixel.iter().all(|value| value.abs_diff(expected) <= 1), "{column}: {pixel:?}");
            }
        }
        let nothing = joined(&[Tile::Gap, Tile::Gap], 90);
        assert_eq!((nothing.width, nothing.height), (320, 90));
        // One row of a thousand columns makes no strip of millions.
        assert_eq!(tile_width_px((1000, 1), 360), 1080);
        assert_eq!((tile_width_px((64, 48), 36), tile_width_px((1, 8192), 32)), (48, 1));
    }
}
