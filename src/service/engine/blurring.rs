//! People who may not be seen in a picture: who is asked to be seen all the same, and what is blurred of each camera.
//!
//! In: what cameras saw with what the segmentation found in it, and tracks of those who may be seen. Out: parts of each
//! camera's picture that are blurred, before anything is drawn of it.

use super::EngineError;
use super::picture::Observations;
use super::shared::Shared;
use glam::DVec2;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::scene::Scene;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{Fault, Gatherer};
use videofields_vision::frame::{Blur, BlurRegion, BufferPool, CameraId, Mask, YuvImage};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{Blob, MOVING, PixelRect};
use videofields_vision::track::{FootPath, Track};

/// People of one picture or export who are not blurred.
const MAX_EXCEPT: usize = 64;

/// Tracks of one instant among which one is sought.
pub(super) const MAX_TRACKS: u32 = 1000;

/// How far from where a track stood a blob's foot may be and still be it, share of the blob's height.
const SAME_SHARE: f64 = 0.35;

/// How far beyond a track's ends an instant may lie, nanoseconds: frames are looked back at a little apart.
const BESIDE_NANOS: i64 = 200_000_000;

/// Who is made unrecognisable.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BlurAsked {
    /// Tracks of those who are not, at most 64.
    pub except: Vec<TrackAsked>,
}

/// A track as a search for tracks names it.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrackAsked {
    /// The camera's id.
    pub camera: String,
    /// Its number.
    pub track: u64,
    /// A time at which it was there, such as its beginning: numbers begin anew with every run of a camera.
    pub at: String,
}

impl BlurAsked {
    /// Notes what is wrong with it, whatever there is to be seen.
    pub(super) fn check(&self, gatherer: &mut Gatherer) {
        if self.except.len() > MAX_EXCEPT {
            gatherer.fault("/blur_people/except", format!("at most {MAX_EXCEPT}"));
        }
        for (idx, who) in self.except.iter().enumerate() {
            if let Err(error) = who.at.parse::<Timestamp>() {
                gatherer.fault(format!("/blur_people/except/{idx}/at"), error.to_string());
            }
        }
    }

    /// Refuses exceptions of cameras that are not among those `what`.
    pub(super) fn check_cameras(
        &self,
        is_there: impl Fn(&str) -> bool,
        what: &str,
    ) -> Result<(), EngineError> {
        let fault = |idx: usize| {
            let message = format!("is none of the cameras that are {what}");
            Fault::new(format!("/blur_people/except/{idx}/camera"), message)
        };
        let all = self.except.iter().enumerate();
        let faults: Vec<Fault> =
            all.filter(|(_, who)| !is_there(&who.camera)).map(|(idx, _)| fault(idx)).collect();
        if faults.is_empty() { Ok(()) } else { Err(EngineError::Faults(faults)) }
    }
}

/// That a camera has no such track.
pub(super) fn unknown_track(idx: usize, who: &TrackAsked) -> EngineError {
    let message = format!("camera {} has no track {} of that time", who.camera, who.track);
    EngineError::Faults(vec![Fault::new(format!("/blur_people/except/{idx}"), message)])
}

/// Somebody who is to be seen: where they stood, in the texture, in order of time.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    /// What a manifest names them by.
    pub(super) name: Value,
    pub(super) path: Vec<(Timestamp, DVec2)>,
    /// The track's number in what memory holds, and when it began.
    pub(super) followed: Option<(u64, Timestamp)>,
}

impl Shown {
    /// Of a track as it is kept; none where its path cannot be read.
    pub(super) fn of(name: Value, began_at: Timestamp, path: &[u8]) -> Option<Self> {
        let points = FootPath::decode(path).ok()?;
        let placed =
            points.iter().map(|point| (point.at(began_at), DVec2::from_array(point.foot_in_texture())));
        Some(Self { name, path: placed.collect(), followed: None })
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

    fn is(&self, track: &Track) -> bool {
        self.followed == Some((track.id, track.first_seen))
    }

    /// Which blob shows them.
    fn blob(&self, seen: &Observation, numbers: Numbers) -> Option<usize> {
        if numbers == Numbers::Own
            && let Some(track) = seen.tracks.iter().find(|track| self.is(track))
        {
            return track.blob_idx.map(|idx| idx as usize);
        }
        // The one that is nearest to where they stood.
        let size = DVec2::new(seen.frame.image.width().into(), seen.frame.image.height().into());
        let place = self.at(seen.frame.timestamp)? * size;
        let away = |blob: &Blob| DVec2::from_array(blob.foot_in_image).distance(place);
        let all = seen.blobs.iter().enumerate().map(|(idx, blob)| (idx, away(blob), blob.rect.height));
        let near = all.min_by(|(_, a, _), (_, b, _)| a.total_cmp(b))?;
        (near.1 <= SAME_SHARE * f64::from(near.2)).then_some(near.0)
    }
}

/// Side of the squares by which moving pixels outside of all blobs are gathered, pixels.
const CELL_PX: u32 = 16;

/// Whether the tracks of an observation have the numbers under which they are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbers {
    Own,
    /// It was looked at again: whatever is followed there means nothing.
    Others,
}

/// What is blurred of a picture of which it is known what moves: all that does, but those `shown`; and how many of these are
/// there.
pub(super) fn blur_of(seen: &Observation, shown: &[Shown], numbers: Numbers) -> (Blur, usize) {
    let left: Vec<usize> = shown.iter().filter_map(|who| who.blob(seen, numbers)).collect();
    let others = seen.blobs.iter().enumerate().filter(|(idx, _)| !left.contains(idx));
    let mut parts: Vec<BlurRegion> = others.map(|(_, blob)| region(&blob.rect)).collect();
    if numbers == Numbers::Own {
        // As large as they are, not as what shows of them; and who stands so still that nothing is found, or shares a blob.
        let others = seen.tracks.iter().filter(|track| !shown.iter().any(|who| who.is(track)));
        let known = others.map(|track| region(&track.rect)).filter(|part| !parts.contains(part));
        let known: Vec<_> = known.collect();
        parts.extend(known);
    }
    parts.extend(loose_parts(seen));
    (Blur::Parts(parts), left.len())
}

/// Returns rectangles around the moving pixels that lie in no blob's rectangle: pieces that are too small for a blob.
fn loose_parts(seen: &Observation) -> Vec<BlurRegion> {
    let labels = &*seen.labels;
    let is_in = |rect: &PixelRect, x: u32, y: u32| {
        (rect.x..rect.x + rect.width).contains(&x) && (rect.y..rect.y + rect.height).contains(&y)
    };
    let mut is_loose = vec![false; labels.width.div_ceil(CELL_PX) as usize];
    let mut parts = Vec::new();
    for top in (0..labels.height).step_by(CELL_PX as usize) {
        let bottom = (top + CELL_PX).min(labels.height);
        is_loose.fill(false);
        for y in top..bottom {
            let moving = (0..).zip(labels.row(y)).filter(|(_, label)| **label == MOVING);
            for (x, _) in moving.filter(|(x, _)| !seen.blobs.iter().any(|blob| is_in(&blob.rect, *x, y))) {
                is_loose[(x / CELL_PX) as usize] = true;
            }
        }
        let mut left = 0;
        for cells in is_loose.chunk_by(|one, other| one == other) {
            let right = (left + cells.len() as u32 * CELL_PX).min(labels.width);
            if cells[0] {
                parts.push(BlurRegion { left_top: [left, top], size_px: [right - left, bottom - top] });
            }
            left = right;
        }
    }
    parts
}

const fn region(rect: &PixelRect) -> BlurRegion {
    BlurRegion { left_top: [rect.x, rect.y], size_px: [rect.width, rect.height] }
}

/// What of one camera's picture is blurred.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraBlur {
    /// The camera.
    pub camera: CameraId,
    /// What of it.
    pub blur: Blur,
    /// How many who were found there are seen all the same.
    pub n_shown: usize,
}

impl CameraBlur {
    /// A picture of the camera in which nobody can be told who may not be.
    #[must_use]
    pub fn blurred(&self, image: &YuvImage) -> Arc<YuvImage> {
        Arc::new(image.blurred_of(&BufferPool::new(1), &self.blur))
    }

    /// Blurs people as `blurs` have it in all that the cameras of a state saw. Nobody is told apart in it any more: whoever is a rectangle
    /// must not be cut to their outline again.
    pub(super) fn apply_to(blurs: &[Self], state: &mut SceneState) {
        state.forget_owners();
        for camera in &mut state.cameras {
            camera.observation = Self::applied(blurs, &camera.id, &camera.observation);
        }
    }

    /// What a camera saw, with people blurred as `blurs` have it before anything is drawn of it: in the frame and in the
    /// background, which may hold what is left of them. Whom a mask cuts out is a rectangle then, since an outline tells who
    /// somebody is.
    fn applied(blurs: &[Self], camera: &CameraId, seen: &Observation) -> Observation {
        let unknown = || Self { camera: camera.clone(), blur: Blur::Whole, n_shown: 0 };
        let own = blurs.iter().find(|of| of.camera == *camera).cloned().unwrap_or_else(unknown);
        let mut hidden = seen.clone();
        hidden.frame.image = own.blurred(&seen.frame.image);
        hidden.background = match Arc::ptr_eq(&seen.background, &seen.frame.image) {
            true => Arc::clone(&hidden.frame.image),
            false => own.blurred(&seen.background),
        };
        if let Blur::Parts(parts) = &own.blur
            && !parts.is_empty()
        {
            hidden.soft_mask = filled(&seen.soft_mask, parts, u8::MAX);
            hidden.labels = filled(&seen.labels, parts, MOVING);
        }
        hidden
    }
}

/// A mask in which these rectangles are `value`.
fn filled(mask: &Mask, parts: &[BlurRegion], value: u8) -> Arc<Mask> {
    let mut mask = mask.clone();
    let (width, height) = (mask.width, mask.height);
    for part in parts {
        let [left, top] = [part.left_top[0].min(width), part.left_top[1].min(height)];
        let right = left.saturating_add(part.size_px[0]).min(width);
        for y in top..top.saturating_add(part.size_px[1]).min(height) {
            let row = y as usize * width as usize;
            mask.data[row + left as usize..row + right as usize].fill(value);
        }
    }
    Arc::new(mask)
}

impl Shared {
    /// What is blurred of each camera in a picture of `scene`, of which they `saw` that.
    ///
    /// # Errors
    /// [`EngineError::Faults`] where somebody is excepted who is not known.
    pub(super) fn blurs(
        &self,
        asked: &BlurAsked,
        scene: &Scene,
        saw: &Observations,
    ) -> Result<Arc<[CameraBlur]>, EngineError> {
        asked.check_cameras(|id| scene.cameras.iter().any(|member| member.id.as_str() == id), "shown")?;
        let shown = self.shown(asked)?;
        Ok(saw.iter().map(|(_, seen)| self.blur_seen(seen, &shown)).collect())
    }

    /// What is blurred of what one camera saw.
    ///
    /// # Errors
    /// As [`Self::blurs`].
    pub(super) fn blur_one(&self, seen: &Observation, asked: &BlurAsked) -> Result<CameraBlur, EngineError> {
        asked.check_cameras(|id| seen.frame.camera.as_str() == id, "shown")?;
        Ok(self.blur_seen(seen, &self.shown(asked)?))
    }

    fn blur_seen(&self, seen: &Observation, shown: &[(CameraId, Shown)]) -> CameraBlur {
        let camera = seen.frame.camera.clone();
        // Where nothing was looked for a picture is its own background.
        if Arc::ptr_eq(&seen.background, &seen.frame.image) {
            return CameraBlur { camera, blur: Blur::Whole, n_shown: 0 };
        }
        let kept = self.camera(camera.as_str()).and_then(|entry| {
            entry.timeline.at(seen.frame.timestamp).map_err(|error| EngineError::Internal(error.to_string()))
        });
        let is_kept = kept.is_ok_and(|kept| Arc::ptr_eq(&kept.frame.image, &seen.frame.image));
        let numbers = if is_kept { Numbers::Own } else { Numbers::Others };
        let own: Vec<Shown> =
            shown.iter().filter(|(of, _)| *of == camera).map(|(_, who)| who.clone()).collect();
        let (blur, n_shown) = blur_of(seen, &own, numbers);
        CameraBlur { camera, blur, n_shown }
    }

    /// Who may be seen, from memory or as it was kept. Blocks for a question of the database for each.
    fn shown(&self, asked: &BlurAsked) -> Result<Vec<(CameraId, Shown)>, EngineError> {
        let mut gatherer = Gatherer::default();
        asked.check(&mut gatherer);
        let faults = gatherer.into_faults();
        if !faults.is_empty() {
            return Err(EngineError::Faults(faults));
        }
        let all = asked.except.iter().enumerate();
        all.map(|(idx, who)| self.shown_one(who)?.ok_or_else(|| unknown_track(idx, who))).collect()
    }

    fn shown_one(&self, who: &TrackAsked) -> Result<Option<(CameraId, Shown)>, EngineError> {
        let entry = self.camera(&who.camera)?;
        let at = who.at.parse::<Timestamp>().unwrap_or_default();
        let followed = entry.timeline.at(at).ok().and_then(|seen| {
            let track = seen.tracks.iter().find(|track| track.id == who.track)?;
            Some((track.id, track.first_seen))
        });
        let name = json!(who);
        let stored = match &self.past {
            Some(past) => past
                .tracks(&entry.id, (at, at), None, MAX_TRACKS)
                .map_err(|error| EngineError::Unavailable(error.to_string()))?,
            None => Vec::new(),
        };
        let stored = stored.into_iter().find(|record| record.number == who.track);
        let stored = stored.and_then(|record| Shown::of(name.clone(), record.began_at, &record.path));
        let shown = match (stored, followed) {
            (None, None) => None,
            (Some(stored), followed) => Some(Shown { followed, ..stored }),
            (None, followed) => Some(Shown { name, path: Vec::new(), followed }),
        };
        Ok(shown.map(|shown| (entry.id.clone(), shown)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_picture::fuse::{OwnerMap, assemble};
    use videofields_picture::scene::{no_imports, parse};
    use videofields_vision::frame::{ColorMatrix, ColorRange, Frame};

    fn rect(x: u32, width: u32) -> PixelRect {
        PixelRect { x, y: 10, width, height: 20 }
    }

    fn blob(x: u32) -> Blob {
        let foot_in_image = [f64::from(x) + 4.0, 30.0];
        Blob { rect: rect(x, 8), area_px: 160, foot_in_image, is_truncated: false, contour: Arc::from([]) }
    }

    fn track(id: u64, x: u32, blob_idx: Option<u32>) -> Track {
        Track {
            id,
            rect: rect(x, 8),
            blob_idx,
            foot_in_image: [f64::from(x) + 4.0, 30.0],
            velocity_px_per_sec: [0.0; 2],
            first_seen: Timestamp::from_nanos(5),
            last_seen: Timestamp::from_nanos(9),
            is_in_group: false,
            still_since: None,
        }
    }

    /// Two blobs that are followed, and somebody who stands so still that nothing is found.
    fn seen() -> Observation {
        let image = |luma| {
            let image = YuvImage::filled(64, 48, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
            Arc::new(image)
        };
        let mask = Arc::new(Mask::filled(64, 48, 0));
        let (camera, timestamp) = (CameraId::new("north").unwrap(), Timestamp::from_nanos(9));
        Observation {
            frame: Frame { camera, timestamp, number: 0, image: image(90) },
            soft_mask: Arc::clone(&mask),
            labels: mask,
            background: image(60),
            blobs: Arc::from([blob(4), blob(20)]),
            tracks: Arc::from([track(1, 4, Some(0)), track(2, 20, Some(1)), track(3, 44, None)]),
        }
    }

    fn columns(blur: &Blur) -> Vec<u32> {
        let Blur::Parts(parts) = blur else { panic!("{blur:?}") };
        parts.iter().map(|part| part.left_top[0]).collect()
    }

    fn followed(id: u64) -> Shown {
        Shown { name: Value::Null, path: Vec::new(), followed: Some((id, Timestamp::from_nanos(5))) }
    }

    #[test]
    fn everybody_is_blurred_who_is_found_or_followed_but_those_who_may_be_seen() {
        let seen = seen();
        let (blur, n_shown) = blur_of(&seen, &[], Numbers::Own);
        assert_eq!((columns(&blur), n_shown), (vec![4, 20, 44], 0));
        let (blur, n_shown) = blur_of(&seen, &[followed(2)], Numbers::Own);
        assert_eq!((columns(&blur), n_shown), (vec![4, 44], 1));
        // The same number of another run is somebody else.
        let other = Shown { followed: Some((2, Timestamp::from_nanos(6))), ..followed(2) };
        assert_eq!(columns(&blur_of(&seen, &[other], Numbers::Own).0), [4, 20, 44]);
        // Whoever shares a blob with one who may be seen is blurred there.
        let shared =
            Observation { tracks: Arc::from([track(1, 4, Some(0)), track(2, 6, Some(0))]), ..seen.clone() };
        assert_eq!(columns(&blur_of(&shared, &[followed(1)], Numbers::Own).0), [20, 6]);
        // Numbers of what is looked at again mean nothing: then the place counts.
        assert_eq!(columns(&blur_of(&seen, &[followed(2)], Numbers::Others).0), [4, 20]);
        let place = DVec2::new(24.0 / 64.0, 30.0 / 48.0);
        let placed = Shown { path: vec![(Timestamp::from_nanos(9), place)], ..followed(7) };
        assert_eq!(columns(&blur_of(&seen, &[placed], Numbers::Others).0), [4]);
    }

    #[test]
    fn who_is_a_rectangle_is_not_cut_to_their_outline() {
        let scene = r#"{"version": 1, "ground": [{"polygon": [[-9, -9], [9, -9], [9, 9], [-9, 9]]}], "cameras": [{"id": "north",
            "calibration": {"image_size_px": [64, 48], "focal_px": [64, 64], "center_px": [32, 24],
            "position_m": [0, 0, 6], "world_from_camera": [1, 0, 0, 0]}}]}"#;
        let scene = Arc::new(parse("a", scene, no_imports).unwrap().scene);
        let seen = seen();
        let mut state = assemble(&scene, Timestamp::from_nanos(9), |_| Some(seen.clone()), None);
        // Their outline is one column of their rectangle, and all else another's.
        let cells = (0..48 * 64).map(|cell| if cell % 64 == 5 { 1 } else { 2 }).collect();
        state.cameras[0].owners = Some(Arc::new(OwnerMap::new((64, 48), 1, cells, Box::new([6.0; 2]))));
        let (blur, n_shown) = blur_of(&seen, &[], Numbers::Own);
        let blurs = [CameraBlur { camera: seen.frame.camera.clone(), blur, n_shown }];
        CameraBlur::apply_to(&blurs, &mut state);
        let camera = &state.cameras[0];
        assert!(camera.observation.labels.data.contains(&MOVING));
        assert!((0..48).all(|y| (0..64).all(|x| camera.may_show(0, (x, y)) && camera.may_show(1, (x, y)))));
    }

    #[test]
    fn what_moves_outside_of_all_blobs_is_blurred_too() {
        let mut seen = seen();
        let mut labels = Mask::filled(64, 48, 0);
        // In the blobs of one who is blurred and of one who is shown; beside them; across two squares; and a shadow.
        for (x, y, label) in [
            (5, 15, MOVING),
            (21, 12, MOVING),
            (50, 3, MOVING),
            (47, 40, MOVING),
            (48, 40, MOVING),
            (2, 40, 50),
        ] {
            labels.data[y * 64 + x] = label;
        }
        seen.labels = Arc::new(labels);
        let (Blur::Parts(parts), _) = blur_of(&seen, &[followed(2)], Numbers::Others) else {
            panic!("known")
        };
        let loose = [([48, 0], [16, 16]), ([32, 32], [32, 16])];
        let expected: Vec<_> = [([4, 10], [8, 20]), ([20, 10], [8, 20])].into_iter().chain(loose).collect();
        let found: Vec<_> = parts.iter().map(|part| (part.left_top, part.size_px)).collect();
        assert_eq!(found, expected);
        let (Blur::Parts(parts), _) = blur_of(&seen, &[followed(2)], Numbers::Own) else { panic!("known") };
        assert!(parts.iter().all(|part| part.left_top != [20, 10]), "who may be seen is: {parts:?}");
        // The picture's last squares are cut by its borders.
        let mut seen = seen;
        let mut labels = Mask::filled(60, 40, 0);
        labels.data[39 * 60 + 59] = MOVING;
        seen.labels = Arc::new(labels);
        let parts = loose_parts(&seen);
        assert_eq!(parts, [BlurRegion { left_top: [48, 32], size_px: [12, 8] }]);
    }

    #[test]
    fn who_is_blurred_is_cut_out_as_a_rectangle_and_gone_from_the_background_too() {
        let mut seen = seen();
        let mut mask = Mask::filled(64, 48, 0);
        for y in 12..28 {
            mask.data[y * 64 + 6..y * 64 + 9].fill(200);
        }
        seen.soft_mask = Arc::new(mask);
        let (blur, n_shown) = blur_of(&seen, &[followed(2)], Numbers::Own);
        let blurs = [CameraBlur { camera: seen.frame.camera.clone(), blur, n_shown }];
        let hidden = CameraBlur::applied(&blurs, &seen.frame.camera, &seen);
        let is_full = |x: u32, y: u32| hidden.soft_mask.get(x, y) == 255 && hidden.labels.get(x, y) == MOVING;
        assert!([4, 11, 44, 51].iter().all(|x| [10, 29].iter().all(|y| is_full(*x, *y))));
        assert!([3, 12, 20, 27].iter().all(|x| hidden.soft_mask.get(*x, 20) == 0));
        assert_eq!((hidden.blobs.len(), hidden.tracks.len()), (2, 3));
        // A uniform picture comes to the nearest of eight steps where it is blurred.
        let luma = |image: &YuvImage, x: usize| image.plane(0).row(20)[x];
        assert_eq!((luma(&hidden.frame.image, 7), luma(&hidden.frame.image, 24)), (88, 90));
        assert_eq!((luma(&hidden.background, 47), luma(&hidden.background, 24)), (64, 60));
        // Of a camera that nothing is said of nothing is left.
        let unknown = CameraBlur::applied(&[], &seen.frame.camera, &seen);
        assert_eq!((luma(&unknown.frame.image, 60), luma(&unknown.background, 60)), (88, 64));
    }
}
