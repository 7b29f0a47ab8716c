//! Pictures one after the other: what a stream shows, whatever way it goes to its client.
//!
//! A picture is asked for when the client has taken the one before. So nothing queues up for a slow client: it gets fewer
//! pictures, always the newest, and nobody else waits for it.

use super::error::Problem;
use super::looks::Following;
use super::parameters::Parameter;
use super::picture::Picture;
use super::query::Query;
use super::shares::{Place, Shares};
use super::tags::Finish;
use super::wall_tiles::{self, Streamed, Wishes};
use super::{Api, kept, scenes, view, views};
use std::ops::RangeInclusive;
use std::time::Duration;
use videofields_service::catalog::NamedView;
use videofields_service::engine::At;
use videofields_service::wall::Wall;
use videofields_vision::encode::PictureFormat;

/// Streams at once; more get 503.
pub(super) const AT_ONCE: usize = 96;

/// Streams that one user may have for each that is left: a wall's 64 tiles may be one user's.
const GREED: usize = 3;

/// Pictures a second of a view.
const RATE_HZ: RangeInclusive<f64> = 0.1..=30.0;
const DEFAULT_RATE_HZ: f64 = 10.0;

/// How many pictures a second.
pub(super) const RATE: &[Parameter] =
    &[Parameter::number("rate", &RATE_HZ, "Pictures a second, where the client takes as many")
        .default_is("10")];

/// Pause after a picture that could not be had for now, and how many of these end a stream.
pub(super) const PAUSE: Duration = Duration::from_secs(1);
pub(super) const MAX_FAILURES: u32 = 30;

/// What a stream shows.
pub(super) enum Source {
    /// A view of a scene, by its parameters.
    View { scene: String, raw: String, pace: Pace },
    /// A named view, with parameters in the place of its own.
    Named { id: String, raw: String, pace: Pace },
    /// A tile of a wall.
    Tile { wall: String, tile: String, format: PictureFormat, wishes: Wishes, last: Option<u64> },
}

/// How often a view is shown.
pub(super) struct Pace {
    rate_hz: f64,
    n_shown: u64,
    /// When the last one was begun, by the monotonic clock.
    begun: Option<Duration>,
}

/// One picture of a stream.
pub(super) struct Shown {
    /// Greater than those of all before.
    pub(super) frame: u64,
    /// Of a wall its version.
    pub(super) version: i64,
    /// Most pictures a second that there will be.
    pub(super) rate_hz: f64,
    /// Whether it shows what is now.
    pub(super) is_live: bool,
    /// Whether it is no picture of the scene.
    pub(super) is_pattern: bool,
    pub(super) picture: Picture,
}

impl Pace {
    fn new(rate_hz: f64) -> Self {
        Self { rate_hz, n_shown: 0, begun: None }
    }

    /// Waits until the next one is due.
    async fn tick(&mut self, api: &Api) {
        let period = Duration::try_from_secs_f64(1.0 / self.rate_hz).unwrap_or(PAUSE);
        let now = api.clock.monotonic();
        let due = self.begun.map_or(now, |begun| begun.saturating_add(period));
        tokio::time::sleep(due.saturating_sub(now).min(period)).await;
        // Who is late does not catch up.
        self.begun = Some(due.max(now));
    }
}

impl Source {
    /// A view of a scene as a query string says: a view's parameters and `rate`.
    pub(super) fn view(scene: String, raw: Option<&str>) -> Result<Self, Problem> {
        let (pace, raw) = paced(raw)?;
        Ok(Self::View { scene, raw, pace })
    }

    /// A named view, in the same way.
    pub(super) fn named(api: &Api, id: String, raw: Option<&str>) -> Result<Self, Problem> {
        let (pace, raw) = paced(raw)?;
        kept::find::<NamedView>(api, &id)?;
        Ok(Self::Named { id, raw, pace })
    }

    /// A tile of a wall as `query` says, which has [`Wishes::PARAMETERS`].
    pub(super) fn tile(
        api: &Api,
        (wall, tile): (String, String),
        query: &mut Query,
        format: PictureFormat,
    ) -> Result<Self, Problem> {
        let wishes = Wishes::read(query);
        let kept = kept::find::<Wall>(api, &wall)?;
        wall_tiles::tile_of(&kept, &tile)?;
        Ok(Self::Tile { wall, tile, format, wishes, last: None })
    }

    /// Whether what it shows is still there for the caller.
    pub(super) fn find(&self, api: &Api) -> Result<(), Problem> {
        match self {
            Self::View { scene, .. } => scenes::find(api, scene).map(drop),
            Self::Named { id, .. } => kept::find::<NamedView>(api, id).map(drop),
            Self::Tile { wall, tile, .. } => wall_tiles::tile_of(&kept::find(api, wall)?, tile).map(drop),
        }
    }

    /// Refuses what is wrong with the request, before anything is drawn.
    pub(super) fn check(&self, api: &Api) -> Result<(), Problem> {
        match self {
            Self::View { scene, raw, .. } => {
                view::asked(api, (scene.clone(), PictureFormat::Jpeg), Some(raw)).map(drop)
            }
            Self::Named { id, raw, .. } => views::asked(api, (id, raw), PictureFormat::Jpeg).map(drop),
            Self::Tile { wall, tile, .. } => {
                let kept = kept::find::<Wall>(api, wall)?;
                wall_tiles::tile_of(&kept, tile)?;
                wall_tiles::time_of(api, &kept.content).map(drop)
            }
        }
    }

    /// The picture that is due, where it goes on after its answer has begun: which of the past it shows is noted first.
    pub(super) async fn followed(
        &mut self,
        api: &Api,
        following: Option<&Following>,
    ) -> Result<Shown, Problem> {
        let shown = self.next(api).await?;
        if let (At::Time(instant), Some(following)) = (shown.picture.moment.at, following) {
            following.shows(api, instant).await?;
        }
        Ok(shown)
    }

    /// The picture that is due.
    pub(super) async fn next(&mut self, api: &Api) -> Result<Shown, Problem> {
        match self {
            Self::View { scene, raw, pace } => {
                pace.tick(api).await;
                let (request, moment) = view::asked(api, (scene.clone(), PictureFormat::Jpeg), Some(raw))?;
                let picture = view::drawn(api, request, (PictureFormat::Jpeg, moment), Finish::None).await?;
                Ok(pace.shown(picture))
            }
            Self::Named { id, raw, pace } => {
                pace.tick(api).await;
                let picture = views::shown(api, (id, raw), PictureFormat::Jpeg).await?;
                Ok(pace.shown(picture))
            }
            Self::Tile { wall, tile, format, wishes, last } => {
                let streamed = wall_tiles::after(api, (wall, tile), (*format, *wishes), *last).await?;
                let Streamed { frame, version, rate_hz, is_live, is_pattern, picture } = streamed;
                *last = Some(frame);
                Ok(Shown { frame, version, rate_hz, is_live, is_pattern, picture })
            }
        }
    }
}

impl Pace {
    fn shown(&mut self, picture: Picture) -> Shown {
        self.n_shown += 1;
        let is_live = picture.moment.at == At::Live;
        Shown { frame: self.n_shown, version: 0, rate_hz: self.rate_hz, is_live, is_pattern: false, picture }
    }
}

/// Takes `rate` out of a query string.
fn paced(raw: Option<&str>) -> Result<(Pace, String), Problem> {
    let (rate, rest) = split_off(raw, "rate");
    let mut query = Query::parse(Some(&rate), RATE);
    let rate_hz = query.number("rate", &RATE_HZ, " pictures a second").unwrap_or(DEFAULT_RATE_HZ);
    let rate_hz = query.finish(Some(rate_hz))?;
    Ok((Pace::new(rate_hz), rest))
}

/// The parameters of one name, and the others.
pub(super) fn split_off(raw: Option<&str>, name: &str) -> (String, String) {
    let is_it = |part: &&str| part.split('=').next() == Some(name);
    let (own, rest): (Vec<&str>, Vec<&str>) = raw.unwrap_or_default().split('&').partition(is_it);
    (own.join("&"), rest.join("&"))
}

/// Returns the places of streams that run at once.
pub(super) fn places() -> Shares<String> {
    Shares::new(AT_ONCE, GREED)
}

impl Api {
    /// Takes a place among the streams that run.
    ///
    /// # Errors
    /// When all are taken, or the user has as many as are its share.
    pub(super) fn stream_place(&self) -> Result<Place<String>, Problem> {
        self.shared(&self.streams, "streams are running")
    }
}
