//! Pose graphs with known poses: a spiral around a sphere and one around a torus, as the literature's `sphere2500` and `torus3D`.

use nalgebra::{Isometry3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use tsdf_hash::pose_graph::{BetweenFactor, PoseGraph, RobustKernel};

/// A graph whose poses are those of its odometry, and the true ones.
pub(crate) struct World {
    pub(crate) graph: PoseGraph,
    pub(crate) truth: Vec<Isometry3<f64>>,
}

/// Standard deviations of a measurement, radians and metres.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub(crate) turn: f64,
    pub(crate) shift: f64,
}

/// `rings` circles of `per_ring` poses around a sphere of 10 m.
pub(crate) fn sphere(rings: usize, per_ring: usize, noise: Noise, uniform: &mut dyn FnMut() -> f64) -> World {
    let count = rings * per_ring;
    let place = |k: usize| {
        let latitude = std::f64::consts::PI * (k as f64 + 0.5) / count as f64 - std::f64::consts::FRAC_PI_2;
        let longitude = std::f64::consts::TAU * k as f64 / per_ring as f64;
        10.0 * Vector3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin())
    };
    spiral(count, per_ring, &place, noise, uniform)
}

/// `turns` circles of `per_turn` poses around the tube of a torus of 10 m and 3 m.
pub(crate) fn torus(turns: usize, per_turn: usize, noise: Noise, uniform: &mut dyn FnMut() -> f64) -> World {
    let count = turns * per_turn;
    let place = |k: usize| {
        let (around, along) =
            (std::f64::consts::TAU * k as f64 / per_turn as f64, std::f64::consts::TAU * k as f64 / count as f64);
        let radius = 10.0 + 3.0 * around.cos();
        Vector3::new(radius * along.cos(), radius * along.sin(), 3.0 * around.sin())
    };
    let mut world = spiral(count, per_turn, &place, noise, uniform);
    // Closed: the last turn meets the first one.
    for k in 0..per_turn {
        measure(&mut world, count - per_turn + k, k, noise, uniform);
    }
    world
}

/// Poses along a path, x forward; each is measured from the one before and from that of the turn before.
fn spiral(
    count: usize,
    period: usize,
    place: &dyn Fn(usize) -> Vector3<f64>,
    noise: Noise,
    uniform: &mut dyn FnMut() -> f64,
) -> World {
    let pose = |k: usize| {
        let (here, forward) = (place(k), place(k + 1) - place(k));
        let up = Vector3::new(0.3, 0.2, 1.0);
        let left = up.cross(&forward).normalize();
        let forward = forward.normalize();
        let axes = nalgebra::Matrix3::from_columns(&[forward, left, forward.cross(&left)]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Isometry3::from_parts(Translation3::from(here), rotation)
    };
    let truth: Vec<_> = (0..count).map(pose).collect();
    let mut world = World { graph: PoseGraph::default(), truth };
    world.graph.poses.push(world.truth[0]);
    for k in 1..count {
        measure(&mut world, k - 1, k, noise, uniform);
        let step = world.graph.betweens[world.graph.betweens.len() - 1].first_from_second;
        let mut next = world.graph.poses[k - 1] * step;
        next.rotation.renormalize();
        world.graph.poses.push(next);
        if k >= period {
            measure(&mut world, k - period, k, noise, uniform);
        }
    }
    world
}

fn measure(world: &mut World, first: usize, second: usize, noise: Noise, uniform: &mut dyn FnMut() -> f64) {
    // Box and Muller 1958.
    let mut normal = || (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
    let error = Vector6::from_fn(|k, _| normal() * if k < 3 { noise.turn } else { noise.shift });
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(error[0], error[1], error[2]));
    let shift = Translation3::new(error[3], error[4], error[5]);
    let first_from_second = world.truth[first].inverse() * world.truth[second] * Isometry3::from_parts(shift, turn);
    let weights = Vector6::from_fn(|k, _| if k < 3 { noise.turn.powi(-2) } else { noise.shift.powi(-2) });
    world.graph.betweens.push(BetweenFactor {
        first,
        second,
        first_from_second,
        information: Matrix6::from_diagonal(&weights),
        kernel: RobustKernel::Squared,
    });
}
