//! Loss and gradients against another program (`PyTorch`), at equal weights, pictures and noise: both rows of Table 8.1.
//! `benches/peers/thesis_reference.py` wrote the file; both draw weights, pictures and noise from the same hash.

use super::adjoint::{ModelAdjoint, backward};
use super::architecture::Architecture;
use super::loss::loss_terms;
use super::rollout::{Model, Noise, Objective, Rollout};
use crate::network::Real;
use crate::procedural::lattice;

const REFERENCE: &str = include_str!("../../tests/data/thesis_reference.txt");
const BATCH: usize = 3;

fn weights<T: Real>(architecture: &Architecture) -> Vec<T> {
    let mut weights = vec![T::default(); architecture.parameters()];
    for layer in architecture.layers().all() {
        for (range, half_width) in [(layer.weight(), 1.5 / (layer.inputs as f64).sqrt()), (layer.bias(), 0.3)] {
            for k in range {
                weights[k] = T::of(half_width * (2.0 * lattice(11, k as i64, 0) - 1.0));
            }
        }
    }
    weights
}

fn rollout<T: Real>(architecture: &Architecture) -> Rollout<T> {
    let wanted: Vec<T> = (0..BATCH * architecture.pixels()).map(|k| T::of(lattice(12, k as i64, 0))).collect();
    let mut noise = Noise::none(architecture, BATCH);
    for t in 0..architecture.steps {
        for (k, v) in noise.latent.at_mut(t).iter_mut().enumerate() {
            *v = T::of(6.0_f64.sqrt() * (lattice(13, k as i64, t as i64) - 0.5));
        }
        for (k, v) in noise.stop.at_mut(t).iter_mut().enumerate() {
            let u = 0.05 + 0.9 * lattice(14, k as i64, t as i64);
            *v = T::of(u.ln() - (1.0 - u).ln());
        }
    }
    let bare = vec![T::default(); wanted.len()];
    Rollout::new(architecture, wanted, bare, noise)
}

/// The largest relative differences of the loss's terms and of the gradients; the latter measured by the length of the
/// gradient of the tensor that they belong to.
fn compare<T: Real>(row: &str, architecture: &Architecture) -> (f64, f64) {
    let (objective, parameters) = (Objective::default(), weights::<T>(architecture));
    let mut rollout = rollout::<T>(architecture);
    rollout.run(&Model::new(architecture, &parameters), objective.gated);
    let terms = loss_terms(&rollout, objective.prior);
    let mut gradient = vec![T::default(); parameters.len()];
    backward(&mut rollout, &ModelAdjoint::new(architecture, &parameters), &objective, &mut gradient);

    let mut lines = REFERENCE.lines().skip_while(|line| !line.starts_with(&format!("row {row}")));
    let number = |text: &str| text.parse::<f64>().unwrap();
    let expected: Vec<f64> = lines.next().unwrap().split(' ').skip(2).map(number).collect();
    let found = [terms.total(&objective), terms.cross_entropy, terms.latent, terms.stop, terms.variation];
    let worst_term = found.iter().zip(&expected).map(|(f, e)| (f / e - 1.0).abs()).fold(0.0, f64::max);
    let used: Vec<usize> =
        (0..BATCH).map(|k| (0..architecture.steps).filter(|&t| rollout.paints(t, k)).count()).collect();
    let expected: Vec<usize> = lines.next().unwrap().split(' ').skip(1).map(|n| n.parse().unwrap()).collect();
    assert_eq!(used, expected, "steps up to the stop");

    let mut worst = 0.0_f64;
    for layer in architecture.layers().all() {
        for (part, range) in [("weight", layer.weight()), ("bias", layer.bias())] {
            let mut fields = lines.next().unwrap().split(' ').skip(1);
            assert_eq!(fields.next().unwrap(), format!("{}.{part}", layer.name));
            let slopes: Vec<f64> = gradient[range].iter().map(|g| g.to_f64()).collect();
            let (sum, length) = (number(fields.next().unwrap()), number(fields.next().unwrap()));
            let mut differ = |found: f64, expected: f64, scale: f64| {
                worst = worst.max((found - expected).abs() / scale);
            };
            differ(slopes.iter().sum::<f64>(), sum, length * (slopes.len() as f64).sqrt());
            differ(slopes.iter().map(|g| g * g).sum::<f64>().sqrt(), length, length);
            for (k, slope) in fields.map(|field| field.split_once(':').unwrap()) {
                differ(slopes[k.parse::<usize>().unwrap()], number(slope), length);
            }
        }
    }
    (worst_term, worst)
}

#[test]
fn loss_and_gradients_are_those_of_the_reference() {
    for (row, architecture) in [("mnist", Architecture::MNIST), ("paint", Architecture::PAINT)] {
        let (double, single) = (compare::<f64>(row, &architecture), compare::<f32>(row, &architecture));
        // Seen with `--nocapture`.
        println!("{row}: loss and gradients differ by {double:?} in double precision, by {single:?} in single");
        assert!(double.0 < 1e-10 && double.1 < 1e-10, "{row}, double precision: {double:?}");
        assert!(single.0 < 1e-4 && single.1 < 1e-4, "{row}, single precision: {single:?}");
    }
}
