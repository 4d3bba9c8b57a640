//! Every place where a cloud could be, the likely ones refined, and how many are left.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::iterative_closest_point::{Alignment, Fit};
use super::local_cloud::LocalCloud;
use super::nearest_points::NearestPoints;
use super::oriented_point::{Lattice, OrientedPoint};
use super::settings::GlobalRegistrationSettings;
use crate::error::Error;
use crate::tracking::pose::within;

/// Points by which places are compared at first, and of which the first few already tell most that are none.
const PROBES: usize = 64;
const FIRST: usize = 16;
/// A place that its first probes leave with more of the cost is none.
const HOPELESS: f64 = 0.8;
/// Probes may be off by so much, spacings.
const REACH: f64 = 1.5;
/// Headings about that of the normals, rad.
const TURNS: [f64; 5] = [-0.1, -0.05, 0.0, 0.05, 0.1];
/// Headings where the normals tell none.
const AROUND: usize = 72;
/// Normals within so much of the vertical tell no heading.
const UPRIGHT: f64 = 0.95;
/// Inclinations of surface and cloud may differ by so much, as a cosine against the vertical.
const INCLINED: f64 = 0.2;
/// Fewest points of a cloud.
const LEAST: usize = 100;
/// Places nearer to each other are one: radians, metres.
const SAME: [f64; 2] = [0.05, 0.05];
/// The same before they are refined: radians, spacings.
const APART: [f64; 2] = [0.08, 3.0];
/// Most samples of a surface.
const MOST_SAMPLES: f64 = 3e7;

/// Where a cloud lies on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registered {
    /// Pose of the cloud.
    pub world_from_local: Isometry3<f64>,
    /// Share of the cloud that lies on the surface.
    pub share: f64,
    /// Distance of that from it, root mean square, metres.
    pub rms: f64,
}

/// A surveyed surface, ready for clouds.
///
/// With the vertical known from an inertial sensor, a point of the cloud laid onto one of the surface leaves the heading open, and the
/// normals of both tell that (point pair features, Drost et al. 2010, with the vertical as the second vector). So a few points of the cloud
/// are laid onto every point of the surface whose normal is inclined alike; what then lies on the surface tells the likely places, ICP
/// refines them, and the answer is all of them that remain: none before another surface or where its shape fixes no place, several where
/// it is ambiguous. Cloud and surface must see the same side.
///
/// ```
/// # use nalgebra::{Isometry3, Vector3};
/// # use tsdf_hash::global_registration::{GlobalRegistration, GlobalRegistrationSettings, LocalCloud};
/// # use tsdf_hash::{DepthView, Error};
/// # fn find(positions: &[[f32; 3]], faces: &[[u32; 3]], seen: &[(DepthView, Isometry3<f64>)]) -> Result<(), Error> {
/// let settings = GlobalRegistrationSettings::default();
/// let surface = GlobalRegistration::new(positions, faces, settings)?;
/// let mut cloud = LocalCloud::new(settings.spacing);
/// for (depth, local_from_camera) in seen {
///     cloud.add(depth, local_from_camera, 3.0)?;
/// }
/// match surface.register(&cloud, &Vector3::z())[..] {
///     [] => println!("not here"),
///     [found] => println!("at {}", found.world_from_local),
///     [..] => println!("it could be at several places"),
/// }
/// # Ok(())
/// # }
/// ```
pub struct GlobalRegistration {
    settings: GlobalRegistrationSettings,
    surface: NearestPoints,
}

impl GlobalRegistration {
    /// A surface from its triangles, counter-clockwise seen from the free side.
    ///
    /// # Errors
    /// Settings out of range, faces that name no vertex, a surface too large for the spacing.
    pub fn new(
        positions: &[[f32; 3]],
        faces: &[[u32; 3]],
        settings: GlobalRegistrationSettings,
    ) -> Result<Self, Error> {
        settings.check()?;
        let mut lattice = Lattice::new(settings.spacing);
        let mut samples = 0.0;
        for face in faces {
            let corner = |k: usize| positions.get(face[k] as usize).map(|p| Vector3::from(p.map(f64::from)));
            let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(corner) else {
                let value = f64::from(face[0].max(face[1]).max(face[2]));
                return Err(Error::InvalidSetting { name: "faces", value, requirement: "numbers of vertices" });
            };
            let (along, across) = (b - a, c - a);
            // What has no area, or is not finite, is no surface.
            let Some(normal) = along.cross(&across).try_normalize(1e-15).filter(|n| n.iter().all(|v| v.is_finite()))
            else {
                continue;
            };
            let longest = along.norm().max(across.norm()).max((c - b).norm());
            let parts = (2.0 * longest / settings.spacing).ceil().max(1.0);
            samples += 0.5 * parts * parts;
            if samples > MOST_SAMPLES {
                let requirement = "larger: the surface has too many points of this distance";
                return Err(Error::InvalidSetting { name: "spacing", value: settings.spacing, requirement });
            }
            let parts = parts as usize;
            for i in 0..parts {
                for j in 0..parts - i {
                    let [s, t] = [i, j].map(|k| (k as f64 + 1.0 / 3.0) / parts as f64);
                    lattice.add(&Point3::from(a + along * s + across * t), &normal);
                }
            }
        }
        Ok(Self { settings, surface: NearestPoints::new(lattice.points(), settings.spacing) })
    }

    /// What it was told.
    pub fn settings(&self) -> &GlobalRegistrationSettings {
        &self.settings
    }

    /// All places where a cloud lies on the surface, the best first; `up`: the vertical in the frame of the cloud, to a degree or two.
    pub fn register(&self, cloud: &LocalCloud, up: &Vector3<f64>) -> Vec<Registered> {
        let mut cloud = cloud.points();
        let level = up.try_normalize(1e-9).and_then(|up| UnitQuaternion::rotation_between(&up, &self.settings.up));
        let Some(level) = level.filter(|_| cloud.len() >= LEAST) else { return Vec::new() };
        // About its middle, and level.
        let middle = cloud.iter().map(|p| p.point.coords).sum::<Vector3<f64>>() / cloud.len() as f64;
        for point in &mut cloud {
            point.point = Point3::from(level * (point.point.coords - middle));
            point.normal = level * point.normal;
        }
        let alignment = Alignment { surface: &self.surface, cloud: &cloud, spacing: self.settings.spacing };
        let mut found: Vec<(Fit, Isometry3<f64>)> = Vec::new();
        for start in self.likely(&cloud) {
            let pose = alignment.settle(&start);
            let fit = alignment.fit(&pose);
            if fit.share >= self.settings.least_share
                && fit.slope >= self.settings.least_slope
                && !found.iter().any(|(_, other)| within(other, &pose, SAME))
            {
                found.push((fit, pose));
            }
        }
        found.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost));
        let most = found.first().map_or(0.0, |(best, _)| best.cost * self.settings.ambiguity);
        let centred_from_local = Isometry3::from_parts((level * -middle).into(), level);
        let registered = |(fit, pose): &(Fit, Isometry3<f64>)| Registered {
            world_from_local: pose * centred_from_local,
            share: fit.share,
            rms: fit.rms,
        };
        found.iter().filter(|(fit, _)| fit.cost <= most).map(registered).collect()
    }

    /// Places from which refining begins, of a level cloud about its middle.
    fn likely(&self, cloud: &[OrientedPoint]) -> Vec<Isometry3<f64>> {
        let probes: Vec<OrientedPoint> = spread(cloud, PROBES).into_iter().map(|k| cloud[k]).collect();
        let bases: Vec<OrientedPoint> = probes.iter().take(self.settings.bases).copied().collect();
        let mut places: Vec<(f64, Isometry3<f64>)> = Vec::new();
        for base in &bases {
            for on in &self.surface.points {
                let inclined = base.normal.dot(&self.settings.up) - on.normal.dot(&self.settings.up);
                if inclined.abs() > INCLINED {
                    continue;
                }
                for heading in self.headings(&base.normal, &on.normal) {
                    let rotation = UnitQuaternion::from_scaled_axis(self.settings.up * heading);
                    let shift = on.point - rotation * base.point;
                    let pose = Isometry3::from_parts(shift.into(), rotation);
                    let first = self.cost(&probes[..FIRST.min(probes.len())], &pose);
                    if first < HOPELESS {
                        places.push((self.cost(&probes, &pose), pose));
                    }
                }
            }
        }
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut likely: Vec<Isometry3<f64>> = Vec::new();
        let apart = [APART[0], APART[1] * self.settings.spacing];
        for (_, pose) in places {
            if likely.len() == self.settings.refined {
                break;
            }
            if !likely.iter().any(|other| within(other, &pose, apart)) {
                likely.push(pose);
            }
        }
        likely
    }

    /// Turns about the vertical that lay one normal onto another.
    fn headings(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vec<f64> {
        let up = &self.settings.up;
        if from.dot(up).abs().max(to.dot(up).abs()) > UPRIGHT {
            return (0..AROUND).map(|k| std::f64::consts::TAU * k as f64 / AROUND as f64).collect();
        }
        let level = |v: &Vector3<f64>| v - up * v.dot(up);
        let (from, to) = (level(from), level(to));
        let heading = up.dot(&from.cross(&to)).atan2(from.dot(&to));
        TURNS.map(|turn| heading + turn).to_vec()
    }

    /// Mean of the squared distances of probes from the surface, cut at the largest, over the square of that.
    fn cost(&self, probes: &[OrientedPoint], pose: &Isometry3<f64>) -> f64 {
        let reach = REACH * self.settings.spacing;
        let off = |probe: &OrientedPoint| {
            let there = pose * probe.point;
            let partner = self.surface.near(&there)?;
            let off = partner.normal.dot(&(there - partner.point)) / reach;
            let alike = partner.normal.dot(&(pose.rotation * probe.normal)) > 0.5;
            (alike && off.abs() < 1.0).then_some(off * off)
        };
        probes.iter().map(|probe| off(probe).unwrap_or(1.0)).sum::<f64>() / probes.len().max(1) as f64
    }
}

/// Numbers of points that are far from each other, from the one nearest to the middle on (farthest point sampling, Gonzalez 1985).
fn spread(points: &[OrientedPoint], count: usize) -> Vec<usize> {
    let norms = points.iter().map(|p| p.point.coords.norm_squared()).enumerate();
    let Some((first, _)) = norms.min_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
    let mut chosen = vec![first];
    let mut off: Vec<f64> = points.iter().map(|p| (p.point - points[first].point).norm_squared()).collect();
    while chosen.len() < count.min(points.len()) {
        let Some((next, _)) = off.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { break };
        chosen.push(next);
        for (off, p) in off.iter_mut().zip(points) {
            *off = off.min((p.point - points[next].point).norm_squared());
        }
    }
    chosen
}
