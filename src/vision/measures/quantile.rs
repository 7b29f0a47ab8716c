//! Quantiles of a sample.

/// The value below which `share` (0 to 1) of `sorted` lies; 0 of nothing.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    (sorted[above] - sorted[below]).mul_add(place - below as f64, sorted[below])
}
