//! What the parts that the robot does not reach would need: a tilt joint that goes further, a longer arm, a vehicle that hovers pitched.

use super::error::MissionError;
use super::planned_robot::{STEEPEST, with_pitch, with_tilt};
use super::reach::texels_in_reach;
use super::settings::MissionSettings;
use crate::report::ReachNeeds;
use crate::surface::PaintSurface;

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
    let longer = |settings: &MissionSettings| {
        let mut longer = settings.clone();
        longer.ptu.body_from_pan_axis.x += LONGER;
        longer
    };
    let mut served = |settings: &MissionSettings| {
        let mut count = 0.0;
        let reached = texels_in_reach(surface, settings)?;
        for (open, _) in open.iter_mut().zip(reached).filter(|(open, reached)| **open && *reached) {
            *open = false;
            count += 1.0;
        }
        Ok::<_, MissionError>(count / all)
    };
    let steep = with_tilt(settings, STEEPEST);
    let both = longer(&steep);
    needs.reach_needs_tilt_share = served(&steep)?;
    needs.reach_needs_arm_share = served(&longer(settings))?;
    needs.reach_needs_tilt_and_arm_share = served(&both)?;
    needs.reach_needs_pitch_share = served(&with_pitch(settings, PITCH.max(settings.pitch)))?;
    needs.reach_needs_pitch_and_arm_share = served(&with_pitch(&longer(settings), PITCH.max(settings.pitch)))?;
    needs.reach_needs_more_share = open.iter().filter(|open| **open).count() as f64 / all;
    Ok(needs)
}
