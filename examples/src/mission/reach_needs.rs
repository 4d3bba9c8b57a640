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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_io::TriangleMesh;
    use crate::mission::settings::MissionSettings;

    /// A strip along a line of points (x, z), metres, from y = 0.5 to -0.5 in pieces of a quarter metre.
    fn folded(line: &[[f32; 2]]) -> PaintSurface {
        let mut mesh = TriangleMesh::default();
        for [x, z] in line {
            mesh.positions.extend((0..5).map(|k| [*x, 0.5 - 0.25 * k as f32, *z]));
        }
        for row in 0..line.len() as u32 - 1 {
            for k in 0..4 {
                let a = 5 * row + k;
                mesh.faces.extend([[a, a + 1, a + 6], [a, a + 6, a + 5]]);
            }
        }
        PaintSurface::new(&mesh, 0.05, &|_| ()).unwrap()
    }

    /// The line through corners, metres, in steps of at most a quarter metre.
    fn points(corners: &[[f32; 2]]) -> Vec<[f32; 2]> {
        let mut line = vec![corners[0]];
        for pair in corners.windows(2) {
            let [dx, dz] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let pieces = (dx.hypot(dz) / 0.25).ceil().max(1.0);
            line.extend(
                (1..=pieces as u32).map(|k| [pair[0][0] + dx * k as f32 / pieces, pair[0][1] + dz * k as f32 / pieces]),
            );
        }
        line
    }

    fn needs(surface: &PaintSurface) -> ReachNeeds {
        let settings = MissionSettings::default();
        let in_reach = texels_in_reach(surface, &settings).unwrap();
        reach_needs(&in_reach, surface, &settings).unwrap()
    }

    /// A wall, a level shelf above it, and a wall again: a step whose tread faces up. The same upside down: an underside.
    #[test]
    fn tops_and_undersides_are_told_apart() {
        let steps = [[0.0, 1.0], [0.0, 2.0], [0.75, 2.0], [0.75, 3.0]];
        let top = needs(&folded(&points(&steps)));
        assert!(top.unreached_tops_share > 0.1, "{top:?}");
        assert_eq!(top.unreached_undersides_share, 0.0);
        let under = needs(&folded(&points(&steps.map(|[x, z]| [0.75 - x, z]))));
        assert!(under.unreached_undersides_share > 0.1 && under.unreached_tops_share == 0.0, "{under:?}");
        for needs in [top, under] {
            let unreached =
                needs.unreached_tops_share + needs.unreached_undersides_share + needs.unreached_hidden_share;
            let served = needs.reach_needs_tilt_share
                + needs.reach_needs_arm_share
                + needs.reach_needs_tilt_and_arm_share
                + needs.reach_needs_pitch_share
                + needs.reach_needs_pitch_and_arm_share
                + needs.reach_needs_more_share;
            assert!((unreached - served).abs() < 1e-9, "{needs:?}");
        }
    }

    /// A groove too narrow for the vehicle, its bottom 0.7 m behind the wall: what an arm 0.4 m longer, forwards, reaches there.
    #[test]
    fn a_deep_groove_needs_a_longer_arm() {
        let groove = [[0.0, 0.5], [0.0, 1.5], [0.7, 1.5], [0.7, 2.5], [0.0, 2.5], [0.0, 3.5]];
        let surface = folded(&points(&groove));
        let settings = MissionSettings::default();
        let reached = |settings: &MissionSettings| texels_in_reach(&surface, settings).unwrap();
        let (usual, steep) = (reached(&settings), reached(&with_tilt(&settings, STEEPEST)));
        let all = surface.coverage().data().iter().sum::<f64>();
        // What an arm with its pan axis moved reaches, and nothing before it.
        let more = |x: f64, y: f64| {
            let mut moved = settings.clone();
            moved.ptu.body_from_pan_axis.x += x;
            moved.ptu.body_from_pan_axis.y += y;
            let reached = reached(&moved);
            (0..usual.len()).filter(|&k| reached[k] && !usual[k] && !steep[k]).count() as f64 / all
        };
        let found = reach_needs(&usual, &surface, &settings).unwrap().reach_needs_arm_share;
        let [forwards, aside] = [more(0.4, 0.0), more(0.0, 0.4)];
        assert!(found > 0.02 && (found - forwards).abs() < 1e-9, "{found} {forwards}");
        assert!((forwards - aside).abs() > 0.02, "{forwards} {aside}");
    }
}
