//! What a picture of a scene is asked for by, and what the answer says of it.

use super::blurring::{BlurAsked, CameraBlur};
use super::forecaster::Expected;
use super::handle::At;
use super::identity::ViewIdentity;
use glam::DVec3;
use std::sync::{Arc, Weak};
use std::time::Duration;
use videofields_picture::plan::{Colors, Effort, EntityStyle, Plan, Settings};
use videofields_picture::scene::{Scene, SceneView};
use videofields_recording::timeline::Horizon;
use videofields_vision::access::Scope;
use videofields_vision::clock::Timestamp;
use videofields_vision::effects::Asked;
use videofields_vision::frame::{CameraId, RgbImage, YuvImage};

/// Distance between the eyes of a stereo pair where the request names none, metres.
pub const EYE_DISTANCE_M: f64 = 0.064;

/// How the world comes onto a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ViewKind {
    /// From the eye towards the target, within the field of view.
    #[default]
    Perspective,
    /// Along the way from the eye to the target by parallel rays.
    Orthographic {
        /// Width of what is shown, metres; what the perspective picture shows at the target if absent.
        across_m: Option<f64>,
    },
    /// Straight down on the target by parallel rays, over everything that stands there. The eye and the field of view
    /// mean nothing.
    Map {
        /// Width of what is shown, metres; all of the scene if absent.
        across_m: Option<f64>,
        /// Direction at the top, from north towards east, radians.
        heading_rad: f64,
    },
    /// Around the vertical through the eye, the target in the middle.
    Panorama {
        /// Angle from the left edge to the right one, radians.
        span_rad: f64,
    },
    /// Two pictures side by side for two eyes.
    Stereo {
        /// Between the eyes, metres.
        eye_distance_m: f64,
        /// Distance at which both pictures agree, metres; the target's if absent.
        convergence_m: Option<f64>,
    },
    /// Through a rectangle in the world; target and field of view mean nothing.
    Window {
        /// Its lower left, lower right and upper left corner as the viewer sees them.
        corners: [DVec3; 3],
    },
}

/// A picture of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewRequest {
    /// The scene's id.
    pub scene: String,
    /// How the world comes onto the picture.
    pub kind: ViewKind,
    /// The viewer's place, metres; the scene's own view if absent.
    pub eye: Option<DVec3>,
    /// What the viewer looks at, metres; the scene's own view if absent, for a map the scene's middle.
    pub target: Option<DVec3>,
    /// Vertical field of view, radians; the scene's own view if absent.
    pub fov_y_rad: Option<f64>,
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
    /// Which time.
    pub at: At,
    /// How moving entities are drawn.
    pub style: EntityStyle,
    /// Whether buildings open where they hide somebody.
    pub see_through: bool,
    /// Whether cameras' colours are made to agree.
    pub colors: Colors,
    /// Who looks: what changes over time does so smoothly from one picture of a session to its next. Without one, every
    /// picture shows what it comes to.
    pub session: Option<String>,
    /// How exactly it is drawn, or how soon it must be there.
    pub effort: Effort,
    /// What is done to it once the scene is drawn.
    pub effects: Asked,
    /// How far cameras had been seen when the instant was chosen: what came since is not looked at, so that the same instant
    /// shows the same. None: all there is.
    pub horizon: Option<Horizon>,
    /// Whether people are made unrecognisable, and who is not. None: nobody is.
    pub blur_people: Option<BlurAsked>,
    /// Which cameras it may show, and anything be concluded from. A caller's door sets it.
    pub scope: Scope,
}

impl ViewRequest {
    /// What is seen of `scene` now from its own view, 640 x 360 pixels of it.
    pub(super) fn own(scene: &Scene, effort: Effort) -> Self {
        Self {
            scene: scene.id.clone(),
            kind: ViewKind::default(),
            eye: None,
            target: None,
            fov_y_rad: None,
            width_px: 640,
            height_px: 360,
            at: At::Live,
            style: EntityStyle::Billboards,
            see_through: true,
            colors: Colors::default(),
            session: None,
            effort,
            effects: Asked::default(),
            horizon: None,
            blur_people: None,
            scope: Scope::all(),
        }
    }
}

/// What a time of a scene means at a moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneMoment {
    /// The instant.
    pub instant: Timestamp,
    /// The cameras that may be seen then.
    pub cameras: Vec<CameraId>,
    /// How far these had been seen at that moment.
    pub horizon: Horizon,
}

/// Which frame of a camera went into a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceTime {
    /// The camera.
    pub camera: CameraId,
    /// Its frame's scene time.
    pub timestamp: Timestamp,
}

/// How an answer came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// It was drawn for this request.
    Drawn,
    /// It was drawn for another request that means the same picture.
    Shared,
    /// It was drawn before, and kept.
    Kept,
}

/// A picture of a scene, and what went into it.
#[derive(Clone, Debug)]
pub struct ViewAnswer {
    /// The picture.
    pub image: Arc<RgbImage>,
    /// The instant shown.
    pub instant: Timestamp,
    /// How the world came onto it; what the request left open is filled in.
    pub kind: ViewKind,
    /// Where it is seen from: what the request named, else the scene's own view.
    pub view: SceneView,
    /// The cameras that had a frame for it.
    pub sources: Vec<SourceTime>,
    /// The frames themselves, in the order of `sources`, as long as somebody else holds them.
    pub frames: Vec<Weak<YuvImage>>,
    /// Those of them that saw nothing near the instant: of these the background alone is shown.
    pub gaps: Vec<CameraId>,
    /// What of each camera was blurred, where people were to be.
    pub blurs: Option<Arc<[CameraBlur]>>,
    /// How exactly it was drawn.
    pub settings: Settings,
    /// What was expected of it before it was drawn.
    pub expected: Option<Expected>,
    /// Which effects ran, and why.
    pub plan: Arc<Plan>,
    /// What the stages took: name and time. First comes `wait`, until the picture was begun or found.
    pub timings: Vec<(&'static str, Duration)>,
    /// How it came about.
    pub origin: Origin,
    /// What it hangs on; none where nothing can be asked for again.
    pub identity: Option<Arc<ViewIdentity>>,
}
