//! The options of the spray and of what carries it.

use clap::Args;
use paint_planner::timing::TimingPolicy;

use super::positive::positive;
use crate::mission::{MissionSettings, with_pitch, with_tilt};

/// The spray and how it moves.
#[derive(Args)]
pub(super) struct Nozzle {
    /// Size of a texel, metres [default: 0.0125]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    texel: Option<f64>,
    /// Standard deviation of a spray spot at the stand-off, metres [default: 0.025]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    spot: Option<f64>,
    /// Distance of the nozzle from the surface, metres, within 0.05 to 0.15 [default: 0.1]
    #[arg(long, value_name = "METRES", value_parser = stand_off)]
    stand_off: Option<f64>,
    /// Speed of the spot over the surface, metres per second [default: 0.4]
    #[arg(long, value_name = "M_PER_S", value_parser = positive)]
    speed: Option<f64>,
    /// Length of the arm, from the middle of the vehicle to the pan joint, metres [default: 0.45]
    #[arg(long, value_name = "METRES", value_parser = arm)]
    arm: Option<f64>,
    /// How far the tilt joint goes to both sides, degrees; more reaches tops and undersides [default: 45]
    #[arg(long, value_name = "DEGREES", value_parser = tilt)]
    tilt: Option<f64>,
    /// How far the vehicle pitches to both sides while it hovers, degrees; reaches undersides and tops. The simulated vehicle hovers level:
    /// for plan and --preview [default: 0]
    #[arg(long, value_name = "DEGREES", value_parser = pitch)]
    pitch: Option<f64>,
    /// Most that the valve gives, litres per minute [default: 0.12]
    #[arg(long, value_name = "L_PER_MIN", value_parser = positive)]
    max_flow: Option<f64>,
}

impl Nozzle {
    /// Changes the settings that were given.
    pub(super) fn apply(&self, settings: &mut MissionSettings) {
        settings.texel = self.texel.unwrap_or(settings.texel);
        settings.spot = self.spot.unwrap_or(settings.spot);
        if let Some(arm) = self.arm {
            settings.ptu.body_from_pan_axis.x = arm;
        }
        if let Some(tilt) = self.tilt {
            *settings = with_tilt(settings, tilt.to_radians());
        }
        if let Some(pitch) = self.pitch {
            *settings = with_pitch(settings, pitch.to_radians());
        }
        let planner = &mut settings.planner;
        if let Some(stand_off) = self.stand_off {
            let nozzle = &mut planner.nozzle;
            // The room about the stand-off stays what it is for the usual one: half of it to both sides.
            (nozzle.stand_off, nozzle.min, nozzle.max) = (stand_off, 0.5 * stand_off, 1.5 * stand_off);
        }
        if let Some(speed) = self.speed {
            planner.timing.policy = TimingPolicy::Uniform { speed };
            planner.timing.max_speed = planner.timing.max_speed.max(1.25 * speed);
        }
        planner.timing.max_flow = self.max_flow.map_or(planner.timing.max_flow, |flow| flow * 1e-3 / 60.0);
    }
}

fn stand_off(text: &str) -> Result<f64, String> {
    let metres = text.parse().ok().filter(|v: &f64| (0.05..=0.15).contains(v));
    metres.ok_or_else(|| "give metres from 0.05 to 0.15".to_owned())
}

/// The vehicle's rotors end before the arm does, and no arm carries a gun farther.
fn arm(text: &str) -> Result<f64, String> {
    let metres = text.parse().ok().filter(|v: &f64| (0.4..=2.0).contains(v));
    metres.ok_or_else(|| "give metres from 0.4 (the rotors) to 2".to_owned())
}

fn tilt(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|v: &f64| (20.0..=80.0).contains(v));
    degrees.ok_or_else(|| "give degrees from 20 to 80: beyond, the pan joint turns the spray about itself".to_owned())
}

fn pitch(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|v: &f64| (0.0..=60.0).contains(v));
    degrees.ok_or_else(|| "give degrees from 0 to 60".to_owned())
}
