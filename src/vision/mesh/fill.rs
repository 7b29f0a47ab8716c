//! Colours for places that nobody has one for.

use glam::Vec3;

/// What stays without a colour: nobody sees it, or anything it hangs together with; linear light.
pub const UNSEEN: Vec3 = Vec3::splat(0.2);

/// Gives what has no colour the mean of its neighbours' that have one, from the border of what has to its middle; what hangs together
/// with nothing that has one stays without.
///
/// **Cost** the triangles, times the edges from the border to the farthest place.
pub fn fill(colors: &mut [Option<Vec3>], triangles: &[[u32; 3]]) {
    // Triangles that there is nothing left to do in are not looked at again.
    let is_open = |colors: &[Option<Vec3>], of: &[u32; 3]| of.iter().any(|at| colors[*at as usize].is_none());
    let mut open: Vec<[u32; 3]> = triangles.iter().filter(|of| is_open(colors, of)).copied().collect();
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); colors.len()];
    loop {
        let mut reached = Vec::new();
        for triangle in &open {
            for (at, beside) in
                [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)].map(|(a, b)| (triangle[a], triangle[b]))
            {
                let (None, Some(color)) = (colors[at as usize], colors[beside as usize]) else { continue };
                let sum = &mut sums[at as usize];
                if sum.1 == 0.0 {
                    reached.push(at);
                }
                *sum = (sum.0 + color, sum.1 + 1.0);
            }
        }
        if reached.is_empty() {
            return;
        }
        for at in reached {
            let (sum, n) = sums[at as usize];
            colors[at as usize] = Some(sum / n);
        }
        open.retain(|of| is_open(colors, of));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_filled_from_their_borders() {
        // A strip of points in a row, and a piece that hangs together with nothing.
        let triangles: Vec<[u32; 3]> = (0..7).map(|at| [at, at + 1, at + 2]).chain([[9, 10, 11]]).collect();
        let mut colors = vec![None; 12];
        colors[0] = Some(Vec3::ZERO);
        colors[8] = Some(Vec3::ONE);
        fill(&mut colors, &triangles);
        let found: Vec<f32> = colors[..9].iter().map(|color| color.unwrap_or(Vec3::NAN).x).collect();
        assert!(found.windows(2).all(|pair| pair[0] <= pair[1]), "{found:?}");
        assert_eq!((found[4], &colors[9..]), (0.5, [None; 3].as_slice()));
        fill(&mut [], &[]);
    }
}
