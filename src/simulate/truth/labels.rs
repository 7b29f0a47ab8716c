//! What every pixel is to a change detector, in the labels of the change detection benchmark.
//!
//! Instance, shadow and coverage go in; a mask of labels comes out, as changedetection.net has them (Wang et al. 2014,
//! `CDnet` 2014: an expanded change detection benchmark dataset).

use videofields_vision::frame::Mask;

/// The still world.
pub const STATIC: u8 = 0;
/// The still world in a shadow that something moving casts.
pub const SHADOW: u8 = 50;
/// Outside the region of interest: where the lens brings no light.
pub const OUTSIDE: u8 = 85;
/// Unknown motion: a pixel of which something moving covers a part.
pub const UNKNOWN: u8 = 170;
/// Something moving.
pub const MOVING: u8 = 255;

/// The labels of a picture.
///
/// `instance` is what the pixels' centres show, 0 the still world. `is_partly_moving` tells of a pixel (by its place in
/// the row-major picture) whether something moving covers a part of it and not the whole, `is_lit` whether the lens
/// brings it light; `shadow` is 255 in shadows of what moves.
#[must_use]
pub fn labels(
    instance: &Mask,
    shadow: Option<&Mask>,
    is_partly_moving: impl Fn(usize) -> bool,
    is_lit: impl Fn(usize) -> bool,
) -> Mask {
    let label = |(i, instance): (usize, &u8)| {
        if !is_lit(i) {
            OUTSIDE
        } else if is_partly_moving(i) {
            UNKNOWN
        } else if *instance > 0 {
            MOVING
        } else if shadow.is_some_and(|shadow| shadow.data[i] > 0) {
            SHADOW
        } else {
            STATIC
        }
    };
    let data = instance.data.iter().enumerate().map(label).collect();
    Mask { width: instance.width, height: instance.height, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_those_of_the_benchmark() {
        let mask = |data: [u8; 6]| Mask { width: 3, height: 2, data: data.to_vec().into() };
        let (instance, shadow) = (mask([0, 1, 2, 0, 0, 3]), mask([0, 255, 0, 255, 255, 0]));
        let got = labels(&instance, Some(&shadow), |i| i == 2 || i == 4, |i| i != 5);
        assert_eq!(got, mask([STATIC, MOVING, UNKNOWN, SHADOW, UNKNOWN, OUTSIDE]));
        let got = labels(&instance, None, |_| false, |_| true);
        assert_eq!(got, mask([0, 255, 255, 0, 0, 255]));
    }
}
