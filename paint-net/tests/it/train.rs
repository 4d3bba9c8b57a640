//! Training: repeatable, resumable, the same for any number of threads, and it learns.

use paint_net::Error;
use paint_net::network::Architecture;
use paint_net::train::{TrainSettings, Trainer};

fn settings() -> TrainSettings {
    let architecture = Architecture { channels: 3, layers: 2, stages: 2 };
    TrainSettings { steps: 30, batch: 5, side: 24, passes: 3, architecture, ..TrainSettings::default() }
}

fn trained(mut trainer: Trainer, steps: usize) -> Trainer {
    for _ in 0..steps {
        trainer.step();
    }
    trainer
}

#[test]
fn one_seed_gives_one_network() {
    let run =
        |seed, threads| trained(Trainer::new(TrainSettings { seed, threads, ..settings() }).unwrap(), 12).network();
    let first = run(1, 1);
    assert!(first == run(1, 1) && first == run(1, 2) && first == run(1, 7));
    assert!(first != run(2, 1));
}

#[test]
fn a_checkpoint_goes_on_where_training_stopped() {
    let straight = trained(Trainer::new(settings()).unwrap(), 30);
    assert!(straight.is_done());
    let half = trained(Trainer::new(settings()).unwrap(), 13);
    let resumed = Trainer::resume(TrainSettings { threads: 2, ..settings() }, &half.checkpoint()).unwrap();
    assert_eq!(resumed.steps_done(), 13);
    assert!(trained(resumed, 17).network() == straight.network());
    let other = TrainSettings { batch: 6, ..settings() };
    assert!(matches!(Trainer::resume(other, &half.checkpoint()), Err(Error::Weights(_))));
    let cut = &half.checkpoint()[..200];
    assert!(matches!(Trainer::resume(settings(), cut), Err(Error::Weights(_))));
    let weights_only = half.network().to_safetensors(&[]);
    assert!(matches!(Trainer::resume(settings(), &weights_only), Err(Error::Weights(_))));
}

#[test]
fn training_lowers_the_loss() {
    let mut trainer = Trainer::new(TrainSettings { steps: 120, ..settings() }).unwrap();
    let losses: Vec<f64> = (0..120).map(|_| trainer.step().loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (early, late) = (mean(&losses[..20]), mean(&losses[100..]));
    assert!(late < early - 0.2, "loss from {early} to {late}");
}

#[test]
fn bad_settings_are_named() {
    for (name, bad) in [
        ("steps", TrainSettings { steps: 0, ..settings() }),
        ("batch", TrainSettings { batch: 0, ..settings() }),
        ("side", TrainSettings { side: 3, ..settings() }),
        ("threads", TrainSettings { threads: 0, ..settings() }),
        ("learning_rate", TrainSettings { learning_rate: f64::NAN, ..settings() }),
        (
            "channels",
            TrainSettings { architecture: Architecture { channels: 0, ..Architecture::default() }, ..settings() },
        ),
    ] {
        assert!(matches!(Trainer::new(bad), Err(Error::InvalidSetting { name: n, .. }) if n == name), "{name}");
    }
}
