//! The painters' projected L-BFGS beside the published L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995; `lbfgsb-rs-pure`, a port of its
//! version 3.0), on the problem that painters solve: the deconvolution of an image on 4096 cells. Both get the same cost
//! function; the second runs until it has reached the cost of the first.

use paint_net::procedural::Texture;
use paint_net::{Image, SprayKernel};
use paintcopter_benches::criterion;

// The library does not offer its solver: the file stands for itself.
#[path = "../../paint-net/src/optimise/projected_lbfgs.rs"]
mod projected_lbfgs;

use lbfgsb_rs_pure::{IterationControl, LBFGSB};
use projected_lbfgs::{StoppingRule, minimise};

/// Side of the pictures and pixels per cell.
const SIDE: usize = 128;
const STRIDE: usize = 2;
/// Largest volume.
const UPPER: f64 = 3.0;
/// Iterations after which the costs are compared.
const ITERATIONS: usize = 20;
/// Pairs of steps remembered, by both.
const MEMORY: usize = 6;

/// `½ Σ (tanh(G v) - y)²` and its gradient, counted.
struct Cost {
    wanted: Image,
    taps: Vec<f64>,
    calls: usize,
}

impl Cost {
    fn new(wanted: Image) -> Self {
        let taps = SprayKernel::default().taps().to_vec();
        Self { wanted, taps, calls: 0 }
    }

    /// Pixels under a cell along one axis, with their taps.
    fn window(&self, cell: usize) -> impl Iterator<Item = (usize, f64)> {
        let (centre, radius) = (cell * STRIDE, self.taps.len() / 2);
        let pixels = (centre + radius).min(SIDE - 1) + 1;
        (centre.saturating_sub(radius)..pixels).map(move |p| (p, self.taps[p + radius - centre]))
    }

    fn evaluate(&mut self, volumes: &[f64], gradient: &mut [f64]) -> f64 {
        self.calls += 1;
        let cells = SIDE / STRIDE;
        let mut canvas = vec![0.0; SIDE * SIDE];
        let mut line = [0.0; SIDE];
        for j in 0..cells {
            line.fill(0.0);
            for i in 0..cells {
                self.window(i).for_each(|(x, tap)| line[x] += tap * volumes[j * cells + i]);
            }
            for (y, tap) in self.window(j) {
                canvas[y * SIDE..(y + 1) * SIDE].iter_mut().zip(&line).for_each(|(c, l)| *c += tap * l);
            }
        }
        let mut value = 0.0;
        for (c, y) in canvas.iter_mut().zip(self.wanted.data()) {
            let ink = c.tanh();
            value += 0.5 * (ink - y) * (ink - y);
            *c = (ink - y) * (1.0 - ink * ink);
        }
        for j in 0..cells {
            line.fill(0.0);
            for (y, tap) in self.window(j) {
                line.iter_mut().zip(&canvas[y * SIDE..]).for_each(|(l, c)| *l += tap * c);
            }
            for i in 0..cells {
                gradient[j * cells + i] = self.window(i).map(|(x, tap)| tap * line[x]).sum();
            }
        }
        value
    }
}

/// Runs the painters' solver for some iterations; the cost reached.
fn ours(cost: &mut Cost, iterations: usize) -> f64 {
    let n = (SIDE / STRIDE).pow(2);
    let (mut volumes, upper) = (vec![0.1; n], vec![UPPER; n]);
    let stop = StoppingRule { iterations, relative_decrease: 0.0 };
    let mut evaluate = |v: &[f64], g: &mut [f64]| cost.evaluate(v, g);
    minimise(&mut volumes, &upper, &stop, &mut evaluate, &mut |_| ());
    cost.evaluate(&volumes, &mut vec![0.0; n])
}

/// Runs L-BFGS-B until the cost is reached; the cost reached.
fn theirs(cost: &mut Cost, target: f64) -> f64 {
    let n = (SIDE / STRIDE).pow(2);
    let (mut volumes, lower, upper) = (vec![0.1; n], vec![0.0; n], vec![UPPER; n]);
    let mut evaluate = |v: &[f64]| {
        let mut gradient = vec![0.0; n];
        let value = cost.evaluate(v, &mut gradient);
        (value, gradient)
    };
    let mut solver = LBFGSB::new(MEMORY).with_pgtol(0.0).with_max_iter(1000);
    let reached = solver.minimize_with_callback(&mut volumes, &lower, &upper, &mut evaluate, &mut |info, _| {
        if info.f <= target { IterationControl::StopConverged } else { IterationControl::Continue }
    });
    reached.map_or(f64::INFINITY, |solution| solution.f)
}

fn main() {
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("L-BFGS");
    for (name, texture) in [("clouds", Texture::Fbm), ("brick", Texture::Brick)] {
        let mut cost = Cost::new(texture.image(1000, SIDE));
        for iterations in [100, ITERATIONS] {
            let target = ours(&mut cost, iterations);
            let our_calls = std::mem::take(&mut cost.calls);
            let reached = theirs(&mut cost, target);
            let their_calls = std::mem::take(&mut cost.calls);
            println!(
                "{name}: cost {target:.4} after {iterations} iterations and {our_calls} evaluations; L-BFGS-B comes to {reached:.4} \
                 after {their_calls} evaluations"
            );
        }
        let target = ours(&mut cost, ITERATIONS);
        group.bench_function(format!("projected, {ITERATIONS} iterations on {name}"), |b| {
            b.iter(|| ours(&mut cost, ITERATIONS));
        });
        group.bench_function(format!("L-BFGS-B to the same cost on {name}"), |b| {
            b.iter(|| theirs(&mut cost, target));
        });
    }
    group.finish();
    criterion.final_summary();
}
