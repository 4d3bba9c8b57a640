//! Drawings of lines come out whole: judged from the sprays alone, each added by its definition.

mod drawings;

use drawings::{Drawing, INK};
use paint_net::painters::Centrelines;
use paint_net::{Image, Limits, Observer, PaintProblem, Painter, Painting, SprayKernel};

/// Deviation of the nozzle, pixels: the core of a line ends half of it before its border.
const SPOT: f64 = 2.0;
/// Least ink of the core, of what is wanted; a hole is less on the middle of a line.
const WHOLE: f64 = 0.7;

struct Judged {
    /// Least ink on a pixel of the core over the wanted one.
    core: f64,
    /// Where that is.
    worst: [f64; 2],
    /// Holes along the middles that are longer than half a spot, and the longest hole, pixels.
    gaps: usize,
    longest: f64,
    /// Most ink farther than a spot from every line.
    beside: f64,
    /// Most depth over the median depth on the middles.
    dark: f64,
    strokes: usize,
    /// Length sprayed along strokes over the length of all lines.
    length: f64,
}

/// Ink at a place, every spray added by its definition.
fn ink(painting: &Painting, kernel: &SprayKernel, [x, y]: [f64; 2]) -> f64 {
    let depth = |s: &paint_net::Spray| {
        let (dx, dy) = (x - s.x, y - s.y);
        let inside = dx.abs().max(dy.abs()) <= kernel.cut() * s.sigma;
        if inside { s.volume * (-(dx * dx + dy * dy) / (2.0 * s.sigma * s.sigma)).exp() } else { 0.0 }
    };
    painting.sprays.iter().map(depth).sum::<f64>().tanh()
}

fn judge(drawing: &Drawing, painting: &Painting, kernel: &SprayKernel) -> Judged {
    let wanted = drawing.wanted();
    let (mut core, mut beside, mut worst) = (f64::INFINITY, 0.0_f64, [0.0; 2]);
    for k in 0..wanted.data().len() {
        let place = [(k % wanted.width()) as f64, (k / wanted.width()) as f64];
        let from = drawing.distance_to_middle(place);
        if from <= 0.5 * drawing.width - 0.5 * SPOT {
            let there = ink(painting, kernel, place) / INK;
            if there < core {
                (core, worst) = (there, place);
            }
        } else if from > 0.5 * drawing.width + SPOT {
            beside = beside.max(ink(painting, kernel, place));
        }
    }
    let (mut gaps, mut longest, mut total) = (0, 0.0_f64, 0.0);
    let mut depths = Vec::new();
    for line in &drawing.lines {
        let mut hole = 0.0_f64;
        for pair in line.windows(2) {
            let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            total += length;
            let steps = (length / 0.25).ceil().max(1.0);
            for k in 0..steps as usize {
                let at = [0, 1].map(|c| pair[0][c] + (pair[1][c] - pair[0][c]) * (k as f64 + 0.5) / steps);
                depths.push(ink(painting, kernel, at).atanh());
                if ink(painting, kernel, at) < WHOLE * INK {
                    hole += length / steps;
                } else {
                    gaps += usize::from(hole > 0.5 * SPOT);
                    hole = 0.0;
                }
                longest = longest.max(hole);
            }
        }
        gaps += usize::from(hole > 0.5 * SPOT);
    }
    let of = |stroke: &paint_net::path::Stroke| -> f64 {
        stroke.sprays.windows(2).map(|p| (p[0].x - p[1].x).hypot(p[0].y - p[1].y)).sum()
    };
    depths.sort_unstable_by(f64::total_cmp);
    let dark = depths[depths.len() - 1] / depths[depths.len() / 2];
    let strokes = painting.strokes.len();
    let length = painting.strokes.iter().map(of).sum::<f64>() / total;
    Judged { core, worst, gaps, longest, beside, dark, strokes, length }
}

fn painted(painter: &dyn Painter, drawing: &Drawing, kernel: &SprayKernel) -> Painting {
    let limits = Limits { row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let wanted = drawing.wanted();
    painter.paint(&PaintProblem::new(&wanted).with_kernel(kernel).with_limits(&limits)).unwrap()
}

/// Core and gaps of the drawings whose names are chosen; a row of the table for each.
fn check(chosen: impl Fn(&str) -> bool) {
    let kernel = SprayKernel::new(SPOT, 3.5).unwrap();
    let all = drawings::all();
    let chosen: Vec<&Drawing> = all.iter().filter(|drawing| chosen(&drawing.name)).collect();
    assert!(chosen.len() >= 4);
    let mut faults = Vec::new();
    for drawing in chosen {
        let painting = painted(&Centrelines::default(), drawing, &kernel);
        let j = judge(drawing, &painting, &kernel);
        println!(
            "| {} | {:.2} | {} | {:.1} | {:.2} | {:.2} | {} | {:.2} |",
            drawing.name, j.core, j.gaps, j.longest, j.beside, j.dark, j.strokes, j.length
        );
        if j.core < WHOLE || j.gaps > 0 || j.beside > 0.5 {
            faults.push(format!(
                "{}: core {:.2} at {:?}, {} gaps, {:.2} beside",
                drawing.name, j.core, j.worst, j.gaps, j.beside
            ));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn lines_come_out_whole_at_joints_in_curves_and_at_ends() {
    check(|name| ["T", "steep sine", "acute X"].contains(&name) || name.contains("lines of 6 px"));
}

/// `cargo test --release -p paint-net --all-features --test it -- --ignored --nocapture twenty_drawings`
#[test]
#[ignore = "all of them, as a table: drawing, core, gaps, longest hole, ink beside, strokes, length sprayed"]
fn twenty_drawings_of_lines_come_out_whole() {
    assert_eq!(drawings::all().len(), 20);
    check(|_| true);
}

/// Where a line goes on out of reach, nothing is sprayed for what lies there.
#[test]
fn what_is_out_of_reach_is_not_painted_from_beside_it() {
    let kernel = SprayKernel::new(SPOT, 3.5).unwrap();
    let drawing = drawings::all().into_iter().find(|drawing| drawing.name == "T").unwrap();
    let wanted = drawing.wanted();
    let reached = wanted.width() / 2 + 12;
    let paintable: Vec<bool> = (0..wanted.data().len()).map(|k| k % wanted.width() < reached).collect();
    let weight = Image::from_fn(wanted.width(), wanted.height(), |x, _| if x < reached { 1.0 } else { 0.02 });
    let limits = Limits { row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits);
    let most = |painting: &Painting| painting.canvas.data().iter().copied().fold(0.0, f64::max);
    let whole = most(&Centrelines::default().paint(&problem).unwrap());
    let part = Centrelines::default().paint(&problem.with_weight(&weight).with_paintable(&paintable)).unwrap();
    assert!(part.sprays.iter().all(|spray| spray.x < reached as f64 + 0.5));
    assert!(most(&part) < 1.2 * whole, "{} for {whole}", most(&part));
}

/// The share of the work that an observer was told of before the end.
struct Told(f64);

impl Observer for Told {
    fn progress(&mut self, share: f64) {
        if share < 1.0 {
            self.0 = self.0.max(share);
        }
    }
}

/// Lines that a fit has covered are not fitted again: a straight one needs few of the eight rounds.
#[test]
fn what_is_covered_is_not_fitted_again() {
    let kernel = SprayKernel::new(SPOT, 3.5).unwrap();
    let wanted = Image::from_fn(80, 40, |x, y| {
        let (x, y) = (x as f64, y as f64);
        INK * (3.5 - (y - 20.0).hypot(x - x.clamp(15.0, 65.0))).clamp(0.0, 1.0)
    });
    let limits = Limits { row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let mut told = Told(0.0);
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits);
    let painting = Centrelines::default().paint_observed(&problem, &mut told).unwrap();
    assert_eq!(painting.strokes.len(), 1);
    assert!(told.0 > 0.0 && told.0 < 0.5, "{}", told.0);
}
