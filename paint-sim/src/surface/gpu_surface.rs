//! Triangles whose rays a GPU casts.

use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::{Point3, Vector3};

use super::gpu_tree::GpuTree;
use super::mesh::TriangleSurface;
use super::ray_query::{Hit, ShadowRay, Surface};
use crate::error::{Error, check_range};
use crate::gpu::{Fallback, GpuOptions, Input, Program, words};

const SOURCE: &str = include_str!("rays.wgsl");
/// Rays of one work group, and words of a ray.
const GROUP: usize = 64;
const RAY: usize = 12;
/// Rays of one run: their memory on this side, too, has an end.
const MOST_RAYS: usize = 1 << 18;
/// Single precision has a range; nothing that is painted comes near its ends.
const SIZES: [f64; 2] = [1e-6, 1e9];
/// By how much a direction's length may differ from one.
const UNIT: f64 = 1e-9;

/// Answers that are not the number of a triangle, as in `rays.wgsl`.
const NONE: u32 = u32::MAX;
const DOUBTFUL: u32 = u32::MAX - 1;
const DARK: u32 = u32::MAX - 2;

/// The rays of a [`TriangleSurface`] on a GPU, many at once; the answers are those of the processor, to the last bit.
///
/// The device searches in single precision and bounds its errors: it answers where the processor, in double precision, can only come to the same
/// triangle, whose distance the processor then works out. Rays that pass an edge, or two triangles, within those errors are left to the
/// processor, and so is everything once the device has failed.
pub struct GpuSurface<'a> {
    surface: &'a TriangleSurface,
    /// Where coordinates begin on the device.
    origin: Vector3<f64>,
    /// Largest coordinates on the device and in the world, m.
    reach: [f64; 2],
    nodes: wgpu::Buffer,
    triangles: wgpu::Buffer,
    first: Program,
    occluded: Program,
    fallback: Fallback,
    asked: AtomicU64,
    checked: AtomicU64,
    left: AtomicU64,
}

/// How many rays a GPU was asked for, and how many of them it left to the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GpuRayCount {
    /// Rays that it was asked for.
    pub asked: u64,
    /// Shadow rays of which it named the only triangle that may be in their way: the processor asked that one.
    pub checked: u64,
    /// Rays that the processor searched for.
    pub left: u64,
}

impl<'a> GpuSurface<'a> {
    /// Opens an adapter, and puts the triangles there.
    ///
    /// # Errors
    /// [`Error::Gpu`]: there is none, it refuses, or it cannot hold the triangles. Triangles smaller in all than a micrometre, or farther than
    /// 1e9 m.
    pub fn new(surface: &'a TriangleSurface, options: &GpuOptions) -> Result<Self, Error> {
        let GpuTree { nodes, triangles, origin, size, farthest } = GpuTree::new(surface.corners());
        check_range("size of a surface on a GPU", size, SIZES[0], SIZES[1], "between 1e-6 and 1e9 m")?;
        check_range("coordinate of a surface on a GPU", farthest, 0.0, SIZES[1], "within 1e9 m")?;
        let [first, occluded] = [Program::new(options, SOURCE, "first")?, Program::new(options, SOURCE, "occluded")?];
        let [nodes, triangles] = [first.keep(&words(&nodes))?, first.keep(&words(&triangles))?];
        let [asked, checked, left] = [0; 3].map(AtomicU64::new);
        let fallback = Fallback::default();
        let reach = [size, farthest];
        Ok(Self { surface, origin, reach, nodes, triangles, first, occluded, fallback, asked, checked, left })
    }

    /// Name and driver of the adapter.
    pub fn name(&self) -> &str {
        self.first.adapter()
    }

    /// The surface itself.
    pub fn surface(&self) -> &'a TriangleSurface {
        self.surface
    }

    /// The fault after which the processor does everything.
    pub fn fault(&self) -> Option<&Error> {
        self.fallback.fault()
    }

    /// Rays so far.
    pub fn rays(&self) -> GpuRayCount {
        let [asked, checked, left] =
            [&self.asked, &self.checked, &self.left].map(|count| count.load(Ordering::Relaxed));
        GpuRayCount { asked, checked, left }
    }

    /// What a program says of rays: origin, direction, and between which distances from the origin.
    fn ask(&self, program: &Program, rays: &[(Point3<f64>, Vector3<f64>, [f64; 2])]) -> Vec<u32> {
        let most = MOST_RAYS.min(GROUP * program.most_groups(GROUP * RAY));
        let mut answers = Vec::with_capacity(rays.len());
        for rays in rays.chunks(most) {
            let packed: Vec<u32> = rays.iter().flat_map(|ray| self.packed(ray)).map(f32::to_bits).collect();
            // By sixteen roundings of the processor.
            let [size, rounding] = [self.reach[0], self.reach[1] * 2.0_f64.powi(-48)].map(|v| (v as f32).to_bits());
            let uniform = words(&[rays.len() as u32, self.node_count(), size, rounding, 0, 0, 0, 0]);
            let inputs = [Input::Kept(&self.nodes), Input::Kept(&self.triangles), Input::Sent(&words(&packed))];
            let found =
                self.fallback.attempt(|| program.run(&uniform, &inputs, rays.len().div_ceil(GROUP), rays.len()));
            let found = found.unwrap_or_else(|| vec![DOUBTFUL; rays.len()]);
            answers
                .extend(found.iter().zip(rays).map(|(answer, ray)| if self.is_fit(ray) { *answer } else { DOUBTFUL }));
        }
        self.asked.fetch_add(rays.len() as u64, Ordering::Relaxed);
        let left = answers.iter().filter(|answer| **answer == DOUBTFUL).count();
        self.left.fetch_add(left as u64, Ordering::Relaxed);
        answers
    }

    fn node_count(&self) -> u32 {
        (self.nodes.size() / 32) as u32
    }

    /// Whether the bounds hold for a ray.
    fn is_fit(&self, (origin, direction, [_, end]): &(Point3<f64>, Vector3<f64>, [f64; 2])) -> bool {
        (origin.coords - self.origin).amax() <= SIZES[1]
            && (direction.norm() - 1.0).abs() <= UNIT
            && (0.0..=SIZES[1]).contains(end)
    }

    fn packed(&self, ray: &(Point3<f64>, Vector3<f64>, [f64; 2])) -> [f32; RAY] {
        if !self.is_fit(ray) {
            return [0.0; RAY];
        }
        let (origin, direction, [start, end]) = ray;
        let from = origin.coords - self.origin;
        let near = from.map(|v| v as f32);
        let rest = (from - near.map(f64::from)).map(|v| v as f32);
        let [start, end] = [*start as f32, *end as f32];
        let d = direction.map(|v| v as f32);
        [near.x, near.y, near.z, start, d.x, d.y, d.z, end, rest.x, rest.y, rest.z, 0.0]
    }
}

impl Surface for GpuSurface<'_> {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        self.surface.cast(origin, direction, max)
    }

    fn cast_beam(&self, origin: &Point3<f64>, directions: &[Vector3<f64>], max: f64) -> Vec<Option<Hit>> {
        let rays: Vec<_> = directions.iter().map(|direction| (*origin, *direction, [0.0, max])).collect();
        let hit = |(answer, direction): (u32, &Vector3<f64>)| match answer {
            NONE => None,
            DOUBTFUL => self.surface.cast(origin, direction, max),
            // A triangle that is not hit after all would be a fault of the bounds.
            triangle => self
                .surface
                .cast_at(triangle, origin, direction, max)
                .or_else(|| self.surface.cast(origin, direction, max)),
        };
        self.ask(&self.first, &rays).into_iter().zip(directions).map(hit).collect()
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        self.surface.occluded(origin, direction, max)
    }

    fn occluded_beam(&self, origin: &Point3<f64>, from: f64, rays: &[(Vector3<f64>, f64)]) -> Vec<bool> {
        let ray = |&(direction, length): &(Vector3<f64>, f64)| ShadowRay { origin: *origin, direction, from, length };
        self.occluded_each(&rays.iter().map(ray).collect::<Vec<_>>())
    }

    fn occluded_parallel(&self, origins: &[Point3<f64>], direction: &Vector3<f64>, max: f64) -> Vec<bool> {
        let ray = |&origin: &Point3<f64>| ShadowRay { origin, direction: *direction, from: 0.0, length: max };
        self.occluded_each(&origins.iter().map(ray).collect::<Vec<_>>())
    }

    fn occluded_each(&self, rays: &[ShadowRay]) -> Vec<bool> {
        let ends = |ray: &ShadowRay| (ray.origin, ray.direction, [ray.from, ray.from + ray.length.max(0.0)]);
        let dark = |(answer, ray): (u32, &ShadowRay)| {
            let (start, ShadowRay { direction, length, .. }) = (ray.start(), ray);
            *length > 0.0
                && match answer {
                    NONE => false,
                    DARK => true,
                    DOUBTFUL => self.surface.occluded(&start, direction, *length),
                    triangle => self.surface.cast_at(triangle, &start, direction, *length).is_some(),
                }
        };
        let answers = self.ask(&self.occluded, &rays.iter().map(ends).collect::<Vec<_>>());
        let checked = answers.iter().filter(|answer| **answer < DARK).count();
        self.checked.fetch_add(checked as u64, Ordering::Relaxed);
        answers.into_iter().zip(rays).map(dark).collect()
    }

    fn rays_at_once(&self) -> usize {
        MOST_RAYS
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.surface.distance(point, max)
    }
}
