//! Seams: a picture in two parts is painted as if it were whole.

use paint_net::painters::{AdaptiveRows, AreaFill, Centrelines, Layered, RowWidth};
use paint_net::problem::GhostPixels;
use paint_net::procedural::Texture;
use paint_net::{Deconvolution, Error, Feedback, Image, Limits, PaintProblem, Painter, Painting, Spray, metrics};

use super::{kernel, paint, render};

/// A picture in two halves that lie apart, joined by ghost pixels.
struct Halves {
    wanted: Image,
    weight: Image,
    ghosts: GhostPixels,
    paintable: Vec<bool>,
}

const HALF: usize = 24;
const APART: usize = 20;
const REACH: usize = 8;

impl Halves {
    fn of(whole: &Image) -> Self {
        let (width, height) = (2 * HALF + APART, whole.height());
        let on = |x: usize| if x < HALF { Some(x) } else { x.checked_sub(APART).filter(|&x| x >= HALF) };
        let (mut ghosts, mut rim) = (Vec::new(), Vec::new());
        for y in 0..height {
            for k in 0..REACH {
                let at = |x: usize| y * width + x;
                ghosts.push((at(HALF + k), vec![(at(HALF + APART + k), 1.0)]));
                ghosts.push((at(HALF + APART - 1 - k), vec![(at(HALF - 1 - k), 1.0)]));
                rim.push((at(HALF + APART + k), vec![(at(HALF + k), 1.0)]));
                rim.push((at(HALF - 1 - k), vec![(at(HALF + APART - 1 - k), 1.0)]));
            }
        }
        Self {
            wanted: Image::from_fn(width, height, |x, y| on(x).map_or(0.0, |x| whole.at(x, y))),
            weight: Image::from_fn(width, height, |x, _| f64::from(u8::from(on(x).is_some()))),
            ghosts: GhostPixels::new(ghosts, rim, (width, height)).unwrap(),
            paintable: (0..width * height).map(|k| on(k % width).is_some()).collect(),
        }
    }

    fn problem(&self) -> PaintProblem<'_> {
        PaintProblem::new(&self.wanted).with_weight(&self.weight).with_paintable(&self.paintable)
    }

    /// The picture put together again.
    fn joined(image: &Image) -> Image {
        Image::from_fn(2 * HALF, image.height(), |x, y| image.at(if x < HALF { x } else { x + APART }, y))
    }
}

/// A picture in two halves is painted as if it were whole: by the painter that finds the optimum to a few digits, by the network nearly as
/// well. Without ghosts the paint that crosses the cut is missing in the one canvas and doubled on the wall.
#[test]
fn a_seam_is_no_border_for_a_painter() {
    let whole = Texture::Fbm.image(3, 2 * HALF);
    let halves = Halves::of(&whole);
    let limits = Limits { spray_spacing: 2, row_spacing: 3, ..Limits::default() };
    let wall = |painting: &Painting| {
        // Where the sprays really land: the second half lies beside the first.
        let home = |x: f64| if x < HALF as f64 { x } else { x - APART as f64 };
        let sprays = painting.sprays.iter().map(|s| Spray { x: home(s.x), ..*s }).collect();
        let bare = whole.map(|_| 0.0);
        render(&Painting { sprays, ..painting.clone() }, &kernel(), &bare)
    };
    let error = |a: &Image, b: &Image| a.data().iter().zip(b.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let precise = Deconvolution { iterations: 2000, tolerance: 1e-12 };
    let feedback = Feedback::shipped().unwrap();
    // Ghosts reach as far as a spray of the nozzle, not as far as a wider one.
    let narrow = AdaptiveRows { widths: vec![RowWidth { spacing: 2.0, spread: 1.0 }], ..AdaptiveRows::default() };
    let painters: [(&dyn Painter, f64, f64); 6] = [
        (&precise, 0.002, 1e-9),
        (&feedback, 0.3, 1e-5),
        (&Layered::new(precise.clone()), 0.002, 1e-9),
        (&Centrelines::default(), f64::INFINITY, 1e-9),
        (&AreaFill::default(), f64::INFINITY, 1e-9),
        (&narrow, f64::INFINITY, 1e-9),
    ];
    for (painter, alike, sure) in painters {
        let at_once = paint(painter, &PaintProblem::new(&whole), &limits);
        let seamless = paint(painter, &halves.problem().with_ghosts(&halves.ghosts), &limits);
        let cut = paint(painter, &halves.problem(), &limits);
        let name = painter.name();
        // What it expects is what lands, and its ghosts show it.
        let (expected, real) = (Halves::joined(&seamless.canvas), wall(&seamless));
        assert!(error(&expected, &real) < sure, "{name}: expects another wall, {}", error(&expected, &real));
        let mut shown = seamless.canvas.clone();
        halves.ghosts.gather(shown.data_mut());
        assert_eq!(shown, seamless.canvas, "{name}");
        assert!(error(&Halves::joined(&cut.canvas), &wall(&cut)) > 0.05, "{name}: nothing crosses the cut");
        // And what lands is as near to the picture as if there were no cut.
        let psnr = |canvas: &Image| metrics::psnr(&canvas.map(f64::tanh), &whole, None).unwrap();
        let (best, got, without) = (psnr(&at_once.canvas), psnr(&real), psnr(&wall(&cut)));
        assert!(got > best - alike, "{name}: {got} dB, {best} without a cut");
        assert!(alike.is_infinite() || without < got - 0.5, "{name}: {without} dB without ghosts, {got} with them");
    }
}

#[test]
fn ghosts_that_show_nothing_are_refused() {
    let ghost = |pixels| GhostPixels::new(pixels, vec![], (4, 4));
    assert!(ghost(vec![(1, vec![(2, 0.5), (3, 0.5)])]).is_ok());
    for wrong in [
        vec![(16, vec![(2, 1.0)])],
        vec![(1, vec![(16, 1.0)])],
        vec![(1, vec![(2, 0.7)])],
        vec![(1, vec![(2, f64::NAN)])],
        vec![(1, vec![])],
        vec![(1, vec![(2, 1.0)]), (2, vec![(3, 1.0)])],
        vec![(1, vec![(2, 1.0)]), (1, vec![(3, 1.0)])],
    ] {
        assert!(matches!(ghost(wrong.clone()), Err(Error::Ghost { .. })), "{wrong:?}");
    }
    for wrong in [(1, vec![(2, 1.0)]), (3, vec![(16, 1.0)]), (3, vec![(2, 0.7), (0, 0.7)]), (16, vec![(2, 1.0)])] {
        let found = GhostPixels::new(vec![(1, vec![(2, 1.0)])], vec![wrong.clone()], (4, 4));
        assert!(matches!(found, Err(Error::Ghost { .. })), "{wrong:?}");
    }
    let (wanted, weight) = (Image::filled(4, 4, 0.5), Image::filled(4, 4, 1.0));
    let ghosts = ghost(vec![(1, vec![(2, 1.0)])]).unwrap();
    let problem = PaintProblem::new(&wanted).with_weight(&weight).with_ghosts(&ghosts);
    assert!(matches!(problem.check(), Err(Error::Ghost { pixel: 1, .. })), "a ghost of weight 1 counts twice");
    let larger = GhostPixels::new(vec![(20, vec![(2, 1.0)])], vec![], (5, 5)).unwrap();
    assert!(matches!(PaintProblem::new(&wanted).with_ghosts(&larger).check(), Err(Error::Mismatch { .. })));
}
