//! A painter that is not the crate's: the trait is enough to be wrapped and compared like any other.

use paint_net::painters::{ClosedLoopPainter, LayerPlanning, Layered, SlewLimited, slew_violations};
use paint_net::procedural::Texture;
use paint_net::{Error, Image, Limits, Observer, PaintProblem, Painter, Painting, Spray, metrics};

/// One spray per cell of two pixels that gives the mean depth wanted there, whatever its neighbours do.
pub(crate) struct Halftone;

impl Painter for Halftone {
    fn name(&self) -> &'static str {
        "halftone"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        problem.check()?;
        let (width, height) = (problem.reference.width(), problem.reference.height());
        let initial = problem.initial_canvas();
        let mut sprays = Vec::new();
        for y in (0..height).step_by(2) {
            observer.progress(y as f64 / height as f64);
            for x in (0..width).step_by(2) {
                let missing = problem.saturation.inverse(problem.reference.at(x, y)) - initial.at(x, y);
                let volume = (4.0 * missing / problem.kernel.mass()).min(problem.limits.max_volume);
                if volume > 0.0 {
                    sprays.push(Spray { x: x as f64, y: y as f64, volume, sigma: problem.kernel.sigma() });
                }
            }
        }
        Ok(Painting::render(problem, sprays))
    }
}

pub(crate) fn psnr(ink: &Image, wanted: &Image) -> f64 {
    metrics::psnr(ink, wanted, None).unwrap()
}

#[test]
fn a_slew_limit_and_layers_around_it_hold() {
    let wanted = Texture::Worley.image(3, 48);
    let limits = Limits { max_volume: 1.0, ..Limits::default() };
    let problem = PaintProblem::new(&wanted).with_limits(&limits);
    let plain = psnr(&Halftone.paint(&problem).unwrap().ink, &wanted);

    let slow = SlewLimited::new(Halftone, 0.05).paint(&problem).unwrap();
    assert!(slew_violations(&slow.waypoints, 0.05) == 0 && slow.waypoints.len() == 24 * 24);
    // It starts from the plan and fits: it may well be better than this plan.
    assert!(psnr(&slow.ink, &wanted) > plain - 1.0);

    for planning in [LayerPlanning::Joint, LayerPlanning::Sequential] {
        let painting = Layered { planning, ..Layered::new(Halftone) }.paint(&problem).unwrap();
        assert!(painting.layers.len() >= 3, "{planning:?}: {} layers", painting.layers.len());
        assert_eq!(painting.layers.iter().map(|l| l.sprays.len()).sum::<usize>(), painting.sprays.len());
        assert_eq!(painting.layers[painting.layers.len() - 1].canvas, painting.canvas);
        assert!(psnr(&painting.ink, &wanted) > plain - 1.5, "{planning:?}");
    }
}

#[test]
fn progress_rises_to_one() {
    let wanted = Texture::Brick.image(1, 32);
    let problem = PaintProblem::new(&wanted);
    let painters: [&dyn Painter; 4] = [
        &Halftone,
        &Layered { planning: LayerPlanning::Sequential, ..Layered::new(Halftone) },
        &SlewLimited::new(Halftone, 0.1),
        &ClosedLoopPainter::new(Halftone),
    ];
    for painter in painters {
        let mut shares = Vec::new();
        painter.paint_observed(&problem, &mut |share| shares.push(share)).unwrap();
        assert!(shares.windows(2).all(|s| s[1] >= s[0] - 1e-12), "{}: {shares:?}", painter.name());
        assert!(shares[0] >= 0.0 && shares[shares.len() - 1] <= 1.0 + 1e-12);
    }
}

#[test]
fn one_call_paints() {
    let wanted = Texture::Glyph.image(2, 48);
    let painting = paint_net::paint(&wanted).unwrap();
    let expected = paint_net::Feedback::shipped().unwrap().paint(&PaintProblem::new(&wanted)).unwrap();
    assert!(painting == expected && psnr(&painting.ink, &wanted) > 22.0);
}
