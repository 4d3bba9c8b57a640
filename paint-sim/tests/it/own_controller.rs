//! A controller of one's own.

use paint_sim::flight::*;
use paint_sim::{FlightSettings, fly};

use crate::flight_scene::wall;
use crate::own_pan_tilt::arm;
use crate::own_reference::Ellipse;

/// Proportional and derivative, nothing known of lags or disturbances.
struct PlainPd(Airframe);

impl Controller for PlainPd {
    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command {
        let wanted = reference.at(time);
        let a = 2.0 * (wanted.position - estimate.position) + 2.0 * (wanted.velocity - estimate.velocity);
        let [_, _, yaw] = estimate.attitude;
        Command {
            roll: -a.y / GRAVITY / self.0.roll_gain,
            pitch: a.x / GRAVITY / self.0.pitch_gain,
            yaw_rate: wanted.heading - yaw,
            thrust: self.0.mass * (GRAVITY + a.z),
        }
    }
}

#[test]
fn a_controller_of_ones_own_flies() {
    let settings =
        FlightSettings { wind: Wind::calm(), localisation: Localisation::perfect(), ..FlightSettings::default() };
    let reference = Ellipse { duration: 20.0 };
    let plain = fly_with(&reference, &mut PlainPd(settings.airframe), &mut arm(), &wall(), &settings).unwrap();
    let error = plain.statistics().position_error_rms;
    let cascaded = fly(&reference, &mut arm(), &wall(), &settings).unwrap().statistics().position_error_rms;
    // No feed-forward: it lags behind an ellipse of half a metre, but not by much more than a tenth of it.
    assert!(error < 0.15 && error > 3.0 * cascaded, "{error} {cascaded}");
}
