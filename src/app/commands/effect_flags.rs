//! Flags of effects, as commands take them that draw views.

/// What is done to the picture once the scene is drawn; what is absent is as the scene has it.
#[derive(Debug, Default, clap::Args)]
pub(super) struct EffectFlags {
    /// Whether light is taken away where much stands around: on or off.
    #[arg(long, value_name = "ON_OFF")]
    occlusion: Option<String>,
    /// With occlusion, within how many metres, 0.05 to 20; 1.5 if absent.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    occlusion_radius: Option<String>,
    /// With occlusion, how much, 0 to 2; 1 if absent.
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    occlusion_strength: Option<String>,
    /// In which light the scene is shown: off, sky, picture (the scene's) or camera.
    #[arg(long, value_name = "LIGHT")]
    relight: Option<String>,
    /// With --relight camera, the camera whose background is the light; the scene's or the first if absent.
    #[arg(long, value_name = "ID")]
    relight_camera: Option<String>,
    /// With --relight, how bright the light is, stops, -4 to 4; 0 if absent.
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true)]
    relight_exposure: Option<String>,
    /// With --relight, how much of it is taken, 0 to 1; 1 if absent.
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    relight_strength: Option<String>,
    /// With --relight, where a sun stands, degrees from north towards east.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    sun_azimuth: Option<String>,
    /// With --relight, how high a sun stands, degrees, -10 to 90.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    sun_elevation: Option<String>,
    /// With --relight, how strong a sun is, of what all else gives in the mean, 0 to 20.
    #[arg(long, value_name = "TIMES", allow_hyphen_values = true)]
    sun_strength: Option<String>,
    /// Whether the picture is drawn as dots on paper: on or off.
    #[arg(long, value_name = "ON_OFF")]
    stipple: Option<String>,
    /// With stippling, the side of a dot, pixels, 1 to 8; 1 if absent.
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true)]
    stipple_dot: Option<String>,
    /// With stippling, how far away a dot's pixel may lie, 1 to 32; 6 if absent.
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true)]
    stipple_blur: Option<String>,
    /// With stippling, the power that the grey is raised to, 0.25 to 8; 2 if absent.
    #[arg(long, value_name = "POWER", allow_hyphen_values = true)]
    stipple_contrast: Option<String>,
    /// With stippling, the share of dots in what is black, 0 to 1; 0.5 if absent.
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    stipple_shade: Option<String>,
}

impl EffectFlags {
    /// The flags by the API's parameters.
    pub(super) const fn pairs(&self) -> [(&'static str, &Option<String>); 15] {
        [
            ("occlusion", &self.occlusion),
            ("occlusion_radius", &self.occlusion_radius),
            ("occlusion_strength", &self.occlusion_strength),
            ("relight", &self.relight),
            ("relight_camera", &self.relight_camera),
            ("relight_exposure", &self.relight_exposure),
            ("relight_strength", &self.relight_strength),
            ("sun_azimuth", &self.sun_azimuth),
            ("sun_elevation", &self.sun_elevation),
            ("sun_strength", &self.sun_strength),
            ("stipple", &self.stipple),
            ("stipple_dot", &self.stipple_dot),
            ("stipple_blur", &self.stipple_blur),
            ("stipple_contrast", &self.stipple_contrast),
            ("stipple_shade", &self.stipple_shade),
        ]
    }
}
