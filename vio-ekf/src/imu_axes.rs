//! Which axes, signs and unit inertial samples have, as the images of a camera tell.

use std::fmt;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::imu_rest::bias_at_rest;
use crate::trajectory::same_length;
use crate::{CameraModel, Error, Imu, PointObservation, Stamp, so3};

/// Images that one window holds.
const WINDOW: usize = 12;
/// Time between them at least, s: long enough for accelerations to show; where too few points stay in view for so long, shorter.
const SPACINGS: [f64; 3] = [0.15, 0.08, 0.04];
/// Least points that two images, or a window, must share.
const MIN_POINTS: usize = 8;
/// Time between the two images that tell a rotation, s.
const PAIR_S: f64 = 0.15;
/// A reading is wrong if another one leaves less than this share of what it leaves.
const CLEARER: f64 = 0.7;
/// With fewer windows, or pairs, than this chance plays a part, and it must be less than this share.
const FEW: (usize, f64) = (15, 0.4);
/// Readings that leave no more than this many times the least are equally good; of these the one with the fewest changes counts.
const EQUAL: f64 = 1.3;
/// Windows, and pairs of images, without which nothing is said.
const MIN_WINDOWS: usize = 3;
const MIN_PAIRS: usize = 20;
/// More pairs, and more windows, tell no more.
const MAX_PAIRS: usize = 120;
const MAX_WINDOWS: usize = 40;
/// Steps between samples that count as one rotation.
const STEPS_TOGETHER: usize = 4;
/// Standard deviation of an accelerometer's bias, m/s², and of what a direction times its distance is off, m: their ratio weighs
/// the bias in the fit.
const BIAS_SIGMA: f64 = 0.1;
const PLACE_SIGMA: f64 = 0.01;
/// Prior distance of a point, m, and its weight, per m².
const PRIOR_DISTANCE: (f64, f64) = (4.0, 1e-5);
/// Degrees in a radian, the other unit of rates.
const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Unknowns of a window: velocity, gravity, bias; then the entries of the accelerometer's matrix, and one for what is known.
const FREE: usize = 9;
const TERMS: usize = FREE + 9 + 1;

/// How one sensor has to be read: signed axes, and their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AxesReading {
    /// What is right, from what is given: a signed permutation of the axes.
    pub axes: Matrix3<f64>,
    /// Whether rates are given in degrees per second.
    pub in_degrees: bool,
    /// What is left unexplained as it is given, and with this reading: mean squares of unequal meaning, of which only the ratio counts.
    pub unexplained: [f64; 2],
}

/// What the images say about the axes of inertial samples. `None` where nothing is wrong, or nothing can be told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AxesCheck {
    /// How the gyroscope has to be read.
    pub gyro: Option<AxesReading>,
    /// How the accelerometer has to be read, once the gyroscope is.
    pub accel: Option<AxesReading>,
    /// Pairs of images that told of the gyroscope, and windows that told of the accelerometer.
    pub evidence: [usize; 2],
}

impl fmt::Display for AxesReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |i: usize| {
            let column = (0..3).find(|&c| self.axes[(i, c)] != 0.0).unwrap_or(i);
            format!("{}{}", if self.axes[(i, column)] < 0.0 { "-" } else { "" }, ["x", "y", "z"][column])
        };
        write!(f, "({}, {}, {})", row(0), row(1), row(2))?;
        if self.in_degrees { f.write_str(" in degrees per second") } else { Ok(()) }
    }
}

impl AxesReading {
    fn new(axes: Matrix3<f64>, in_degrees: bool) -> Self {
        Self { axes, in_degrees, unexplained: [0.0; 2] }
    }

    fn factor(&self) -> f64 {
        if self.in_degrees { RADIANS_PER_DEGREE } else { 1.0 }
    }

    /// Axes that are not where they were, signs that are turned, another unit.
    fn changes(&self) -> usize {
        let moved = (0..3).filter(|&i| self.axes[(i, i)] == 0.0).count();
        let negative = self.axes.iter().filter(|v| **v < 0.0).count();
        // All three negated are one mistake.
        moved + if negative == 3 { 1 } else { negative } + usize::from(self.in_degrees)
    }
}

/// Compares inertial samples with the points that a tracker has followed through the images, each by its id, without any help of the
/// samples.
///
/// The gyroscope's reading is the one with which points of two images, turned into common axes, have the normals of their epipolar
/// planes in one plane (Kneip and Lynen 2013). The accelerometer's is the one with which the points stay where they are while the
/// camera moves under gravity of its known length: linear equations in velocity, gravity, bias and distances (Martinelli 2014), in
/// which the reading is linear too, so that all 48 signed permutations cost one set of equations a window. `time_offset_s` is added to
/// the images' stamps.
///
/// An axis that the motion does not excite looks the same with either sign, and is not named.
pub fn check_imu_axes(
    samples: &[Imu],
    images: &[(Stamp, Vec<PointObservation>)],
    camera: &dyn CameraModel,
    (gravity, time_offset_s): (f64, f64),
) -> Result<AxesCheck, Error> {
    same_length("samples", samples.len().min(2), "samples that are needed", 2)?;
    let body_from_camera = camera.body_from_camera();
    let images: Vec<SeenImage> = images
        .iter()
        .map(|(stamp, points)| SeenImage {
            stamp: stamp.plus_secs(time_offset_s),
            points: points
                .iter()
                .filter_map(|p| Some((p.id, body_from_camera.rotation * camera.bearing(&p.pixel)?.into_inner())))
                .collect(),
        })
        .filter(|image| image.stamp >= samples[0].stamp && image.stamp <= samples[samples.len() - 1].stamp)
        .collect();
    let bias = bias_at_rest(samples);
    let (gyro, pairs) = check_gyroscope(samples, &images, &bias);
    let read = gyro.unwrap_or_else(|| AxesReading::new(Matrix3::identity(), false));
    let turned = |sample: &Imu| Imu { gyro: read.axes * (sample.gyro - bias) * read.factor(), ..*sample };
    let samples: Vec<Imu> = samples.iter().map(turned).collect();
    let lever = body_from_camera.translation.vector;
    let (accel, windows) = check_accelerometer(&samples, &images, &lever, gravity);
    Ok(AxesCheck { gyro, accel, evidence: [pairs, windows] })
}

/// An image: its time by the inertial sensor's clock, and the directions of points in body axes, by rising ids.
struct SeenImage {
    stamp: Stamp,
    points: Vec<(u64, Vector3<f64>)>,
}

impl SeenImage {
    fn direction(&self, id: u64) -> Option<Vector3<f64>> {
        self.points.iter().find(|point| point.0 == id).map(|point| point.1)
    }
}

/// The best reading if it is clearly better than the one given, and how many changes are the fewest among the equally good.
fn clearly_better(readings: &[AxesReading], left: &[Vec<f64>]) -> Option<AxesReading> {
    let evidence = left.first()?.len();
    let left: Vec<f64> = left.iter().map(|left| trimmed_mean(left)).collect();
    let given = *left.first()?;
    let least = left.iter().copied().fold(f64::INFINITY, f64::min);
    let clearer = if evidence < FEW.0 { FEW.1 } else { CLEARER };
    if least > clearer * given {
        return None;
    }
    let equal = readings.iter().zip(&left).filter(|(_, left)| **left <= EQUAL * least);
    let (best, &left) = equal.min_by(|a, b| a.0.changes().cmp(&b.0.changes()).then(a.1.total_cmp(b.1)))?;
    Some(AxesReading { unexplained: [given, left], ..*best })
}

fn check_gyroscope(samples: &[Imu], images: &[SeenImage], bias: &Vector3<f64>) -> (Option<AxesReading>, usize) {
    let readings: Vec<AxesReading> = [false, true]
        .into_iter()
        .flat_map(|degrees| signed_permutations().map(move |axes| AxesReading::new(axes, degrees)))
        .collect();
    let pairs = turning_pairs(samples, images, bias);
    let mut left: Vec<Vec<f64>> = vec![Vec::with_capacity(pairs.len()); readings.len()];
    for pair in &pairs {
        for (reading, left) in readings.iter().zip(&mut left) {
            left.push(pair.unexplained(reading));
        }
    }
    let pairs = pairs.len();
    if pairs < MIN_PAIRS {
        return (None, pairs);
    }
    (clearly_better(&readings, &left), pairs)
}

/// Two images, and how the sensor turned from one to the other.
struct Pair {
    /// Directions of the same points.
    seen: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Rotation vectors of successive short times, as read.
    turns: Vec<Vector3<f64>>,
}

/// The pairs of images between which the sensor turned most, whichever axes it has.
fn turning_pairs(samples: &[Imu], images: &[SeenImage], bias: &Vector3<f64>) -> Vec<Pair> {
    let (mut pairs, mut first): (Vec<Pair>, _) = (Vec::new(), 0);
    for (second, to) in images.iter().enumerate() {
        while first < second && to.stamp.secs_since(images[first].stamp) > 1.5 * PAIR_S {
            first += 1;
        }
        let from = &images[first];
        if to.stamp.secs_since(from.stamp) < PAIR_S {
            continue;
        }
        let seen: Vec<_> = from.points.iter().filter_map(|(id, d)| Some((*d, to.direction(*id)?))).collect();
        if seen.len() < MIN_POINTS {
            continue;
        }
        let steps = between(samples, from.stamp, to.stamp);
        let turn =
            |pair: &[Imu]| ((pair[0].gyro + pair[1].gyro) * 0.5 - bias) * pair[1].stamp.secs_since(pair[0].stamp);
        let each: Vec<Vector3<f64>> = steps.windows(2).map(turn).collect();
        let turns = each.chunks(STEPS_TOGETHER).map(|some| some.iter().sum()).collect();
        pairs.push(Pair { seen, turns });
    }
    let turned = |pair: &Pair| pair.turns.iter().sum::<Vector3<f64>>().norm();
    pairs.sort_by(|a, b| turned(b).total_cmp(&turned(a)));
    pairs.truncate(MAX_PAIRS);
    pairs
}

impl Pair {
    /// Smallest eigenvalue of the mean square of the normals of the epipolar planes.
    fn unexplained(&self, reading: &AxesReading) -> f64 {
        let mut rotation = UnitQuaternion::identity();
        for turn in &self.turns {
            rotation *= so3::exp(&(reading.axes * turn * reading.factor()));
        }
        let mut normals = Matrix3::zeros();
        for (a, b) in &self.seen {
            let normal = a.cross(&(rotation * b));
            normals += normal * normal.transpose();
        }
        normals.symmetric_eigenvalues().min().max(0.0) / self.seen.len() as f64
    }
}

/// Mean without the largest tenth: images in which a track has slipped.
fn trimmed_mean(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let kept = &sorted[..sorted.len() - sorted.len() / 10];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

fn check_accelerometer(
    samples: &[Imu],
    images: &[SeenImage],
    lever: &Vector3<f64>,
    gravity: f64,
) -> (Option<AxesReading>, usize) {
    let readings: Vec<AxesReading> = signed_permutations().map(|axes| AxesReading::new(axes, false)).collect();
    let mut left: Vec<Vec<f64>> = vec![Vec::new(); readings.len()];
    for spacing in SPACINGS {
        left.iter_mut().for_each(Vec::clear);
        for window in windows(images, spacing) {
            let Some(equations) = window_equations(samples, &window, lever) else { continue };
            for (reading, left) in readings.iter().zip(&mut left) {
                left.push(least_squares(&equations, reading, gravity));
            }
            if left[0].len() == MAX_WINDOWS {
                break;
            }
        }
        if left[0].len() >= MIN_WINDOWS {
            break;
        }
    }
    let windows = left[0].len();
    if windows < MIN_WINDOWS {
        return (None, windows);
    }
    (clearly_better(&readings, &left), windows)
}

/// Windows of images that are so far apart at least, each from where the one before ends.
fn windows(images: &[SeenImage], spacing: f64) -> Vec<Vec<&SeenImage>> {
    let (mut windows, mut window): (_, Vec<&SeenImage>) = (Vec::new(), Vec::with_capacity(WINDOW));
    for image in images {
        if window.last().is_none_or(|before| image.stamp.secs_since(before.stamp) >= spacing) {
            window.push(image);
        }
        if window.len() == WINDOW {
            windows.push(std::mem::replace(&mut window, vec![image]));
        }
    }
    windows
}

/// Normal equations of a window, without the distances, per equation; `None` if it shares too few points.
fn window_equations(
    samples: &[Imu],
    window: &[&SeenImage],
    lever: &Vector3<f64>,
) -> Option<SMatrix<f64, TERMS, TERMS>> {
    let moved: Vec<Moved> = moved(samples, window)?;
    // The camera's place by the terms: v t + g t²/2 + α(A) − α_b b + R r.
    let place = |k: usize| {
        let Moved { rotation, time, by_bias, by_entries } = &moved[k];
        let mut place = SMatrix::<f64, 3, TERMS>::zeros();
        place.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(*time);
        place.fixed_view_mut::<3, 3>(0, 3).fill_diagonal(0.5 * time * time);
        place.fixed_columns_mut::<3>(6).copy_from(&-by_bias);
        place.fixed_columns_mut::<9>(FREE).copy_from(by_entries);
        place.set_column(TERMS - 1, &(rotation * lever));
        place
    };
    let places: Vec<_> = (0..window.len()).map(place).collect();
    let mut ids: Vec<u64> = window.iter().flat_map(|image| image.points.iter().map(|point| point.0)).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let (mut used, mut count) = (0, 0.0);
    for id in ids {
        let seen: Vec<(usize, Vector3<f64>)> =
            window.iter().enumerate().filter_map(|(k, image)| Some((k, image.direction(id)?))).collect();
        // A point that is followed through half of the window tells of its motion.
        if seen.len() * 2 < window.len() {
            continue;
        }
        used += 1;
        let (anchor, first) = (seen[0].0, moved[seen[0].0].rotation * seen[0].1);
        let (mut hh, mut h) = (PRIOR_DISTANCE.1, SVector::<f64, TERMS>::zeros());
        h[TERMS - 1] = -PRIOR_DISTANCE.0 * PRIOR_DISTANCE.1;
        for (k, direction) in &seen[1..] {
            // m × (d m_a + r_a − r) = 0.
            let cross = so3::hat(&(moved[*k].rotation * direction));
            let row = cross * (places[anchor] - places[*k]);
            let by_distance = cross * first;
            hh += by_distance.norm_squared();
            h += row.transpose() * by_distance;
            normal += row.transpose() * row;
            count += 1.0;
        }
        normal -= h * h.transpose() / hh;
    }
    (used >= MIN_POINTS).then(|| normal / count)
}

/// What happened since the first image of a window.
struct Moved {
    rotation: UnitQuaternion<f64>,
    time: f64,
    /// `∬ R`, and `∬ R e_r f_c` for each entry of the accelerometer's matrix, row by row.
    by_bias: Matrix3<f64>,
    by_entries: SMatrix<f64, 3, 9>,
}

fn moved(samples: &[Imu], window: &[&SeenImage]) -> Option<Vec<Moved>> {
    let begin = window.first()?.stamp;
    let mut moved = vec![Moved {
        rotation: UnitQuaternion::identity(),
        time: 0.0,
        by_bias: Matrix3::zeros(),
        by_entries: SMatrix::zeros(),
    }];
    let (mut rotation, mut time) = (UnitQuaternion::identity(), 0.0);
    let (mut bias, mut entries) = ([Matrix3::zeros(); 2], [SMatrix::<f64, 3, 9>::zeros(); 2]);
    let mut from = begin;
    for image in &window[1..] {
        for pair in between(samples, from, image.stamp).windows(2) {
            let dt = pair[1].stamp.secs_since(pair[0].stamp);
            let (rate, force) = ((pair[0].gyro + pair[1].gyro) * 0.5, (pair[0].accel + pair[1].accel) * 0.5);
            let middle = (rotation * so3::exp(&(rate * (0.5 * dt)))).to_rotation_matrix().into_inner();
            let now = SMatrix::<f64, 3, 9>::from_fn(|axis, k| middle[(axis, k / 3)] * force[k % 3]);
            let half = 0.5 * dt * dt;
            bias[1] += bias[0] * dt + middle * half;
            bias[0] += middle * dt;
            entries[1] += entries[0] * dt + now * half;
            entries[0] += now * dt;
            rotation = UnitQuaternion::new_normalize((rotation * so3::exp(&(rate * dt))).into_inner());
            time += dt;
        }
        from = image.stamp;
        moved.push(Moved { rotation, time, by_bias: bias[1], by_entries: entries[1] });
    }
    Some(moved)
}

/// What a reading leaves of the equations with the best velocity, bias, and gravity of the given length.
fn least_squares(equations: &SMatrix<f64, TERMS, TERMS>, reading: &AxesReading, gravity: f64) -> f64 {
    // The reading makes a constant of nine terms.
    let mut fold = SMatrix::<f64, TERMS, { FREE + 1 }>::zeros();
    fold.fixed_view_mut::<FREE, FREE>(0, 0).fill_with_identity();
    for k in 0..9 {
        fold[(FREE + k, FREE)] = reading.axes[(k / 3, k % 3)];
    }
    fold[(TERMS - 1, FREE)] = 1.0;
    let mut folded = fold.transpose() * equations * fold;
    for k in 6..FREE {
        folded[(k, k)] += (PLACE_SIGMA / BIAS_SIGMA).powi(2);
    }
    let cost = |x: &SVector<f64, FREE>| {
        let mut full = SVector::<f64, { FREE + 1 }>::from_element(1.0);
        full.fixed_rows_mut::<FREE>(0).copy_from(x);
        full.dot(&(folded * full)).max(0.0)
    };
    let matrix = folded.fixed_view::<FREE, FREE>(0, 0).into_owned();
    let vector = -folded.fixed_view::<FREE, 1>(0, FREE).into_owned();
    let Some(factor) = matrix.cholesky() else { return f64::INFINITY };
    let mut x = factor.solve(&vector);
    // Gravity's length by a Lagrange multiplier on its linearised square, a few times.
    for _ in 0..4 {
        let along = x.fixed_rows::<3>(3).normalize();
        let mut constraint = SVector::<f64, FREE>::zeros();
        constraint.fixed_rows_mut::<3>(3).copy_from(&along);
        let free = factor.solve(&vector);
        let response = factor.solve(&constraint);
        let excess = constraint.dot(&free) - gravity;
        x = free - response * (excess / constraint.dot(&response));
    }
    cost(&x)
}

/// Readings from one time to another, both included, linear between samples.
fn between(samples: &[Imu], from: Stamp, to: Stamp) -> Vec<Imu> {
    let at = |stamp: Stamp| {
        let after = samples.partition_point(|sample| sample.stamp < stamp).clamp(1, samples.len() - 1);
        let (a, b) = (&samples[after - 1], &samples[after]);
        let share = (stamp.secs_since(a.stamp) / b.stamp.secs_since(a.stamp)).clamp(0.0, 1.0);
        Imu { stamp, gyro: a.gyro.lerp(&b.gyro, share), accel: a.accel.lerp(&b.accel, share) }
    };
    let inside = samples.partition_point(|s| s.stamp <= from)..samples.partition_point(|s| s.stamp < to);
    std::iter::once(at(from)).chain(samples[inside].iter().copied()).chain([at(to)]).collect()
}

/// All 48, the identity first.
fn signed_permutations() -> impl Iterator<Item = Matrix3<f64>> {
    let orders = [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
    orders.into_iter().flat_map(|order| {
        (0..8_u8).map(move |signs| {
            Matrix3::from_fn(|r, c| match (order[r] == c, signs >> r & 1) {
                (false, _) => 0.0,
                (true, 0) => 1.0,
                (true, _) => -1.0,
            })
        })
    })
}
