//! Masks as letters, for tests.

use crate::frame::BitMask;

/// Moving and shadow pixels drawn with `#` moving, `s` shadow, `.` background, one row a word.
pub(super) fn drawn(picture: &str) -> (BitMask, BitMask) {
    let rows: Vec<&str> = picture.split_whitespace().collect();
    let bits = |letter| {
        let mut mask = BitMask::new(rows[0].len() as u32, rows.len() as u32);
        for (y, row) in rows.iter().enumerate() {
            for (x, _) in row.chars().enumerate().filter(|(_, drawn)| *drawn == letter) {
                mask.set_run(y, x, x + 1);
            }
        }
        mask
    };
    (bits('#'), bits('s'))
}

pub(super) fn shown(moving: &BitMask, shadow: &BitMask) -> String {
    let letter = |x: usize, y: usize| match (moving.get(x, y), shadow.get(x, y)) {
        (true, _) => '#',
        (false, true) => 's',
        (false, false) => '.',
    };
    let row = |y: usize| (0..moving.width()).map(|x| letter(x, y)).collect::<String>();
    (0..moving.height()).map(row).collect::<Vec<String>>().join(" ")
}
