//! Painting as robots do: with noise, a nozzle of unknown flow, a valve that is not infinitely fast.

use paint_net::painters::{ClosedLoopPainter, SlewLimited, slew_violations};
use paint_net::path::ScanOrder;
use paint_net::procedural::{Texture, lattice};
use paint_net::{
    Deconvolution, Error, Feedback, Image, Limits, Observer, PaintProblem, Painter, Spray, SprayKernel, metrics,
};

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 2.0).unwrap()
}

/// A wall and a nozzle that sprays 20 % too much or too little, half a pixel beside the point, and has a gain of its own.
struct Wall {
    canvas: Image,
    gain: f64,
    sprayed: i64,
}

impl Wall {
    fn new(side: usize, gain: f64) -> Self {
        Self { canvas: Image::filled(side, side, 0.0), gain, sprayed: 0 }
    }

    /// Normally distributed, by Box and Muller.
    fn noise(&self, salt: i64) -> f64 {
        let (u, v) = (lattice(77, self.sprayed, salt), lattice(78, self.sprayed, salt));
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    fn deposit(&mut self, sprays: &[Spray]) -> Image {
        for s in sprays {
            self.sprayed += 1;
            let (x, y) = (s.x + 0.5 * self.noise(0), s.y + 0.5 * self.noise(1));
            let volume = self.gain * s.volume * (1.0 + 0.2 * self.noise(2)).max(0.0);
            let width = self.canvas.width();
            for j in (s.y as usize).saturating_sub(4)..(s.y as usize + 5).min(self.canvas.height()) {
                for i in (s.x as usize).saturating_sub(4)..(s.x as usize + 5).min(width) {
                    let d = (i as f64 - x).powi(2) + (j as f64 - y).powi(2);
                    self.canvas.data_mut()[j * width + i] += volume * (-d / 8.0).exp();
                }
            }
        }
        self.ink()
    }

    fn ink(&self) -> Image {
        self.canvas.map(f64::tanh)
    }
}

/// Somebody sprays and measures.
impl Observer for Wall {
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, Error> {
        Ok(Some(self.deposit(sprays)))
    }
}

#[test]
fn looking_at_the_wall_makes_good_what_the_nozzle_does_wrong() {
    for painter in [&Deconvolution::default() as &dyn Painter, &Feedback::shipped().unwrap()] {
        let wanted = Texture::Worley.image(12, 96);
        let problem = PaintProblem::new(&wanted);
        let quality = |ink: &Image| metrics::psnr(ink, &wanted, None).unwrap();
        let plan = painter.paint(&problem).unwrap();
        let open = quality(&Wall::new(96, 1.0).deposit(&plan.sprays));
        for gain in [0.7, 1.0, 1.3] {
            let mut wall = Wall::new(96, gain);
            let painting = ClosedLoopPainter::new(painter).paint_observed(&problem, &mut wall).unwrap();
            let closed = quality(&wall.ink());
            assert!(closed > open + 2.0, "{}: {closed} dB watched, {open} dB blind, gain {gain}", painter.name());
            assert!((painting.flow_gain / gain - 1.0).abs() < 0.03, "gain {gain} found as {}", painting.flow_gain);
            assert_eq!(painting.layers.len(), 3);
        }
    }
}

/// A wall that only ever gets paint, each spray one pixel wide.
struct AddingWall(Image);

impl Observer for AddingWall {
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, Error> {
        assert!(sprays.iter().all(|s| s.volume > 0.0));
        let width = self.0.width();
        for s in sprays {
            self.0.data_mut()[s.y as usize * width + s.x as usize] += s.volume;
        }
        Ok(Some(self.0.map(f64::tanh)))
    }
}

#[test]
fn coats_only_add_and_lose_little() {
    let wanted = Texture::Fbm.image(4, 64);
    let problem = PaintProblem::new(&wanted);
    let paint = |painter: &dyn Painter| {
        let ink = painter.paint(&problem).unwrap().ink;
        metrics::psnr(&ink, &wanted, None).unwrap()
    };
    let painter = Feedback::shipped().unwrap();
    let (once, coats) = (paint(&painter), paint(&ClosedLoopPainter::new(painter.clone())));
    assert!(coats > once - 0.3, "{coats} dB in coats, {once} dB at once");
    let mut wall = AddingWall(Image::filled(64, 64, 0.0));
    let painting = ClosedLoopPainter::new(painter).paint_observed(&problem, &mut wall).unwrap();
    // The canvas is the wall as it was measured, not as it was planned.
    for (depth, wall) in painting.canvas.data().iter().zip(wall.0.data()) {
        assert!((depth.tanh() - wall.tanh().min(0.995)).abs() < 1e-9);
    }
}

/// A wall that looks the same whatever is sprayed.
struct Measured(Image);

impl Observer for Measured {
    fn spray(&mut self, _: &[Spray]) -> Result<Option<Image>, Error> {
        Ok(Some(self.0.clone()))
    }
}

#[test]
fn bad_shares_and_pictures_are_named() {
    let wanted = Image::filled(16, 16, 0.4);
    let problem = PaintProblem::new(&wanted);
    let run = |shares: Vec<f64>, seen: Image| {
        ClosedLoopPainter { inner: Deconvolution::default(), shares }.paint_observed(&problem, &mut Measured(seen))
    };
    let black = Image::filled(16, 16, 0.0);
    for share in [0.0, -1.0, 1.1, f64::NAN] {
        assert!(matches!(run(vec![share], black.clone()), Err(Error::InvalidSetting { name: "shares", .. })));
    }
    assert!(matches!(run(vec![1.0], Image::filled(8, 16, 0.0)), Err(Error::Mismatch { .. })));
    assert!(matches!(run(vec![], black.clone()), Err(Error::EmptyProblem(_))));
    assert!(run(vec![0.5, 1.0], black).is_ok());
}

#[test]
fn the_valve_is_never_too_fast() {
    let side = 48;
    let wanted = Texture::Brick.image(6, side);
    let problem = PaintProblem::new(&wanted);
    let mut last = f64::INFINITY;
    for (limit, along) in [(1.0, 2), (0.05, 2), (0.01, 2), (0.02, 1)] {
        let limits = Limits { spray_spacing: along, max_volume: 1.0, ..Limits::default() };
        let painter = SlewLimited::new(Feedback::shipped().unwrap(), limit);
        let painting = painter.paint(&problem.with_limits(&limits)).unwrap();
        let waypoints = &painting.waypoints;
        assert_eq!(slew_violations(waypoints, limit), 0, "limit {limit}");
        // By the definition: every row of cells in turn, every other one backwards.
        let columns = side.div_ceil(along);
        let mut path = vec![0.0; columns * (side / 2)];
        for s in &painting.sprays {
            let (i, j) = (s.x as usize / along, s.y as usize / 2);
            path[j * columns + if j % 2 == 0 { i } else { columns - 1 - i }] = s.volume;
        }
        assert!(path.iter().copied().eq(waypoints.iter().map(|s| s.volume)));
        assert!(path.windows(2).all(|p| (p[1] - p[0]).abs() <= limit), "limit {limit}");
        let faster = path.windows(2).filter(|p| (p[1] - p[0]).abs() > 0.5 * limit).count();
        assert_eq!(slew_violations(waypoints, 0.5 * limit), faster);
        let quality = metrics::psnr(&painting.ink, &wanted, None).unwrap();
        if along == 2 {
            assert!(quality < last, "{quality} dB with {limit}, {last} dB with more");
            last = quality;
        } else {
            assert!(quality > last + 0.5, "twice the waypoints: {quality} dB after {last} dB");
        }
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = SlewLimited::new(Deconvolution::default(), bad).paint(&problem);
        assert!(matches!(refused, Err(Error::InvalidSetting { name: "slew_limit", .. })));
    }
}

#[test]
fn a_path_along_what_is_alike_is_as_long_and_asks_less_of_the_valve() {
    for (texture, width, height) in [(Texture::Worley, 48, 48), (Texture::Stripes, 46, 41)] {
        let whole = texture.image(6, 48);
        let wanted = Image::from_fn(width, height, |x, y| whole.at(x, y));
        let problem = PaintProblem::new(&wanted);
        let limits = Limits { max_volume: 1.0, ..Limits::default() };
        let paint = |order| {
            let painter = SlewLimited { order, ..SlewLimited::new(Feedback::shipped().unwrap(), 0.02) };
            let painting = painter.paint(&problem.with_limits(&limits)).unwrap();
            let waypoints = &painting.waypoints;
            assert_eq!(slew_violations(waypoints, 0.02), 0);
            let length: f64 = waypoints.windows(2).map(|p| (p[1].x - p[0].x).hypot(p[1].y - p[0].y)).sum();
            (waypoints.len(), length, metrics::psnr(&painting.ink, &wanted, None).unwrap())
        };
        let (rows, alike) = (paint(ScanOrder::Boustrophedon), paint(ScanOrder::ContextBased));
        assert_eq!((rows.0, rows.1), (alike.0, alike.1));
        assert!(alike.2 > rows.2 + 0.5, "{texture:?}: {} dB row by row, {} dB along what is alike", rows.2, alike.2);
    }
}

/// The optimum under a slow valve, by the conditions it must meet: no feasible small change of the volumes lowers the error.
#[test]
fn volumes_under_a_slow_valve_are_nearly_optimal() {
    let side = 24;
    let wanted = Texture::Fbm.image(3, side);
    let problem = PaintProblem::new(&wanted);
    let limits = Limits { max_volume: 1.0, ..Limits::default() };
    let limit = 0.02;
    let painter = SlewLimited { iterations: 100, ..SlewLimited::new(Deconvolution::default(), limit) };
    let painting = painter.paint(&problem.with_limits(&limits)).unwrap();
    let waypoints = &painting.waypoints;
    let best = metrics::psnr(&painting.ink, &wanted, None).unwrap();
    let quality = |volumes: &[f64]| {
        let mut canvas = Image::filled(side, side, 0.0);
        for (s, &volume) in waypoints.iter().zip(volumes) {
            nozzle().stamp(&Spray { volume, ..*s }, &mut canvas);
        }
        metrics::psnr(&canvas.map(f64::tanh), &wanted, None).unwrap()
    };
    let volumes: Vec<f64> = waypoints.iter().map(|s| s.volume).collect();
    assert!((quality(&volumes) - best).abs() < 1e-9);
    let (mut tried, mut better) = (0, 0.0_f64);
    for k in 0..200 {
        // A stretch of the path, a little more or a little less.
        let of = |salt: i64| lattice(9, k, salt);
        let first = (of(0) * volumes.len() as f64) as usize;
        let end = (first + 1 + (of(1) * 40.0) as usize).min(volumes.len());
        let mut other = volumes.clone();
        other[first..end].iter_mut().for_each(|v| *v += 0.004 * (of(2) - 0.5));
        let feasible =
            other.iter().all(|v| (0.0..=1.0).contains(v)) && other.windows(2).all(|p| (p[1] - p[0]).abs() <= limit);
        if feasible {
            tried += 1;
            better = better.max(quality(&other) - best);
        }
    }
    assert!(tried > 20 && better < 2e-3, "{tried} changes tried, the best gained {better} dB");
}
