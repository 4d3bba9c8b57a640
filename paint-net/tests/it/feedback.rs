//! What the feedback painter promises beyond what every painter does.

use paint_net::model::MonotoneCurve;
use paint_net::network::{Architecture, Network};
use paint_net::procedural::{Texture, lattice, scene};
use paint_net::{
    Deconvolution, Error, Feedback, Image, Limits, PaintProblem, Painter, Painting, Saturation, SprayKernel, metrics,
};

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 2.0).unwrap()
}

fn paint(painter: &dyn Painter, problem: &PaintProblem, kernel: &SprayKernel, limits: &Limits) -> Painting {
    painter.paint(&problem.with_kernel(kernel).with_limits(limits)).unwrap()
}

#[test]
fn tiles_and_threads_change_no_bit() {
    // Sizes that no stride divides; borders, masks and paint that is there already.
    for (width, height, along, row_spacing) in [(131, 94, 2, 2), (97, 75, 2, 3), (60, 81, 3, 1), (50, 40, 1, 4)] {
        let wanted = scene(7, width, height);
        let canvas = Image::from_fn(width, height, |x, y| 0.3 * lattice(3, x as i64, y as i64));
        let weight =
            Image::from_fn(width, height, |x, y| if x + y < 60 { 1.0 } else { lattice(4, x as i64, y as i64) });
        let paintable: Vec<bool> = (0..width * height).map(|k| k % width > 10).collect();
        let problem = PaintProblem::new(&wanted).with_canvas(&canvas).with_weight(&weight).with_paintable(&paintable);
        let limits = Limits { spray_spacing: along, row_spacing, min_volume: 0.005, ..Limits::default() };
        let kernel = SprayKernel::new(2.0, 3.0).unwrap();
        let whole = Feedback { tile: 1000, ..Feedback::shipped().unwrap() };
        let expected = paint(&whole, &problem, &kernel, &limits);
        assert!(expected.sprays.len() > 100);
        for (tile, threads) in [(7, 1), (16, 3), (33, 2)] {
            let found = paint(&Feedback { tile, threads, ..whole.clone() }, &problem, &kernel, &limits);
            assert!(found == expected, "{width} x {height}, tiles of {tile} cells, {threads} threads");
        }
    }
}

/// Buffers are kept from one painting to the next: between grids of the same size and other strides too.
#[test]
fn what_a_thread_painted_before_changes_no_bit() {
    let kernel = SprayKernel::new(1.0, 3.0).unwrap();
    let painter = Feedback::shipped().unwrap();
    let painted = |size: usize, stride: usize| {
        let wanted = scene(7, size, size);
        let limits = Limits { spray_spacing: stride, row_spacing: stride, ..Limits::default() };
        paint(&painter, &PaintProblem::new(&wanted), &kernel, &limits)
    };
    for size in 5..12 {
        for stride in 1..6 {
            let in_turn = painted(size, stride);
            let alone = std::thread::scope(|scope| scope.spawn(|| painted(size, stride)).join().unwrap());
            assert!(in_turn == alone, "{size} pixels, a cell every {stride}");
        }
    }
}

#[test]
fn a_large_picture_is_the_same_in_tiles_and_whole() {
    let tile = scene(11, 256, 256);
    let wanted = Image::from_fn(2048, 2048, |x, y| tile.at(x % 256, (y + x / 256) % 256));
    let problem = PaintProblem::new(&wanted);
    let whole = Feedback { tile: 1024, passes: 2, ..Feedback::shipped().unwrap() };
    let expected = paint(&whole, &problem, &nozzle(), &Limits::default());
    let found = paint(&Feedback { tile: 64, threads: 2, ..whole }, &problem, &nozzle(), &Limits::default());
    assert!(found == expected);
}

#[test]
fn blank_pictures_get_nothing_at_all() {
    let knots: Vec<(f64, f64)> = (0..50).map(|k| 0.1 * f64::from(k)).map(|c| (c, 0.8 * (c * 0.7).tanh())).collect();
    let curves = [
        Saturation::Tanh,
        Saturation::BeerLambert { density: 2.5 },
        Saturation::Curve(MonotoneCurve::new(&knots).unwrap()),
    ];
    let painter = Feedback::shipped().unwrap();
    for k in 0..1000_usize {
        let (width, height) = (1 + k % 41, 1 + (k * 7) % 37);
        let blank = Image::filled(width, height, 0.0);
        let before = Image::from_fn(width, height, |x, y| lattice(k as u64, x as i64, y as i64));
        let limits = Limits { spray_spacing: 1 + k % 3, row_spacing: 1 + (k / 3) % 3, ..Limits::default() };
        let problem = PaintProblem { canvas: (k % 2 == 1).then_some(&before), ..PaintProblem::new(&blank) };
        let painting = painter
            .paint(&problem.with_kernel(&nozzle()).with_saturation(&curves[k % 3]).with_limits(&limits))
            .unwrap();
        assert!(painting.sprays.is_empty(), "picture {k}");
    }
}

#[test]
fn comes_near_the_optimum_on_pictures_it_was_not_trained_on() {
    // Bricks are not among the scenes; the optimum is that of the deconvolution, which has no weights to learn.
    for (kernel, limits, loss) in [
        (nozzle(), Limits::default(), 0.35),
        (SprayKernel::new(2.0, 3.5).unwrap(), Limits { row_spacing: 3, ..Limits::default() }, 0.5),
    ] {
        for seed in [1000, 2000] {
            let wanted = Texture::Brick.image(seed, 128);
            let problem = PaintProblem::new(&wanted);
            let quality = |painter: &dyn Painter| {
                metrics::psnr(&paint(painter, &problem, &kernel, &limits).ink, &wanted, None).unwrap()
            };
            let (learned, optimum) = (quality(&Feedback::shipped().unwrap()), quality(&Deconvolution::default()));
            assert!(learned > optimum - loss, "{learned} dB against {optimum} dB");
            assert!(learned < optimum + 0.05, "{learned} dB is more than the optimum, {optimum} dB");
        }
    }
}

#[test]
fn each_pass_helps() {
    let wanted = Texture::Worley.image(5, 96);
    let quality = |passes| {
        let painter = Feedback { passes, ..Feedback::shipped().unwrap() };
        metrics::psnr(&paint(&painter, &PaintProblem::new(&wanted), &nozzle(), &Limits::default()).ink, &wanted, None)
            .unwrap()
    };
    let curve: Vec<f64> = [1, 2, 4, 8, 16].map(quality).to_vec();
    assert!(curve.windows(2).all(|q| q[1] > q[0] - 0.02), "{curve:?}");
    assert!(curve[3] > curve[0] + 0.5, "{curve:?}");
}

#[test]
fn takes_what_is_on_the_wall_into_account() {
    let wanted = Texture::Fbm.image(8, 80);
    // Half of the paint is there already, unevenly.
    let canvas = Image::from_fn(80, 80, |x, y| wanted.at(x, y).atanh() * lattice(1, x as i64 / 9, y as i64 / 9));
    let problem = PaintProblem { canvas: Some(&canvas), ..PaintProblem::new(&wanted) };
    let kernel = nozzle();
    let over = paint(&Feedback::shipped().unwrap(), &problem, &kernel, &Limits::default());
    let optimum = paint(&Deconvolution::default(), &problem, &kernel, &Limits::default());
    let quality = |p: &Painting| metrics::psnr(&p.ink, &wanted, None).unwrap();
    assert!(quality(&over) > quality(&optimum) - 0.4, "{} dB against {} dB", quality(&over), quality(&optimum));
}

#[test]
fn weights_survive_a_file_and_foreign_ones_are_named() {
    let architecture = Architecture { channels: 5, layers: 3, stages: 2 };
    let network = Network::random(architecture, 4);
    let bytes = network.to_safetensors(&[("seed", "4".into())]);
    assert_eq!(Network::from_safetensors(&bytes).unwrap(), network);
    let shipped = Network::shipped().unwrap();
    assert!(shipped.parameters() * 4 < 500_000);
    for cut in [0, 7, 9, 100, bytes.len() - 1] {
        assert!(matches!(Network::from_safetensors(&bytes[..cut]), Err(Error::Weights(_))), "cut at {cut}");
    }
    let mut poisoned = bytes.clone();
    let end = poisoned.len();
    poisoned[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(Network::from_safetensors(&poisoned), Err(Error::Weights(_))));
    let text = String::from_utf8_lossy(&bytes[8..]).replacen("features.bias", "features.bios", 1);
    let renamed = [&bytes[..8], text.as_bytes()].concat();
    assert!(matches!(Network::from_safetensors(&renamed), Err(Error::Weights(_))));
}

#[test]
fn bad_settings_are_named() {
    let wanted = Image::filled(8, 8, 0.5);
    let run = |painter: &Feedback| painter.paint(&PaintProblem::new(&wanted).with_kernel(&nozzle()));
    let good = Feedback::shipped().unwrap();
    for (name, bad) in [
        ("passes", Feedback { passes: 0, ..good.clone() }),
        ("tile", Feedback { tile: 0, ..good.clone() }),
        ("threads", Feedback { threads: 0, ..good.clone() }),
    ] {
        assert!(matches!(run(&bad), Err(Error::InvalidSetting { name: n, .. }) if n == name));
    }
    assert!(run(&good).is_ok());
}
