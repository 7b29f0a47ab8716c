//! A scene's surfaces as a fine mesh with what cameras lend to its vertices, made once for cameras that stand still.
//!
//! Triangles to which the same cameras lend are a group and drawn together; a vertex of two groups is there twice, so that of the
//! cameras of its group alone numbers are kept.

use super::mesh::{Mesh, MeshVertex};
use super::passes::{FIELD_SLOTS, FieldGroup, FieldSlots, FieldVertex, NO_FIELD_VIEW};
use super::patches::{Batch, Batches, CameraList, Drawing, Shading, within};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;
use videofields_picture::plan::{Filtering, Opened};
use videofields_vision::fields::{Field, FieldSettings, MAX_VIEWS, Sight, Tessellation, Topology, View};
use videofields_vision::geometry::{Camera, SurfaceId};

/// The fine mesh of one scene for a set of cameras.
#[derive(Debug)]
pub(super) struct FieldMesh {
    /// Another for every mesh and set of patches that a renderer makes.
    pub number: u64,
    mesh_number: u64,
    /// Each another: the field's views.
    cameras: Vec<Arc<Camera>>,
    pub vertices: Vec<MeshVertex>,
    /// Of every vertex, for the device.
    pub lent: Vec<FieldVertex>,
    /// Cameras of every group, for the device.
    pub groups: Vec<FieldGroup>,
    drawn: Vec<Group>,
    indices: Vec<u32>,
    may_overlap: bool,
    /// What the device's places are relative to.
    pub origin_in_world: DVec3,
    /// How wrong depths are taken to be, metres.
    pub depth_m: f64,
}

/// Triangles of one surface with one picture, to which the same cameras lend.
#[derive(Debug)]
struct Group {
    surface: SurfaceId,
    texture: Option<usize>,
    /// The best first, by their places among the field's.
    views: Vec<u8>,
    /// In the mesh's indices.
    indices: Range<usize>,
}

/// In a list in place of a camera that the picture does not draw with.
const NOT_DRAWN: u32 = u32::MAX;

/// What tells groups apart: surface and picture by their places, cameras by their bits.
type GroupKey = (usize, Option<usize>, u64);

impl FieldMesh {
    /// Of a scene's triangles and cameras, of which at most [`MAX_VIEWS`] are taken. Who sees nothing, and a scene without surfaces, is no
    /// error: nobody lends anything there.
    ///
    /// **Cost** some tenths of a second for ten cameras: rays to every camera from every triangle near its seams.
    pub(super) fn new(mesh: &Mesh, cameras: Vec<Arc<Camera>>, number: u64) -> Self {
        let mut distinct: Vec<Arc<Camera>> = Vec::with_capacity(cameras.len());
        for camera in cameras {
            if !distinct.contains(&camera) && distinct.len() < MAX_VIEWS {
                distinct.push(camera);
            }
        }
        let cameras = distinct;
        let seeing: Vec<Camera> = cameras.iter().map(|camera| (**camera).clone()).collect();
        let (fine, origins) = Tessellation::default().with_origins(&mesh.scene.surfaces, &seeing);
        let topology = Topology::of(&fine.positions_m, &fine.triangles);
        let mut views: Vec<View> = seeing.into_iter().map(View::without_picture).collect();
        // Colours are evened out elsewhere; votes need pictures, which change.
        let settings = FieldSettings { is_evened: false, vote: None, ..FieldSettings::of_places() };
        let field = Field::new(&fine, &topology, &mut views, &settings).ok();
        let origin_in_world = fine.bounds().map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high));
        let may_overlap = mesh.scene.surfaces.hiding_bounds().next().is_some();
        let mut made = Self {
            number,
            mesh_number: mesh.number,
            cameras,
            vertices: Vec::new(),
            lent: Vec::new(),
            groups: Vec::new(),
            drawn: Vec::new(),
            indices: Vec::new(),
            may_overlap,
            origin_in_world,
            depth_m: field.as_ref().map_or(0.0, Field::depth_m),
        };
        let mut sorted: BTreeMap<GroupKey, Vec<usize>> = BTreeMap::new();
        for (triangle, corners) in fine.triangles.iter().enumerate() {
            let origin = origins[triangle];
            let surface = mesh.ranges.partition_point(|(_, range)| range.end <= 3 * origin);
            let lends = |view: usize| {
                let of =
                    |field: &Field| corners.iter().any(|corner| field.lends_by_normals(*corner)[view] > 0.0);
                field.as_ref().is_some_and(of)
            };
            let bits =
                (0..made.cameras.len()).filter(|view| lends(*view)).fold(0, |bits, view| bits | 1 << view);
            let texture = mesh.triangles[origin as usize].1;
            sorted.entry((surface, texture, bits)).or_default().push(triangle);
        }
        for ((surface, texture, bits), triangles) in sorted {
            let corners = || triangles.iter().flat_map(|triangle| fine.triangles[*triangle]);
            let views = best(bits, field.as_ref(), corners);
            let first = made.indices.len();
            made.append(mesh, (&fine, &origins), (field.as_ref(), &views), &triangles);
            let mut slots = [NO_FIELD_VIEW; FIELD_SLOTS];
            slots.iter_mut().zip(&views).for_each(|(slot, view)| *slot = u32::from(*view));
            made.groups.push(FieldGroup::of(slots));
            let surface = mesh.ranges[surface].0;
            made.drawn.push(Group { surface, texture, views, indices: first..made.indices.len() });
        }
        made
    }

    /// Adds a group's triangles.
    fn append(
        &mut self,
        mesh: &Mesh,
        (fine, origins): (&videofields_vision::mesh::Mesh, &[u32]),
        (field, views): (Option<&Field>, &[u8]),
        triangles: &[usize],
    ) {
        let mut known: HashMap<(u32, u32), u32> = HashMap::new();
        for triangle in triangles {
            let origin = origins[*triangle];
            let [a, b, c] = [0, 1, 2].map(|idx| mesh.vertices[3 * origin as usize + idx]);
            for corner in fine.triangles[*triangle] {
                let idx = *known.entry((corner, origin)).or_insert_with(|| {
                    self.vertices.push(within(&[a, b, c], fine.positions_m[corner as usize]));
                    self.lent.push(self.lent_to(fine.positions_m[corner as usize], corner, (field, views)));
                    self.vertices.len() as u32 - 1
                });
                self.indices.push(idx);
            }
        }
    }

    /// What the cameras of the next group have to do with one of its vertices.
    fn lent_to(&self, at: DVec3, vertex: u32, (field, views): (Option<&Field>, &[u8])) -> FieldVertex {
        let mut slots = FieldSlots::default();
        // Beside what a camera shows its picture ends pixel by pixel: what it lends need not end before, unless something hides the place
        // from another. Whom the list has no room for others stand for.
        let lends = |field: &Field, view: u8| field.lends_by_normals(vertex)[usize::from(view)] > 0.0;
        let sees = |field: &Field, view: u8| field.sight(vertex, usize::from(view));
        let goes_on = field.is_some_and(|field| {
            let is_hidden = |view: &u8| matches!(sees(field, *view), Sight::Hidden | Sight::Near);
            let is_lent = field.lends_by_normals(vertex).iter().any(|lent| *lent > 0.0);
            let is_listed = views.iter().any(|view| lends(field, *view));
            if is_lent { !is_listed } else { !views.iter().any(is_hidden) }
        });
        for (slot, view) in views.iter().enumerate() {
            let Some(field) = field else { break };
            let view = usize::from(*view);
            if goes_on {
                (slots.normals[slot], slots.fallback[slot]) = (1.0, 1.0);
                continue;
            }
            slots.ramps[slot] = field.trust(vertex, view);
            slots.normals[slot] = field.lends_by_normals(vertex)[view];
            slots.pixels_m[slot] = field.pixel_m(vertex, view);
            slots.fallback[slot] = field.falls_back_to(vertex)[view];
        }
        FieldVertex::new((at - self.origin_in_world).as_vec3(), self.groups.len() as u32, &slots)
    }

    /// Whether this is the mesh for at least these cameras.
    pub(super) fn serves(&self, mesh: &Mesh, cameras: &[Arc<Camera>]) -> bool {
        self.mesh_number == mesh.number && cameras.iter().all(|camera| self.place_of(camera).is_some())
    }

    /// Whether one surface may lie before another.
    pub(super) const fn may_overlap(&self) -> bool {
        self.may_overlap
    }

    /// Which of the field's views a camera is.
    pub(super) fn place_of(&self, camera: &Arc<Camera>) -> Option<usize> {
        self.cameras.iter().position(|known| Arc::ptr_eq(known, camera) || known == camera)
    }

    /// Where the field's views are.
    pub(super) fn eyes_in_world(&self) -> impl Iterator<Item = DVec3> {
        self.cameras.iter().map(|camera| camera.pose().position_in_world)
    }

    /// What is drawn together in one picture. A camera that is not of the picture keeps its place in lists, and is not drawn with.
    pub(super) fn batch(&self, drawing: &Drawing<'_>, batches: &mut Batches) {
        batches.begin(drawing.opened.len());
        let in_frame: Vec<Option<u32>> = self
            .cameras
            .iter()
            .map(|camera| (0..).zip(drawing.cameras).find(|(_, of)| *of == camera).map(|(place, _)| place))
            .collect();
        for group in &self.drawn {
            let is_this = |opened: &Opened| opened.surface == group.surface;
            let opened = drawing.opened.iter().position(is_this);
            let listed = &group.views[..group.views.len().min(drawing.most_cameras)];
            let places = || listed.iter().map(|view| in_frame[usize::from(*view)]);
            let is_any = places().any(|place| place.is_some());
            let mut slots = [0; FIELD_SLOTS];
            slots.iter_mut().zip(places()).for_each(|(slot, place)| *slot = place.unwrap_or(NOT_DRAWN));
            let of = |is_so: &dyn Fn(&super::camera_data::Camera) -> bool| {
                places().flatten().any(|place| is_so(&drawing.data[place as usize]))
            };
            let shading = Shading {
                n_cameras: if is_any { listed.len() } else { 0 },
                has_lenses: of(&super::camera_data::Camera::has_lens),
                has_gains: of(&super::camera_data::Camera::has_gain),
                has_levels: drawing.filtering == Filtering::Levels && is_any,
                has_texture: group.texture.is_some(),
                has_fields: is_any,
                ..Shading::default()
            };
            let first = batches.indices.len() as u32;
            batches.indices.extend_from_slice(&self.indices[group.indices.clone()]);
            batches.lists.push(CameraList::of(slots));
            let batch = Batch {
                shading,
                texture: group.texture,
                list: batches.lists.len() as u32 - 1,
                indices: first..batches.indices.len() as u32,
            };
            match opened {
                None => batches.opaque.push(batch),
                Some(place) => batches.opened[place].push(batch),
            }
        }
        // What is opaque lies before what is not, as one depth pass draws it.
        batches.opaque.sort_by_key(|batch| batch.indices.start);
    }
}

/// The cameras of a group by what they lend to its corners, the best first: at most as many as lists hold.
fn best<C: Iterator<Item = u32>>(bits: u64, field: Option<&Field>, corners: impl Fn() -> C) -> Vec<u8> {
    let lent = |view: u8| -> f64 {
        let of = |corner: u32| field.map_or(0.0, |field| field.lends_by_normals(corner)[usize::from(view)]);
        corners().map(|corner| f64::from(of(corner))).sum()
    };
    let mut ranked: Vec<(f64, u8)> =
        (0..64).filter(|view| bits & (1 << view) != 0).map(|view| (lent(view), view)).collect();
    ranked.sort_by(|(a, of_a), (b, of_b)| b.total_cmp(a).then(of_a.cmp(of_b)));
    ranked.truncate(FIELD_SLOTS);
    ranked.into_iter().map(|(_, view)| view).collect()
}
