//! Every derivative of the network against central differences, in double precision.

use super::activations::Activations;
use super::adjoint::{ModelAdjoint, backward};
use super::architecture::Architecture;
use super::loss::loss_terms;
use super::rollout::{Model, Noise, Objective, Rollout};
use crate::procedural::lattice;

fn small(stop: f64) -> Architecture {
    Architecture { side: 9, steps: 6, latent: 3, hidden: 7, read: 3, radius: 3.0, stop, paint: 5 }
}

fn rollout(architecture: &Architecture, parameters: &[f64], gated: bool) -> Rollout<f64> {
    let batch = 4;
    let wanted = (0..batch * architecture.pixels()).map(|k| lattice(5, k as i64, 0)).collect();
    let before = (0..batch * architecture.pixels()).map(|k| 0.3 * lattice(6, k as i64, 0)).collect();
    let mut noise = Noise::none(architecture, batch);
    let fill = |rows: &mut Activations<f64>, seed| {
        for t in 0..architecture.steps {
            for (k, v) in rows.at_mut(t).iter_mut().enumerate() {
                *v = 3.0 * (lattice(seed, k as i64, t as i64) - 0.5);
            }
        }
    };
    fill(&mut noise.latent, 7);
    fill(&mut noise.stop, 8);
    let mut rollout = Rollout::new(architecture, wanted, before, noise);
    rollout.run(&Model::new(architecture, parameters), gated);
    rollout
}

#[test]
fn every_derivative_is_that_of_the_loss() {
    let free = small(100.0);
    let parameters: Vec<f64> = (0..free.parameters()).map(|k| 1.2 * (lattice(1, k as i64, 0) - 0.5)).collect();
    for gated in [true, false] {
        // A stop between the samples: some stop, some do not.
        let mut stop_sum = rollout(&free, &parameters, gated).stop_sum.at(free.steps - 1).to_vec();
        stop_sum.sort_unstable_by(f64::total_cmp);
        let architecture = small(0.5 * (stop_sum[1] + stop_sum[2]));
        let objective = Objective { latent: 0.7, prior: -0.4, gated, ..Objective::default() };
        let loss = |parameters: &[f64]| {
            loss_terms(&rollout(&architecture, parameters, gated), objective.prior).total(&objective)
        };
        let mut gradient = vec![0.0; parameters.len()];
        let mut whole = rollout(&architecture, &parameters, gated);
        assert_eq!((0..whole.batch).filter(|&k| whole.paints(architecture.steps - 1, k)).count(), 2);
        backward(&mut whole, &ModelAdjoint::new(&architecture, &parameters), &objective, &mut gradient);
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        for k in 0..parameters.len() {
            let moved = |by: f64| {
                let mut moved = parameters.clone();
                moved[k] += by;
                loss(&moved)
            };
            let h = 1e-5;
            // Fourth order: what is left is rounding.
            let slope = (8.0 * (moved(h) - moved(-h)) - (moved(2.0 * h) - moved(-2.0 * h))) / (12.0 * h);
            assert!((slope - gradient[k]).abs() < 1e-8 * length, "weight {k}: {} is not {slope}", gradient[k]);
        }
    }
}
