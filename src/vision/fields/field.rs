//! How much each camera lends to every vertex of a mesh: stage after stage.
//!
//! `[M19]` Du et al. 2019, `Montage4D`, sections 4.2 to 4.5.

use super::agreement::even;
use super::seams::{SeamCounts, seams};
use super::settings::{Distances, FieldSettings, Preference};
use super::sight::{Hiding, Sight, sights};
use super::smoothing::{Taking, smooth};
use super::vote::{Ballot, footprints};
use super::{DEPTH_PX, MAX_VIEWS, ROUNDS, Topology, View, bounded, exact, marching};
use crate::error::ErrorKind;
use crate::mesh::{Mesh, fill};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles from a camera's seam over which it comes to lend in full: `[M19]` section 4.4. About a third as many edges.
pub const REACH_TRIANGLES: f64 = 15.0;

/// Cosine between the directions to the viewer and to the nearest camera below which fields give way to normals, so that they do not
/// end all at once where every camera looks against the viewer.
const LEAST_ALIKE: f64 = 0.1;

/// Why there is no field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FieldError {
    /// No views, or too many.
    #[error("expected 1 to {MAX_VIEWS} views, got {count}")]
    Views {
        /// How many there are.
        count: usize,
    },
    /// Nothing to lend to.
    #[error("the mesh has no triangle with an area")]
    Empty,
    /// Lists of the mesh do not belong together.
    #[error("the mesh is not sound: {0}")]
    Mesh(#[from] crate::mesh::MeshError),
}

impl FieldError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        ErrorKind::Invalid
    }
}

/// What of a field does not depend on the viewer.
#[derive(Clone, Debug)]
pub struct Field {
    n_views: usize,
    /// By vertex, and of a vertex by view, as all that follows.
    sights: Vec<Sight>,
    /// How far from its seams, 0 to 1; 1 for a view without seams, 0 where a view sees nothing.
    ramps: Vec<f32>,
    /// Weights by normals: the baseline. Sums are 1, or 0 where nobody sees a vertex.
    by_normals: Vec<f32>,
    /// The same without steps: what the field falls back to.
    fallback: Vec<f32>,
    /// By view: which share of all vertices it sees.
    shares: Vec<f64>,
    seams: Vec<SeamCounts>,
    /// By vertex, linear light: what it looks like from everywhere, and where nobody sees it as what is around it.
    colors: Vec<Vec3>,
    /// How large a pixel of the view is on the surface, along its longer side, metres.
    pixels_m: Vec<f32>,
    reach_m: f64,
    /// How wrong depths are taken to be.
    depth_m: f64,
    preference: Preference,
    coverage_exponent: f64,
}

/// How much each view lends to every vertex: by vertex, and of a vertex by view. Sums are 1, or 0 where nobody sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    pub(super) n_views: usize,
    pub(super) shares: Vec<f32>,
}

impl Weights {
    /// How many views there are.
    #[must_use]
    pub const fn n_views(&self) -> usize {
        self.n_views
    }

    /// What every view lends to a vertex.
    ///
    /// # Panics
    /// Of a vertex that is not there.
    #[must_use]
    pub fn of(&self, vertex: u32) -> &[f32] {
        &self.shares[vertex as usize * self.n_views..][..self.n_views]
    }
}

impl Field {
    /// Of a mesh and what cameras see of it; sets the views' gains where `settings` say so. Normals are taken as they are.
    ///
    /// **Cost** of `n` vertices and `v` views: `n v` projections, `v` depth maps, `n v` times the levels of the vote, distances.
    ///
    /// # Errors
    /// Without views, with too many, and where the mesh has no triangles or is not sound.
    pub fn new(
        mesh: &Mesh,
        topology: &Topology,
        views: &mut [View],
        settings: &FieldSettings,
    ) -> Result<Self, FieldError> {
        let n_views = views.len();
        if !(1..=MAX_VIEWS).contains(&n_views) {
            return Err(FieldError::Views { count: n_views });
        }
        mesh.is_sound()?;
        if topology.n_edges() == 0 {
            return Err(FieldError::Empty);
        }
        let n_vertices = mesh.positions_m.len();
        let hiding = Hiding::of(mesh, settings.visibility);
        let mut all = vec![Sight::Hidden; n_vertices * n_views];
        for (view, of) in views.iter().enumerate() {
            let own = sights(mesh, of, (settings.visibility, settings.depth_map_px), &hiding);
            own.into_iter().enumerate().for_each(|(vertex, sight)| all[vertex * n_views + view] = sight);
        }
        if settings.is_evened {
            even(mesh, views, &all, 2.0);
        }
        let views = &*views;
        if let Some(levels) = settings.vote {
            let within = footprints(mesh, views, settings.depth_map_px);
            let votes = all.par_chunks_mut(n_views).zip(within.par_chunks(n_views)).zip(&mesh.positions_m);
            votes.for_each_init(Ballot::default, |ballot, ((sights, within), place)| {
                ballot.vote(*place, (views, within), levels, sights);
            });
        }
        let reach_m = settings
            .reach_m
            .unwrap_or(REACH_TRIANGLES / 3.0 * topology.mean_length_m())
            .max(f64::MIN_POSITIVE);
        let (mut ramps, mut counts) = (vec![0.0_f32; n_vertices * n_views], Vec::new());
        let each: Vec<(Vec<f32>, SeamCounts)> = (0..n_views)
            .into_par_iter()
            .map(|view| {
                let (sources, counts) = seams(topology, |vertex| all[vertex as usize * n_views + view]);
                (ramp(topology, mesh, (&sources, reach_m), settings.distances), counts)
            })
            .collect();
        for (view, (own, seams)) in each.into_iter().enumerate() {
            for (vertex, ramp) in own.into_iter().enumerate() {
                let at = vertex * n_views + view;
                ramps[at] = if all[at] == Sight::Seen { ramp } else { 0.0 };
            }
            counts.push(seams);
        }
        let mut n_seen = vec![0_u64; n_views];
        for (at, sight) in all.iter().enumerate() {
            n_seen[at % n_views] += u64::from(*sight == Sight::Seen);
        }
        let mut field = Self {
            n_views,
            by_normals: by_normals(mesh, views, &all, settings.normal_exponent),
            fallback: Vec::new(),
            sights: all,
            ramps,
            shares: n_seen.into_iter().map(|n| n as f64 / n_vertices as f64).collect(),
            seams: counts,
            colors: Vec::new(),
            reach_m,
            depth_m: 0.0,
            pixels_m: Vec::new(),
            preference: settings.preference,
            coverage_exponent: settings.coverage_exponent,
        };
        field.pixels_m = field.pixels_m(mesh, views);
        field.depth_m = match settings.preference {
            Preference::Errors { depth_m: Some(depth_m), .. } => depth_m,
            _ => (DEPTH_PX * field.finest_px_m()).max(0.5 * topology.mean_length_m()),
        };
        field.spread(topology, settings.smoothing_rounds);
        field.colors = field.vertex_colors(mesh, views, topology.mean_length_m());
        Ok(field)
    }

    /// How many views there are.
    #[must_use]
    pub const fn n_views(&self) -> usize {
        self.n_views
    }

    /// What a view has to say of a vertex.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn sight(&self, vertex: u32, view: usize) -> Sight {
        self.sights[vertex as usize * self.n_views + view]
    }

    /// How far from its seams a view sees a vertex, 0 to 1, as smooth as the settings say; 0 where it does not.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn ramp(&self, vertex: u32, view: usize) -> f32 {
        self.ramps[vertex as usize * self.n_views + view]
    }

    /// How much a view is believed at a vertex: how far from its seams it is, 0 to 1, and 0 where it does not see it.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn trust(&self, vertex: u32, view: usize) -> f32 {
        if self.sight(vertex, view) == Sight::Seen { self.ramp(vertex, view) } else { 0.0 }
    }

    /// What every view lends to a vertex by normals alone.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn lends_by_normals(&self, vertex: u32) -> &[f32] {
        &self.by_normals[vertex as usize * self.n_views..][..self.n_views]
    }

    /// What every view lends to a vertex where fields give way: by normals, without steps.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn falls_back_to(&self, vertex: u32) -> &[f32] {
        &self.fallback[vertex as usize * self.n_views..][..self.n_views]
    }

    /// How large a pixel of a view is on the surface at a vertex that it sees, along its longer side, metres; infinite at others.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn pixel_m(&self, vertex: u32, view: usize) -> f32 {
        self.pixels_m[vertex as usize * self.n_views + view]
    }

    /// Every view's seams.
    #[must_use]
    pub fn seams(&self) -> &[SeamCounts] {
        &self.seams
    }

    /// Which share of all vertices each view sees.
    #[must_use]
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// How far from its seams a camera lends in full, metres.
    #[must_use]
    pub const fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// How wrong depths are taken to be, metres.
    #[must_use]
    pub const fn depth_m(&self) -> f64 {
        self.depth_m
    }

    /// Weights by normals without steps, as smooth as the settings say: what fields fall back to.
    #[must_use]
    pub fn fallback(&self) -> Weights {
        Weights { n_views: self.n_views, shares: self.fallback.clone() }
    }

    /// What every vertex looks like from everywhere, linear light; of what nobody sees the mesh's own colour, or what is around it.
    #[must_use]
    pub fn colors(&self) -> &[Vec3] {
        &self.colors
    }

    /// Weights by normals alone, whoever looks: the baseline (Holoportation).
    #[must_use]
    pub fn by_normals(&self) -> Weights {
        Weights { n_views: self.n_views, shares: self.by_normals.clone() }
    }

    /// Weights that a viewer at `eye` should come to.
    ///
    /// **Cost** of every vertex and view a direction and a power.
    ///
    /// # Panics
    /// Where mesh and views are not those that the field was made of.
    #[must_use]
    pub fn target(&self, mesh: &Mesh, views: &[View], eye: DVec3) -> Weights {
        let n_views = self.n_views;
        assert_eq!(
            (mesh.positions_m.len() * n_views, views.len()),
            (self.sights.len(), n_views),
            "the field's own"
        );
        let mut shares = self.fallback.clone();
        let rows = shares.par_chunks_mut(n_views).zip(self.sights.par_chunks(n_views));
        let rows = rows.zip(self.ramps.par_chunks(n_views)).zip(self.pixels_m.par_chunks(n_views));
        let rows = rows.zip(&mesh.positions_m);
        let coverage: Vec<f64> = self.shares.iter().map(|share| share.powf(self.coverage_exponent)).collect();
        rows.for_each_init(Vec::new, |wanted, ((((row, sights), ramps), pixels_m), place)| {
            let to_eye = (eye - *place).normalize_or_zero();
            wanted.clear();
            wanted.resize(n_views, 0.0);
            let trusted = || (0..n_views).filter(|view| sights[*view] == Sight::Seen && ramps[*view] > 0.0);
            let mut alike = 0.0_f64;
            for view in trusted() {
                let cosine = to_eye.dot((views[view].eye() - *place).normalize_or_zero());
                alike = alike.max(cosine);
                wanted[view] = match self.preference {
                    Preference::Directions { .. } => cosine.max(0.0),
                    Preference::Errors { .. } => {
                        let beside_m = self.depth_m * (1.0 - cosine * cosine).max(0.0).sqrt();
                        beside_m.hypot(f64::from(pixels_m[view])).max(f64::MIN_POSITIVE).recip()
                    }
                };
            }
            let most = wanted.iter().copied().fold(0.0, f64::max);
            if most <= 0.0 {
                return;
            }
            // Relative to the greatest, so that powers of small numbers do not vanish together.
            let exponent = match self.preference {
                Preference::Directions { exponent } | Preference::Errors { exponent, .. } => exponent,
            };
            for view in trusted() {
                wanted[view] = coverage[view] * f64::from(ramps[view]) * (wanted[view] / most).powf(exponent);
            }
            let sum: f64 = wanted.iter().sum();
            if sum <= 0.0 {
                return;
            }
            let n_lending: f64 = trusted().map(|view| f64::from(ramps[view])).sum();
            let share = n_lending.min(1.0) * (alike / LEAST_ALIKE).clamp(0.0, 1.0);
            row.iter_mut().for_each(|own| *own *= (1.0 - share) as f32);
            for view in trusted() {
                row[view] += (share * wanted[view] / sum) as f32;
            }
        });
        Weights { n_views, shares }
    }

    /// Makes what weights are made of smooth: ramps, where what does not see a vertex counts as 0; sizes of pixels, whose logarithms are
    /// taken among those that see it, since normals of meshes are uneven; and what fields fall back to.
    fn spread(&mut self, topology: &Topology, rounds: u32) {
        let (n_views, sights) = (self.n_views, &self.sights);
        let is_seen = |at: usize| sights[at] == Sight::Seen;
        smooth(topology, (&mut self.ramps, n_views), rounds, &Taking { changes: is_seen, counts: |_| true });
        self.fallback = self.by_normals.clone();
        if rounds == 0 {
            return;
        }
        let is_sized: Vec<bool> = self.pixels_m.iter().map(|pixel_m| pixel_m.is_finite()).collect();
        let sized = |at: usize| is_sized[at];
        self.pixels_m.par_iter_mut().for_each(|pixel_m| *pixel_m = pixel_m.ln());
        smooth(topology, (&mut self.pixels_m, n_views), rounds, &Taking { changes: sized, counts: sized });
        self.pixels_m.par_iter_mut().for_each(|log| *log = log.exp());
        let by_normals = &self.by_normals;
        let may_lend = |at: usize| by_normals[at] > 0.0;
        smooth(
            topology,
            (&mut self.fallback, n_views),
            rounds,
            &Taking { changes: may_lend, counts: |_| true },
        );
        self.fallback.par_chunks_mut(n_views).for_each(|row| {
            let sum: f32 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|share| *share /= sum);
            }
        });
    }

    /// How large the finest pixel is on the surface, in the median of all vertices that are seen, metres; 0 where none is.
    fn finest_px_m(&self) -> f64 {
        let finest = |row: &[f32]| row.iter().copied().fold(f32::INFINITY, f32::min);
        let mut all: Vec<f32> =
            self.pixels_m.chunks(self.n_views).map(finest).filter(|pixel_m| pixel_m.is_finite()).collect();
        let middle = all.len() / 2;
        if all.is_empty() {
            return 0.0;
        }
        f64::from(*all.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    fn pixels_m(&self, mesh: &Mesh, views: &[View]) -> Vec<f32> {
        let n_views = self.n_views;
        let mut pixels_m = vec![f32::INFINITY; self.sights.len()];
        let rows = pixels_m.par_chunks_mut(n_views).zip(self.sights.par_chunks(n_views));
        rows.zip(mesh.positions_m.par_iter().zip(&mesh.normals)).for_each(
            |((row, sights), (place, normal))| {
                for (view, own) in row.iter_mut().enumerate().filter(|(view, _)| sights[*view] == Sight::Seen)
                {
                    let Some((_, depth_m)) = views[view].project(*place) else { continue };
                    let facing = (views[view].eye() - *place).normalize_or_zero().dot(normal.as_dvec3());
                    *own = (1.0 / (views[view].px_per_m(depth_m) * facing.max(1e-6))) as f32;
                }
            },
        );
        pixels_m
    }

    fn vertex_colors(&self, mesh: &Mesh, views: &[View], edge_m: f64) -> Vec<Vec3> {
        let color = |vertex: usize| {
            let row = &self.by_normals[vertex * self.n_views..][..self.n_views];
            let (mut sum, mut lent) = (Vec3::ZERO, 0.0);
            for (view, share) in views.iter().zip(row).filter(|(_, share)| **share > 0.0) {
                let Some((texture, depth_m)) = view.project(mesh.positions_m[vertex]) else { continue };
                // As wide as the mesh is fine.
                let level = (view.px_per_m(depth_m) * edge_m).max(1.0).log2() as f32;
                sum += *share * view.light_at(texture, level);
                lent += *share;
            }
            let own = || Some(light_of(mesh.colors_srgb.as_ref()?[vertex]));
            if lent > 0.0 { Some(sum / lent) } else { own() }
        };
        let mut colors: Vec<Option<Vec3>> = (0..mesh.positions_m.len()).into_par_iter().map(color).collect();
        fill(&mut colors, &mesh.triangles);
        colors.into_iter().map(|color| color.unwrap_or(crate::mesh::UNSEEN)).collect()
    }
}

fn light_of(codes: [u8; 3]) -> Vec3 {
    Vec3::from(codes.map(|code| crate::frame::linear_from_srgb(f32::from(code) / 255.0)))
}

/// How far vertices are from sources, as a share of `reach_m` up to 1.
fn ramp(
    topology: &Topology,
    mesh: &Mesh,
    (sources, reach_m): (&[u32], f64),
    distances: Distances,
) -> Vec<f32> {
    let n_vertices = mesh.positions_m.len();
    if sources.is_empty() {
        return vec![1.0; n_vertices];
    }
    let share = |distance_m: f64| (distance_m / reach_m).min(1.0) as f32;
    match distances {
        Distances::Off => vec![1.0; n_vertices],
        Distances::Marching => {
            marching(topology, &mesh.positions_m, sources, reach_m).into_iter().map(share).collect()
        }
        Distances::Bounded => bounded(topology, &mesh.positions_m, sources, ROUNDS)
            .into_iter()
            .map(|distance_m| share(f64::from(distance_m)))
            .collect(),
        Distances::Exact => {
            exact(topology, &mesh.positions_m, sources, reach_m).into_iter().map(share).collect()
        }
    }
}

/// Weights by normals: of whoever is believed, else of whoever others disagree with, else of whoever sees it beside something that hides,
/// else nobody's.
fn by_normals(mesh: &Mesh, views: &[View], sights: &[Sight], exponent: f64) -> Vec<f32> {
    let n_views = views.len();
    let mut shares = vec![0.0_f32; sights.len()];
    let rows = shares.par_chunks_mut(n_views).zip(sights.par_chunks(n_views));
    rows.zip(&mesh.positions_m).zip(&mesh.normals).for_each(|(((row, sights), place), normal)| {
        for believed in [Sight::Seen, Sight::Outvoted, Sight::Near] {
            let facing = |view: usize| {
                let to_camera = (views[view].eye() - *place).normalize_or_zero();
                to_camera.dot(normal.as_dvec3()).max(0.0)
            };
            let of = || (0..n_views).filter(|view| sights[*view] == believed);
            let most = of().map(facing).fold(0.0, f64::max);
            if most <= 0.0 {
                continue;
            }
            let wanted = |view: usize| (facing(view) / most).powf(exponent);
            let sum: f64 = of().map(wanted).sum();
            of().for_each(|view| row[view] = (wanted(view) / sum) as f32);
            return;
        }
    });
    shares
}
