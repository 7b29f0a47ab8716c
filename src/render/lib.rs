//! From a `SceneState`, a `Picture` to be drawn and a `Plan` to pixels, on the GPU.
//!
//! In: one immutable instant, where to look from, what to run. Out: an 8-bit sRGB picture and the passes' times.
//! Must not know of HTTP, encoders, threads or clocks. Points reach the GPU relative to an anchor (the eye, or where
//! the scene begins for one far away; subtracted in f64),
//! depth is reversed with the far plane at infinity, light is blended linearly.

pub mod gpu;

mod camera_data;
mod coplanar;
mod drawing;
mod effects;
mod error;
mod field_mesh;
mod found_hulls;
mod given_mesh;
mod hull_data;
mod hull_meshes;
mod hulls;
mod image_array;
mod lent_mesh;
mod mesh;
mod mesh_fields;
mod owner_data;
mod passes;
mod patches;
mod pending;
mod pieces;
mod planned;
mod prepare;
mod ready;
mod renderer;
mod sequences;
mod surface_distances;
mod surface_fields;
mod targets;
mod texture_store;

pub use drawing::{Drawing, Progress, Rendered, expected_pieces};
pub use effects::{EffectFilter, Filtered};
pub use error::RenderError;
pub use found_hulls::{FoundHull, FoundHulls};
pub use ready::MAX_READY_SCENES;
pub use renderer::{Renderer, view_limits};
pub use surface_distances::{FoundDistances, SurfaceDistances};
pub use surface_fields::{FieldsPicture, FoundFields, Reading, SurfaceFields};
pub use texture_store::TextureUse;
pub use videofields_picture::plan::{Picture, View, ViewLimits};

use crate::gpu::Mirror;

/// The passes in the order in which they run; only the planned ones do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Pictures that are new since the last frame, from YUV planes to sRGB layers.
    Yuv,
    /// What may hide surfaces from the cameras, where scene or camera changed.
    CameraDepth,
    /// Which faces of a mesh meet.
    FieldsTopology,
    /// Distances along a mesh.
    FieldsDistances,
    /// What every camera sees first of a mesh that changes.
    MeshDepths,
    /// Who sees its vertices, and how far it is from there to where that ends.
    MeshSight,
    /// What weights of it are made of, without steps.
    MeshSmooth,
    /// What it looks like from everywhere.
    MeshColors,
    /// What cameras lent to the mesh before.
    MeshCarry,
    /// How much each camera lends to its vertices.
    MeshWeights,
    /// How much each camera lends to the vertices of what stands still.
    Fields,
    /// All that stands still, with the cameras' backgrounds; a plain sky.
    Surface,
    /// A sky that is more than one colour, where nothing else was drawn.
    Sky,
    /// Entities as upright rectangles.
    Billboard,
    /// Entities as squares.
    Points,
    /// Surfaces of entities' hulls, by the rays of the picture's pixels.
    HullRays,
    /// The same by the faces of their silhouettes' cones, each trimmed by the other silhouettes.
    HullTrim,
    /// The same by layers of their cones' faces, counting what takes away behind each.
    HullPeel,
    /// The same by their outermost voxels.
    HullVoxels,
    /// What every camera sees of the hulls, as depth maps.
    HullDepths,
    /// Entities as hulls.
    Hull,
    /// Entities as meshes that change.
    ChangingMesh,
    /// Buildings that are open, over whom they hide; with billboards, within their pass.
    SeeThrough,
    /// How far what was drawn lies, where an effect asks.
    Distance,
    /// Another light on what was drawn.
    Relight,
    /// Light taken away where much stands around.
    Occlusion,
    /// Several pixels averaged into one.
    Average,
    /// One pixel made several.
    Enlarge,
    /// The finished picture as dots on paper.
    Stipple,
}

impl Pass {
    /// Name in plans, metrics and labels, and stem of its files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Yuv => "yuv",
            Self::CameraDepth => "camera_depth",
            Self::FieldsTopology => "fields_topology",
            Self::FieldsDistances => "fields_distances",
            Self::MeshDepths => "mesh_depths",
            Self::MeshSight => "mesh_sight",
            Self::MeshSmooth => "mesh_smooth",
            Self::MeshColors => "mesh_colors",
            Self::MeshCarry => "mesh_carry",
            Self::MeshWeights => "mesh_weights",
            Self::Fields => "fields",
            Self::Surface => "surface",
            Self::Sky => "sky",
            Self::Billboard => "billboard",
            Self::Points => "points",
            Self::HullRays => "hull_rays",
            Self::HullTrim => "hull_trim",
            Self::HullPeel => "hull_peel",
            Self::HullVoxels => "hull_voxels",
            Self::HullDepths => "hull_depths",
            Self::Hull => "hull",
            Self::ChangingMesh => "changing_mesh",
            Self::SeeThrough => "see_through",
            Self::Distance => "distance",
            Self::Relight => "relight",
            Self::Occlusion => "occlusion",
            Self::Average => "average",
            Self::Enlarge => "enlarge",
            Self::Stipple => "stipple",
        }
    }
}

/// Every Rust struct that mirrors a WGSL struct, for the test that holds them together.
#[must_use]
pub fn mirrors() -> Vec<Mirror> {
    let mut mirrors =
        vec![camera_data::View::MIRROR, camera_data::Camera::MIRROR, patches::CameraList::MIRROR];
    mirrors.extend([hull_data::HullFrame::MIRROR, hull_data::Hull::MIRROR, hull_data::HullView::MIRROR]);
    mirrors.extend(passes::mirrors());
    mirrors
}
