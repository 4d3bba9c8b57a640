//! Residuals of a pose: point-to-plane distances (Eq. (5.2)) and differences of intensity (Eq. (5.3)), with their Jacobians.

use nalgebra::{Isometry3, Vector3};

use crate::parallel::in_chunks;
use crate::settings::NoiseModel;
use crate::tracking::image_level::ImageLevel;
use crate::tracking::model_points::{Model, ModelPoint};
use crate::tracking::normal_equations::{NormalEquations, Run};
use crate::tracking::residual_scale::ResidualHistogram;

/// Huber's constant: 95 % efficiency on normal residuals.
const HUBER: f32 = 1.345;
/// Cost of a point without a partner: that of a residual of ten standard deviations.
const OUTLIER: f32 = HUBER * (10.0 - 0.5 * HUBER);
/// Tiles with fewer distances say nothing about what is shared.
const LEAST_TERMS: u32 = 16;
/// Points that are compared in colour alone count for so many that are in depth (ours).
const COLOUR_PER_DEPTH: u32 = 2;
/// Depth residuals are counted up to so many standard deviations of the noise model.
const MOST_DEVIATIONS: f32 = 32.0;
/// Intensity residuals are counted up to so many grey levels.
const MOST_LEVELS: f32 = 128.0;
/// Slopes of the intensity below so many of its standard deviations per pixel are noise (ours).
const LEAST_GRADIENT: f32 = 1.0;
/// No camera has more noise than so many grey levels (ours).
const MOST_NOISE: f32 = 4.0;

/// Standard deviations that residuals are measured in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scales {
    /// Of distances, as a multiple of the noise model's.
    pub(crate) depth: f32,
    /// Of intensities, grey levels.
    pub(crate) intensity: f32,
}

/// What is compared with the model at one level.
#[derive(Clone, Copy)]
pub(crate) struct Comparison<'a> {
    pub(crate) level: &'a ImageLevel,
    pub(crate) model: &'a Model,
    /// The camera that the positions of the points are relative to.
    pub(crate) origin: Vector3<f64>,
    pub(crate) noise: NoiseModel,
    /// Partners are at most so far apart, metres.
    pub(crate) max_distance: f32,
    /// Half a voxel: the map is not better than that, metres.
    pub(crate) tolerance: f32,
    /// As that of [`model_points`](crate::tracking::model_points::model_points).
    pub(crate) rim_width: f64,
    pub(crate) photometric: bool,
    pub(crate) threads: usize,
}

/// The sums over all points.
#[derive(Clone, Debug)]
pub(crate) struct Evaluation {
    pub(crate) equations: NormalEquations,
    /// `Σ ρ` of the distances and of the intensities: half of the sum of squared residuals, in standard deviations, where they are small.
    pub(crate) cost: [f64; 2],
    /// Points of the model that are in the image, in front of nothing nearer.
    pub(crate) in_view: u32,
    /// Points in the image where no depth was measured and there is a colour.
    pub(crate) in_colour: u32,
    /// Those with a partner.
    pub(crate) partners: u32,
    /// Those that agree with it.
    pub(crate) agreeing: u32,
    /// Of tiles: how many, and the sums of `m² − 1/Σw`, the mean distance of a tile squared beyond what independent noise makes.
    pub(crate) tiles: [f64; 2],
    /// Sum of the partners' depths, metres.
    pub(crate) depth_sum: f64,
    pub(crate) depth: ResidualHistogram,
    pub(crate) intensity: ResidualHistogram,
    /// Sums of the intensities of the model and of the frame, and of their difference's count: for the offset.
    pub(crate) grey: [f64; 3],
}

impl Evaluation {
    fn new() -> Self {
        Self {
            equations: NormalEquations::zero(),
            cost: [0.0; 2],
            in_view: 0,
            in_colour: 0,
            partners: 0,
            agreeing: 0,
            tiles: [0.0; 2],
            depth_sum: 0.0,
            depth: ResidualHistogram::new(MOST_DEVIATIONS),
            intensity: ResidualHistogram::new(MOST_LEVELS),
            grey: [0.0; 3],
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        self.equations.add(&other.equations);
        (0..2).for_each(|k| self.cost[k] += other.cost[k]);
        self.in_view += other.in_view;
        self.in_colour += other.in_colour;
        self.partners += other.partners;
        self.agreeing += other.agreeing;
        (0..2).for_each(|k| self.tiles[k] += other.tiles[k]);
        self.depth_sum += other.depth_sum;
        self.depth.merge(&other.depth);
        self.intensity.merge(&other.intensity);
        (0..3).for_each(|k| self.grey[k] += other.grey[k]);
        self
    }

    /// The mean cost of a term, with `share` terms of intensity to one of distance. Points in view without a partner count
    /// as outliers: a pose must not get better by losing them.
    pub(crate) fn mean_cost(&self, share: f64) -> f64 {
        let outliers = f64::from(OUTLIER) * f64::from(self.in_view - self.partners);
        let distance = (self.cost[0] + outliers) / f64::from(self.in_view.max(1));
        distance + share * self.cost[1] / f64::from(self.intensity.total.max(1))
    }

    /// Points that are compared with the frame: in depth, and in colour where there is none, as far as depth bears it out.
    pub(crate) fn compared(&self) -> u32 {
        self.in_view + self.in_colour.min(COLOUR_PER_DEPTH * self.in_view)
    }

    /// Terms of intensity to one of distance.
    pub(crate) fn share(&self) -> f64 {
        f64::from(self.intensity.total) / f64::from(self.in_view.max(1))
    }

    /// Variance that the distances of a tile share beyond independent noise, square metres.
    pub(crate) fn excess(&self) -> f64 {
        (self.tiles[1] / self.tiles[0].max(1.0)).max(0.0)
    }

    /// Mean depth of the partners, metres.
    pub(crate) fn mean_depth(&self) -> f64 {
        self.depth_sum / f64::from(self.partners.max(1))
    }

    /// By how much the frame is brighter than the model, grey levels.
    pub(crate) fn brightness(&self) -> f32 {
        if self.grey[2] > 0.0 { ((self.grey[1] - self.grey[0]) / self.grey[2]) as f32 } else { 0.0 }
    }
}

impl Comparison<'_> {
    /// Metres.
    pub(crate) fn voxel_size(&self) -> f64 {
        2.0 * f64::from(self.tolerance)
    }

    /// Compares at a pose; `brightness` is what the frame is brighter than the model, grey levels.
    pub(crate) fn evaluate(&self, pose: &Isometry3<f64>, scales: Scales, brightness: f32) -> Evaluation {
        let task = Task::new(self, pose, scales, brightness);
        // Tiles, added in their order: the sums do not depend on the number of threads.
        let mut runs: Vec<&[ModelPoint]> = self.model.tiles().collect();
        let parts = in_chunks(&mut runs, self.threads, |runs| {
            let (mut sums, mut all) = (Vec::with_capacity(runs.len()), Evaluation::new());
            for run in runs.iter() {
                let mut terms = [Run::ZERO; 2];
                let mut sum = Sums::default();
                run.iter().for_each(|point| task.add(point, &mut terms, &mut sum, &mut all));
                sums.push((terms, sum));
            }
            (sums, all)
        });
        let mut total = Evaluation::new();
        for (sums, counts) in parts {
            total = total.merge(&counts);
            for (terms, sum) in sums {
                total.equations.add_runs(&terms[0], &terms[1]);
                (0..2).for_each(|k| total.cost[k] += f64::from(sum.cost[k]));
                total.depth_sum += f64::from(sum.depth);
                if sum.terms >= LEAST_TERMS {
                    let [weight, pull] = sum.weighted.map(f64::from);
                    let mean = pull / weight;
                    total.tiles[0] += 1.0;
                    total.tiles[1] += mean * mean - 1.0 / weight;
                }
                (0..3).for_each(|k| total.grey[k] += f64::from(sum.grey[k]));
            }
        }
        total
    }
}

#[derive(Default)]
struct Sums {
    cost: [f32; 2],
    depth: f32,
    /// Distances, and the sums of their weights and of the weighted distances.
    terms: u32,
    weighted: [f32; 2],
    grey: [f32; 3],
}

/// A comparison at a pose, in single precision, relative to the camera of the view.
struct Task<'a> {
    of: &'a Comparison<'a>,
    /// Columns of the rotation of the pose.
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    scales: Scales,
    brightness: f32,
    noise: [f32; 3],
}

impl<'a> Task<'a> {
    fn new(of: &'a Comparison, pose: &Isometry3<f64>, scales: Scales, brightness: f32) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner().cast::<f32>();
        let noise = [of.noise.base, of.noise.quadratic, of.noise.nearest].map(|x| x as f32);
        let translation = (pose.translation.vector - of.origin).cast::<f32>().into();
        Self { of, rotation: rotation.into(), translation, scales, brightness, noise }
    }

    #[inline(always)]
    fn add(&self, point: &ModelPoint, runs: &mut [Run; 2], sums: &mut Sums, all: &mut Evaluation) {
        let [distances, intensities] = runs;
        let level = self.of.level;
        let arm = sub(point.position, self.translation);
        let [x, y, z] = self.rotation.map(|column| dot(column, arm));
        if z < 0.05 {
            return;
        }
        let inverse = 1.0 / z;
        let (u, v) = (level.focal[0] * x * inverse + level.centre[0], level.focal[1] * y * inverse + level.centre[1]);
        let (i, j) = ((u + 0.5) as usize, (v + 0.5) as usize);
        if !(u >= 0.0 && v >= 0.0 && i < level.width && j < level.height) {
            return;
        }
        let at = j * level.width + i;
        let omega = level.omega[at];
        let coloured = self.of.photometric && !point.intensity.is_nan();
        if omega <= 0.0 {
            // Not measured: no word for or against the surface, but what is there has a colour.
            if coloured {
                all.in_colour += 1;
                self.add_intensity(point, arm, [x, y, inverse, u, v], intensities, sums, all);
            }
            return;
        }
        all.in_view += 1;
        // The measured point, relative to the camera, along the axes of the world.
        let depth = 1.0 / omega;
        let ray = [
            (i as f32 - level.centre[0]) / level.focal[0] * depth,
            (j as f32 - level.centre[1]) / level.focal[1] * depth,
            depth,
        ];
        let measured = combine(self.rotation, ray);
        let apart = sub(measured, arm);
        if dot(apart, apart) > self.of.max_distance * self.of.max_distance {
            return;
        }
        let normal = point.normal;
        let residual = dot(normal, apart);
        let beyond = depth - self.noise[2];
        // The noise is along the optical axis, its share along the normal is what counts; never less than a fifth.
        let forward = [self.rotation[2][0], self.rotation[2][1], self.rotation[2][2]];
        let slant = dot(normal, forward).abs().max(0.2);
        let sigma = (self.noise[0] + self.noise[1] * beyond * beyond) * slant;
        let own = residual / sigma;
        all.partners += 1;
        all.agreeing += u32::from(residual.abs() <= 3.0 * sigma + self.of.tolerance);
        all.depth.add(own);
        sums.depth += depth;
        let (weight, cost) = huber(own / self.scales.depth);
        sums.cost[0] += cost;
        let weight = weight / (sigma * self.scales.depth * sigma * self.scales.depth);
        sums.terms += 1;
        sums.weighted[0] += weight;
        sums.weighted[1] += weight * residual;
        let turn = cross(measured, normal);
        distances.add([turn[0], turn[1], turn[2], normal[0], normal[1], normal[2]], residual, weight, 1.0);

        if coloured {
            self.add_intensity(point, arm, [x, y, inverse, u, v], intensities, sums, all);
        }
    }

    #[inline(always)]
    fn add_intensity(
        &self,
        point: &ModelPoint,
        arm: [f32; 3],
        [x, y, inverse, u, v]: [f32; 5],
        run: &mut Run,
        sums: &mut Sums,
        all: &mut Evaluation,
    ) {
        let level = self.of.level;
        let (i, j) = (u as usize, v as usize);
        if i + 1 >= level.width || j + 1 >= level.height {
            return;
        }
        let at = j * level.width + i;
        let (du, dv) = (u - i as f32, v - j as f32);
        let mix =
            |a: f32, b: f32, c: f32, d: f32| (1.0 - dv) * ((1.0 - du) * a + du * b) + dv * ((1.0 - du) * c + du * d);
        let corners = [at, at + 1, at + level.width, at + level.width + 1];
        let [a, b, c, d] = corners.map(|k| level.intensity[k]);
        let seen = mix(a, b, c, d);
        let [a, b, c, d] = corners.map(|k| level.gradient[k]);
        let (gu, gv) = (mix(a[0], b[0], c[0], d[0]), mix(a[1], b[1], c[1], d[1]));
        // A NaN, on the rim or without colour, fails. Far from the right pose the residuals are no noise.
        let least = LEAST_GRADIENT * self.scales.intensity.min(MOST_NOISE);
        let steep = gu * gu + gv * gv >= least * least;
        if !steep || seen.is_nan() {
            return;
        }
        (sums.grey[0], sums.grey[1], sums.grey[2]) =
            (sums.grey[0] + point.intensity, sums.grey[1] + seen, sums.grey[2] + 1.0);
        let residual = seen - point.intensity - self.brightness;
        all.intensity.add(residual);
        let (weight, cost) = huber(residual / self.scales.intensity);
        sums.cost[1] += cost;
        let (gx, gy) = (gu * level.focal[0] * inverse, gv * level.focal[1] * inverse);
        let gz = -(gx * x + gy * y) * inverse;
        // The gradient at the point, along the axes of the world.
        let g = combine(self.rotation, [gx, gy, gz]);
        let turn = cross(g, arm);
        let weight = weight / (self.scales.intensity * self.scales.intensity);
        run.add([turn[0], turn[1], turn[2], -g[0], -g[1], -g[2]], residual, weight, 0.0);
    }
}

/// Weight and cost of a residual in standard deviations.
#[inline(always)]
fn huber(residual: f32) -> (f32, f32) {
    let size = residual.abs();
    if size <= HUBER { (1.0, 0.5 * size * size) } else { (HUBER / size, HUBER * (size - 0.5 * HUBER)) }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `Σ columns[k] x[k]`.
#[inline(always)]
fn combine(columns: [[f32; 3]; 3], x: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|n| columns[0][n] * x[0] + columns[1][n] * x[1] + columns[2][n] * x[2])
}
