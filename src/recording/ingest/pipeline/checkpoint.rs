//! Keeps what a pipeline learned as bytes, and goes on from them.

use super::light::Light;
use super::{MAX_ASIDE, Model, Pipeline};
use crate::ingest::standing::SETTLED_SECS;
use videofields_vision::background::{BackgroundError, GaussianMixture};
use videofields_vision::segment::Memory;
use videofields_vision::shake::Shake;

/// Version of the checkpoints that this build writes. It reads those of version 1 too, which say nothing of what segmentation remembers.
pub const CHECKPOINT_VERSION: u32 = 2;

/// Checkpoints begin with this and their version.
pub(super) const MAGIC: [u8; 4] = *b"vfpl";

/// Flags of a model in a checkpoint: it learned a background clip; the time of its last frame is known; what segmentation remembers
/// follows it.
const HAS_CLIP: u8 = 1;
const HAS_TIME: u8 = 2;
const HAS_MEMORY: u8 = 4;

impl Pipeline {
    /// Everything that later masks depend on, as bytes; `None` before anything was learned.
    ///
    /// **Cost** about a tenth of a second a megapixel, most of it compression: not for every frame.
    #[must_use]
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        let mut bytes = Vec::from(MAGIC);
        bytes.push(CHECKPOINT_VERSION as u8);
        let header_len = bytes.len();
        let current = self.current.iter().map(|model| (model, self.segmenter.memory()));
        for (model, memory) in current.chain(self.aside.iter().rev().map(|model| (model, &model.memory))) {
            if model.mixture.n_frames() == 0 {
                continue;
            }
            let memory = memory.encode().map_err(BackgroundError::from);
            let encoded = model.mixture.encode(model.seen.unwrap_or_default());
            match encoded.and_then(|encoded| Ok((encoded, memory?))) {
                Ok((encoded, memory)) => {
                    let flag = |is_set: bool, flag: u8| if is_set { flag } else { 0 };
                    bytes.push(
                        flag(model.has_clip, HAS_CLIP) | flag(model.seen.is_some(), HAS_TIME) | HAS_MEMORY,
                    );
                    for part in [encoded, memory] {
                        bytes.extend((part.len() as u64).to_le_bytes());
                        bytes.extend(part);
                    }
                }
                Err(error) => tracing::error!(%error, "background model not kept"),
            }
        }
        (bytes.len() > header_len).then_some(bytes)
    }

    /// Goes on from a checkpoint. Thresholds and rates are the settings' own, so they may have changed since.
    ///
    /// # Errors
    /// When `bytes` are not a whole checkpoint or were made with another number of modes; nothing has changed then.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), BackgroundError> {
        let (version, mut rest) = bytes
            .strip_prefix(&MAGIC)
            .and_then(<[u8]>::split_first)
            .filter(|(version, _)| (1..=CHECKPOINT_VERSION).contains(&u32::from(**version)))
            .ok_or_else(|| refused("it is of another kind or version than this build reads"))?;
        let known_flags = if *version == 1 { HAS_CLIP | HAS_TIME } else { HAS_CLIP | HAS_TIME | HAS_MEMORY };
        let mut models = Vec::new();
        while !rest.is_empty() {
            models.push(self.read_model(&mut rest, known_flags)?);
        }
        if models.is_empty() || models.len() > 1 + MAX_ASIDE {
            return Err(refused("it has no models or too many"));
        }
        models.reverse();
        self.current = models.pop();
        let remembered = self.current.as_mut().map(|model| std::mem::take(&mut model.memory));
        *self.segmenter.memory_mut() = remembered.unwrap_or_default();
        self.aside = models;
        self.picture = None;
        Ok(())
    }

    /// Takes one model off the front of `rest`.
    fn read_model(&self, rest: &mut &[u8], known_flags: u8) -> Result<Model, BackgroundError> {
        let (flags, after) = rest.split_first().ok_or_else(|| refused("it ends before a model's flags"))?;
        *rest = after;
        if flags & !known_flags != 0 {
            return Err(refused("a model has flags that no build writes"));
        }
        let (mixture, time) = GaussianMixture::decode(take_part(rest)?, &self.settings)?;
        let memory = if flags & HAS_MEMORY == 0 {
            Memory::default()
        } else {
            let format = mixture.format();
            Memory::decode(take_part(rest)?, (format.width, format.height))?
        };
        // A stored background was learned for long before.
        let (has_clip, seen) = (flags & HAS_CLIP != 0, (flags & HAS_TIME != 0).then_some(time));
        Ok(Model {
            mixture,
            memory,
            seen,
            has_clip,
            learned_secs: SETTLED_SECS,
            previous: None,
            detail: None,
            since_detail_secs: 0.0,
            // The zones of now are taken anew from the next picture.
            hidden: None,
            shake: Shake::default(),
            light: Light::default(),
        })
    }
}

/// Takes a length and so many bytes off the front of `rest`.
fn take_part<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], BackgroundError> {
    let parts = rest.split_first_chunk().and_then(|(len, after)| {
        usize::try_from(u64::from_le_bytes(*len)).ok().and_then(|len| after.split_at_checked(len))
    });
    let (part, after) = parts.ok_or_else(|| refused("it ends within a model"))?;
    *rest = after;
    Ok(part)
}

fn refused(reason: &str) -> BackgroundError {
    BackgroundError::Checkpoint { reason: reason.to_owned() }
}
