//! Recorded pictures as they may be given out: what is hidden filled, and people who may not be seen made unrecognisable.

use super::past::Past;
use super::privacy::{Privacies, Privacy};
use crate::archive::Redraw;
use crate::clock::Timestamp;
use crate::frame::{Blur, BlurRegion, BufferPool, CameraId, YuvImage};
use crate::ingest::recorded_as_jpeg;
use crate::media::EncodedFrame;
use crate::segment::Blob;
use crate::store::digest_hex;
use crate::timeline::Observation;
use crate::track::FootPath;
use glam::DVec2;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};

/// How far from where a track stood a blob's foot may be and still be it, share of the blob's height.
const SAME_SHARE: f64 = 0.35;

/// How far beyond a track's ends an instant may lie, nanoseconds: frames are looked back at a little apart.
const BESIDE_NANOS: i64 = 200_000_000;

/// Somebody who is to be seen: where they stood, in the texture, in order of time.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    /// What the manifest names them by.
    pub(super) name: Value,
    pub(super) path: Vec<(Timestamp, DVec2)>,
}

impl Shown {
    /// Of a track as it is kept; none where its path cannot be read.
    pub(super) fn of(name: Value, began_at: Timestamp, path: &[u8]) -> Option<Self> {
        let points = FootPath::decode(path).ok()?;
        let placed =
            points.iter().map(|point| (point.at(began_at), DVec2::from_array(point.foot_in_texture())));
        Some(Self { name, path: placed.collect() })
    }

    /// Where they stood at an instant, if they were there.
    fn at(&self, at: Timestamp) -> Option<DVec2> {
        let (first, last) = (self.path.first()?, self.path.last()?);
        if at.nanos_since(first.0) < -BESIDE_NANOS || at.nanos_since(last.0) > BESIDE_NANOS {
            return None;
        }
        let next = self.path.partition_point(|(time, _)| *time <= at);
        match (next.checked_sub(1).map(|before| self.path[before]), self.path.get(next)) {
            (Some((from, start)), Some((to, end))) => {
                let share = at.nanos_since(from) as f64 / to.nanos_since(from).max(1) as f64;
                Some(start.lerp(*end, share))
            }
            (Some((_, place)), None) => Some(place),
            (None, next) => next.map(|(_, place)| *place),
        }
    }
}

/// One camera's recorded pictures as they may be given out.
pub(super) struct Redrawn {
    camera: CameraId,
    /// Gone once the daemon stops.
    past: Weak<Past>,
    privacies: Arc<Privacies>,
    /// Of whom people are blurred all the same, if they are at all.
    shown: Option<Vec<Shown>>,
    /// What named all that was hidden when it was asked for.
    hidden_by: String,
    pool: Arc<BufferPool>,
    n_frames: AtomicU64,
    n_whole: AtomicU64,
}

impl Redrawn {
    /// Blurs everybody but those `shown`, if that is there.
    pub(super) fn new(
        camera: CameraId,
        past: &Arc<Past>,
        privacies: &Arc<Privacies>,
        shown: Option<Vec<Shown>>,
    ) -> Self {
        let hidden_by = hidden_by(&privacies.of_known(&camera).now());
        Self {
            camera,
            hidden_by,
            past: Arc::downgrade(past),
            privacies: Arc::clone(privacies),
            shown,
            pool: BufferPool::new(2),
            n_frames: AtomicU64::new(0),
            n_whole: AtomicU64::new(0),
        }
    }

    /// What is blurred of a picture of which it is known what moves: all that does, but those `shown`.
    fn blur(seen: &Observation, shown: &[Shown]) -> Blur {
        let size = DVec2::new(seen.frame.image.width().into(), seen.frame.image.height().into());
        let places: Vec<DVec2> = shown.iter().filter_map(|who| who.at(seen.frame.timestamp)).collect();
        // Each of those shown is the one blob that is nearest to where they stood.
        let nearest = |place: &DVec2| {
            let away = |blob: &Blob| DVec2::from_array(blob.foot_in_image).distance(*place * size);
            let all = seen.blobs.iter().enumerate().map(|(idx, blob)| (idx, away(blob), blob.rect.height));
            let near = all.min_by(|(_, a, _), (_, b, _)| a.total_cmp(b))?;
            (near.1 <= SAME_SHARE * f64::from(near.2)).then_some(near.0)
        };
        let left: Vec<usize> = places.iter().filter_map(nearest).collect();
        let others = seen.blobs.iter().enumerate().filter(|(idx, _)| !left.contains(idx));
        Blur::Parts(others.map(|(_, blob)| region(blob)).collect())
    }

    fn drawn(&self, past: &Past, at: Timestamp) -> Result<(Arc<YuvImage>, Timestamp), String> {
        let gone = || "it is not recorded any more".to_owned();
        let Some(shown) = &self.shown else {
            let found = past.frame_at(&self.camera, at).ok_or_else(gone)?;
            let found = found.map_err(|error| error.to_string())?;
            return Ok((found.image, found.timestamp));
        };
        let found = past.looked_at(&self.camera, at).ok_or_else(gone)?;
        let (seen, is_known) = found.map_err(|error| error.to_string())?;
        let blur = if is_known {
            Self::blur(&seen, shown)
        } else {
            self.n_whole.fetch_add(1, Ordering::Relaxed);
            Blur::Whole
        };
        let image = seen.frame.image.blurred_of(&self.pool, &blur);
        Ok((Arc::new(image), seen.frame.timestamp))
    }
}

fn region(blob: &Blob) -> BlurRegion {
    BlurRegion { left_top: [blob.rect.x, blob.rect.y], size_px: [blob.rect.width, blob.rect.height] }
}

impl Redraw for Redrawn {
    fn next_after(
        &self,
        after: Timestamp,
        to: Timestamp,
    ) -> Result<Option<(EncodedFrame, Timestamp)>, String> {
        let past = self.past.upgrade().ok_or("the daemon stops")?;
        let next = past.recorded_after(&self.camera, after).map_err(|error| error.to_string())?;
        let Some(at) = next.filter(|at| *at < to) else { return Ok(None) };
        let (image, shown_at) = self.drawn(&past, at)?;
        if shown_at != at {
            return Err(format!("the picture of {at} is not to be had"));
        }
        // Part of it under other zones would be named wrongly.
        if hidden_by(&self.privacies.of_known(&self.camera).now()) != self.hidden_by {
            return Err("the privacy zones were changed meanwhile: ask again".to_owned());
        }
        self.n_frames.fetch_add(1, Ordering::Relaxed);
        let frame = recorded_as_jpeg(&image).ok_or("a picture is too large")?;
        Ok(Some((frame, at)))
    }

    fn told(&self) -> Value {
        let privacy = self.privacies.of_known(&self.camera).now();
        let names = |shown: &Vec<Shown>| shown.iter().map(|who| who.name.clone()).collect::<Vec<_>>();
        json!({
            "codec": "image/jpeg",
            "zones": privacy.zones.iter().map(|zone| &zone.name).collect::<Vec<_>>(),
            "hidden_by": self.hidden_by,
            "blurs_people": self.shown.is_some(),
            "except": self.shown.as_ref().map(names),
            "frames": self.n_frames.load(Ordering::Relaxed),
            "frames_blurred_whole": self.n_whole.load(Ordering::Relaxed),
        })
    }
}

/// What names all that hides: another set has another.
pub(super) fn hidden_by(privacy: &Privacy) -> String {
    let zones: Vec<_> = privacy.zones.iter().map(|zone| &zone.polygon).collect();
    let lifted: Vec<_> = privacy.lifted.iter().map(|of| (&of.zone.polygon, of.until.as_nanos())).collect();
    digest_hex(json!([zones, lifted]).to_string().as_bytes())
}
