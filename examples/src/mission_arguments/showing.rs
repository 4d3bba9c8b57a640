//! The options of how the painted surface is shown.

use clap::Args;

use crate::light::Light;
use crate::mission::{Showing, TURNTABLE};

/// How the painted surface is shown.
#[derive(Debug, Clone, Args)]
pub struct ShowingArguments {
    /// Show it in the light of noon, dusk, an overcast sky or a street lamp, or with the sun of a moment and a place:
    /// [YYYY-MM-DDT]HH:MM@LATITUDE[,LONGITUDE][/FACING], as 18:30@47.4 or 2026-06-21T16:30@47.4,8.5/west; also from several places, in views.png
    /// [default: a sun behind the camera]
    #[arg(long, value_name = "noon|dusk|overcast|lamp|SUN")]
    light: Option<Light>,
    /// Show it under a varnish of this roughness: 0.05 mirrors, 0.2 is semi-gloss, 0.5 eggshell [default: matt]
    #[arg(long, value_name = "ROUGHNESS", value_parser = roughness)]
    gloss: Option<f64>,
    /// Show it from so many places around it, in turntable.png
    #[arg(long, value_name = "PLACES", value_parser = clap::value_parser!(u16).range(1..=i64::from(TURNTABLE)))]
    turntable: Option<u16>,
}

impl ShowingArguments {
    /// Changes what was given.
    pub fn apply(&self, show: &mut Showing) {
        show.light = self.light.or(show.light);
        show.gloss = self.gloss.or(show.gloss);
        show.turntable = self.turntable.or(show.turntable);
    }
}

fn roughness(text: &str) -> Result<f64, String> {
    let roughness = text.parse().ok().filter(|v: &f64| (0.02..=1.0).contains(v));
    roughness.ok_or_else(|| "give a roughness from 0.02 to 1".to_owned())
}
