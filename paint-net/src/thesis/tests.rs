//! Every derivative of the network against central differences, in double precision.

use super::adjoint::ModelAdjoint;
use super::rollout::{Model, Noise, Objective, Rollout};
use super::rows::Rows;
use super::shape::Shape;
use crate::procedural::lattice;

fn small(stop: f64) -> Shape {
    Shape { side: 9, steps: 6, latent: 3, hidden: 7, read: 3, radius: 3.0, stop, paint: 5 }
}

fn rollout(shape: &Shape, parameters: &[f64], gated: bool) -> Rollout<f64> {
    let batch = 4;
    let wanted = (0..batch * shape.pixels()).map(|k| lattice(5, k as i64, 0)).collect();
    let before = (0..batch * shape.pixels()).map(|k| 0.3 * lattice(6, k as i64, 0)).collect();
    let mut noise = Noise::none(shape, batch);
    let fill = |rows: &mut Rows<f64>, seed| {
        for t in 0..shape.steps {
            for (k, v) in rows.at_mut(t).iter_mut().enumerate() {
                *v = 3.0 * (lattice(seed, k as i64, t as i64) - 0.5);
            }
        }
    };
    fill(&mut noise.latent, 7);
    fill(&mut noise.stop, 8);
    let mut rollout = Rollout::new(shape, wanted, before, noise);
    rollout.run(&Model::new(shape, parameters), gated);
    rollout
}

#[test]
fn every_derivative_is_that_of_the_loss() {
    let free = small(100.0);
    let parameters: Vec<f64> = (0..free.parameters()).map(|k| 1.2 * (lattice(1, k as i64, 0) - 0.5)).collect();
    for gated in [true, false] {
        // A stop between the samples: some stop, some do not.
        let mut spent = rollout(&free, &parameters, gated).spent.at(free.steps - 1).to_vec();
        spent.sort_unstable_by(f64::total_cmp);
        let shape = small(0.5 * (spent[1] + spent[2]));
        let objective = Objective { latent: 0.7, prior: -0.4, gated, ..Objective::default() };
        let loss = |parameters: &[f64]| rollout(&shape, parameters, gated).terms(objective.prior).total(&objective);
        let mut gradient = vec![0.0; parameters.len()];
        let mut whole = rollout(&shape, &parameters, gated);
        assert_eq!((0..whole.batch).filter(|&k| whole.paints(shape.steps - 1, k)).count(), 2);
        whole.back(&ModelAdjoint::new(&shape, &parameters), &objective, &mut gradient);
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
