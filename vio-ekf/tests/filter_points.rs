//! The filter on points: accuracy, honesty, and what it must not claim to know.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

mod support;

use support::flight::{Flight, nees};
use vio_ekf::{Settings, StartSigma, chi2};

#[test]
fn follows_a_flight_and_knows_how_well() {
    let (runs, seconds) = (6, 15.0);
    let mut sums = vec![];
    for seed in 1..=runs {
        let mut flight = Flight::new(seed, seconds);
        let start = flight.drawn_start(StartSigma::default());
        let mut frame = 0;
        flight
            .run(Settings::default(), &start, |odometry, truth, biases| {
                if sums.len() <= frame {
                    sums.push([0.0; 5]);
                }
                for (sum, value) in sums[frame].iter_mut().zip(nees(odometry, truth, biases)) {
                    *sum += value / runs as f64;
                }
                frame += 1;
                let off = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
                assert!(off.norm() < 0.5, "seed {seed}, frame {frame}: {off}");
            })
            .unwrap();
    }
    let (low, high) = chi2::mean_band(3, runs as usize, 0.95).unwrap();
    let mut inside = [0; 5];
    for sums in &sums {
        for (inside, sum) in inside.iter_mut().zip(sums) {
            *inside += usize::from((low..=high).contains(sum));
        }
    }
    let share = inside.map(|n| n as f64 / sums.len() as f64);
    let mean: [f64; 5] = std::array::from_fn(|k| sums.iter().map(|s| s[k]).sum::<f64>() / sums.len() as f64);
    eprintln!("share in the band {share:?}, mean {mean:?}");
    assert!(share.iter().all(|s| *s > 0.7), "{share:?}");
}
