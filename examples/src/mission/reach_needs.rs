//! What the parts that the robot does not reach would need: a tilt joint that goes further, a longer arm, a vehicle that hovers pitched.

use nalgebra::Vector3;
use paint_planner::nozzle::NozzleSettings;
use ptu_kinematics::{KinematicChain, PitchingPtu, Ptu, PtuSettings, Range};

use super::error::MissionError;
use super::reach::texels_in_reach;
use super::settings::MissionSettings;
use crate::adapters::Robot;
use crate::report::ReachNeeds;
use crate::surface::PaintSurface;

/// How far a tilt joint may go, radians: at 90 degrees the pan joint turns the spray about itself.
pub(super) const STEEPEST: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// What the spray keeps of the joint's range, radians: the body leans against the wind.
pub(super) const KEPT: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// How much longer an arm is tried, metres.
const LONGER: f64 = 0.4;
/// Pitch at which a vehicle with vectored thrust hovers, radians.
const PITCH: f64 = 45.0 * std::f64::consts::PI / 180.0;
/// Normals of tops and undersides rise or fall by more than this, radians.
const LEVEL: f64 = 45.0 * std::f64::consts::PI / 180.0;

/// Sorts the texels out of reach.
pub(super) fn reach_needs(
    in_reach: &[bool],
    surface: &PaintSurface,
    settings: &MissionSettings,
) -> Result<ReachNeeds, MissionError> {
    let coverage = surface.coverage();
    let all = coverage.data().iter().sum::<f64>().max(1.0);
    let mut open: Vec<bool> = coverage.data().iter().zip(in_reach).map(|(c, reached)| *c > 0.0 && !reached).collect();
    let mut needs = ReachNeeds::default();
    for (texel, _) in open.iter().enumerate().filter(|(_, open)| **open) {
        let at = surface.texels.at(texel % surface.width(), texel / surface.width());
        let height = at.map_or(0.0, |at| surface.chart.smooth_normal(at).z);
        let part = if height > LEVEL.sin() {
            &mut needs.unreached_tops_share
        } else if height < -LEVEL.sin() {
            &mut needs.unreached_undersides_share
        } else {
            &mut needs.unreached_hidden_share
        };
        *part += 1.0 / all;
    }
    let longer = |ptu: PtuSettings| PtuSettings {
        body_from_pan_axis: ptu.body_from_pan_axis + Vector3::new(LONGER, 0.0, 0.0),
        ..ptu
    };
    let mut served = |reached: Vec<bool>| {
        let mut count = 0.0;
        for (open, _) in open.iter_mut().zip(reached).filter(|(open, reached)| **open && *reached) {
            *open = false;
            count += 1.0;
        }
        count / all
    };
    let steep = with_tilt(settings, STEEPEST);
    needs.reach_needs_tilt_share = served(reached(surface, Ptu::new(steep.ptu)?, &steep)?);
    let long = MissionSettings { ptu: longer(settings.ptu), ..settings.clone() };
    needs.reach_needs_arm_share = served(reached(surface, Ptu::new(long.ptu)?, &long)?);
    let both = MissionSettings { ptu: longer(steep.ptu), ..steep };
    needs.reach_needs_tilt_and_arm_share = served(reached(surface, Ptu::new(both.ptu)?, &both)?);
    let pitching = PitchingPtu::new(Ptu::new(both.ptu)?, Range::symmetric(PITCH))?;
    needs.reach_needs_pitched_vehicle_share = served(reached(surface, pitching, &both)?);
    needs.reach_needs_more_share = open.iter().filter(|open| **open).count() as f64 / all;
    Ok(needs)
}

/// The settings with a tilt joint of this range, radians to both sides, and a spray that rises as far as that allows.
pub fn with_tilt(settings: &MissionSettings, tilt: f64) -> MissionSettings {
    let mut changed = settings.clone();
    changed.ptu.tilt_limits = Range::symmetric(tilt);
    changed.planner.nozzle = NozzleSettings { max_elevation: tilt - KEPT, ..changed.planner.nozzle };
    changed
}

fn reached<C: KinematicChain + Clone>(
    surface: &PaintSurface,
    chain: C,
    settings: &MissionSettings,
) -> Result<Vec<bool>, MissionError> {
    let robot = Robot { tether: settings.constraints.tether, ..Robot::new(chain) };
    texels_in_reach(surface, &robot, settings)
}
