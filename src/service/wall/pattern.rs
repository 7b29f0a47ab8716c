//! Pictures by which a wall is put up: lines that go on from tile to tile as the viewer sees them, and every tile's name.

use super::{Tile, Wall};
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::FONT_10X20;
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use embedded_graphics::{Drawable, Pixel};
use glam::{DVec2, DVec3};
use std::convert::Infallible;
use videofields_vision::frame::RgbImage;

/// Degrees between two lines of the test pattern.
const STEP_DEG: f64 = 5.0;

/// Least half the width of a line, degrees.
const HALF_LINE_DEG: f64 = 0.06;

/// Columns and rows of a letter.
const LETTER_PX: [u32; 2] = [10, 20];

const LINE: [u8; 3] = [235, 235, 235];
const MIDDLE_LINE: [u8; 3] = [255, 210, 60];
const BORDER: [u8; 3] = [230, 60, 50];

/// Which picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Lines of equal azimuth and of equal elevation about the viewer, five degrees apart (those straight ahead are yellow), and
    /// each tile's border: on a wall that was put up as its document says, lines go on straight behind bezels.
    Test,
    /// The tile's name and size, as large as they fit.
    Identify,
}

/// The picture of a tile.
#[must_use]
pub fn pattern(wall: &Wall, tile: &Tile, which: Pattern) -> RgbImage {
    let [width, height] = tile.size_px;
    let mut image = RgbImage { width, height, data: ground(tile).repeat((width * height) as usize) };
    match which {
        Pattern::Test => draw_lines(wall, tile, &mut image),
        Pattern::Identify => {
            let [width, height] = tile.size_px;
            write(&format!("{}\n{width} x {height}", tile.id), &mut image);
        }
    }
    draw_border(&mut image);
    image
}

/// A dark colour of the tile's own, so that two that were exchanged show.
fn ground(tile: &Tile) -> [u8; 3] {
    let hash = tile
        .id
        .bytes()
        .fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    [hash >> 8, hash >> 16, hash >> 24].map(|part| 20 + (part & 0x3f) as u8)
}

fn draw_lines(wall: &Wall, tile: &Tile, image: &mut RgbImage) {
    let [lower_left, lower_right, upper_left] = tile.corners_m.map(|corner| corner - wall.viewer_m);
    let (width, height) = (f64::from(image.width), f64::from(image.height));
    let (across, down) = ((lower_right - lower_left) / width, (lower_left - upper_left) / height);
    let columns = image.width as usize;
    for (idx, pixel) in image.data.chunks_exact_mut(3).enumerate() {
        let at = DVec2::new((idx % columns) as f64 + 0.5, (idx / columns) as f64 + 0.5);
        let here = directions_deg(upper_left + across * at.x + down * at.y);
        // How far a pixel reaches and a little more, so that no line falls between two.
        let next = directions_deg(upper_left + across * (at.x + 1.0) + down * (at.y + 1.0));
        let half = (0.6 * (next - here).abs()).max(DVec2::splat(HALF_LINE_DEG));
        let off = (here / STEP_DEG - (here / STEP_DEG).round()) * STEP_DEG;
        if off.x.abs() <= half.x || off.y.abs() <= half.y {
            let is_middle = here.x.abs() <= half.x || here.y.abs() <= half.y;
            pixel.copy_from_slice(if is_middle { &MIDDLE_LINE } else { &LINE });
        }
    }
}

/// Azimuth to the right of straight ahead and elevation, degrees.
fn directions_deg(from_viewer: DVec3) -> DVec2 {
    let DVec3 { x, y, z } = from_viewer;
    DVec2::new(x.atan2(-z), y.atan2(x.hypot(z))).map(f64::to_degrees)
}

fn draw_border(image: &mut RgbImage) {
    let (width, height) = (image.width as usize, image.height as usize);
    let over = (width.min(height) / 200).max(1);
    for (idx, pixel) in image.data.chunks_exact_mut(3).enumerate() {
        let (x, y) = (idx % width, idx / width);
        if x < over || y < over || x + over >= width || y + over >= height {
            pixel.copy_from_slice(&BORDER);
        }
    }
}

/// Writes lines of text in the middle, each letter's pixels as many of the image's as fit.
fn write(text: &str, image: &mut RgbImage) {
    let longest = text.lines().map(str::len).max().unwrap_or(1).max(1) as u32;
    let lines = text.lines().count().max(1) as u32;
    let scale =
        (image.width / ((longest + 1) * LETTER_PX[0])).min(image.height / ((lines + 1) * LETTER_PX[1]));
    let mut canvas = Canvas { image, scale: scale.max(1) };
    let size = canvas.size();
    let middle = Point::new(size.width as i32 / 2, (size.height as i32 - (lines * LETTER_PX[1]) as i32) / 2);
    let style = TextStyleBuilder::new().alignment(Alignment::Center).baseline(Baseline::Top).build();
    let letters = MonoTextStyle::new(&FONT_10X20, BinaryColor::On);
    let Ok(_end) = Text::with_text_style(text, middle, letters, style).draw(&mut canvas);
}

/// An image of which `scale` pixels each way are one.
struct Canvas<'a> {
    image: &'a mut RgbImage,
    scale: u32,
}

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.image.width / self.scale, self.image.height / self.scale)
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let (size, scale, width) = (self.size(), self.scale as usize, self.image.width as usize);
        for Pixel(at, color) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y)) else { continue };
            if x >= size.width || y >= size.height || color == BinaryColor::Off {
                continue;
            }
            for row in 0..scale {
                let start = 3 * ((y as usize * scale + row) * width + x as usize * scale);
                for pixel in self.image.data[start..start + 3 * scale].chunks_exact_mut(3) {
                    pixel.copy_from_slice(&LINE);
                }
            }
        }
        Ok(())
    }
}
