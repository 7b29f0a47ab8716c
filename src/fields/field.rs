//! How much each camera lends to every vertex of a mesh: stage after stage, each of which can be off.
//!
//! `[M19]` Du et al. 2019, `Montage4D`, sections 4.2 to 4.5.

use super::agreement::even;
use super::seams::{SeamCounts, seams};
use super::sight::{Hiding, Sight, Visibility, sights};
use super::vote::{Ballot, VoteLevels};
use super::{MAX_VIEWS, ROUNDS, Topology, View, bounded, exact, marching};
use crate::error::ErrorKind;
use crate::mesh::{Mesh, fill};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// How distances from seams are found, from cheap to exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Distances {
    /// They are not: a camera lends up to its seams.
    Off,
    /// By one front.
    Marching,
    /// In rounds of two windows an edge, as a device does.
    Bounded,
    /// To rounding.
    Exact,
}

impl Distances {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Off, Self::Marching, Self::Bounded, Self::Exact];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Marching => "marching",
            Self::Bounded => "bounded",
            Self::Exact => "exact",
        }
    }
}

impl std::str::FromStr for Distances {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|of| of.name() == name)
            .ok_or_else(|| format!("expected one of {}", names()))
    }
}

/// Which cameras lend most to a viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Preference {
    /// Those that look as the viewer does: the cosine between both directions, to a power (`[M19]`).
    Directions {
        /// The power.
        exponent: f64,
    },
    /// Those whose colours are least beside where the viewer sees them: by how a wrong depth is seen from another direction, and by how
    /// large a pixel is on the surface (after `[B01]` Buehler et al. 2001, Unstructured lumigraph rendering, section 3: angles and
    /// resolutions, both in metres here).
    Errors {
        /// How wrong depths are, metres; if none half of a mean edge, which is what the mesh itself leaves out.
        depth_m: Option<f64>,
        /// To which power the reciprocal of an error counts.
        exponent: f64,
    },
}

/// Which stages of a field are run, and how exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSettings {
    /// How hidden vertices are found.
    pub visibility: Visibility,
    /// Texels of depth maps along their longer side, at least 1.
    pub depth_map_px: u32,
    /// Levels of detail in which cameras vote on each other, if they do: where meshes lack what hides, as people; else it costs more than it
    /// mends (docs/benchmarks/fields.md).
    pub vote: Option<VoteLevels>,
    /// How distances from seams are found.
    pub distances: Distances,
    /// How far from its seams a camera lends in full, metres; if none what fifteen triangles reach.
    pub reach_m: Option<f64>,
    /// Whether pictures are evened out first.
    pub is_evened: bool,
    /// Which cameras are preferred where several are believed.
    pub preference: Preference,
    /// Exponent of the share of all vertices that a camera sees: 1 as `[M19]` has it, for one thing in the middle of all cameras; 0 for
    /// places of which cameras see parts, where who sees less may see it from nearer.
    pub coverage_exponent: f64,
    /// Exponent of the cosine between a surface's normal and the direction to a camera, in the baseline and what fields fall back to.
    pub normal_exponent: f64,
}

impl Default for FieldSettings {
    fn default() -> Self {
        Self {
            visibility: Visibility::Dilated,
            depth_map_px: 1024,
            vote: None,
            distances: Distances::Exact,
            reach_m: None,
            is_evened: true,
            preference: Preference::Errors { depth_m: None, exponent: 4.0 },
            coverage_exponent: 0.0,
            normal_exponent: 2.0,
        }
    }
}

/// Triangles from a camera's seam over which it comes to lend in full: `[M19]` section 4.4. About a third as many edges.
const REACH_TRIANGLES: f64 = 15.0;

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
    /// How far from its seams, 0 to 1; 1 for a view without seams.
    ramps: Vec<f32>,
    /// Weights by normals: what the field falls back to, and the baseline. Sums are 1, or 0 where nobody sees a vertex.
    by_normals: Vec<f32>,
    /// By view: which share of all vertices it sees.
    shares: Vec<f64>,
    seams: Vec<SeamCounts>,
    /// By vertex, linear light: what it looks like from everywhere, and where nobody sees it as what is around it.
    colors: Vec<Vec3>,
    /// How large a pixel of the view is on the surface, along its longer side, metres.
    pixels_m: Vec<f32>,
    reach_m: f64,
    /// Of all edges in the mean.
    edge_m: f64,
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
            let votes = all.par_chunks_mut(n_views).zip(&mesh.positions_m);
            votes.for_each_init(Ballot::default, |ballot, (sights, place)| {
                ballot.vote(*place, views, levels, sights);
            });
        }
        let reach_m = settings
            .reach_m
            .unwrap_or(REACH_TRIANGLES / 3.0 * topology.mean_length_m())
            .max(f64::MIN_POSITIVE);
        let (mut ramps, mut counts) = (vec![1.0_f32; n_vertices * n_views], Vec::new());
        let each: Vec<(Vec<f32>, SeamCounts)> = (0..n_views)
            .into_par_iter()
            .map(|view| {
                let (sources, counts) = seams(topology, |vertex| all[vertex as usize * n_views + view]);
                (ramp(topology, mesh, (&sources, reach_m), settings.distances), counts)
            })
            .collect();
        for (view, (own, seams)) in each.into_iter().enumerate() {
            own.into_iter().enumerate().for_each(|(vertex, ramp)| ramps[vertex * n_views + view] = ramp);
            counts.push(seams);
        }
        let mut n_seen = vec![0_u64; n_views];
        for (at, sight) in all.iter().enumerate() {
            n_seen[at % n_views] += u64::from(*sight == Sight::Seen);
        }
        let mut field = Self {
            n_views,
            by_normals: by_normals(mesh, views, &all, settings.normal_exponent),
            sights: all,
            ramps,
            shares: n_seen.into_iter().map(|n| n as f64 / n_vertices as f64).collect(),
            seams: counts,
            colors: Vec::new(),
            reach_m,
            edge_m: topology.mean_length_m(),
            pixels_m: Vec::new(),
            preference: settings.preference,
            coverage_exponent: settings.coverage_exponent,
        };
        field.pixels_m = field.pixels_m(mesh, views);
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

    /// How far from its seams a view sees a vertex, 0 to 1.
    ///
    /// # Panics
    /// Of one that is not there.
    #[must_use]
    pub fn ramp(&self, vertex: u32, view: usize) -> f32 {
        self.ramps[vertex as usize * self.n_views + view]
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

    /// What every vertex looks like from everywhere, linear light; of what nobody sees the mesh's own colour, or what is around it.
    #[must_use]
    pub fn colors(&self) -> &[Vec3] {
        &self.colors
    }

    /// Weights by normals alone, whoever looks: the baseline (Holoportation), and what fields fall back to.
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
        let mut shares = self.by_normals.clone();
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
                    Preference::Errors { depth_m, .. } => {
                        let depth_m = depth_m.unwrap_or(0.5 * self.edge_m);
                        let beside_m = depth_m * (1.0 - cosine * cosine).max(0.0).sqrt();
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
