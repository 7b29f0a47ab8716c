//! Recorded pictures as they may be given out: what is hidden filled, and people who may not be seen made unrecognisable.

use super::blurring::{Numbers, Shown, blur_of};
use super::past::Past;
use super::privacy::{Privacies, Privacy};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use videofields_recording::archive::Redraw;
use videofields_recording::ingest::recorded_as_jpeg;
use videofields_recording::media::EncodedFrame;
use videofields_recording::store::digest_hex;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{Blur, BufferPool, CameraId, YuvImage};

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
            // Of a past that is looked at anew the tracks' numbers are others.
            blur_of(&seen, shown, Numbers::Others).0
        } else {
            self.n_whole.fetch_add(1, Ordering::Relaxed);
            Blur::Whole
        };
        let image = seen.frame.image.blurred_of(&self.pool, &blur);
        Ok((Arc::new(image), seen.frame.timestamp))
    }
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
