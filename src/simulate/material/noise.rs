//! Deterministic noise with a stated wavelength.
//!
//! Value noise on a lattice `[P85]`: hashed values at whole coordinates, joined by a smooth curve. A sample whose
//! footprint comes near the wavelength gets the mean instead, so that detail finer than a pixel never aliases and
//! two views of one place differ by their resolution alone.
//!
//! `[P85]` Perlin 1985, An image synthesizer (with the later quintic fade of Perlin 2002, Improving noise).

use glam::DVec2;

/// A number in [0, 1) for a lattice place; the same on every machine.
pub(crate) fn hash01(x: i64, y: i64, seed: u32) -> f64 {
    // The finaliser of SplitMix64 (Steele, Lea, Flood 2014) over a mix of the inputs.
    let mut bits = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(31)
        ^ u64::from(seed).wrapping_mul(0x1656_67b1_9e37_79f9);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// Noise of mean about 0 within [-1, 1] whose features are `wavelength_m` wide, for a sample `footprint_m` wide.
pub(crate) fn noise(at: DVec2, wavelength_m: f64, footprint_m: f64, seed: u32) -> f64 {
    let visible = 1.0 - smooth_step(0.35, 0.9, footprint_m / wavelength_m);
    if visible <= 0.0 {
        return 0.0;
    }
    let scaled = at / wavelength_m;
    let cell = scaled.floor();
    let fade = (scaled - cell).map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let value = |dx: i64, dy: i64| hash01(cell.x as i64 + dx, cell.y as i64 + dy, seed);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let low = lerp(value(0, 0), value(1, 0), fade.x);
    let high = lerp(value(0, 1), value(1, 1), fade.x);
    visible * (2.0 * lerp(low, high, fade.y) - 1.0)
}

/// 0 below `from`, 1 above `to`, smooth in between.
pub(crate) fn smooth_step(from: f64, to: f64, value: f64) -> f64 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How much of a sample `footprint_m` wide lies where `signed_distance_m` is below 0: 1 inside, 0 outside, and a
/// ramp of at least `softness_m` across the edge.
pub(crate) fn coverage(signed_distance_m: f64, footprint_m: f64, softness_m: f64) -> f64 {
    let ramp = footprint_m.max(softness_m);
    (0.5 - signed_distance_m / ramp).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_centred_and_gone_below_its_wavelength() {
        let (mut sum, mut most, mut before) = (0.0, 0.0_f64, None::<f64>);
        for i in 0..20_000 {
            let at = DVec2::new(f64::from(i) * 0.01 - 70.0, f64::from(i) * 0.003);
            let value = noise(at, 1.0, 0.05, 7);
            if let Some(before) = before {
                assert!((value - before).abs() < 0.05, "a jump at {at}");
            }
            (sum, most, before) = (sum + value, most.max(value.abs()), Some(value));
            assert_eq!(noise(at, 1.0, 1.0, 7), 0.0);
        }
        assert!((sum / 20_000.0).abs() < 0.1 && most > 0.5 && most <= 1.0, "mean {sum} / 20000, peak {most}");
    }

    #[test]
    fn hashes_fill_their_range_evenly() {
        let mut counts = [0; 10];
        for x in -50..50 {
            for y in -50..50 {
                counts[(hash01(x, y, 3) * 10.0) as usize] += 1;
            }
        }
        assert!(counts.iter().all(|count| (850..1150).contains(count)), "{counts:?}");
    }

    #[test]
    fn coverage_is_half_at_the_edge() {
        assert_eq!(coverage(0.0, 0.1, 0.02), 0.5);
        assert_eq!(coverage(-1.0, 0.1, 0.02), 1.0);
        assert_eq!(coverage(1.0, 0.1, 0.02), 0.0);
    }
}
