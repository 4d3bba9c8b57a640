//! How good the painting is at seams: where the plane of the picture is cut, and the surface is not.

use paint_net::{Image, metrics};
use paint_planner::mission::upright_steps;
use paint_sim::Film;

use super::error::MissionError;
use super::nozzle::{kernel, shot, spray_model};
use super::painting_task::PaintingTask;
use super::plan::layer_strokes;
use super::run::Mission;
use crate::appearance::UNIT_THICKNESS;
use crate::simulated_sensors::SHOT_STEP;

/// Half the width of the band about the seams, metres.
const BAND: f64 = 0.03;

/// The painted surface in a band of 3 cm about the seams, and elsewhere. Windows go on beyond the seams.
pub(super) struct SeamLikeness {
    /// Structural similarity to the wanted picture where the robot can paint, in the band.
    pub(super) near: f64,
    /// The same elsewhere.
    pub(super) far: f64,
}

/// What the painter expects beside what the simulator's spray deposits along the strokes when it stands upright and hits. Means of the difference
/// of thickness over the mean thickness, by area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepositError {
    /// In a band of 3 cm about the seams.
    pub(super) near: f64,
    /// There, if what a spray puts beyond a seam counted as lost.
    pub(super) naive: f64,
    /// Elsewhere.
    pub(super) far: f64,
}

/// `None` on a surface without seams.
pub(super) fn likeness(mission: &Mission) -> Result<Option<SeamLikeness>, MissionError> {
    let task = &mission.task;
    let Some(at_seams) = band(task) else { return Ok(None) };
    let ghosts = &task.surface.beyond_seams;
    let continued = |mut image: Image| {
        ghosts.gather(image.data_mut());
        image
    };
    let (painted, wanted) = (continued(mission.painted_ink()), continued(task.wanted.clone()));
    let weight = continued(task.coverage_in_reach()).map(|share| f64::from(u8::from(share > 0.999)));
    // Ghosts are where windows end, not where they lie.
    let own = own_texels(task);
    let [near, far] =
        [true, false].map(|side| own.iter().zip(&at_seams).map(|(&o, &n)| o && n == side).collect::<Vec<_>>());
    Ok(Some(SeamLikeness {
        near: metrics::ssim_at(&painted, &wanted, Some(&weight), &near)?,
        far: metrics::ssim_at(&painted, &wanted, Some(&weight), &far)?,
    }))
}

/// `None` on a surface without seams.
pub(super) fn deposit_error(task: &PaintingTask) -> Result<Option<DepositError>, MissionError> {
    let (Some(at_seams), Some(last)) = (band(task), task.layers.last()) else { return Ok(None) };
    let PaintingTask { surface, settings, .. } = task;
    let kernel = kernel(settings)?;
    let mut naive = task.wanted.map(|_| 0.0);
    let mut shots = Vec::new();
    for layer in &task.layers {
        layer.sprays.iter().for_each(|spray| kernel.stamp(spray, &mut naive));
        let targets = layer_strokes(layer, surface, settings)?.ordered(None, &settings.planner)?.targets;
        let stand_off = settings.planner.nozzle.stand_off;
        let ways = targets.windows(2).flat_map(|pair| upright_steps(&pair[0], &pair[1], stand_off, SHOT_STEP));
        shots.extend(ways.map(|spray| shot(&spray.nozzle, spray.volume)));
    }
    let (texels, pixels) = surface.film_texels();
    let mut film = Film::new(texels)?;
    film.deposit(&shots, &spray_model(settings), &surface.world, settings.threads, &mut |_, _| ())?;
    let own = own_texels(task);
    let error = |expected: &Image, near: bool| {
        let (mut off, mut all) = (0.0, 0.0);
        for (k, (&pixel, texel)) in pixels.iter().zip(film.texels()).enumerate() {
            if own[pixel] && at_seams[pixel] == near {
                let there = film.thickness(k) / UNIT_THICKNESS;
                off += texel.area * (expected.data()[pixel] - there).abs();
                all += texel.area * there;
            }
        }
        off / f64::max(all, f64::MIN_POSITIVE)
    };
    Ok(Some(DepositError {
        near: error(&last.canvas, true),
        naive: error(&naive, true),
        far: error(&last.canvas, false),
    }))
}

/// Texels of the surface that show nothing else.
fn own_texels(task: &PaintingTask) -> Vec<bool> {
    let mut own: Vec<bool> = task.coverage.data().iter().map(|&covered| covered > 0.0).collect();
    for (ghost, _) in task.surface.beyond_seams.ghosts() {
        own[*ghost] = false;
    }
    own
}

/// Texels nearer to a seam than the band is wide; `None` on a surface without seams.
fn band(task: &PaintingTask) -> Option<Vec<bool>> {
    let ghosts = task.surface.beyond_seams.ghosts();
    if ghosts.is_empty() {
        return None;
    }
    let (width, height) = (task.surface.width(), task.surface.height());
    // The seam lies half a texel before the first centre beyond it.
    let reach = BAND / task.settings.texel + 0.5;
    let steps = reach.floor() as i64;
    let mut near = vec![false; width * height];
    for &(ghost, _) in ghosts {
        for dy in -steps..=steps {
            for dx in -steps..=steps {
                let (x, y) = ((ghost % width) as i64 + dx, (ghost / width) as i64 + dy);
                let inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
                if inside && ((dx * dx + dy * dy) as f64) <= reach * reach {
                    near[y as usize * width + x as usize] = true;
                }
            }
        }
    }
    Some(near)
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use nalgebra::{Point3, Vector3};
    use paint_planner::mission::TargetOutcomes;

    use super::super::settings::MissionSettings;
    use super::*;
    use crate::design::Design;
    use crate::mesh_io::TriangleMesh;
    use crate::region::Scene;

    const TEXEL: f64 = 0.025;

    /// A cube of 0.6 m, half of it dark.
    fn cube() -> PaintingTask {
        let mut mesh = TriangleMesh::default();
        let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { 0.3 } else { -0.3 });
        mesh.positions = (0..8).map(corner).map(|[x, y, z]| [x, y, z + 1.8]).collect();
        for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
        let settings = MissionSettings { texel: TEXEL, ..MissionSettings::default() };
        PaintingTask::new("cube", &Scene::whole(mesh), &Design::Even { ink: 0.5 }, settings).unwrap()
    }

    /// How far every texel lies from where the surface is cut, metres; `None` beside it.
    fn from_cut(task: &PaintingTask) -> Vec<Option<f64>> {
        let disk = task.surface.disk();
        let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
        for face in disk.faces() {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let at = |v: u32| Point3::from(disk.positions()[v as usize]);
        let cut: Vec<_> = edges.iter().filter(|(_, sides)| **sides == 1).map(|([a, b], _)| (at(*a), at(*b))).collect();
        let to = |p: &Point3<f64>, (a, b): &(Point3<f64>, Point3<f64>)| {
            let way: Vector3<f64> = b - a;
            let share = ((p - a).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
            (p - (a + way * share)).norm()
        };
        let (width, height) = (task.surface.width(), task.surface.height());
        let of = |k: usize| {
            let at = task.surface.texels.at(k % width, k / width)?;
            let point = task.surface.chart.point(at);
            Some(cut.iter().map(|edge| to(&point, edge)).fold(f64::INFINITY, f64::min))
        };
        (0..width * height).map(of).collect()
    }

    #[test]
    fn the_band_is_what_lies_within_three_centimetres_of_a_cut() {
        let task = cube();
        let (own, near, distance) = (own_texels(&task), band(&task).unwrap(), from_cut(&task));
        let mut counts = [0; 2];
        for k in (0..own.len()).filter(|&k| own[k]) {
            let distance = distance[k].unwrap();
            assert!(!near[k] || distance < BAND + 1.5 * TEXEL, "{k}: {distance} m");
            assert!(near[k] || distance > BAND - TEXEL, "{k}: {distance} m");
            counts[usize::from(near[k])] += 1;
        }
        assert!(counts.iter().all(|count| *count > 200), "far and near: {counts:?}");
        assert!(task.surface.beyond_seams.ghosts().iter().all(|(ghost, _)| !own[*ghost]));
    }

    /// Nothing is painted. A pattern that is wanted counts where it is, and nowhere else.
    #[test]
    fn a_pattern_at_seams_shows_at_seams() {
        let likeness_of = |wanted_at: &dyn Fn(f64) -> bool| {
            let mut task = cube();
            let (distance, width) = (from_cut(&task), task.surface.width());
            task.in_reach.fill(true);
            for (k, ink) in task.wanted.data_mut().iter_mut().enumerate() {
                let dark = distance[k].is_some_and(wanted_at) && (k % width + k / width).is_multiple_of(2);
                *ink = f64::from(u8::from(dark));
            }
            let (texels, pixels) = task.film_texels();
            let (film, outcomes) = (Film::new(texels).unwrap(), TargetOutcomes::default());
            let (flights, looked) = (Vec::new(), None);
            let (planning, unreachable_paint, kept_off, left_bare) = (0.0, 0.0, 0, 0);
            let mission = Mission {
                task,
                flights,
                film,
                pixels,
                ran: Vec::new(),
                ground_times: [0.0; 2],
                partly_painted: Vec::new(),
                planning,
                unreachable_paint,
                kept_off,
                left_bare,
                outcomes,
                looked,
                identified: None,
                grounded: None,
            };
            likeness(&mission).unwrap().unwrap()
        };
        let seams = likeness_of(&|distance| distance < BAND);
        assert!(seams.near < 0.3 && seams.far > seams.near + 0.3, "{} {}", seams.near, seams.far);
        // Windows are 11 texels wide.
        let middles = likeness_of(&|distance| distance > BAND + 6.5 * TEXEL);
        assert!(middles.near > 1.0 - 1e-9 && middles.far < 0.9, "{} {}", middles.near, middles.far);
    }
}
