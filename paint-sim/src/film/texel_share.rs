//! The share of a shot that texels catch: the density over a square by Gauss's rule, several texels at once.
//!
//! `unsafe`: a function that is compiled for AVX2 may only be called where the processor has it; that is asked before. Both versions do the
//! same operations in the same order, so their results are the same bits.
#![allow(unsafe_code, reason = "a function compiled for AVX2 is called where the processor has it")]

use std::array::from_fn;

use nalgebra::Vector3;

use super::texel::Texel;
use crate::spray::{Cone, SlopeForms};

/// Up to this size, in deviations of the spot, a texel is one sample.
pub(super) const SINGLE_SAMPLE_SIZE: f64 = 0.125;

/// Up to this size two by two Gauss points leave a relative error of about 5e-5 in the middle of the spot.
pub(super) const TWO_POINT_SIZE: f64 = 0.5;

/// Up to this size three by three points leave less. Larger texels are cut into pieces of this size.
pub(super) const THREE_POINT_SIZE: f64 = 1.0;

/// Most pieces per side of one texel.
pub(super) const MAX_PIECES_PER_SIDE: f64 = 8.0;

/// Radius of a ball around all samples of a texel, in its sides: half a diagonal, and a little for rounding.
pub(super) const REACH: f64 = 0.75;

/// Gauss points on -1/2..1/2, and their weights.
pub(super) const TWO: [(f64, f64); 2] = [(-0.288_675_134_594_812_9, 0.5), (0.288_675_134_594_812_9, 0.5)];
pub(super) const THREE: [(f64, f64); 3] =
    [(-0.387_298_334_620_741_7, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.387_298_334_620_741_7, 5.0 / 18.0)];

/// Texels side by side, so that a loop over them becomes vector code.
pub(super) const LANES: usize = 8;

type Lanes = [f64; LANES];

/// By how many points a texel is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Points {
    Two,
    Three,
    Pieces,
}

impl Points {
    /// From the fewest points up.
    pub(super) const ALL: [Self; 3] = [Self::Two, Self::Three, Self::Pieces];

    /// As the texel is large for the spot; `None` of one that catches nothing. What is not wholly before the nozzle is cut into pieces.
    pub(super) fn of(cone: &Cone, texel: &Texel) -> Option<Self> {
        let ray = texel.point - cone.origin;
        let (side, deviation) = (texel.area.sqrt(), ray.dot(cone.axis) * cone.deviation);
        if ray.dot(&texel.normal) >= 0.0 || !cone.may_intersect(&texel.point, REACH * side) {
            return None;
        }
        Some(if side <= TWO_POINT_SIZE * deviation {
            Self::Two
        } else if side <= THREE_POINT_SIZE * deviation {
            Self::Three
        } else {
            Self::Pieces
        })
    }
}

/// Shares of the shot that texels catch if nothing stands before them.
pub(super) type TexelShares = fn(&Cone, &SlopeForms, &[&Texel; LANES], Points) -> Lanes;

/// The best version that this processor runs.
pub(super) fn vectorised() -> TexelShares {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return |cone, forms, texels, points| unsafe { texel_shares_avx2(cone, forms, texels, points) };
    }
    texel_shares
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn texel_shares_avx2(cone: &Cone, forms: &SlopeForms, texels: &[&Texel; LANES], points: Points) -> Lanes {
    texel_shares(cone, forms, texels, points)
}

#[inline(always)]
fn texel_shares(cone: &Cone, forms: &SlopeForms, texels: &[&Texel; LANES], points: Points) -> Lanes {
    match points {
        Points::Two => shares_by(&TWO, cone, forms, texels),
        Points::Three => shares_by(&THREE, cone, forms, texels),
        Points::Pieces => texels.map(|texel| share_in_pieces(cone, forms, texel)),
    }
}

#[inline(always)]
fn shares_by<const N: usize>(
    rule: &[(f64, f64); N],
    cone: &Cone,
    forms: &SlopeForms,
    texels: &[&Texel; LANES],
) -> Lanes {
    let rays: [Lanes; 3] = from_fn(|axis| from_fn(|k| texels[k].point[axis] - cone.origin[axis]));
    let normals: [Lanes; 3] = from_fn(|axis| from_fn(|k| texels[k].normal[axis]));
    let areas: Lanes = from_fn(|k| texels[k].area);
    let mut shares = [0.0; LANES];
    for k in 0..LANES {
        let [ray, normal] = [&rays, &normals].map(|v| Vector3::new(v[0][k], v[1][k], v[2][k]));
        shares[k] = Square::new(cone, forms, ray, normal, areas[k]).share(rule, forms, [0.0; 2], 1.0);
    }
    shares
}

fn share_in_pieces(cone: &Cone, forms: &SlopeForms, texel: &Texel) -> f64 {
    let square = Square::new(cone, forms, texel.point - cone.origin, *texel.normal, texel.area);
    let pieces = if square.deviation > 0.0 {
        (square.side / (THREE_POINT_SIZE * square.deviation)).ceil().min(MAX_PIECES_PER_SIDE)
    } else {
        MAX_PIECES_PER_SIDE
    };
    let middle = |k: u32| (f64::from(k) + 0.5) / pieces - 0.5;
    let mut sum = 0.0;
    for i in 0..pieces as u32 {
        for j in 0..pieces as u32 {
            sum += square.share(&THREE, forms, [middle(i), middle(j)], 1.0 / pieces);
        }
    }
    sum
}

/// A texel as a square, by the three forms of the spray.
struct Square {
    side: f64,
    area: f64,
    /// Distance of the nozzle from its plane, which all its points share.
    facing: f64,
    /// Deviation of the spot there, m.
    deviation: f64,
    middle: [f64; 3],
    /// Along both sides, as long as they are.
    along: [[f64; 3]; 2],
}

impl Square {
    #[inline(always)]
    fn new(cone: &Cone, forms: &SlopeForms, ray: Vector3<f64>, normal: Vector3<f64>, area: f64) -> Self {
        let side = area.sqrt();
        let facing = -ray.dot(&normal);
        let middle = forms.of(&ray);
        let deviation = middle[0] * cone.deviation;
        let extent = if side <= SINGLE_SAMPLE_SIZE * deviation { 0.0 } else { side };
        let (u, v) = tangents(&normal);
        let along = [forms.of(&(u * extent)), forms.of(&(v * extent))];
        Self { side, area, facing, deviation, middle, along }
    }

    /// Share of the shot that a piece catches, `size` times as long, its middle as many sides from that of the square.
    #[inline(always)]
    fn share<const N: usize>(&self, rule: &[(f64, f64); N], forms: &SlopeForms, middle: [f64; 2], size: f64) -> f64 {
        let [u, v] = &self.along;
        let mut sum = 0.0;
        for (i, weight) in rule {
            let a = middle[0] + i * size;
            let row: [f64; 3] = from_fn(|form| self.middle[form] + a * u[form]);
            for (j, other) in rule {
                let b = middle[1] + j * size;
                sum += (weight * other) * forms.density(&from_fn(|form| row[form] + b * v[form]));
            }
        }
        let share = sum * self.facing * self.area * (size * size);
        if self.facing > 0.0 { share } else { 0.0 }
    }
}

/// Two unit vectors that make a right-handed frame with the normal, continuous except where the normal is -z
/// (Duff et al. 2017).
#[inline(always)]
fn tangents(n: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vector3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spray::SprayModel;
    use nalgebra::{Point3, UnitVector3};

    /// What the processor's own vectors compute is what any computes.
    #[test]
    fn all_versions_give_the_same_bits() {
        let sprays = [SprayModel::default(), SprayModel { aspect: 1.5, yaw: 0.1, ..SprayModel::default() }];
        let (origin, axis) = (Point3::origin(), Vector3::z_axis());
        let mut caught = 0;
        for round in 0..400 {
            let cone = Cone::new(&sprays[round % 2], &origin, &axis);
            let texels: [Texel; LANES] = from_fn(|lane| {
                let part = |k: usize| ((round * LANES + lane) as f64 * [0.618, 0.755, 0.57][k]).fract() - 0.5;
                Texel {
                    point: Point3::new(0.1 * part(0), 0.1 * part(1), 0.1 + 0.15 * part(2)),
                    normal: UnitVector3::new_normalize(Vector3::new(part(1), part(2), part(0) - 0.5)),
                    area: 1e-6 * (1.0 + round as f64),
                }
            });
            let lanes = texels.each_ref();
            let forms = cone.slope_forms();
            for points in [Points::Two, Points::Three, Points::Pieces] {
                let [plain, vector] =
                    [texel_shares, vectorised()].map(|version| version(&cone, &forms, &lanes, points));
                assert_eq!(plain.map(f64::to_bits), vector.map(f64::to_bits));
                caught += plain.iter().filter(|share| **share > 0.0).count();
            }
        }
        assert!(caught > 400, "{caught}");
    }
}
