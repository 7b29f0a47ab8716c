//! The silhouette of one thing before a plain background, where a picture set has pictures alone: what differs from the colour of the
//! picture's border, its largest piece, without holes. Dark places of a thing before a black background would be holes else, and a
//! hull that is cut by a false hole is wrong, while one that is not cut by a true one is merely larger.

use crate::frame::RgbImage;

/// The silhouette, row by row. What differs from the background's colour by more than `threshold` codes in some channel is inside.
#[must_use]
pub fn silhouette(picture: &RgbImage, threshold: u8) -> Vec<bool> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let background = border_color(picture);
    let differs = |pixel: &[u8]| pixel.iter().zip(background).any(|(code, of)| code.abs_diff(of) > threshold);
    let is_foreground: Vec<bool> = picture.data.chunks_exact(3).map(differs).collect();
    let thing = largest((width, height), &is_foreground);
    // What the border cannot be reached from without crossing the thing is within it.
    let reached = reached_from_border(width, height, &thing);
    reached.into_iter().map(|is| !is).collect()
}

/// The median of the border's pixels, channel by channel.
fn border_color(picture: &RgbImage) -> [u8; 3] {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let is_border = |i: usize| {
        let (x, y) = (i % width, i / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    [0, 1, 2].map(|channel| {
        let mut codes: Vec<u8> = (0..width * height)
            .filter(|i| is_border(*i))
            .filter_map(|i| picture.data.get(3 * i + channel).copied())
            .collect();
        codes.sort_unstable();
        codes.get(codes.len() / 2).copied().unwrap_or_default()
    })
}

/// The largest piece of a mask, whose pixels touch by sides or corners.
#[must_use]
pub fn largest((width, height): (usize, usize), is_in: &[bool]) -> Vec<bool> {
    let mut piece_of = vec![0_u32; is_in.len()];
    let (mut n_pieces, mut largest) = (0, (0, 0));
    for first in 0..is_in.len() {
        if is_in[first] && piece_of[first] == 0 {
            n_pieces += 1;
            let n = flood((width, height, is_in), &mut piece_of, (first, n_pieces));
            largest = largest.max((n, n_pieces));
        }
    }
    piece_of.into_iter().map(|piece| piece != 0 && piece == largest.1).collect()
}

/// Marks the piece that `first` belongs to; answers how many pixels it has.
fn flood(
    (width, height, is_in): (usize, usize, &[bool]),
    piece_of: &mut [u32],
    (first, piece): (usize, u32),
) -> usize {
    let mut open = vec![first];
    piece_of[first] = piece;
    let mut n = 0;
    while let Some(at) = open.pop() {
        n += 1;
        let (x, y) = (at % width, at / width);
        let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
        let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
        for beside in rows.flat_map(|row| columns.clone().map(move |column| row * width + column)) {
            if is_in[beside] && piece_of[beside] == 0 {
                piece_of[beside] = piece;
                open.push(beside);
            }
        }
    }
    n
}

/// What of the outside hangs together with the picture's border, by sides.
fn reached_from_border(width: usize, height: usize, is_in: &[bool]) -> Vec<bool> {
    let mut is_reached = vec![false; is_in.len()];
    let is_border = |i: &usize| {
        let (x, y) = (i % width, i / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    let mut open: Vec<usize> = (0..is_in.len()).filter(is_border).filter(|i| !is_in[*i]).collect();
    open.iter().for_each(|i| is_reached[*i] = true);
    while let Some(at) = open.pop() {
        let (x, y) = (at % width, at / width);
        let sides = [
            (x > 0).then(|| at - 1),
            (x + 1 < width).then_some(at + 1),
            (y > 0).then(|| at - width),
            (y + 1 < height).then_some(at + width),
        ];
        for beside in sides.into_iter().flatten() {
            if !is_in[beside] && !is_reached[beside] {
                is_reached[beside] = true;
                open.push(beside);
            }
        }
    }
    is_reached
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_piece_is_taken_and_its_holes_are_filled() {
        let rows = ["#.......", "..####..", "..#..#..", "..####..", "........"];
        let data = rows.iter().flat_map(|row| row.bytes()).flat_map(|at| {
            // Noise of the background stays below the threshold.
            if at == b'#' { [90, 60, 20] } else { [4, 3, 9] }
        });
        let picture = RgbImage { width: 8, height: 5, data: data.collect() };
        let found = silhouette(&picture, 20);
        let shown: Vec<String> =
            found.chunks(8).map(|row| row.iter().map(|is| if *is { '#' } else { '.' }).collect()).collect();
        assert_eq!(shown, ["........", "..####..", "..####..", "..####..", "........"]);
    }

    #[test]
    fn a_picture_of_nothing_has_no_silhouette() {
        let picture = RgbImage { width: 4, height: 3, data: vec![200; 36] };
        assert!(silhouette(&picture, 20).iter().all(|is| !is));
        assert!(silhouette(&RgbImage { width: 1, height: 1, data: vec![1, 2, 3] }, 0).iter().all(|is| !is));
    }
}
