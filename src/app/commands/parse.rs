//! Values of arguments that several commands take.

use glam::DVec3;

/// Reads `WIDTHxHEIGHT` in pixels.
///
/// # Errors
/// When it is not so written, or a side is not 1 to 65536.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let parse = |side: &str| side.parse::<u32>().ok().filter(|side| (1..=65_536).contains(side));
    text.split_once('x')
        .and_then(|(width, height)| Some([parse(width)?, parse(height)?]))
        .ok_or_else(|| "expected WIDTHxHEIGHT, each 1 to 65536, such as 768x576".to_owned())
}

/// Reads `x,y,z` in metres.
///
/// # Errors
/// When it is not three numbers.
pub fn parse_point(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("{text:?} is no place: expected x,y,z in metres")),
    }
}
