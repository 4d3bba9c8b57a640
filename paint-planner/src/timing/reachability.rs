//! The fastest way along a fixed path, by two passes: which speeds can still be braked, then as fast as those allow (Pham and Pham 2018,
//! TOPP-RA). The limit of the acceleration is a ball, so each step of a pass has a closed form.

use nalgebra::Vector3;

/// Greatest ratio of the squared rates of two neighbouring pieces: a spline through them has no kinks then.
const GREATEST_STEP: f64 = 4.0;

/// Where two pieces of a path meet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    /// Slope `q'` of the path by its parameter, m.
    pub(super) first: Vector3<f64>,
    /// Its slope in turn, `q''`, m.
    pub(super) second: Vector3<f64>,
    /// Lengths of the pieces before and after, in the parameter.
    pub(super) lengths: [f64; 2],
    /// Greatest acceleration, m/s^2.
    pub(super) limit: f64,
}

/// The greatest squared rates `b = (ds/dt)^2` of the pieces of a path that stay below `caps` and within the accelerations of the `joints`
/// between them.
pub(super) fn squared_rates(caps: &[f64], joints: &[Joint]) -> Vec<f64> {
    // Both sides of a bend keep to it: what one of them left to the other would alternate along the path.
    let mut controllable = caps.to_vec();
    for (i, joint) in joints.iter().enumerate() {
        for cap in &mut controllable[i..i + 2] {
            *cap = cap.min(joint.greatest_in_bend());
        }
    }
    for i in (0..joints.len()).rev() {
        controllable[i] = controllable[i].min(joints[i].greatest_before(controllable[i + 1]));
    }
    let mut rates = controllable;
    for i in 0..joints.len() {
        rates[i + 1] = rates[i + 1].min(joints[i].greatest_after(rates[i]));
    }
    rates
}

impl Joint {
    /// The squared rate at which the bend alone takes all of the acceleration.
    fn greatest_in_bend(&self) -> f64 {
        let along = self.first * (self.first.dot(&self.second) / self.first.norm_squared());
        let across = if along.iter().all(|c| c.is_finite()) { self.second - along } else { self.second };
        self.limit / across.norm()
    }

    /// The acceleration is `q'' b + q' b'/2`, linear in the squared rates before and after: `A x + B y`.
    fn acceleration(&self) -> [Vector3<f64>; 2] {
        let [before, after] = self.lengths.map(|length| length / (self.lengths[0] + self.lengths[1]));
        let slope = self.first / (self.lengths[0] + self.lengths[1]);
        [self.second * after - slope, self.second * before + slope]
    }

    /// The greatest `x` from which some `y <= cap` can be reached: a linear objective over a convex set, so one of its corners or the tip
    /// of the ellipse.
    fn greatest_before(&self, cap: f64) -> f64 {
        let ([a, b], limit) = (self.acceleration(), self.limit);
        let on_ray = |k: f64| (limit / (a + b * k).norm()).min(cap / k);
        let most = on_ray(GREATEST_STEP).max(on_ray(1.0 / GREATEST_STEP));
        let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
        let det = (aa * bb - ab * ab).max(0.0);
        let tip = limit * (bb / det).sqrt();
        let tip = [tip, -tip * ab / bb];
        // Not a number where the ellipse ends below the cap.
        let at_cap = ((limit * limit * aa - det * cap * cap).sqrt() - ab * cap) / aa;
        [tip, [at_cap, cap]]
            .into_iter()
            .filter(|[x, y]| x.is_finite() && *y <= cap && x / GREATEST_STEP <= *y && *y <= x * GREATEST_STEP)
            .fold(most, |most, [x, _]| most.max(x))
    }

    /// The greatest `y` that can be reached from `x`.
    fn greatest_after(&self, x: f64) -> f64 {
        let ([a, b], limit) = (self.acceleration(), self.limit);
        let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
        let det = (aa * bb - ab * ab).max(0.0);
        let root = ((limit * limit * bb - det * x * x).max(0.0).sqrt() - ab * x) / bb;
        let root = if root.is_finite() { root } else { f64::INFINITY };
        root.clamp(x / GREATEST_STEP, x * GREATEST_STEP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(first: [f64; 3], second: [f64; 3], limit: f64) -> Joint {
        Joint { first: first.into(), second: second.into(), lengths: [0.1, 0.1], limit }
    }

    #[test]
    fn a_straight_line_is_flown_bang_bang() {
        // 2 m in pieces of 0.1 from almost rest, within 1 m/s^2: b = 2 s a on both sides.
        let joints = vec![joint([1.0, 0.0, 0.0], [0.0; 3], 1.0); 19];
        let mut caps = vec![100.0; 20];
        (caps[0], caps[19]) = (0.1, 0.1);
        for (i, rate) in squared_rates(&caps, &joints).iter().enumerate() {
            let expected = 0.1 + 0.2 * i.min(19 - i) as f64;
            assert!((rate - expected).abs() < 1e-12, "{i}: {rate} for {expected}");
        }
    }

    #[test]
    fn a_circle_is_flown_as_fast_as_its_curvature_allows() {
        // Radius 0.5 at unit slope: b = a r.
        let joints = vec![joint([1.0, 0.0, 0.0], [0.0, 2.0, 0.0], 1.0); 19];
        let rates = squared_rates(&[100.0; 20], &joints);
        assert!(rates.iter().all(|rate| (rate - 0.5).abs() < 1e-12), "{rates:?}");
    }

    #[test]
    fn steps_are_the_greatest_by_brute_force() {
        let mut seed = 7_u64;
        let mut unit = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..200 {
            let mut vector = |size: f64| [0; 3].map(|_| size * (2.0 * unit() - 1.0));
            let joint = joint(vector(1.0), vector(8.0), 1.0);
            let cap = 0.05 + 2.0 * unit();
            let [a, b] = joint.acceleration();
            let feasible = |x: f64, y: f64| {
                y <= cap && y >= x / GREATEST_STEP && y <= x * GREATEST_STEP && (a * x + b * y).norm() <= 1.0
            };
            let most = joint.greatest_before(cap);
            let exists = |x: f64| (0..=4000).any(|k| feasible(x, cap * f64::from(k) / 4000.0));
            assert!(exists(0.995 * most) && !exists(1.005 * most), "{most}");
            let x = 0.9 * most;
            let after = joint.greatest_after(x).min(cap);
            assert!(feasible(x, after * (1.0 - 1e-9)) && (after == cap || !feasible(x, after * 1.001)), "{after}");
        }
    }
}
