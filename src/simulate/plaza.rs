//! The plaza: 40 m x 30 m of paving between a hall and a café, three figures on their rounds, three cameras.
//!
//! Owns the numbers of this world and nothing else. All figures walk one lap in the world's period, so a clip of
//! that length loops without a seam.

use super::effects::{CastShadows, Effects, Entries};
use super::figure::{Clothes, Figure};
use super::light::Light;
use super::paint::{Bed, BoxPaint, Facade, GroundPaint, Meadow, Paving, srgb};
use super::path::ClosedPath;
use super::solids::Solids;
use super::world::{World, WorldCamera, WorldView};
use crate::geometry::{Distortion, GroundPolygon, OrientedBox, SurfaceError, Surfaces};
use glam::{DVec2, DVec3};
use std::sync::Arc;

const PERIOD_SECS: f64 = 24.0;
const SKY_SRGB: [u8; 3] = [0x9c, 0xc4, 0xe6];

impl World {
    /// The plaza.
    ///
    /// # Panics
    /// Never: its numbers are constant and a test makes it.
    #[must_use]
    pub fn plaza() -> Self {
        let (surfaces, parts) = surfaces().expect("the plaza's own surfaces are whole");
        let mut world = Self {
            id: "plaza",
            name: "Plaza",
            period_secs: PERIOD_SECS,
            solids: Solids::new(surfaces, None),
            ground_paints: ground_paints(),
            terrain_paint: None,
            box_paints: Vec::new(),
            box_ids: Vec::new(),
            box_yaws_deg: Vec::new(),
            figures: figures(),
            light: light(),
            effects: Effects { cast_shadows: Some(CastShadows::STILL), ..Effects::default() },
            entries: Arc::new(Entries::default()),
            sky_srgb: SKY_SRGB,
            sky: srgb(u32::from_be_bytes([0, SKY_SRGB[0], SKY_SRGB[1], SKY_SRGB[2]])),
            cameras: cameras(),
            // From the south, above the hedge: both fronts, the ring, and most of the figures' paths.
            view: WorldView { eye_m: [-6.0, -19.0, 7.0], target_m: [0.5, 1.0, 0.5], fov_deg: 45.0 },
        };
        for part in parts {
            world.box_ids.push(part.id);
            world.box_yaws_deg.push(part.yaw_deg);
            world.box_paints.push(part.paint);
        }
        world
    }
}

fn light() -> Light {
    Light {
        // Afternoon: the sun stands 46 degrees high in the south-west.
        to_sun: DVec3::new(-0.62, -0.46, 0.80).normalize(),
        sun: DVec3::new(1.00, 0.95, 0.86) * 0.95,
        sky: DVec3::new(0.30, 0.35, 0.43),
        bounce: DVec3::new(0.19, 0.175, 0.15),
        lamps: Vec::new(),
    }
}

/// A box with what geometry does not know of it.
struct BoxPart {
    id: &'static str,
    yaw_deg: f64,
    paint: BoxPaint,
}

/// Half extents of the paving and of everything inside the hedge, metres.
const PAVING_HALF: DVec2 = DVec2::new(20.0, 15.0);
const GARDEN_HALF: DVec2 = DVec2::new(27.0, 22.0);

fn surfaces() -> Result<(Surfaces, Vec<BoxPart>), SurfaceError> {
    let rectangle = |low: DVec2, high: DVec2| {
        let corners = vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        GroundPolygon::new(corners, 0.0)
    };
    let (inner, outer) = (PAVING_HALF, GARDEN_HALF);
    let ground = vec![
        rectangle(-inner, inner)?,
        rectangle(-outer, DVec2::new(outer.x, -inner.y))?,
        rectangle(DVec2::new(-outer.x, inner.y), outer)?,
        rectangle(DVec2::new(-outer.x, -inner.y), DVec2::new(-inner.x, inner.y))?,
        rectangle(DVec2::new(inner.x, -inner.y), DVec2::new(outer.x, inner.y))?,
    ];
    let mut boxes = Vec::new();
    let mut parts = Vec::new();
    let mut add = |id, center: DVec2, size: DVec3, yaw_deg: f64, paint| {
        boxes.push(OrientedBox::new(center.extend(size.z * 0.5), size, yaw_deg.to_radians())?);
        parts.push(BoxPart { id, yaw_deg, paint });
        Ok(())
    };
    add("hall", DVec2::new(-8.5, 9.5), DVec3::new(15.0, 6.0, 6.4), 0.0, BoxPaint::Facade(Box::new(hall())))?;
    add("cafe", DVec2::new(11.0, 3.0), DVec3::new(6.4, 4.8, 4.0), 18.0, BoxPaint::Facade(Box::new(cafe())))?;
    let leaves = srgb(0x4a6b38);
    for (id, direction) in [
        ("hedge-south", -DVec2::Y),
        ("hedge-east", DVec2::X),
        ("hedge-north", DVec2::Y),
        ("hedge-west", -DVec2::X),
    ] {
        let across = direction.perp().abs();
        // North and south run the whole width, east and west fit between them.
        let half =
            across * (GARDEN_HALF + if direction.y == 0.0 { -0.5 } else { 0.5 }) + direction.abs() * 0.5;
        let size = (half * 2.0).extend(2.1);
        add(id, direction * GARDEN_HALF, size, 0.0, BoxPaint::Hedge { leaves })?;
    }
    Ok((Surfaces { ground, boxes }, parts))
}

fn ground_paints() -> Vec<GroundPaint> {
    let meadow = |stripe_m| Meadow { grass: srgb(0x789650), stripe_m };
    let paving = Paving {
        slab: srgb(0xb4ac9e),
        band: srgb(0x867c72),
        ring_light: srgb(0xd6c9ac),
        ring_dark: srgb(0x9a5c48),
        kerb: srgb(0xcfcabe),
        lawn: meadow(0.9),
        slab_m: 1.25,
        band_spacing_m: 5.0,
        ring_center: DVec2::new(-0.5, -2.5),
        beds: vec![
            Bed { center: DVec2::new(-12.8, -9.0), half_size: DVec2::new(4.2, 2.6), corner_m: 1.6 },
            Bed { center: DVec2::new(11.5, -8.8), half_size: DVec2::new(4.6, 2.4), corner_m: 1.6 },
        ],
    };
    let garden = GroundPaint::Meadow(meadow(1.6));
    vec![GroundPaint::Paving(paving), garden.clone(), garden.clone(), garden.clone(), garden]
}

fn hall() -> Facade {
    Facade {
        wall: srgb(0xd9b88c),
        trim: srgb(0xece3d0),
        glass: srgb(0x4a5c6c),
        door: srgb(0x4a3328),
        roof: srgb(0x9c543c),
        storey_m: 3.0,
        bay_m: 2.1,
        window_half_m: DVec2::new(0.52, 0.78),
        window_middle_m: 1.75,
        door_walls: vec![0, 1],
        awning: None,
    }
}

fn cafe() -> Facade {
    Facade {
        wall: srgb(0x8fa3a0),
        trim: srgb(0xe4e2d8),
        glass: srgb(0x546670),
        door: srgb(0x6b2f2a),
        roof: srgb(0x707478),
        storey_m: 4.0,
        bay_m: 2.1,
        window_half_m: DVec2::new(0.78, 0.82),
        window_middle_m: 1.55,
        door_walls: vec![3],
        awning: Some((3.0, srgb(0xb83a32), srgb(0xeee6d8))),
    }
}

fn figures() -> Vec<Figure> {
    let path =
        |corners: &[[f64; 2]]| ClosedPath::new(corners.iter().map(|c| DVec2::from_array(*c)).collect());
    vec![
        Figure {
            name: "red",
            // Round the café.
            path: path(&[
                [6.2, -1.2],
                [11.0, -1.6],
                [15.6, 0.8],
                [16.4, 4.6],
                [13.6, 7.6],
                [8.8, 7.3],
                [5.8, 3.6],
            ]),
            start: 0.1,
            n_strides: 27,
            height_m: 1.74,
            clothes: Clothes {
                jacket: srgb(0xc8302c),
                trousers: srgb(0x2c344c),
                shoes: srgb(0x242222),
                skin: srgb(0xd8a888),
                hair: srgb(0x3c2a20),
                backpack: None,
            },
        },
        Figure {
            name: "yellow",
            // Round the compass rose, the other way.
            path: path(&[
                [-6.0, -2.0],
                [-4.2, 1.8],
                [0.4, 2.6],
                [4.0, -0.2],
                [4.2, -5.0],
                [0.6, -7.8],
                [-4.4, -6.4],
            ]),
            start: 0.3,
            n_strides: 27,
            height_m: 1.66,
            clothes: Clothes {
                jacket: srgb(0xe6b42a),
                trousers: srgb(0x3a3a3e),
                shoes: srgb(0x6a3c28),
                skin: srgb(0x8a5c44),
                hair: srgb(0x1c1816),
                backpack: None,
            },
        },
        Figure {
            name: "blue",
            // Along the hall's front, round its corner, and back.
            path: path(&[
                [-9.6, 4.8],
                [-4.6, 5.0],
                [0.4, 5.6],
                [1.4, 9.4],
                [4.0, 10.4],
                [5.2, 6.6],
                [1.6, 3.8],
                [-4.4, 3.2],
                [-9.4, 2.6],
                [-11.2, 3.8],
            ]),
            start: 0.62,
            n_strides: 31,
            height_m: 1.80,
            clothes: Clothes {
                jacket: srgb(0x2c5cb4),
                trousers: srgb(0xa08c6c),
                shoes: srgb(0xd8d4cc),
                skin: srgb(0xe0b498),
                hair: srgb(0x8a6a3c),
                backpack: Some(srgb(0x3c4a30)),
            },
        },
    ]
}

fn cameras() -> Vec<WorldCamera> {
    let camera = |id, name, eye: [f64; 3], target: [f64; 3], fov_x_deg: f64, distortion| WorldCamera {
        id,
        name,
        eye: DVec3::from_array(eye),
        target: DVec3::from_array(target),
        fov_x_rad: fov_x_deg.to_radians(),
        distortion,
    };
    // A mild barrel: 7 % at the corners of the north camera's picture, which bows the hedge visibly.
    let barrel = Distortion::BrownConrady { coefficients: [-0.10, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    vec![
        camera("west", "South-west corner", [-15.5, -11.5, 6.4], [-0.6, -0.2, 0.3], 62.0, Distortion::None),
        camera("east", "South-east corner", [16.0, -12.0, 6.0], [0.0, 0.2, 0.3], 62.0, Distortion::None),
        camera("north", "North side", [4.6, 13.6, 7.2], [0.4, -0.6, 0.0], 74.0, barrel),
    ]
}
