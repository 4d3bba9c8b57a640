//! The thesis' network as its users see it: one seed, one network; checkpoints; what it paints; what it refuses.

use paint_net::path::{StrokeSettings, in_order};
use paint_net::procedural::Texture;
use paint_net::thesis::{Architecture, Network, Objective, ThesisPainter};
use paint_net::train::{ThesisSettings, ThesisTrainer, thesis_patch};
use paint_net::{Error, Image, Limits, PaintProblem, Painter, Painting, Spray, SprayKernel, metrics};

const SMALL: Architecture =
    Architecture { side: 12, steps: 10, latent: 4, hidden: 12, read: 3, radius: 4.0, stop: 4.0, paint: 8 };

fn settings() -> ThesisSettings {
    ThesisSettings { architecture: SMALL, steps: 20, batch: 60, learning_rate: 3e-3, ..ThesisSettings::default() }
}

fn picture(n: u64) -> Result<Image, Error> {
    thesis_patch(1, n, &SMALL)
}

fn trained(mut trainer: ThesisTrainer, steps: usize) -> ThesisTrainer {
    for _ in 0..steps {
        trainer.step(&picture).unwrap();
    }
    trainer
}

fn paint(network: Network, problem: &PaintProblem, limits: &Limits) -> Painting {
    let kernel = SprayKernel::new(2.0, 4.0).unwrap();
    ThesisPainter::new(network).paint(&problem.with_kernel(&kernel).with_limits(limits)).unwrap()
}

#[test]
fn one_seed_gives_one_network() {
    let run = |seed, threads| {
        trained(ThesisTrainer::new(ThesisSettings { seed, threads, ..settings() }).unwrap(), 4).network()
    };
    let first = run(1, 1);
    assert!(first == run(1, 2) && first == run(1, 7));
    assert!(first != run(2, 1));
    assert!(Network::from_safetensors(&first.to_safetensors(&[])).unwrap() == first);
}

/// A network that was trained as the thesis prints it paints so: the stop variable leaves its volumes alone.
#[test]
fn a_network_paints_as_it_was_trained() {
    let objective = |gated| Objective { gated, ..Objective::default() };
    let [gated, printed] = [true, false].map(|gated| {
        let trainer = ThesisTrainer::new(ThesisSettings { objective: objective(gated), ..settings() }).unwrap();
        let file = trainer.network().to_safetensors(&[]);
        let network = Network::from_safetensors(&file).unwrap();
        assert_eq!(network.is_gated(), gated);
        network.paint(&[(picture(3).unwrap(), None)]).unwrap()[0][0]
    });
    // The same weights: the first spray goes to the same place, and untrained the variable is near a half.
    assert_eq!(gated.position, printed.position);
    let share = gated.volume / printed.volume;
    assert!((0.3..0.7).contains(&share), "{share}");
}

#[test]
fn a_checkpoint_goes_on_where_training_stopped() {
    let straight = trained(ThesisTrainer::new(settings()).unwrap(), 6);
    let half = trained(ThesisTrainer::new(settings()).unwrap(), 2);
    let resumed = ThesisTrainer::resume(ThesisSettings { threads: 2, ..settings() }, &half.checkpoint()).unwrap();
    assert_eq!(resumed.steps_done(), 2);
    assert!(trained(resumed, 4).network() == straight.network());
    let other = ThesisSettings { learning_rate: 1e-3, ..settings() };
    assert!(matches!(ThesisTrainer::resume(other, &half.checkpoint()), Err(Error::Weights(_))));
    for cut in [0, 7, 100, half.checkpoint().len() - 1] {
        let cut = &half.checkpoint()[..cut];
        assert!(matches!(ThesisTrainer::resume(settings(), cut), Err(Error::Weights(_))));
    }
    assert!(matches!(
        Network::from_safetensors(include_bytes!("../../weights/painter.safetensors")),
        Err(Error::Weights(_))
    ));
}

#[test]
fn training_lowers_the_loss_on_pictures_it_has_not_seen() {
    let held: Vec<Image> = (0..50).map(|k| picture((1 << 40) + k).unwrap()).collect();
    let mut trainer = ThesisTrainer::new(ThesisSettings {
        steps: 300,
        batch: 25,
        learning_rate: 1e-2,
        last_learning_rate: 1e-4,
        ..settings()
    })
    .unwrap();
    let before = trainer.validate(&held).unwrap();
    trainer = trained(trainer, 300);
    let after = trainer.validate(&held).unwrap();
    assert!(after == trainer.validate(&held).unwrap());
    let floor: f64 = held.iter().map(|p| 144.0 * metrics::binary_cross_entropy(p, p).unwrap()).sum::<f64>() / 50.0;
    // What no painting can go below; before, a bare wall's distance to it.
    assert!(
        after.total - floor < 0.5 * (before.total - floor) && after.cross_entropy > floor - 0.5,
        "floor {floor}: {before:?} became {after:?}"
    );
    assert!(after.steps <= 10.0 && after.latent >= 0.0);
}

#[test]
fn the_painter_paints_what_its_network_says_and_obeys_limits() {
    let network = trained(ThesisTrainer::new(settings()).unwrap(), 20).network();
    // Two tiles and a part of others.
    let wanted = Image::from_fn(29, 17, |x, y| 0.6 * f64::from(u8::from((x / 5 + y / 4) % 2 == 0)));
    let problem = PaintProblem::new(&wanted);
    let free = paint(network.clone(), &problem, &Limits::default());
    assert!(free.sprays.len() > 10 && free == paint(network.clone(), &problem, &Limits::default()));
    let kernel = SprayKernel::new(2.0, 4.0).unwrap();
    let mut canvas = wanted.map(|_| 0.0);
    free.sprays.iter().for_each(|s| kernel.stamp(s, &mut canvas));
    assert!(metrics::psnr(&free.ink, &canvas.map(f64::tanh), None).unwrap() > 150.0);

    // One tile, and one pixel.
    for side in [12, 1] {
        let small = Image::filled(side, side, 0.5);
        let painting = paint(network.clone(), &PaintProblem::new(&small), &Limits::default());
        assert!(painting.ink.data().iter().all(|a| (0.0..=1.0).contains(a)));
    }
    assert!(network.paint(&[]).unwrap().is_empty());

    let tight = Limits { max_sprays: Some(7), max_volume: 0.05, ..Limits::default() };
    let few = paint(network.clone(), &problem, &tight);
    assert!(few.sprays.len() == 7 && few.sprays.iter().all(|s| s.volume <= 0.05));
    let left: Vec<bool> = (0..29 * 17).map(|k| k % 29 < 10).collect();
    let masked = paint(network, &PaintProblem { paintable: Some(&left), ..problem }, &Limits::default());
    assert!(masked.sprays.iter().all(|s| s.x < 9.5 + 1e-9));
}

/// Joined sprays keep their paint, `2 π σ² v` each, and lie in strokes; what the canvas shows is what they leave.
#[test]
fn strokes_are_made_of_the_sprays_of_a_tile_in_their_order() {
    let network = trained(ThesisTrainer::new(settings()).unwrap(), 20).network();
    let wanted = Image::from_fn(29, 17, |x, y| 0.6 * f64::from(u8::from((x / 5 + y / 4) % 2 == 0)));
    let kernel = SprayKernel::new(2.0, 4.0).unwrap();
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel);
    let one_tile = Image::from_fn(12, 12, |x, y| wanted.at(x, y));
    let tile = PaintProblem::new(&one_tile).with_kernel(&kernel);
    let free = ThesisPainter::new(network.clone());
    let joined = ThesisPainter { strokes: Some(StrokeSettings::default()), ..free.clone() };
    // Of one tile: what neighbours leave in the canvas of the next tile differs a little.
    let (alone, strokes) = (free.paint(&tile).unwrap(), joined.paint(&tile).unwrap());
    assert!(alone.strokes.is_empty() && !strokes.strokes.is_empty());
    let paint = |painting: &Painting| painting.sprays.iter().map(|s| s.volume * s.sigma * s.sigma).sum::<f64>();
    assert!((paint(&strokes) / paint(&alone) - 1.0).abs() < 1e-12 && strokes.sprays.len() <= alone.sprays.len());
    assert_eq!(in_order(&alone.sprays, &StrokeSettings::default()).unwrap(), strokes.strokes);

    for max_sprays in [None, Some(2)] {
        let limits = Limits { max_sprays, ..Limits::default() };
        let painting = joined.paint(&problem.with_limits(&limits)).unwrap();
        let along: Vec<Spray> = painting.strokes.iter().flat_map(|stroke| stroke.sprays.clone()).collect();
        assert!(along == painting.sprays && max_sprays.is_none_or(|most| most == along.len()));
        let rendered = Painting::render(&problem, along);
        assert!(metrics::psnr(&painting.ink, &rendered.ink, None).unwrap() > 150.0);
    }
}

/// What is shipped is a network for patches: it paints tiles that it has never seen.
#[test]
fn the_shipped_network_paints() {
    let painter = ThesisPainter::shipped().unwrap();
    assert_eq!(painter.network.architecture(), Architecture::PAINT);
    let wanted = Texture::Worley.image(77, 64);
    let kernel = SprayKernel::new(2.0, 4.0).unwrap();
    let painting = painter.paint(&PaintProblem::new(&wanted).with_kernel(&kernel)).unwrap();
    let mean = wanted.data().iter().sum::<f64>() / wanted.data().len() as f64;
    let [psnr, flat] = [painting.ink, wanted.map(|_| mean)].map(|ink| metrics::psnr(&ink, &wanted, None).unwrap());
    assert!(psnr > flat + 3.0, "{psnr} dB, one grey {flat} dB");
}

#[test]
fn bad_settings_and_pictures_are_named() {
    for (name, bad) in [
        ("steps", ThesisSettings { steps: 0, ..settings() }),
        ("batch", ThesisSettings { batch: 0, ..settings() }),
        ("read", ThesisSettings { architecture: Architecture { read: 1, ..SMALL }, ..settings() }),
        ("radius", ThesisSettings { architecture: Architecture { radius: f64::NAN, ..SMALL }, ..settings() }),
        ("last_learning_rate", ThesisSettings { last_learning_rate: -1.0, ..settings() }),
    ] {
        assert!(matches!(ThesisTrainer::new(bad), Err(Error::InvalidSetting { name: n, .. }) if n == name), "{name}");
    }
    let mut trainer = ThesisTrainer::new(settings()).unwrap();
    assert!(matches!(trainer.step(&|_| Ok(Image::filled(5, 5, 0.1))), Err(Error::Mismatch { .. })));
    assert!(matches!(trainer.step(&|_| Ok(Image::filled(12, 12, 1.1))), Err(Error::Pixel { .. })));
    assert!(matches!(trainer.validate(&[]), Err(Error::EmptyProblem(_))));
}
