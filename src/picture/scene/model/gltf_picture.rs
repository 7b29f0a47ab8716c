//! Pictures of a glTF's materials: their bytes, and where they lie on triangles.

use super::MAX_POINTS;
use super::accessor::Elements;
use crate::scene::paint::{MOST_REPEATS, MappedTriangle, near_zero, repeats};
use crate::scene::texture::Wrap;
use glam::DVec2;
use gltf::texture::WrappingMode;
use gltf::{Document, Primitive, Semantic, Texture};

/// A picture of a model as a primitive shows it.
#[derive(Clone, Copy)]
pub(super) struct ShownPicture {
    /// Its place among the model's.
    pub(super) place: u16,
    pub(super) wraps: [Wrap; 2],
    /// Which of the primitive's sets of texture coordinates says where it lies.
    pub(super) set: u32,
}

/// What lies beyond a texture's edges.
pub(super) fn wraps_of(texture: &Texture<'_>) -> [Wrap; 2] {
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::Repeat => Wrap::Repeat,
    })
}

/// The bytes of an image: out of a buffer, or of what its URI leads to. From the JSON itself: the library takes on trust
/// that an image has the one or the other.
pub(super) fn image_bytes(
    document: &Document,
    image: usize,
    buffers: &[Vec<u8>],
    linked: impl FnOnce(&str) -> Result<Vec<u8>, String>,
) -> Result<Vec<u8>, String> {
    let image = document.as_json().images.get(image).ok_or("there is none")?;
    if let Some(view) = &image.buffer_view {
        let beyond = || "reaches beyond its buffer".to_owned();
        let view = document.views().nth(view.value()).ok_or_else(beyond)?;
        let buffer = buffers.get(view.buffer().index()).ok_or_else(beyond)?;
        let end = view.offset().checked_add(view.length()).ok_or_else(beyond)?;
        return buffer.get(view.offset()..end).map(<[u8]>::to_vec).ok_or_else(beyond);
    }
    linked(image.uri.as_deref().ok_or("neither `uri` nor `bufferView` is there")?)
}

/// Where a picture lies on a primitive's triangles.
pub(super) struct Covering<'a> {
    picture: ShownPicture,
    coordinates: Elements<'a>,
}

impl<'a> Covering<'a> {
    /// `None` where the primitive does not say where the picture lies: it is plain then.
    pub(super) fn new(
        picture: ShownPicture,
        primitive: &Primitive<'_>,
        buffers: &'a [Vec<u8>],
    ) -> Result<Option<Self>, String> {
        let Some(accessor) = primitive.get(&Semantic::TexCoords(picture.set)) else { return Ok(None) };
        let place = format!("/accessors/{}", accessor.index());
        let coordinates = Elements::new(&accessor, buffers, MAX_POINTS)?;
        if coordinates.width != 2 {
            return Err(format!("{place}: texture coordinates are two numbers each"));
        }
        Ok(Some(Self { picture, coordinates }))
    }

    /// What covers a triangle.
    pub(super) fn triangle(&self, corners: [u32; 3]) -> Result<MappedTriangle, String> {
        let beyond = corners.into_iter().find(|corner| *corner as usize >= self.coordinates.len());
        if let Some(corner) = beyond {
            return Err(format!("vertex {corner} has no texture coordinate"));
        }
        let corners = corners.map(|corner| {
            let number = |axis: usize| self.coordinates.number(corner as usize, axis);
            DVec2::new(number(0), number(1))
        });
        if !corners.iter().all(|corner| corner.is_finite()) {
            return Err("a texture coordinate is not finite".to_owned());
        }
        let near = near_zero(corners);
        // What does not repeat stays where it is.
        let [s, t] = self.picture.wraps.map(|wrap| wrap != Wrap::Clamp);
        let small: [DVec2; 3] = std::array::from_fn(|idx| {
            let axis = |repeats: bool, near: f64, far: f64| if repeats { near } else { far };
            DVec2::new(axis(s, near[idx].x, corners[idx].x), axis(t, near[idx].y, corners[idx].y))
        });
        let farthest = small.iter().map(|corner| corner.abs().max_element()).fold(repeats(&small), f64::max);
        if farthest > 2.0 * MOST_REPEATS {
            return Err(format!(
                "its texture coordinates reach over {farthest:.0} pictures, at most {} are allowed",
                2.0 * MOST_REPEATS
            ));
        }
        let corners = small.map(|corner| corner.as_vec2().to_array());
        Ok(MappedTriangle { picture: Some(self.picture.place), corners })
    }
}
